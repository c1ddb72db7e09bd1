"""The rows that act while some contacts are closed."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from lagcli import doubles
from lagcli.compiled.selection import Selection
from lagcli.linear import independent_rows, rank
from lagcli.linear.metric_rows import MetricRows, stacked
from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.closed_contacts.contact_change import ContactForces, ContactsUndecided
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant, Flags, Floats

# How far ahead is looked, as a part of the size of the motion; Newton's steps back onto the rows that are enforced.
FAR, STEPS = 1e-3, 5
# Of the way ahead, what a gap may be off that stays closed. One that opens like a square is off by FAR of it.
CLOSED = 1e-8
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
    """Gaps a little later, on the way with accelerations x (n,), with the contacts `enforced` closed.

    Where nothing moves, or where nothing has a value ahead, all are said to stay.
    """
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
    allowed = np.maximum(CLOSED * here.gap_changes(way), here.noise)
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
    level: contacts that are closed and do not part, those that press among them.

    A contact whose row depends on those before it shares their forces as any redundant row does, as long as it stays
    closed with them. Where they are dependent at the instant alone, those are enforced that keep the others from
    closing. Raises `ContactsUndecided`.
    """
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
    return ContactMode(
        dataclasses.replace(
            chosen, idle=tuple(dependency for dependency in idle if dependency[0] - rows not in apart)
        ),
        closed,
    )


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
