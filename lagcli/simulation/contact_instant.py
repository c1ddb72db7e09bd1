"""One-sided constraints at one instant of a run, as plain numbers."""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.compiled.bound_function import BoundFunction
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, Sparse, sparse, stacked
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.intp]

EPS = float(np.finfo(float).eps)
# The gap of a contact is known to so many roundings of its terms, and to a few of the size of the motion.
ROUNDINGS, FEW = 32.0, 4.0
# A rebound that rises no higher than so many roundings of the size of the motion is not followed.
RESOLVED = 512.0
# Speeds that rise no higher than so many times the rounding of a gap are none.
UNSEEN = 4.0
# Contacts that are this part of the tolerance of the run away from closed belong to the same instant.
TOGETHER = 1.0
# A speed of a gap is none where it is this part of those that it is the difference of.
SLOW = 1e-11
# A force is none where it is this part of what would press the contact, or hold it back.
WEIGHTLESS = 1e-10


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ContactParameters:
    """Numbers of a run: rtol; span: the length of the step that is looked at; size: the largest size of the motion so
    far, as `parts.Sizes.q`; speed: as `parts.Sizes.v`, before an impact."""

    rtol: float
    span: float = 0.0
    size: float = 0.0
    speed: float = 0.0


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _MotionSizes:
    """`parts.Sizes`: units (n,), and the largest q, v and a in them."""

    units: Floats
    size: float
    speed: float
    acceleration: float


class ContactRowValues:
    """The contacts of one system as functions of numbers, bound to memory; kept: the independent equality rows.

    `numeric` is of the system with any contacts closed.
    """

    def __init__(self, numeric: NumericSystem, kept: list[int]) -> None:
        self.numeric, self.kept = numeric, kept
        n, p = numeric.n, numeric.contacts.numel_in(3)
        arguments = [np.zeros(1), np.zeros(n), np.zeros(n), np.zeros(p)]
        self._bound = BoundFunction(numeric.contacts, arguments, is_sparse=True)
        rows, columns = numeric.contacts.sparsity_out(1).get_triplet()
        self.row, self.column = np.asarray(rows, dtype=np.intp), np.asarray(columns, dtype=np.intp)
        self.count = int(numeric.contacts.size1_out(0))

    def at(self, state: State) -> list[Floats]:
        """g (K,), the entries of G, g_t, gamma, sum |G_i q_i|, in memory of their own."""
        t, q, v, p = self._bound.arguments
        t[0], q[:], v[:], p[:] = state.t, state.q, state.v, state.p
        self._bound.trigger()
        return [result.ravel().copy() for result in self._bound.results]


