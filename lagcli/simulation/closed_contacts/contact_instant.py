"""One-sided constraints at one instant of a run, as plain numbers."""

from __future__ import annotations

import dataclasses
import itertools
import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats, Indices
from lagcli.compiled import NumericSystem, contact_values
from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.contact_values import MotionNumbers
from lagcli.contact import impact_law
from lagcli.contact.impact_law import FewContacts, Response
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse, sparse, stacked
from lagcli.simulation.closed_contacts import many_contacts
from lagcli.simulation.closed_contacts.many_contacts import ManyContacts
from lagcli.start.initial import State


class InstantParameters:
    """Forces, speeds and distances that count as none at an instant; parts are of no unit. The tests are of
    `tests/unit/test_numbers_of_starts.py`."""

    __slots__ = ()

    weightless: float = 1e-10
    """Forces, accelerations, speeds are none where they are this part of what presses.
    `test_a_force_of_ten_digits_less_is_none`."""
    creeping: float = 1e-11
    """And where speeds that are this part of those of the motion would make it.
    `test_a_contact_creeps_below_eleven_digits`."""
    closely: float = 4.0
    """So many times farther away than closed ones contacts are judged before an impact.
    `test_contacts_that_are_nearly_closed_part_clearly`."""
    clearly: float = 1e3
    """And so are speeds that many times larger than none. `test_contacts_that_are_nearly_closed_part_clearly`."""


PARAMETERS = InstantParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ContactParameters:
    """Indices of a run: rtol; span: the length of the step that is looked at; size: the largest size of the motion so
    far, as `parts.Sizes.q`; speed: as `parts.Sizes.v`, before an impact; since: the time from the start on; across: by
    which the state lies behind a switch; ahead: the length of the step that is tried next."""

    rtol: float
    span: float = 0.0
    size: float = 0.0
    speed: float = 0.0
    since: float = 0.0
    across: float = 0.0
    ahead: float = 0.0


class InstantNumbers(NamedTuple):
    """The numbers of contacts at an instant: columns (11, K), entries of G, units (n,) and numbers of the motion;
    looked: the contacts that all of them are of, None for all K; own: the places of their entries."""

    columns: Floats
    entries: Floats
    units: Floats
    motion: MotionNumbers
    looked: Indices | None = None
    own: Indices | slice = slice(None)


class ContactRowValues:
    """The contacts of one system as functions of numbers, bound to memory; equality_count: C; `numeric` is of the
    system with any contacts closed; has_independent_rows: no equality row is redundant."""

    def __init__(self, numeric: NumericSystem, equality_count: int) -> None:
        self.numeric, self.equality_count = numeric, equality_count
        self.has_independent_rows = not numeric.selection.dependencies
        n, p = numeric.n, numeric.contacts.numel_in(3)
        self._arguments = [np.zeros(size) for size in (1, n, n, p, contact_values.CHOSEN)]
        self._order = numeric.contact_values.order
        pattern = numeric.contacts.sparsity_out(1)
        rows, columns = pattern.get_triplet()
        self.row, self.column = np.asarray(rows, dtype=np.intp), np.asarray(columns, dtype=np.intp)
        self.count = int(numeric.contacts.size1_out(0))
        order = np.argsort(self.row, kind="stable")
        ends = np.searchsorted(self.row[order], np.arange(self.count + 1))
        # The indices among the entries of G of those of each contact.
        self.of = [order[first:end] for first, end in itertools.pairwise(ends)]

    @cached_property
    def _every(self) -> BoundFunction:
        return BoundFunction(self.numeric.contact_values.function, self._arguments)

    @cached_property
    def _many(self) -> ManyContacts | None:
        values = self.numeric.contact_values
        return ManyContacts(values, self._arguments) if many_contacts.are_some(values, self.count) else None

    def at(
        self, state: State, chosen: ContactParameters, asked: Indices | None, is_near: bool
    ) -> InstantNumbers:
        """The numbers of `compiled.contact_values`, in memory of their own; asked, is_near: see `ContactInstant`."""
        t, q, v, p, numbers = self._arguments
        t[0], q[:], v[:], p[:] = state.t, state.q, state.v, state.p
        numbers[:] = chosen.rtol, chosen.span, chosen.size, chosen.speed, chosen.since, chosen.across
        if asked is not None and self._many is not None:
            columns, looked, found, units, motion = self._many.at(asked, PARAMETERS.closely * is_near)
            none = np.zeros(0, dtype=np.intp)
            own = np.concatenate([none, *(self.of[j] for j in looked.tolist())])
            entries = np.zeros(self.row.size)
            entries[own] = found
            return InstantNumbers(columns, entries, units, motion, looked, own)
        self._every.trigger()
        packed = np.asarray(self._every.results[0][self._order])
        count = len(contact_values.COLUMNS) * self.count
        first, last = count + self.row.size, packed.size - len(MotionNumbers._fields)
        motion = MotionNumbers(*packed[last:].tolist())
        columns = packed[:count].reshape(-1, self.count)
        return InstantNumbers(columns, packed[count:first], packed[first:last], motion)

    @cached_property
    def _response(self) -> BoundFunction:
        arguments = [np.zeros(each.size) for each in self._arguments[:4]]
        return BoundFunction(self.numeric.response, [*arguments, np.zeros(self.numeric.n)])

    @cached_property
    def _rate(self) -> BoundFunction:
        t, q, _, p = self._arguments[:4]
        arguments = [np.zeros(t.size), np.zeros(2 * q.size + 1), np.zeros(p.size)]
        return BoundFunction(self.numeric.rhs, arguments)

    def open_acceleration(self, state: State) -> Floats:
        """The accelerations (n,) with the equality rows alone."""
        n = state.q.size
        t, y, p = self._rate.arguments
        t[0], y[:n], y[n : 2 * n], p[:] = state.t, state.q, state.v, state.p
        self._rate.trigger()
        return self._rate.results[0][n : 2 * n].copy()

    def response(self, state: State, columns: Indices, entries: Floats) -> list[Floats]:
        """See `NumericSystem.response`, to a row with entries at columns; in memory that the next call overwrites."""
        t, q, v, p, f = self._response.arguments
        t[0], q[:], v[:], p[:] = state.t, state.q, state.v, state.p
        f[:] = 0.0
        f[columns] = entries
        self._response.trigger()
        return self._response.results


