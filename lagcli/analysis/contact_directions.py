"""Directions of virtual displacements beside closed contacts, and an allowed displacement with them (D.8).

Displacements that equality rows allow are dq = Z u over dt = 0, with columns of Z orthonormal in the metric. Closed
contacts leave the cone G Z u >= 0 of them: the sum of `free` directions, G Z u = 0, and of rays that open contacts and
close none, the `one-sided` ones. `blocked` is a displacement against such a ray, or across contacts that close as soon
as others open. Contacts whose gradients are orthogonal in the metric make cones of their own.

Over dt the conditions are G dq + g_t dt >= 0, and B dq + b dt = 0.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Literal

import numpy as np

from lagcli import doubles
from lagcli.analysis.codimension.examine import connected
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.contact import complementarity
from lagcli.contact.complementarity import ContradictoryRows, UndecidedRows
from lagcli.equations import kinks
from lagcli.equations.rows import ConstraintRows
from lagcli.equations.system import System
from lagcli.linear import decompositions, rank
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows
from lagcli.smoothness import named_functions
from lagcli.start import gaps, initial, projection
from lagcli.start.gaps import Gaps, Side
from lagcli.start.initial import State

Kind = Literal["free", "one-sided", "blocked"]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ContactCondition:
    """A contact and its side; of one that is closed dg = gradient (n,) . dq + rate dt."""

    name: str
    state: Side
    gradient: Floats
    rate: float


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Direction:
    """A displacement (n,) of length one in the metric; contacts: those that open along it, or that block it."""

    kind: Kind
    displacement: Floats
    contacts: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ContactDirections:
    """The directions that contacts leave at an instant.

    directions: a basis of the free ones, then the one-sided and the blocked ones; allowed (n,): the shortest
    displacement over dt = 1; None where there is none, or a contact tells none. notes: why, and which contacts are
    violated.
    """

    contacts: tuple[ContactCondition, ...]
    directions: tuple[Direction, ...] | None
    allowed: Floats | None
    notes: tuple[str, ...] = ()

    @property
    def are_closed(self) -> bool:
        """True where a contact is closed."""
        return any(one.state == "closed" for one in self.contacts)

    def as_json(self, columns: tuple[str, ...]) -> dict[str, object]:
        """The keys `contacts`, `directions` and `notes` of `displacements --json`, where there are contacts; columns
        (n,): of the coordinates."""
        if not self.contacts:
            return {}

        def named(dq: Floats) -> dict[str, float]:
            return dict(zip(columns, dq.tolist(), strict=True))

        return {
            "contacts": [
                {"name": one.name, "state": one.state}
                | ({"gradient": named(one.gradient), "rate": one.rate} if one.state == "closed" else {})
                for one in self.contacts
            ],
            "directions": self.directions
            and [
                {"kind": one.kind, "columns": named(one.displacement), "contacts": list(one.contacts)}
                for one in self.directions
            ],
            "notes": list(self.notes),
        }


def directions(
    system: System, numeric: NumericSystem, state: State, metric: Metric, Z: Floats, shortest: Floats
) -> ContactDirections:
    """The directions at a state. Equality rows leave the displacements Z (n, d), orthonormal in the metric, and over
    dt = 1 the shortest (n,). Raises `ModelError` naming a gap that is not finite."""
    sides = gaps.at_state(system, numeric, state)
    values = numeric.contacts(state.t, state.q, state.v, state.p)
    G, g_t = LocalRows(values[1]), np.array(values[2]).ravel()
    dense = np.array(G.B)
    contacts = tuple(
        ContactCondition(row.name, side, dense[j], float(g_t[j]))
        for j, (row, side) in enumerate(zip(system.contacts.rows, sides.sides, strict=True))
    )
    notes = tuple(one.message for one in gaps.penetrations(system, sides))
    closed = [j for j, one in enumerate(contacts) if one.state == "closed"]
    reason = _without_direction(system, numeric, state, sides, closed)
    if reason:
        return ContactDirections(contacts, None, None, (*notes, reason))
    # The cone of the closed contacts that equality rows let move, by their unit rows A (k, d) over u, and A u >= least
    # over dt = 1; others may close over dt.
    lengths = LocalRows(metric.whitened(G.B[closed, :])).divisors
    rows, rates = np.array(G.B[closed, :]), g_t[closed]
    over = (rows @ Z) / lengths[:, None]
    sizes = np.linalg.norm(over, axis=1)
    rate = rows @ shortest + rates
    terms = np.abs(rows) @ np.abs(shortest) + np.abs(rates)
    rate = np.where(np.abs(rate) <= complementarity.PARAMETERS.safe * doubles.EPS * terms, 0.0, rate)
    moves = sizes > rank.PARAMETERS.small
    taken = np.flatnonzero(moves)
    A, least = over[taken] / sizes[taken, None], -rate[taken] / (lengths * sizes)[taken]
    moving, against = (
        [contacts[closed[i]].name for i in np.flatnonzero(which)] for which in (moves, ~moves & (rate < 0.0))
    )
    try:
        found, more = _of_cone(A, moving)
        allowed: Floats | None = None
        try:
            allowed = shortest + Z @ complementarity.shortest(A, least).x
        except ContradictoryRows as error:
            closing = initial.quoted([moving[i] for i in error.rows])
            reason = f"no displacement over dt > 0 is allowed: {closing} close on each other"
    except UndecidedRows:
        named = initial.quoted([contacts[j].name for j in closed])
        reason = f"the directions beside {named} are not decided: their gradients are too near dependent ones"
        return ContactDirections(contacts, None, None, (*notes, reason))
    if against:
        allowed, named = None, initial.quoted(against)
        reason = f"no displacement over dt > 0 is allowed: the rows would have {named} violated"
    moved = tuple(dataclasses.replace(one, displacement=Z @ one.displacement + 0.0) for one in found)
    return ContactDirections(contacts, moved, allowed, (*notes, *more, *([reason] if reason else ())))


def _without_direction(
    system: System, numeric: NumericSystem, state: State, sides: Gaps, closed: list[int]
) -> str:
    """A sentence about a closed contact whose gradient vanishes, has no value or jumps, which tells no direction."""

    def rows_at(q: Floats) -> LocalRows:
        return LocalRows(numeric.contacts(state.t, q, state.v, state.p)[1])

    vanishing = sides.flat | projection.vanishing(rows_at, state) | ~rows_at(state.q).are_finite()
    for j in closed:
        if vanishing[j]:
            return (
                f"no directions are told: the gradient of `{system.contacts.rows[j].name}` vanishes or has no value"
                " here (write the condition with a slope at its surface, as `x >= 0` in place of `x**3 >= 0`)"
            )
    kinked, contacts = named_functions.switching_contacts(system.model), system.contacts
    switching = [j for j in closed if kinked[j]]
    if not switching:
        return ""
    names = tuple(contacts.rows[j] for j in switching)
    some = ConstraintRows(
        names,
        contacts.g[switching],
        contacts.G[switching, :],
        contacts.g_t[switching],
        contacts.gamma[switching],
    )
    switches = kinks.find(system.symbols, system.p, some)
    edge = None if switches is None else switches.at(state.t, state.q, state.p)
    if edge is None:
        return ""
    return (
        f"no directions are told: the gradient of `{edge.name}` jumps here, at an edge or in a corner of one condition"
        " (declare each side as an inequality of its own)"
    )


def _of_cone(A: Floats, names: list[str]) -> tuple[list[Direction], list[str]]:
    """The directions, displacements u (d,), beside contacts with unit rows A (k, d), and a note where not all rays are
    listed."""
    found = [Direction("free", _signed(u)) for u in (rank.null_basis(A)).T]
    one_sided: list[Direction] = []
    blocked: list[Direction] = []
    notes = []
    linked = np.abs(A @ A.T) > A.shape[1] * doubles.EPS  # others are orthogonal to each other, to rounding
    for members in connected([*((i,) for i in range(len(A))), *np.argwhere(linked).tolist()]):
        part = A[members]

        def moved(u: Floats, sign: int, members: list[int] = members, part: Floats = part) -> tuple[str, ...]:
            flags = sign * (part @ u) > rank.PARAMETERS.large
            return tuple(names[members[i]] for i in np.flatnonzero(flags))

        locked = _locked(part)
        rays, is_complete = _rays(_off(part, locked))
        if not is_complete:
            shown = initial.quoted([names[i] for i in members])
            notes.append(
                f"the rays beside {shown} are not listed, as they may be too many: one stands for them"
            )
        one_sided += [Direction("one-sided", ray, moved(ray, 1)) for ray in rays]
        across = [_signed(u) for u in rank.row_basis(part[locked])]
        for u in (*(-ray for ray in rays), *across, *(-u for u in across)):
            blocked.append(Direction("blocked", u, moved(u, -1)))
    return [*found, *one_sided, *blocked], notes


def _locked(A: Floats) -> list[int]:
    """The rows that A u >= 0 keeps at zero: such as have a sum with positive weights that vanishes (Farkas)."""
    locked: list[int] = []
    while True:
        free = _off(A, locked)
        rest = np.flatnonzero(free.any(axis=1))
        if len(rank.row_basis(free[rest])) == rest.size:
            return sorted(locked)
        try:
            complementarity.shortest(free[rest], np.ones(rest.size))
        except ContradictoryRows as error:
            locked += [int(rest[i]) for i in error.rows]
            off = _off(A, locked)
            locked = [i for i in range(len(A)) if not off[i].any()]
        else:
            return sorted(locked)


def _off(A: Floats, locked: list[int]) -> Floats:
    """The part of unit rows (k, d) across some of them, of length one again; zero where none is left."""
    basis = rank.row_basis(A[locked])
    off = A - (A @ basis.T) @ basis
    lengths = np.linalg.norm(off, axis=1)
    is_left = lengths > rank.PARAMETERS.large
    return np.where(is_left[:, None], off / np.where(is_left, lengths, 1.0)[:, None], 0.0)


def _rays(A: Floats) -> tuple[list[Floats], bool]:
    """The extreme rays (d,) of A u >= 0 in what the rows (k, d) span, of length one, where all can open at once. Where
    they may be too many it is one ray, along which all open, and False."""
    A = A[A.any(axis=1)]
    basis = rank.row_basis(A)
    numbers = list(range(len(A)))
    if len(basis) < len(A):  # others imply rows that are a sum of them with positive weights
        for i in range(len(A)):
            others = [j for j in numbers if j != i]
            left = complementarity.residual(A[others].T, A[i])
            if left is not None and np.linalg.norm(left) <= rank.PARAMETERS.small:
                numbers = others
    needed = A[numbers]
    if len(needed) == len(basis):
        return [ray / np.linalg.norm(ray) for ray in decompositions.pseudo_inverse(needed).T], True
    # Each set of contacts is looked at for a ray along which just these stay closed.
    if math.comb(len(needed), len(basis) - 1) > 20_000:
        middle = complementarity.shortest(A, np.ones(len(A))).x
        return [middle / np.linalg.norm(middle)], False
    over = needed @ basis.T
    found: dict[tuple[int, ...], Floats] = {}
    for edge in itertools.combinations(range(len(needed)), len(basis) - 1):
        beside = rank.space(over[list(edge)])
        opened = over @ beside.right[-1]
        ray = beside.right[-1] if opened.sum() > 0 else -beside.right[-1]
        if beside.low == len(edge) and (over @ ray >= -rank.PARAMETERS.large).all():
            found[tuple(np.flatnonzero(np.abs(opened) <= rank.PARAMETERS.large).tolist())] = ray @ basis
    return list(found.values()), True


def _signed(u: Floats) -> Floats:
    """A direction or its opposite, that with the largest component positive."""
    return np.asarray(u if u[np.argmax(np.abs(u))] > 0 else -u)
