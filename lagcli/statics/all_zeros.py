"""All points of a problem by exact algebra, where its equations are polynomials of few unknowns."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import numpy.typing as npt

from lagcli.statics import algebraic_zeros, newton, polynomial_equations, refine
from lagcli.statics.point_search import PointSearch
from lagcli.statics.polynomial_equations import NotPolynomial, PolynomialEquations, SpentError
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import RestEquations

Floats = npt.NDArray[np.float64]


class CompletenessParameters:
    """Sizes of models whose points are counted, and what is zero there.

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
    """Comparisons of monomials, some seconds. `test_two_million_comparisons_of_monomials_are_made` fails at
    200000 and 20000000."""
    vanishing: float = 1e-9
    """A denominator of this size vanishes at the zero, which is none of the equations then.
    `test_a_denominator_below_nine_digits_vanishes` fails at 1e-10 and 1e-8."""
    positive: float = -1e-7
    """A gap or a force of a contact may be so far below zero by rounding.
    `test_a_root_may_be_below_zero_by_rounding` fails at -1e-8 and -1e-6."""


PARAMETERS = CompletenessParameters()


@dataclasses.dataclass(frozen=True, slots=True)
class Completeness:
    """True where the list is proved to hold all points, else why that is not known; final: further points would change
    nothing about it."""

    proved: bool
    reason: str = ""
    final: bool = True


def complete(search: PointSearch) -> Completeness:
    """Add the points that a search has missed to it, and return whether all are known."""
    problem = search.problem
    if len(problem.times) > 1:
        return Completeness(False, "the equations hold t")
    if problem.n + problem.C > PARAMETERS.most_unknowns or PARAMETERS.most_contacts < problem.K:
        return Completeness(False, "there are too many unknowns for exact algebra")
    sets = [s for size in range(problem.K + 1) for s in itertools.combinations(range(problem.K), size)]
    expected: list[Floats] = []
    try:
        for closed in sets:
            expected += _of_set(search, closed)
    except (NotPolynomial, algebraic_zeros.NotCounted) as why:
        return Completeness(False, str(why))
    except SpentError:
        return Completeness(False, "the budget of exact algebra is spent")
    known = [one.point.q for one in search.points]
    apart = [q for q in expected if not any(search.apart(q, other) <= 1e-5 for other in known)]
    if apart or any(one.dimension for one in search.points):
        return Completeness(False, "a point that algebra gives could not be refined", final=False)
    if any(not any(search.apart(q, other) <= 1e-5 for q in expected) for other in known):
        return Completeness(False, "algebra and the search disagree", final=False)
    return Completeness(True)


def _of_set(search: PointSearch, closed: tuple[int, ...]) -> list[Floats]:
    """The points with some contacts closed, each taken into the search."""
    problem = search.problem
    unknowns = problem.n + problem.C + len(closed)
    numbers = np.concatenate([[problem.t], problem.p])
    exact = polynomial_equations.equations(
        problem.exact_program(closed), unknowns, numbers, PARAMETERS.budget
    )
    used = [k for k in range(len(exact.names)) if k not in exact.angles]
    found = []
    for zero in algebraic_zeros.zeros(exact.ring, exact.equations, used):
        if not _is_valid(exact, zero):
            continue
        x = exact.unknowns(zero)
        equations = RestEquations(problem, closed, search.scales)
        point = _refined(equations, x)
        if point is None:
            found.append(x[: problem.n])
            continue
        pulling, below = refine.wrong_side(problem, point, search.scales)
        if below or (pulling and search.options.pushes):
            continue
        search.take(point)
        found.append(search.wrapped_angles(point.q))
    return found


def _is_valid(exact: PolynomialEquations, zero: Floats) -> bool:
    """True if roots are positive and nothing is divided by zero."""
    values = zero.tolist()
    first = len(values) - len(exact.roots)
    if any(values[k] < PARAMETERS.positive for k in range(first, len(values))):
        return False
    return all(abs(polynomial_equations.at(d, values)) > PARAMETERS.vanishing for d in exact.denominators)


def _refined(equations: RestEquations, x: Floats) -> EquilibriumPoint | None:
    if equations(x) is None:
        return None
    found = refine.settled(equations, newton.refined(equations, x))
    near = isinstance(found, EquilibriumPoint) and np.abs(found.q - x[: equations.problem.n]).max() < 1e-3
    return found if near and isinstance(found, EquilibriumPoint) else None