class ContactInstant:
    """All K contacts at a state, with the numbers of `compiled.contact_values`. values: of the system; chosen: numbers
    of the run; has_gradient (K,): contacts whose gradient has a value there, as others have none until they are closed;
    units (n,): of `parts.Sizes`; size: of the motion, as `parts.Sizes.q`, or the largest so far.

    Of many contacts g and touching_gap are of all, all else of those that are nearly closed or `asked` for, and
    nothing, nan or zero, of others. Where `is_near` is not wanted only g is of all, and all else of those that are
    violated or asked for.
    """

    _own: Indices | slice = slice(None)

    def __init__(
        self,
        values: ContactRowValues,
        state: State,
        chosen: ContactParameters,
        asked: Indices | None = None,
        is_near: bool = True,
    ) -> None:
        self.state, self.values, self.chosen = state, values, chosen
        columns, self._entries, self.units, self._motion, self._looked, self._own = values.at(
            state, chosen, asked, is_near
        )
        self.g, self.g_t, self.gamma, has_gradient, self.speeds = columns[:5]
        self.noise, self.touching_gap, self.slow, self.lowest, self.pull, self._blurred = columns[5:]
        self.has_gradient: Flags = has_gradient > 0
        self.size = self._motion.size
        # Of contacts that were asked for together; None of those that are not few, or not apart.
        self._few: dict[tuple[int, ...], FewContacts | None] = {}

    def moved(self, v: Floats) -> ContactInstant:
        """The instant at another velocity (n,)."""
        chosen = dataclasses.replace(self.chosen, speed=self._motion.speed)
        other = ContactInstant(self.values, dataclasses.replace(self.state, v=v), chosen, self._looked)
        other._few = self._few
        return other

    def parts(self, v: Floats) -> bool:
        """True if at another velocity (n,) all contacts that are nearly closed part or approach, far faster than what
        counts as none."""
        speeds = np.abs(self.speeds + self.changes(v - self.state.v))
        return bool(
            (speeds > PARAMETERS.clearly * self.slow)[self.g <= PARAMETERS.closely * self.touching_gap].all()
        )

    def at(self, state: State) -> ContactInstant:
        """The contacts at another state."""
        return ContactInstant(self.values, state, self.chosen, self._looked)

    @property
    def whole(self) -> ContactInstant:
        """The same instant with all numbers of all contacts."""
        return self if self._looked is None else ContactInstant(self.values, self.state, self.chosen)

    def displaced(self, way: Floats) -> ContactInstant:
        """The contacts at another place, this way (n,) off."""
        return self.at(dataclasses.replace(self.state, q=self.state.q + way))

    def later(self, tau: float, x: Floats) -> State:
        """The state on the parabola with accelerations x (n,), a time tau later."""
        s = self.state
        return State(s.t + tau, s.q + tau * s.v + tau * tau / 2 * x, s.v + tau * x, s.p)

    def reach(self, x: Floats, part: float) -> tuple[float, float]:
        """The time in which the motion with accelerations x (n,) goes this part of its size, and that way; 0 where it
        does not move."""
        units, acceleration = self.units, self._motion.acceleration
        speed = float(np.abs(self.state.v / units).max(initial=0.0))
        rate = float(np.abs(x / units).max(initial=0.0))
        # Below this the rounding of forces that balance moves it.
        rate = rate if rate > PARAMETERS.weightless * acceleration else 0.0
        speed = speed if speed > PARAMETERS.weightless * math.sqrt(acceleration * self.size) else 0.0
        way = part * (self.size or 1.0)
        if not (speed or rate):
            return 0.0, 0.0
        return 2 * way / (speed + math.sqrt(speed * speed + 2 * rate * way)), way

    def gap_changes(self, way: float) -> Floats:
        """Changes of g (K,) that a displacement by this way makes, which is counted as the size."""
        return self._summed(np.abs(self._terms(self.units)) * way)

    def _terms(self, x: Floats) -> Floats:
        """What each entry of G gives with x (n,)."""
        return np.asarray(self._entries[self._own] * x[self.values.column[self._own]])

    def _summed(self, terms: Floats) -> Floats:
        """The sums (K,) of what each entry of G gives."""
        return np.asarray(np.bincount(self.values.row[self._own], terms, minlength=self.values.count))

    @property
    def speed_roundoff(self) -> Floats:
        """Speeds (K,) that are rounding of those of the motion."""
        return PARAMETERS.creeping * self.gap_changes(self._motion.speed)

    def entries(self, contact: int) -> Floats:
        """The entries of the gradient of one contact."""
        return self._entries[self.values.of[contact]]

    def direction(self, contact: int) -> tuple[Floats, float]:
        """The displacement (n,) along the gradient of a contact that counts as 1 in units, and dg/ds along it."""
        values = self.values
        entry_indices = values.of[contact]
        columns = values.column[entry_indices]
        steepness, way = self._entries[entry_indices] * self.units[columns], np.zeros(self.state.q.size)
        slope = float(np.linalg.norm(steepness))
        if slope > 0:
            way[columns] = steepness / slope * self.units[columns]
        return way, slope

    @property
    def holonomic(self) -> tuple[Floats, Sparse]:
        """f (s,) of the holonomic equality rows, and their gradients (s, n)."""
        s = self.state
        f, B = self.values.numeric.holonomic(s.t, s.q, s.p)
        return np.array(f).ravel(), B

    def changes(self, x: Floats) -> Floats:
        """G x (K,)."""
        return self._summed(self._terms(x))

    def sizes_of_changes(self, x: Floats) -> Floats:
        """|G| |x| (K,)."""
        return self._summed(np.abs(self._terms(x)))

    def gradients(self, contacts: Indices) -> Sparse:
        """The rows of G of some contacts, (k, n)."""
        values = self.values
        entry_indices = [values.of[j] for j in contacts.tolist()]
        taken = np.concatenate(entry_indices) if entry_indices else np.zeros(0, dtype=np.intp)
        rows = np.repeat(np.arange(contacts.size), [each.size for each in entry_indices])
        return sparse(rows, values.column[taken], self._entries[taken], (contacts.size, self.state.q.size))

    def response(self, contact: int) -> Response:
        """The effect of an impulse of one contact, with all equality rows."""
        values = self.values
        entry_indices = values.of[contact]
        columns, entries = values.column[entry_indices], self._entries[entry_indices]
        x, of_equalities, (square, free, left) = values.response(self.state, columns, entries)
        terms = float(np.abs(entries) @ np.abs(self.state.v[columns])) + abs(float(self.g_t[contact]))
        reported = float(square), float(free), float(left)
        return Response(x.copy(), of_equalities.ravel().copy(), *reported, terms)

    def few(self, contacts: Indices) -> FewContacts | None:
        """Contacts that are few and stand well apart from each other and from equality rows, of which none is
        redundant; None where they do not."""
        if not (0 < contacts.size <= impact_law.PARAMETERS.most and self.values.has_independent_rows):
            return None
        key = tuple(contacts.tolist())
        if key not in self._few:
            responses = tuple(self.response(j) for j in key)
            D = np.array(
                [
                    [self._entries[p] @ r.x[self.values.column[p]] for r in responses]
                    for p in (self.values.of[j] for j in key)
                ]
            )
            found = FewContacts(responses, D)
            self._few[key] = found if found.are_apart else None
        return self._few[key]

    @cached_property
    def near(self) -> Flags:
        """The contacts that are closed, (K,)."""
        return np.asarray(self.g <= self.touching_gap)

    @property
    def unresolved(self) -> Floats:
        """Gaps (K,) that are closed before a step could end there: they are not known from rounding."""
        return np.asarray(np.minimum(self.touching_gap, np.maximum(self.lowest, 4 * self.noise)))

    def deep(self, room: float) -> list[tuple[float, int]]:
        """The depths and numbers of contacts that are violated by so many times what counts as closed."""
        return [(float(-self.g[j]), j) for j in np.flatnonzero(self.g < -room * self.touching_gap).tolist()]

    @property
    def at_rest(self) -> Flags:
        """The contacts that are closed and neither approach nor part, (K,), in memory of their own."""
        return np.asarray(self.near & (np.abs(self.speeds) <= self.slow))

    @cached_property
    def forces(self) -> tuple[Floats, Floats]:
        """h (n,) and gamma of all rows."""
        s = self.state
        h, gamma, _ = self.values.numeric.force(s.t, s.q, s.v, s.p)
        return np.array(h).ravel(), np.array(gamma).ravel()

    def squares(self, contacts: Indices) -> Floats:
        """G_i M^-1 G_i^T (k,) of some contacts, 1 of those without a gradient."""
        lengths = LocalRows(self.metric.whitened(self.gradients(contacts))).norms
        return np.asarray(np.where(lengths > 0, lengths, 1.0) ** 2)

    def least_forces(self, contacts: Indices, x: Floats) -> Floats:
        """Multipliers (k,) of some contacts that are none, in a motion with accelerations x (n,): other rows may press
        a contact too, that no force and no curvature of its own does."""
        few = self.few(contacts)
        squares = self.squares(contacts) if few is None else few.free
        rate = float(np.abs(x / self.units).max(initial=0.0))
        # At a start the way of a step may be larger than all that has a size yet.
        way = max(self.size, self._motion.speed * self.chosen.ahead) or 1.0
        creep = (PARAMETERS.creeping * self._motion.speed) ** 2 / way
        in_units = self.gap_changes(1.0)[contacts]
        pull = np.maximum(PARAMETERS.weightless * (self.pull[contacts] + in_units * rate), in_units * creep)
        least = np.asarray(pull / squares)
        if not (self._blurred[contacts] + in_units * self._motion.forces_blurred > pull).any():
            return least
        # Where forces or curvatures are sums of terms that cancel, they are known to the rounding of these.
        s, ratio = self.state, contact_values.ROUNDINGS * doubles.EPS
        h, gamma = (np.array(x).ravel() for x in self.values.numeric.force_roundings(s.t, s.q, s.v, s.p))
        responses = [self.response(j) for j in contacts.tolist()]
        own = np.array([np.abs(r.x) @ h + np.abs(r.of_equalities) @ gamma for r in responses])
        accelerations = ratio * own + self._blurred[contacts]
        if few is not None:
            return np.asarray(np.maximum(least, np.abs(np.linalg.inv(few.D)) @ accelerations))
        # What rows cannot move takes any force.
        square = np.array([r.square for r in responses])
        rounding = np.where(square > 0.0, accelerations / np.where(square > 0.0, square, 1.0), 0.0)
        return np.asarray(np.maximum(least, rounding))

    @cached_property
    def metric(self) -> Metric:
        """The mass metric."""
        s = self.state
        return Metric(self.values.numeric.inertia(s.t, s.q, s.v, s.p))

    def rows_of(self, equalities: list[int], contacts: list[int]) -> MetricRows:
        """Some equality rows, and those of some contacts after them, in the metric."""
        B = self.equalities[0][equalities, :]
        return MetricRows(stacked(B, self.gradients(np.array(contacts, dtype=np.intp))), self.metric)

    @cached_property
    def equalities(self) -> tuple[Sparse, Floats, Floats]:
        """B (C, n), b (C,) and gamma (C,) of the equality rows."""
        s, C = self.state, self.values.equality_count
        if not C:
            nothing = np.zeros(0, dtype=np.intp)
            return sparse(nothing, nothing, np.zeros(0), (0, s.q.size)), np.zeros(0), np.zeros(0)
        B, b = self.values.numeric.rows(s.t, s.q, s.v, s.p)
        return B[:C, :], np.array(b).ravel()[:C], self.forces[1][:C]
