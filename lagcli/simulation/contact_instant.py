"""One-sided constraints at one instant of a run, as plain numbers."""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, Sparse, stacked
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

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
    """Numbers of a run: rtol, and e (K,) of the contacts; span: the length of the step that is looked at."""

    rtol: float
    restitution: Floats
    span: float = 0.0


class ContactInstant:
    """All K contacts at a state, g and speeds dg/dt.

    kept: the independent equality rows. `numeric` is of the system with any contacts closed.
    """

    def __init__(
        self, numeric: NumericSystem, state: State, kept: list[int], chosen: ContactParameters
    ) -> None:
        self.state, self._numeric, self._kept, self._chosen = state, numeric, kept, chosen
        g, G, g_t, gamma, size = numeric.contacts(state.t, state.q, state.v, state.p)
        self.G = LocalRows(G)
        self.g, self.g_t, self.gamma, self._size = (np.array(x).ravel() for x in (g, g_t, gamma, size))

    def moved(self, v: Floats) -> ContactInstant:
        """This place at another velocity (n,)."""
        state = dataclasses.replace(self.state, v=v)
        return ContactInstant(self._numeric, state, self._kept, self._chosen)

    @cached_property
    def speeds(self) -> Floats:
        """dg/dt (K,)."""
        return self.G.times(self.state.v) + self.g_t

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
    def _extent(self) -> Floats:
        """Changes of g (K,) that a displacement of the size of the motion makes."""
        s = self.state
        packed = np.array(self._numeric.sizes(s.t, s.q, s.v, s.p)).ravel()
        units, (size, speed) = packed[: s.q.size], packed[s.q.size : s.q.size + 2]
        return _sizes(self.G, units * (size + self._chosen.span * speed))

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
        return np.maximum(SLOW * self._terms_of_speed, unseen)

    @cached_property
    def _terms_of_speed(self) -> Floats:
        return _sizes(self.G, self.state.v) + np.abs(self.g_t)

    @cached_property
    def force(self) -> Floats:
        """h (n,)."""
        s = self.state
        return np.array(self._numeric.force(s.t, s.q, s.v, s.p)[0]).ravel()

    @cached_property
    def pull(self) -> Floats:
        """The largest accelerations of gaps (K,): the sum of the sizes of all terms."""
        inverse = np.abs(self.metric.solved(self.force))
        return _sizes(self.G, inverse) + np.abs(self.gamma)

    @cached_property
    def lengths(self) -> Floats:
        """sqrt(G_i M^-1 G_i^T) (K,)."""
        return LocalRows(self.metric.whitened(self.G.B)).norms

    @cached_property
    def metric(self) -> Metric:
        """The mass metric."""
        s = self.state
        return Metric(self._numeric.inertia(s.t, s.q, s.v, s.p))

    def rows_of(self, contacts: list[int]) -> Sparse:
        """The independent equality rows, and those of some contacts after them."""
        B = self.equalities[0].B
        return stacked(B, self.G.B[contacts, :])

    @cached_property
    def equalities(self) -> tuple[LocalRows, Floats, Floats]:
        """B (C, n), b (C,) and gamma (C,) of the independent equality rows."""
        s = self.state
        B, b = self._numeric.rows(s.t, s.q, s.v, s.p)
        gamma = self._numeric.force(s.t, s.q, s.v, s.p)[1]
        numbers = self._kept
        b_kept, gamma_kept = (np.array(x).ravel()[numbers] for x in (b, gamma))
        return LocalRows(B[numbers, :]), b_kept, gamma_kept


def _sizes(rows: LocalRows, x: Floats) -> Floats:
    """sum |G_i x_i| of each row, (K,)."""
    return np.asarray(np.bincount(rows.row, np.abs(rows.values * x[rows.column]), minlength=rows.count))