class ContactInstant:
    """All K contacts at a state, g and speeds dg/dt.

    has_gradient (K,): contacts whose gradient has a value there, as others have none until they are closed.
    """

    def __init__(self, values: ContactRowValues, state: State, chosen: ContactParameters) -> None:
        self.state, self._values, self._chosen = state, values, chosen
        g, entries, g_t, gamma, size = values.at(state)
        self.has_gradient = np.isfinite(self._summed(entries) + g_t + gamma)
        self._entries = np.where(self.has_gradient[values.row], entries, 0.0)
        self.g = g
        self.g_t, self.gamma, self._size = (np.where(self.has_gradient, x, 0.0) for x in (g_t, gamma, size))

    def moved(self, v: Floats) -> ContactInstant:
        """This place at another velocity (n,)."""
        chosen = dataclasses.replace(self._chosen, speed=self._sizes.speed)
        return ContactInstant(self._values, dataclasses.replace(self.state, v=v), chosen)

    def _summed(self, entries: Floats) -> Floats:
        values = self._values
        return np.asarray(np.bincount(values.row, entries, minlength=values.count))

    def changes(self, x: Floats) -> Floats:
        """G x (K,)."""
        return self._summed(self._entries * x[self._values.column])

    def _largest_changes(self, x: Floats) -> Floats:
        """sum |G_i x_i| (K,)."""
        return self._summed(np.abs(self._entries * x[self._values.column]))

    def gradients(self, contacts: Numbers) -> Sparse:
        """The rows of G of some contacts, (k, n)."""
        values = self._values
        place = np.full(values.count, -1)
        place[contacts] = np.arange(contacts.size)
        taken = place[values.row] >= 0
        rows, columns = place[values.row[taken]], values.column[taken]
        return sparse(rows, columns, self._entries[taken], (contacts.size, self.state.q.size))

    @cached_property
    def speeds(self) -> Floats:
        """dg/dt (K,)."""
        return self.changes(self.state.v) + self.g_t

    @cached_property
    def noise(self) -> Floats:
        """Rounding of g (K,): of its terms and the way of a step, of the size of the motion, and of the time."""
        local = self._size + np.abs(self.g) + self._chosen.span * self._terms_of_speed
        rounding = np.maximum(ROUNDINGS * local, FEW * self._extent)
        return np.asarray(EPS * (rounding + 4 * abs(self.state.t) * self._terms_of_speed))

    @cached_property
    def lowest(self) -> Floats:
        """Heights (K,) of rebounds that are not followed."""
        return np.asarray(RESOLVED * EPS * self._extent)

    @cached_property
    def _sizes(self) -> _MotionSizes:
        s, chosen = self.state, self._chosen
        packed = np.array(self._values.numeric.sizes(s.t, s.q, s.v, s.p)).ravel()
        size, speed, acceleration = packed[s.q.size :].tolist()
        speed = max(speed, chosen.speed)
        return _MotionSizes(
            packed[: s.q.size], max(size + chosen.span * speed, chosen.size), speed, acceleration
        )

    @property
    def size(self) -> float:
        """The size of the motion, as `parts.Sizes.q`, or the largest so far."""
        return self._sizes.size

    @cached_property
    def _extent(self) -> Floats:
        """Changes of g (K,) that a displacement of the size of the motion makes."""
        return self._largest_changes(self._sizes.units * self._sizes.size)

    @cached_property
    def nearness(self) -> Floats:
        """Gaps (K,) of contacts that are closed as far as a run can tell: within its tolerance."""
        return np.maximum(4 * self.noise, TOGETHER * self._chosen.rtol * (self._extent + np.abs(self.g)))

    @cached_property
    def near(self) -> Flags:
        """The contacts that are closed, (K,)."""
        return self.g <= self.nearness

    @cached_property
    def slow(self) -> Floats:
        """Speeds (K,) of a gap that are none: rounding, or what rises no higher than rounding under the forces."""
        unseen = np.sqrt(2 * self.pull * UNSEEN * self.noise)
        return np.maximum(SLOW * self._largest_changes(self._sizes.units * self._sizes.speed), unseen)

    @cached_property
    def _terms_of_speed(self) -> Floats:
        return self._largest_changes(self.state.v) + np.abs(self.g_t)

    @cached_property
    def force(self) -> Floats:
        """h (n,)."""
        return self._forces[0]

    @cached_property
    def _forces(self) -> tuple[Floats, Floats]:
        s = self.state
        h, gamma, _ = self._values.numeric.force(s.t, s.q, s.v, s.p)
        return np.array(h).ravel(), np.array(gamma).ravel()

    @cached_property
    def pull(self) -> Floats:
        """The largest accelerations of gaps (K,) in this motion."""
        return self._largest_changes(self._sizes.units * self._sizes.acceleration) + np.abs(self.gamma)

    def squares(self, contacts: Numbers) -> Floats:
        """G_i M^-1 G_i^T (k,) of some contacts, 1 of those without a gradient."""
        lengths = LocalRows(self.metric.whitened(self.gradients(contacts))).norms
        return np.asarray(np.where(lengths > 0, lengths, 1.0) ** 2)

    def least_forces(self, contacts: Numbers) -> Floats:
        """Multipliers (k,) of some contacts that are none."""
        return np.asarray(WEIGHTLESS * self.pull[contacts] / self.squares(contacts))

    @cached_property
    def metric(self) -> Metric:
        """The mass metric."""
        s = self.state
        return Metric(self._values.numeric.inertia(s.t, s.q, s.v, s.p))

    def rows_of(self, contacts: list[int]) -> Sparse:
        """The independent equality rows, and those of some contacts after them."""
        return stacked(self.equalities[0], self.gradients(np.array(contacts, dtype=np.intp)))

    @cached_property
    def equalities(self) -> tuple[Sparse, Floats, Floats]:
        """B (C, n), b (C,) and gamma (C,) of the independent equality rows."""
        s, kept = self.state, self._values.kept
        if not kept:
            nothing = np.zeros(0, dtype=np.intp)
            return sparse(nothing, nothing, np.zeros(0), (0, s.q.size)), np.zeros(0), np.zeros(0)
        B, b = self._values.numeric.rows(s.t, s.q, s.v, s.p)
        return B[kept, :], np.array(b).ravel()[kept], self._forces[1][kept]
