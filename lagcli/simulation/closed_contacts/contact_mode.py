"""The rows that act while some contacts are closed."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats, Indices
from lagcli.compiled import NumericSystem
from lagcli.compiled.selection import Selection
from lagcli.contact import impact_law
from lagcli.equations import power_series
from lagcli.equations.power_series import PowerSeries, SeriesFunction
from lagcli.linear import independent_rows, rank
from lagcli.linear.metric_rows import MetricRows, Sparse, sparse, stacked
from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.closed_contacts.contact_change import ContactForces, ContactsUndecided
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant

# How far ahead is looked, as a part of the size of the motion; Newton's steps back onto the rows that are enforced.
FAR, STEPS = 1e-3, 5
# Sets of contacts that are tried, where not all that are closed can stay so.
MOST_TRIED = 256
APART = (
    "inertias that differ by so much amplify rounding: in their metric the rows of closed contacts cannot be told from"
    " dependent ones, and their pushes not from one another"
)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class GapsAhead:
    """Contacts (K,) that stay closed, and those that are violated, a little later; others open."""

    stays: Flags
    is_violated: Flags


def gaps_ahead(here: ContactInstant, x: Floats, enforced: Sequence[int]) -> GapsAhead:
    """Gaps a little later, on the way with accelerations x (n,), with the contacts `enforced` closed. Where nothing
    moves, or where nothing has a value ahead, all are said to stay."""
    everything, contacts = np.ones(here.g.size, dtype=bool), np.array(enforced, dtype=np.intp)
    tau, way = here.reach(x, FAR)
    if not way > 0:
        return GapsAhead(everything, ~everything)
    state = here.later(tau, x)
    for _ in range(STEPS):
        # Onto the holonomic equality rows and these contacts.
        instant = here.at(state)
        f, B = instant.holonomic
        off = np.concatenate([f, instant.g[contacts]])
        A = np.array(here.metric.whitened(stacked(B, instant.gradients(contacts))))
        if not (np.isfinite(off).all() and np.isfinite(A).all()):
            return GapsAhead(everything, ~everything)
        back = rank.space(A, is_whole=False).step(-off)
        state = dataclasses.replace(state, q=state.q + here.metric.unwhitened(back))
    g = here.at(state).g
    allowed = np.maximum(doubles.ZERO * here.gap_changes(way), here.noise)
    return GapsAhead(np.abs(g) <= allowed, g < -allowed)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ContactMode:
    """The selection of rows with contacts closed, and the contacts that press."""

    selection: Selection
    closed: tuple[int, ...]


def mode(
    open_: Selection, here: ContactInstant, found: ContactForces, level: Sequence[int], rows: int
) -> ContactMode:
    """The rows that act after an instant; open_: the selection without contacts; rows: C, the number of equality rows;
    level: contacts that are closed and do not part, those that press among them. A contact whose row depends on those
    before it shares their forces as any redundant row does, as long as it stays closed with them. Where they are
    dependent at the instant alone, those are enforced that keep the others from closing. Raises `ContactsUndecided`."""
    choice = ModeChoice(open_, here, rows)
    closed = found.closed
    if are_independent(open_, here, level):
        return ContactMode(choice.independent(closed), closed)
    chosen = choice.of(closed)
    others = [j for j in level if j not in set(closed)]
    idle = choice.following(chosen, others)
    shared = {i - rows for dependency in (*chosen.dependencies, *idle) for i in dependency if i >= rows}
    if not shared:
        return ContactMode(chosen, closed)
    ahead = gaps_ahead(here, found.x, [i - rows for i in chosen.independent if i >= rows])
    apart = {j for j in shared if not ahead.stays[j]}
    if apart & set(closed) or ahead.is_violated[list(apart)].any():
        return choice.tried(found, sorted({*closed, *shared}))
    lying = tuple(dependency for dependency in idle if dependency[0] - rows not in apart)
    return ContactMode(dataclasses.replace(chosen, idle=lying), closed)


def are_independent(open_: Selection, here: ContactInstant, contacts: Sequence[int]) -> bool:
    """True where rows of contacts depend neither on one another nor on the equality rows; open_: as in `mode`."""
    numbers = np.array(sorted(contacts), dtype=np.intp)
    if not numbers.size or here.few(numbers) is not None:
        return True
    return here.rows_of(list(open_.independent), numbers.tolist()).are_independent


class ModeChoice:
    """Rows to be chosen among contacts at an instant."""

    def __init__(self, open_: Selection, here: ContactInstant, rows: int) -> None:
        self._open, self._here, self._rows = open_, here, rows

    def of(self, closed: Sequence[int]) -> Selection:
        """The selection with these contacts closed, dependent ones as dependencies."""
        open_, rows = self._open, self._rows
        if are_independent(open_, self._here, closed):
            return self.independent(closed)
        numbers = [*open_.independent, *(rows + j for j in sorted(closed))]
        found = self._here.rows_of(list(open_.independent), sorted(closed))
        independent = list(range(len(open_.independent)))
        for row in range(len(open_.independent), len(numbers)):
            if not _depend(found.take([*independent, row]), closed):
                independent.append(row)
        dependencies = independent_rows.over(found, tuple(independent)).selection.dependencies
        shared = tuple(tuple(numbers[k] for k in dependency) for dependency in dependencies)
        inactive = tuple(i for i in range(rows, open_.count) if i not in set(numbers))
        return Selection(tuple(numbers[k] for k in independent), (*open_.dependencies, *shared), inactive)

    def independent(self, closed: Sequence[int]) -> Selection:
        """The selection with these contacts closed, whose rows depend on no others."""
        open_, numbers = self._open, [self._rows + j for j in sorted(closed)]
        inactive = tuple(i for i in range(self._rows, open_.count) if i not in set(numbers))
        return Selection((*open_.independent, *numbers), open_.dependencies, inactive)

    def following(self, chosen: Selection, contacts: Sequence[int]) -> tuple[tuple[int, ...], ...]:
        """The contacts among some whose rows depend on the independent rows, each with these."""
        rows, here = self._rows, self._here
        enforced = [i - rows for i in chosen.independent if i >= rows]
        if not contacts or not chosen.independent:
            return ()
        equalities = [i for i in chosen.independent if i < rows]
        independent, found = range(len(chosen.independent)), []
        for j in contacts:
            together = here.rows_of(equalities, [*enforced, j])
            if here.has_gradient[j] and _depend(together, [*enforced, j]):
                dependency = independent_rows.over(together, tuple(independent)).selection.dependencies[0]
                found.append((rows + j, *(chosen.independent[k] for k in dependency[1:])))
        return tuple(found)

    def tried(self, found: ContactForces, contacts: Sequence[int]) -> ContactMode:
        """The rows of the fewest contacts that carry what the pressing ones do and keep the others from closing."""
        here = self._here
        among = np.zeros(here.g.size, dtype=bool)
        size = np.abs(found.x) + np.abs(here.metric.solved(here.forces[0]))
        sets = itertools.chain.from_iterable(
            itertools.combinations(contacts, count) for count in range(1, len(contacts) + 1)
        )
        for enforced in itertools.islice(sets, MOST_TRIED):
            among[:] = False
            among[list(enforced)] = True
            try:
                alone = contact_change.contact_forces(here, among)
            except ContactsUndecided:
                continue
            if alone.closed != enforced or (np.abs(alone.x - found.x) > doubles.ZERO * size.max()).any():
                continue
            ahead = gaps_ahead(here, found.x, enforced)
            if ahead.is_violated[list(contacts)].any():
                continue
            # Others that stay closed with them share the load.
            lying = [*enforced, *(j for j in contacts if ahead.stays[j] and j not in enforced)]
            among[lying] = True
            closed = contact_change.contact_forces(here, among).closed
            chosen = self.of(closed)
            idle = self.following(chosen, [j for j in lying if j not in closed])
            return ContactMode(dataclasses.replace(chosen, idle=idle), closed)
        raise ContactsUndecided(
            "the gradients of closed contacts depend on one another at this instant alone, and none of them keep the"
            " others from closing",
            contacts,
        )


def _depend(rows: MetricRows, contacts: Sequence[int]) -> bool:
    """True for rows that depend on one another. Raises `ContactsUndecided` for those that do so in the mass metric
    alone: their multipliers would be rounding."""
    if rows.are_independent:
        return False
    if rows.plain().are_independent:
        raise ContactsUndecided(APART, contacts)
    return True


# Coefficients of forces that are looked at: a load of t^11 decides still. One is zero where it is so small beside its
# terms.
ORDERS, NONE = 12, doubles.SUM / 2


class MotionSeries:
    """The forces, rows and inertia of one system, with all contacts open, as power series along a motion: of the rows
    of contacts those of some, by their numbers."""

    def __init__(self, numeric: NumericSystem, contacts: tuple[int, ...]) -> None:
        self._numeric, self.contacts = numeric, contacts

    @cached_property
    def _function(self) -> SeriesFunction:
        return SeriesFunction(self._numeric.contact_motion(self.contacts))

    @cached_property
    def patterns(self) -> list[tuple[Indices, Indices, tuple[int, int]]]:
        """Rows, columns and shape of M, B and G."""
        numeric = self._numeric
        found = []
        of_contacts, _ = numeric.contacts.sparsity_out(1).sub(list(self.contacts), list(range(numeric.n)))
        for sparsity in (numeric.inertia.sparsity_out(0), numeric.rows.sparsity_out(0), of_contacts):
            rows, columns = sparsity.get_triplet()
            found.append((np.asarray(rows, np.intp), np.asarray(columns, np.intp), sparsity.shape))
        return found

    def at(self, here: ContactInstant, a: list[Floats], rounding: float) -> tuple[list[_Terms], int]:
        """The results of `NumericSystem.contact_motion` where a_0, a_1, ... are the accelerations, and none beyond, and
        how many coefficients were asked for. All coefficients are made while nothing moves, for they stay the same, and
        where a switch asks for the first that is not zero; else those up to the order after the accelerations."""
        s = here.state
        n, moves = s.q.size, s.v.any() or any(each.any() for each in a)
        count = len(a) + 1 if moves and not self._function.has_switches else ORDERS
        time = power_series.constant(s.t, count)
        time.c[1:2] = time.size[1:2] = 1.0
        v, q = np.zeros((n, count)), np.zeros((n, count))
        v[:, 0], q[:, 0] = s.v, s.q
        for k, each in enumerate(a[: count - 1]):
            v[:, k + 1] = each / (k + 1)
        q[:, 1:] = v[:, :-1] / np.arange(1, count)
        arguments = [
            [time],
            *([PowerSeries(row, np.abs(row)) for row in part] for part in (q, v)),
            [power_series.constant(value, count) for value in s.p.tolist()],
        ]
        found = []
        for series in self._function.at(arguments, count, rounding):
            known = min((each.known for each in series), default=count)
            c, size = (
                np.array([getattr(each, part)[:known] for each in series]).reshape(len(series), known)
                for part in ("c", "size")
            )
            found.append(_Terms(c, size, known))
        return found, count


@dataclasses.dataclass(slots=True, eq=False)
class _Terms:
    """Coefficients (k, order) with the sizes of their terms, of the results of one kind; `known` of all."""

    c: Floats
    size: Floats
    known: int


class _Products:
    """The coefficients of a matrix along the motion."""

    def __init__(self, pattern: tuple[Indices, Indices, tuple[int, int]], terms: _Terms) -> None:
        (self._rows, self._columns, self._shape), self._terms = pattern, terms

    @property
    def first(self) -> Sparse:
        """The matrix at the instant."""
        return sparse(self._rows, self._columns, self._terms.c[:, 0], self._shape)

    def later(self, x: list[Floats], k: int, is_turned: bool = False) -> tuple[Floats, Floats]:
        """The sum of A_j x_(k - j) for j > 0, of A^T where it is turned, and the sizes of its terms."""
        rows, columns = (self._columns, self._rows) if is_turned else (self._rows, self._columns)
        total, size = np.zeros((2, self._shape[1] if is_turned else self._shape[0]))
        for j in range(1, k + 1):
            given = x[k - j][columns]
            total += np.bincount(rows, self._terms.c[:, j] * given, minlength=total.size)
            size += np.bincount(rows, self._terms.size[:, j] * np.abs(given), minlength=total.size)
        return total, size


class ContactOrders:
    """Contacts of which neither the force nor d2g/dt2 is above zero: the first of their derivatives that is decides.

    Along the motion 0 <= lambda(t) ⊥ d2g/dt2(t) >= 0. Where both are power series of the time, the coefficients of the
    contacts that are undecided so far obey the same problem at every order, with the same matrix: that of (D.24) with
    the contacts that press as equations. The leading coefficients decide, lexicographically.

    known: the part of its terms to which the state is known. forces: what order zero says.
    """

    def __init__(self, series: MotionSeries, here: ContactInstant, known: float) -> None:
        self._series, self._here = series, here
        self._rounding = max(NONE, known)
        # The numbers of contacts among those of the series.
        self._place = {j: place for place, j in enumerate(series.contacts)}

    def decided(self, forces: ContactForces, level: Indices, crossing: Flags) -> ContactForces:
        """The contacts that press among those that are closed and neither approach nor part, `level`; crossing (K,):
        those whose forces are zero there, as far as the instant is known."""
        here = self._here
        closed, squares = [j for j in forces.closed if not crossing[j]], here.squares(level)
        none = here.least_forces(level, forces.x) * squares
        is_open = (forces.accelerations[level] > none) & ~crossing[level]
        left = [j for j, parts in zip(level.tolist(), is_open, strict=True) if not parts and j not in closed]
        if not left:
            return forces
        a: list[Floats] = []
        equal: list[Floats] = []
        pushes: list[Floats] = []
        series, count = list[_Terms](), 0
        for k in range(ORDERS):
            if k >= count or a[-1].any():
                series, count = self._series.at(here, a, self._rounding)
            if min(each.known for each in series) <= k:
                break
            found = self._order(series, (a, equal, pushes), (closed, left))
            if found is None:
                break
            pressing, leaving = found if k else ([j for j in each if not crossing[j]] for each in found)
            closed = sorted({*closed, *pressing})
            left = [j for j in left if j not in {*pressing, *leaving}]
            if not left:
                break
        return dataclasses.replace(forces, closed=tuple(closed))

    def _order(
        self,
        series: list[_Terms],
        before: tuple[list[Floats], list[Floats], list[Floats]],
        contacts: tuple[list[int], list[int]],
    ) -> tuple[list[int], list[int]] | None:
        """Solve one order, with the accelerations, multipliers and pushes of those before it, which go on with it;
        contacts that press by it, and that part, or lie on those that press."""
        here, (a, equal, pushes), (closed, left) = self._here, before, contacts
        k = len(a)
        force, gamma, gamma_contacts = series[:3]
        inertia, B, G = map(_Products, self._series.patterns, series[3:])
        h, h_size = force.c[:, k].copy(), force.size[:, k].copy()
        for sign, (value, size) in (
            (1.0, B.later(equal, k, True)),
            (1.0, G.later(pushes, k, True)),
            (-1.0, inertia.later(a, k)),
        ):
            h, h_size = h + sign * value, h_size + size
        (of_rows, rows_size), (moved, moved_size) = B.later(a, k), G.later(a, k)
        wanted = gamma.c[:, k] - of_rows, gamma_contacts.c[:, k] - moved
        sizes = gamma.size[:, k] + rows_size, gamma_contacts.size[:, k] + moved_size
        fixed, asked = (np.array([self._place[j] for j in each], dtype=np.intp) for each in (closed, left))
        numbers = np.array(left, dtype=np.intp)
        # All that is nothing but rounding moves nothing.
        h = np.where(np.abs(h) > self._rounding * h_size, h, 0.0)
        of_equalities, of_contacts = (
            np.where(np.abs(w) > self._rounding * s, w, 0.0) for w, s in zip(wanted, sizes, strict=True)
        )
        if not (h.any() or of_equalities.any() or of_contacts.any()):
            a.append(h)
            equal.append(of_equalities)
            pushes.append(of_contacts)
            return [], []
        first = G.first
        rows = stacked(B.first, first[fixed.tolist(), :])
        equations = rows, np.concatenate([of_equalities, of_contacts[fixed]])
        try:
            found = impact_law.forces(
                here.metric, h, equations, (first[asked.tolist(), :], of_contacts[asked])
            )
        except impact_law.LawError:
            return None
        count = of_equalities.size
        push = np.zeros(G.first.shape[0])
        push[fixed], push[asked] = found.of_equalities[count:], found.of_contacts
        a.append(found.x)
        equal.append(found.of_equalities[:count])
        pushes.append(push)
        carried, entries = np.zeros(asked.size, dtype=bool), np.abs(np.array(first[asked.tolist(), :]))
        h_size = h_size + np.abs(np.array(rows)).T @ np.abs(found.of_equalities)
        room = self._rounding * (
            entries @ (np.abs(here.metric.solved(h_size)) + np.abs(found.x)) + sizes[1][asked]
        )
        presses = found.of_contacts * here.squares(numbers) > room
        shared = presses & ~found.unique[-asked.size :]
        if closed and shared.any():
            carried[shared] = self._are_linked((rows, len(closed)), first[asked[shared].tolist(), :])
        parts = carried | ~presses & (found.slack > room)
        return numbers[presses & ~carried].tolist(), numbers[parts].tolist()

    def _are_linked(self, before: tuple[Sparse, int], contacts: Sparse) -> Flags:
        """True for rows of contacts (k,) that share a load with some that press already, the last so many of the rows
        before them: who takes how much of it, the run finds as their loads grow."""
        rows, count = before
        null = rank.estimate(MetricRows(stacked(rows, contacts), self._here.metric)).dependences
        are_together = np.abs(null.T @ null) > doubles.ROOT
        first = rows.shape[0]
        linked = np.arange(len(are_together)) >= first - count
        linked[first:] = False
        for _ in are_together:
            linked = linked | are_together[linked].any(axis=0)
        return np.asarray(linked[first:])
