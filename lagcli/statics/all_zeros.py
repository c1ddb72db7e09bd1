"""All points of a problem by exact algebra, where its equations are polynomials of few unknowns."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from lagcli.statics import algebraic_zeros, newton, polynomial_equations, refine
from lagcli.statics.algebraic_zeros import AlgebraicZero
from lagcli.statics.point_search import PointSearch
from lagcli.statics.polynomial_equations import CountedOrder, NotPolynomial, PolynomialEquations, SpentError
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import RestEquations


class CompletenessParameters:
    """Sizes of models whose points are counted.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py`.
    """

    __slots__ = ()

    most_unknowns: int = 24
    """Coordinates and multipliers: of more no Groebner basis is tried.
    `test_points_of_twenty_four_unknowns_and_three_contacts_are_counted` fails at 2 and 240."""
    most_contacts: int = 3
    """Contacts, every set of which is counted alone.
    `test_points_of_twenty_four_unknowns_and_three_contacts_are_counted` fails at 0 and 30."""
    budget: int = 2_000_000
    """Comparisons of monomials of all sets of contacts together, some seconds.
    `test_two_million_comparisons_of_monomials_are_made` fails at 200000 and 20000000."""


PARAMETERS = CompletenessParameters()


@dataclasses.dataclass(frozen=True, slots=True)
class Completeness:
    """True where the list is proved to hold all points; and a sentence on the proof, or on why there is none. final:
    a search from other starts would find no more; is_told: the sentence is one for users."""

    proved: bool
    reason: str
    final: bool = False
    is_told: bool = False


@dataclasses.dataclass(frozen=True, slots=True)
class SetZeros:
    """All zeros with some contacts closed: the points of them, and those at which further contacts touch, which are
    points of another set."""

    points: list[EquilibriumPoint]
    touching: list[EquilibriumPoint]


def complete(search: PointSearch) -> Completeness:
    """Put the exact points in the place of those of a search, for every set of contacts that can be counted; and say
    whether all are known."""
    problem = search.problem
    if len(problem.times) > 1:
        return Completeness(False, "the equations hold t")
    if problem.n + problem.C > PARAMETERS.most_unknowns or PARAMETERS.most_contacts < problem.K:
        return Completeness(False, "there are too many unknowns for exact algebra")
    counted, reasons, planes = _counted(search)
    if reasons or planes:
        for zeros in counted.values():
            for point in zeros.touching:
                search.take(point)
    agrees = search.settle({closed: zeros.points for closed, zeros in counted.items()})
    if reasons:
        return Completeness(False, reasons[0])
    if planes:
        return Completeness(False, planes[0], final=agrees, is_told=True)
    if not agrees:
        return Completeness(False, "algebra and the search disagree")
    return Completeness(
        True,
        "that there are no others is proved by exact algebra: a Groebner basis, of which all real zeros are isolated",
        is_told=True,
    )


class _Plane(Exception):
    """The points with some contacts closed, if there are any, are one plane or a part of it."""


def _counted(search: PointSearch) -> tuple[dict[tuple[int, ...], SetZeros], list[str], list[str]]:
    """The points of the sets of contacts that can be counted, why others cannot, and which are known to be a plane."""
    counted: dict[tuple[int, ...], SetZeros] = {}
    reasons: list[str] = []
    planes: list[str] = []
    order = CountedOrder(PARAMETERS.budget)
    contacts = range(search.problem.K)
    for closed in (
        each for size in range(len(contacts) + 1) for each in itertools.combinations(contacts, size)
    ):
        try:
            counted[closed] = _of_set(search, closed, order)
        except _Plane as why:
            if search.leave_out(closed):
                planes.append(str(why))
            else:
                reasons.append(str(why))
        except (NotPolynomial, algebraic_zeros.NotCounted) as why:
            reasons.append(str(why))
        except SpentError:
            reasons.append("the budget of exact algebra is spent")
    return counted, reasons, planes


def _of_set(search: PointSearch, closed: tuple[int, ...], order: CountedOrder) -> SetZeros:
    """All points with these contacts closed, and with no other one touching."""
    problem = search.problem
    unknowns = problem.n + problem.C + len(closed)
    program, signs = problem.exact_program(closed)
    numbers = np.concatenate([[problem.t], problem.p])
    exact = polynomial_equations.equations(program, unknowns, numbers, order, signs)
    found = SetZeros([], [])
    contacts = problem.K - len(closed)
    try:
        zeros = algebraic_zeros.zeros(exact.ring, exact.equations, exact.used, exact.denominators)
    except algebraic_zeros.Infinite as why:
        if exact.is_linear:
            raise _Plane("all points are one plane or a part of it, as their equations are linear") from why
        raise
    for zero in zeros:
        if any(root.is_unknown and zero.sign(exact.ring.gens[k]) <= 0 for k, root in exact.squares.items()):
            continue
        sides = _signs(exact, zero)
        if any(side < 0 for side in sides[:contacts]) or any(side <= 0 for side in sides[contacts:]):
            continue
        pushes = (zero.sign(exact.ring.gens[k]) for k in range(problem.n + problem.C, unknowns))
        if search.options.pushes and any(push < 0 for push in pushes):
            continue
        point = _point(search, closed, exact, zero)
        (found.points if all(sides) else found.touching).append(point)
    return found


def _signs(exact: PolynomialEquations, zero: AlgebraicZero) -> list[int]:
    """The signs of the gaps of open contacts, then of the sides of leaves."""
    if exact.signs and not all(zero.sign(divisor, exact.squares) for divisor in exact.divisors):
        raise algebraic_zeros.NotCounted("a gap has no value at a zero")
    return [
        zero.sign(quotient.above, exact.squares) * zero.sign(quotient.below, exact.squares)
        for quotient in exact.signs
    ]


def _point(
    search: PointSearch, closed: tuple[int, ...], exact: PolynomialEquations, zero: AlgebraicZero
) -> EquilibriumPoint:
    """The point of a zero, rounded to doubles."""
    problem = search.problem
    values = np.array([0.0 if k in exact.angles else zero.value(k) for k in range(len(exact.names))])
    x = exact.unknowns(values)
    q = search.wrapped_angles(x[: problem.n])
    equations = RestEquations(problem, closed, search.scales)
    rounded = refine.settled(equations, newton.NewtonEnd(np.concatenate([q, x[problem.n :]]), 0.0, 0.0))
    return EquilibriumPoint(q, equations.all_multipliers(x[problem.n :]), closed, rounded.residual)
