"""All points of a problem, with the proof that none is left out: by exact algebra, or by intervals.

Exact algebra serves where the equations are polynomials of few unknowns, intervals where there is one coordinate and no
row: each has one zero of the force, or none, or stays undecided, as at a pole, a kink, a double zero or in a flat tail.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections import deque
from collections.abc import Callable

import numpy as np
from mpmath import iv

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.expression import enclosures
from lagcli.expression.enclosures import NoBounds, NoValue
from lagcli.smoothness import sides
from lagcli.statics import algebraic_zeros, point_search, polynomial_equations, refine
from lagcli.statics.point_search import PointSearch
from lagcli.statics.polynomial_equations import CountedOrder, NotPolynomial, SpentError
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import RestEquations
from lagcli.statics.univariate import NotCounted

SetZeros = tuple[list[EquilibriumPoint], list[EquilibriumPoint]]
Piece = tuple[float, float]
# The force and its slope over an interval; it raises `NoBounds`.
Force = Callable[[iv.mpf], tuple[iv.mpf, iv.mpf]]


class CompletenessParameters:
    """Sizes of pieces. The tests are of `tests/unit/test_numbers_of_rest_searches.py`."""

    __slots__ = ()

    uneven: float = 1.0371
    """The end of the first shell in sizes of things, and so those of all: no decimal number is one, for there zeros
    are likely. `test_all_zeros_of_one_unknown_lie_within_a_million_sizes` fails at 0.10371 and 10.371."""


PARAMETERS = CompletenessParameters()


@dataclasses.dataclass(frozen=True, slots=True)
class Completeness:
    """True where the list is proved to hold all points; told: a sentence for users on the proof, or on why there is
    none; final: a search from other starts would find no more."""

    proved: bool
    told: str = ""
    final: bool = False


def by_algebra(search: PointSearch) -> Completeness:
    """Put the exact points of each set of contacts that can be counted in the place of those of a search; and say
    whether all are known."""
    problem = search.problem
    is_few = problem.n + problem.C <= 24 and point_search.PARAMETERS.most_contacts >= problem.K
    if len(problem.times) > 1 or not is_few:
        return Completeness(False)
    counted: dict[tuple[int, ...], SetZeros] = {}
    is_open = is_plane = False
    # Comparisons of monomials of all sets of contacts together, some seconds
    order = CountedOrder(2_000_000)
    for closed in problem.contact_sets():
        try:
            counted[closed] = _of_set(search, closed, order)
        except _Plane:
            is_known = search.leave_out(closed)
            is_plane, is_open = is_plane or is_known, is_open or not is_known
        except (NotPolynomial, NotCounted, SpentError):
            is_open = True
    if is_open or is_plane:
        for _, touching in counted.values():
            for point in touching:
                search.take(point)
    agrees = search.settle({closed: points for closed, (points, _) in counted.items()})
    if is_open or (not is_plane and not agrees):
        return Completeness(False)
    if is_plane:
        plane = "all points are one plane or a part of it, as their equations are linear"
        return Completeness(False, plane, final=agrees)
    return Completeness(
        True,
        "that there are no others is proved by exact algebra: a Groebner basis, of which all real zeros are isolated",
    )


class _Plane(Exception):
    """The points with some contacts closed, if there are any, are one plane or a part of it."""


def _of_set(search: PointSearch, closed: tuple[int, ...], order: CountedOrder) -> SetZeros:
    """All points with these contacts closed and no other one touching, and those at which further ones touch."""
    problem = search.problem
    unknowns, contacts = problem.n + problem.C + len(closed), problem.K - len(closed)
    program, signs = problem.exact_programs(closed)
    numbers = [problem.t, *problem.p.tolist()]
    exact = polynomial_equations.equations(program, unknowns, numbers, order, signs)
    found: SetZeros = ([], [])
    try:
        zeros = algebraic_zeros.zeros(exact.ring, exact.equations, exact.used, exact.denominators)
    except algebraic_zeros.Infinite as why:
        if exact.is_linear:
            raise _Plane from why
        raise
    for zero in zeros:
        if any(root.is_unknown and zero.sign(exact.ring.gens[k]) <= 0 for k, root in exact.squares.items()):
            continue
        if exact.signs and not all(zero.sign(divisor, exact.squares) for divisor in exact.divisors):
            raise NotCounted("a gap has no value at a zero")
        # The signs of the gaps of open contacts, then of the sides of leaves
        sides = [
            zero.sign(quotient.above, exact.squares) * zero.sign(quotient.below, exact.squares)
            for quotient in exact.signs
        ]
        if any(side < 0 for side in sides[:contacts]) or any(side <= 0 for side in sides[contacts:]):
            continue
        pushes = (zero.sign(exact.ring.gens[k]) for k in range(problem.n + problem.C, unknowns))
        if search.options.pushes and any(push < 0 for push in pushes):
            continue
        # The point, rounded to doubles
        values = np.array([0.0 if k in exact.angles else zero.value(k) for k in range(len(exact.names))])
        x = exact.unknowns(values)
        q, lam = search.wrapped_angles(x[: problem.n]), x[problem.n :]
        equations = RestEquations(problem, closed, search.scales)
        rounded = refine.settled(equations, np.concatenate([q, lam]))
        point = EquilibriumPoint(q, equations.all_multipliers(lam), closed, rounded.residual)
        found[0 if all(sides) else 1].append(point)
    return found


# One unknown, by intervals


@dataclasses.dataclass(slots=True)
class LinePieces:
    """Pieces of the line with one zero each, and undecided ones; there is none elsewhere."""

    isolated: list[Piece] = dataclasses.field(default_factory=list)
    undecided: list[Piece] = dataclasses.field(default_factory=list)


def by_intervals(search: PointSearch, is_angle: bool) -> Completeness:
    """Put the zeros that intervals enclose in the place of the points of a search, but where a piece is undecided; and
    say whether all are known."""
    problem, length = search.problem, search.scales.length
    if len(problem.times) > 1:
        return Completeness(False)
    program, numbers = problem.with_gradient(problem.laws.F), (problem.t, *problem.p.tolist())

    def force(x: iv.mpf) -> tuple[iv.mpf, iv.mpf]:
        result = functools.partial(enclosures.result, iv)
        value, slope = program.run([[x], list(map(iv.mpf, numbers))], iv.mpf, result)
        return value, slope

    # More digits than a double has, so that roundings are no reason to halve an interval
    digits, iv.dps = iv.dps, 20
    try:
        pieces = _pieces(force, search, is_angle)
        narrowed = [_narrowed(force, piece) for piece in pieces.isolated]
    finally:
        iv.dps = digits
    equations = RestEquations(problem, (), search.scales)
    points = []
    for x in narrowed:
        rounded = refine.settled(equations, np.array([x]))
        points.append(
            EquilibriumPoint(search.wrapped_angles(np.array([x])), problem.nothing, (), rounded.residual)
        )
    # Undecided pieces, those that touch as one
    own: list[Piece] = []
    for low, high in sorted(pieces.undecided):
        if own and low <= own[-1][1]:
            before = own.pop()
            low, high = before[0], max(high, before[1])
        own.append((low, high))
    turns = (-2 * np.pi, 0.0, 2 * np.pi) if search.options.angles[0] else (0.0,)

    def is_decided(q: Floats) -> bool:
        """True outside of undecided pieces, and not within an interval of one that is not halved further."""
        near = _width(length, float(q[0]), 1)
        return not any(low - near <= q[0] + turn <= high + near for low, high in own for turn in turns)

    agrees = search.settle({(): points}, is_decided)
    for low, high in own:
        if np.isfinite([low, high]).all():
            search.take(refine.reached(problem, np.array([(low + high) / 2]), (), search.scales))
    if own:
        is_narrow = all(abs(low + high) == np.inf or high - low <= _width(length, low) for low, high in own)
        return Completeness(False, _undecided(own), is_narrow)
    proof = "that there are no others is proved by intervals: each piece of the line has one of them, or none"
    return Completeness(True, proof) if agrees else Completeness(False)


def _undecided(pieces: list[Piece]) -> str:
    """A sentence on pieces that are undecided."""
    most = point_search.PARAMETERS.most_named
    named = [
        f"near {(low + high) / 2:.6g}" if high - low <= doubles.ROOT else f"from {low:.3g} to {high:.3g}"
        for low, high in sorted(pieces, key=lambda piece: abs(piece[0] + piece[1]))[:most]
    ]
    more = "" if len(pieces) <= most else " and elsewhere"
    return f"intervals decide everywhere but {', '.join(named)}{more}: a pole, a kink, a double zero or a flat tail"


def _width(length: float, x: float, together: int = 100) -> float:
    """The width of some intervals that are not halved further, side by side: as narrow ones they are one piece."""
    return together * doubles.ZERO * (length + abs(x))


def _narrowed(force: Force, piece: Piece) -> float:
    """The zero in a piece on which the force rises or falls, to rounding."""
    low, high = piece
    if low < 0 < high and 0 in force(iv.mpf(0))[0]:
        return 0.0
    left = _is_up(force, low)
    while math.nextafter(low, high) < high:  # beside zero there are more doubles than an interval is halved
        low, high = map(float, sides.bracket(lambda x: _is_up(force, float(x)) is left, low, high))
    return high


def _pieces(force: Force, search: PointSearch, is_angle: bool) -> LinePieces:
    """All pieces, from the middle outward: a whole turn, or shells as far as the force has no zero beyond."""
    found, length, left = LinePieces(), search.scales.length, 4000  # intervals that are looked at
    if is_angle:
        # The ends lie at no point where a zero is likely, and overlap: none is lost between them.
        turn = (-np.pi + 0.0123 - doubles.VALUE, np.pi + 0.0123 + doubles.VALUE)
        _search(force, [turn], found, left, length)
        return found
    # Shells that share the intervals, from one size of things up to a million
    ends = [length * PARAMETERS.uneven * 10.0**k for k in range(7)]
    for k, end in enumerate(ends):
        shell = [(-end, end)] if not k else [(-end, -ends[k - 1]), (ends[k - 1], end)]
        left -= _search(force, shell, found, left // (len(ends) - k), length)
    for end, tail in ((ends[-1], (ends[-1], np.inf)), (-ends[-1], (-np.inf, -ends[-1]))):
        try:
            value, slope = force(iv.mpf(list(tail)))
        except NoValue:
            continue
        except NoBounds:
            found.undecided.append(tail)
            continue
        # The force has one sign there by its bounds, or as it grows away from zero.
        is_up = _is_up(force, end)
        grows = is_up is not None and _is_determined(slope) and bool(slope.a > 0) == (is_up == (end > 0))
        if not _is_determined(value) and not grows:
            found.undecided.append(tail)
    return found


def _search(force: Force, begun: list[Piece], found: LinePieces, boxes: int, length: float) -> int:
    """Halve pieces as long as they are undecided; the number that was looked at."""
    waiting = deque(begun)
    count = 0
    while waiting and count < boxes:
        count += 1
        low, high = waiting.popleft()
        middle = low + (high - low) * 0.4871
        try:
            value, slope = force(iv.mpf([low, high]))
        except NoValue:
            continue
        except NoBounds:
            if low < 0 < high:
                middle = 0.0  # where poles and kinks are likely
        else:
            if 0 not in value:
                continue
            ends = [None] if 0 in slope else [_is_up(force, x) for x in (low, high)]
            if None not in ends:
                found.isolated += [(low, high)] if ends[0] != ends[1] else []
                continue
        if high - low < doubles.ZERO * (length + abs(low)) or not low < middle < high:
            found.undecided.append((low, high))
        else:
            waiting += [(low, middle), (middle, high)]
    found.undecided += waiting
    return count


def _is_up(force: Force, x: float) -> bool | None:
    """True if the force is positive at a point, False if it is negative; None where neither is determined."""
    try:
        value = force(iv.mpf(x))[0]
    except NoBounds:
        return None
    return bool(value.a > 0) if _is_determined(value) else None


def _is_determined(value: iv.mpf) -> bool:
    return bool(value.a == value.a and value.b == value.b and 0 not in value)
