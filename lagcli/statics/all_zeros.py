"""All points of a problem, with the proof that none is left out.

By exact algebra where the equations are polynomials of few unknowns; by intervals of one coordinate without rows, which
have one zero of the force, or none, or stay undecided, as at a pole, a kink, a double zero or in a flat tail.
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
from lagcli.statics.rest_equations import EquilibriumPoint, RestEquations
from lagcli.statics.univariate import NotCounted

SetZeros = tuple[list[EquilibriumPoint], list[EquilibriumPoint]]
Piece = tuple[float, float]
Pieces = list[Piece]
# The force and its slope over an interval; it raises `NoBounds`.
Force = Callable[[iv.mpf], tuple[iv.mpf, iv.mpf]]


@dataclasses.dataclass(frozen=True, slots=True)
class Completeness:
    """proved: the list holds all points; told: a sentence on it; final: a search from other starts finds no more."""

    proved: bool
    told: str = ""
    final: bool = False


def by_algebra(search: PointSearch) -> Completeness:
    """Put exact points in the place of those of a search, for sets of contacts that can be counted; are all known?"""
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
            found = _of_set(search, closed, order)
        except (NotPolynomial, NotCounted, SpentError):
            is_open = True
            continue
        if found is not None:
            counted[closed] = found
        elif search.leave_out(closed):
            is_plane = True
        else:
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


def _of_set(search: PointSearch, closed: tuple[int, ...], order: CountedOrder) -> SetZeros | None:
    """All points with these contacts closed and no other one touching, and those at which further ones touch; None
    where they are one plane or a part of it, if there are any."""
    problem, equations = search.problem, search.free.closing(closed)
    unknowns, contacts = problem.n + problem.C + len(closed), problem.K - len(closed)
    program, signs = problem.exact_programs(closed)
    numbers = [problem.t, *problem.p.tolist()]
    exact = polynomial_equations.equations(program, unknowns, numbers, order, signs)
    found: SetZeros = ([], [])
    try:
        zeros = algebraic_zeros.zeros(exact.ring, exact.equations, exact.used, exact.denominators)
    except algebraic_zeros.Infinite:
        if exact.is_linear:
            return None
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
        values = np.array([0.0 if k in exact.angles else zero.value(k) for k in range(len(exact.names))])
        found[0 if all(sides) else 1].append(_rounded(search, equations, exact.unknowns(values)))
    return found


def _rounded(search: PointSearch, equations: RestEquations, x: Floats) -> EquilibriumPoint:
    """The point of a zero that was rounded to doubles."""
    n = search.problem.n
    q, lam = search.wrapped_angles(x[:n]), x[n:]
    residual = equations.settled(np.concatenate([q, lam])).residual
    return EquilibriumPoint(q, equations.all_multipliers(lam), tuple(equations.contacts), residual)


# One unknown, by intervals


def by_intervals(search: PointSearch) -> Completeness:
    """Put the zeros that intervals enclose in the place of found points, but in undecided pieces; are all known?"""
    problem, length, (is_angle,) = search.problem, search.scales.length, search.options.angles
    if len(problem.times) > 1:
        return Completeness(False)
    program, numbers = problem.with_gradient(problem.laws.F), (problem.t, *problem.p.tolist())

    def force(x: iv.mpf) -> tuple[iv.mpf, iv.mpf]:
        result = functools.partial(enclosures.result, iv)
        value, slope = program.run([[x], list(map(iv.mpf, numbers))], iv.mpf, result)
        return value, slope

    # More digits than a double has, so that roundings are no reason to halve an interval
    digits, iv.dps, narrowed = iv.dps, 20, list[float]()
    try:
        isolated, undecided = pieces(force, length, is_angle)
        for low, high in isolated:
            # The force rises or falls on the piece: its zero to rounding
            if low < 0 < high and 0 in force(iv.mpf(0))[0]:
                high = 0.0
            else:
                left = _is_up(force, low)
                # Again and again: beside zero there are more doubles than an interval is halved.
                while math.nextafter(low, high) < high:
                    between = sides.bracket(lambda x: _is_up(force, float(x)) is left, low, high)  # noqa: B023
                    low, high = map(float, between)
            narrowed.append(high)
    finally:
        iv.dps = digits
    points = [_rounded(search, search.free, np.array([x])) for x in narrowed]
    # Undecided pieces, those that touch as one
    own: Pieces = []
    for low, high in sorted(undecided):
        if own and low <= own[-1][1]:
            before = own.pop()
            low, high = before[0], max(high, before[1])
        own.append((low, high))
    turns = (-2 * np.pi, 0.0, 2 * np.pi) if is_angle else (0.0,)

    def is_decided(q: Floats) -> bool:
        """True outside of undecided pieces, and not within an interval of one that is not halved further."""
        near = _narrow(length, float(q[0]))
        return not any(low - near <= q[0] + turn <= high + near for low, high in own for turn in turns)

    agrees = search.settle({(): points}, is_decided)
    for low, high in own:
        if np.isfinite([low, high]).all():
            search.take(refine.reached(search.free, np.array([(low + high) / 2])))
    if not own:
        told = (
            "that there are no others is proved by intervals: each piece of the line has one of them, or none"
        )
        return Completeness(agrees, told if agrees else "")
    most = point_search.PARAMETERS.most_named
    named = [
        f"near {(low + high) / 2:.6g}" if high - low <= doubles.ROOT else f"from {low:.3g} to {high:.3g}"
        for low, high in sorted(own, key=lambda piece: abs(piece[0] + piece[1]))[:most]
    ]
    more = "" if len(own) <= most else " and elsewhere"
    told = f"intervals decide everywhere but {', '.join(named)}{more}: a pole, a kink, a double zero or a flat tail"
    # Narrow ones side by side are one piece.
    is_narrow = all(np.isinf(low + high) or high - low <= 100 * _narrow(length, low) for low, high in own)
    return Completeness(False, told, is_narrow)


def _narrow(length: float, x: float) -> float:
    """The width of an interval that is not halved further."""
    return doubles.ZERO * (length + abs(x))


def pieces(force: Force, length: float, is_angle: bool) -> tuple[Pieces, Pieces]:
    """Pieces of the line with one zero each, and undecided ones; none is elsewhere. From the middle outward."""
    left = 4000  # intervals that are looked at
    if is_angle:
        # The ends lie at no point where a zero is likely, and overlap: none is lost between them.
        turn = (-np.pi + 0.0123 - doubles.VALUE, np.pi + 0.0123 + doubles.VALUE)
        isolated, undecided, _ = _halved(force, [turn], left, length)
        return isolated, undecided
    # Shells that share the intervals, from one size of things up to a million
    isolated, undecided = [], []
    ends = [length * point_search.PARAMETERS.uneven * 10.0**k for k in range(7)]
    for k, end in enumerate(ends):
        shell = [(-end, end)] if not k else [(-end, -ends[k - 1]), (ends[k - 1], end)]
        own, unknown, count = _halved(force, shell, left // (len(ends) - k), length)
        isolated, undecided, left = isolated + own, undecided + unknown, left - count
    for end, tail in ((ends[-1], (ends[-1], np.inf)), (-ends[-1], (-np.inf, -ends[-1]))):
        try:
            value, slope = force(iv.mpf(list(tail)))
        except NoValue:
            continue
        except NoBounds:
            undecided.append(tail)
            continue
        # The force has one sign there by its bounds, or as it grows away from zero.
        is_up = _is_up(force, end)
        grows = is_up is not None and _is_determined(slope) and bool(slope.a > 0) == (is_up == (end > 0))
        if not _is_determined(value) and not grows:
            undecided.append(tail)
    return isolated, undecided


def _halved(force: Force, begun: Pieces, boxes: int, length: float) -> tuple[Pieces, Pieces, int]:
    """Pieces with one zero, those that stay undecided however they are halved, and how many were looked at."""
    isolated, undecided, waiting = Pieces(), Pieces(), deque(begun)
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
                isolated += [(low, high)] if ends[0] != ends[1] else []
                continue
        if high - low < _narrow(length, low) or not low < middle < high:
            undecided.append((low, high))
        else:
            waiting += [(low, middle), (middle, high)]
    return isolated, [*undecided, *waiting], count


def _is_up(force: Force, x: float) -> bool | None:
    """True if the force is positive at a point, False if it is negative; None where neither is determined."""
    try:
        value = force(iv.mpf(x))[0]
    except NoBounds:
        return None
    return bool(value.a > 0) if _is_determined(value) else None


def _is_determined(value: iv.mpf) -> bool:
    return bool(value.a == value.a and value.b == value.b and 0 not in value)
