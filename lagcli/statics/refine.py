"""The point of rest that a start leads to, refined to rounding."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.linear import decompositions
from lagcli.statics import newton, rest_equations
from lagcli.statics.newton import NewtonEnd
from lagcli.statics.rest_equations import RestEquations, Scales
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]


class RefineParameters:
    """Numbers of the refinement of a point; parts are of no unit.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py`.
    """

    __slots__ = ()

    settled: float = 1e-5
    """The last Newton step, as a part of the unknowns: 1e-8 where a zero is double.
    `test_a_point_is_settled_and_balanced` fails at 1e-6 and 0.0001."""
    changes: int = 12
    """Sets of closed contacts that are tried in turn.
    `test_twelve_sets_of_closed_contacts_are_tried_from_a_guess` fails at 1 and 120."""
    offset: tuple[float, ...] = (0.003, 0.03, 0.1, 0.3)
    """How far starts beside the first one lie, as parts of the size of things.
    `test_starts_lie_beside_the_first_in_four_sizes` fails at a tenth and at ten times of it."""
    large: int = 60
    """Above so many unknowns a search costs so much that the starts aside wait until the way downhill has
    failed. `test_above_sixty_unknowns_the_starts_beside_wait` fails at 6 and 600."""


PARAMETERS = RefineParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class EquilibriumPoint:
    """A point of rest: q (n,), lambda of all rows at the start time (C + K,), the closed contacts by their numbers, and
    the largest |F + B^T lambda|, |c|, |g of a closed contact|."""

    q: Floats
    lam: Floats
    closed: tuple[int, ...]
    residual: float


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class NoEquilibrium:
    """No point was found; the least residual, and where it is."""

    residual: float
    q: Floats


def nearest_equilibrium(
    problem: StaticProblem, begin: Floats, asides: Sequence[float] = PARAMETERS.offset
) -> EquilibriumPoint | NoEquilibrium:
    """The point of rest reached from a configuration: by damped Newton steps, and from beside it where these fail.

    Contacts push: 0 <= lambda, 0 <= g, and one of them is zero.
    """
    scales = rest_equations.scales(problem, begin)
    random = np.random.default_rng(20061)
    best = NoEquilibrium(np.inf, begin)
    for part in (0.0, *asides):
        point = begin + part * scales.length * random.standard_normal(begin.size)
        if problem.K:
            found = pushed(problem, point, scales)
        else:
            found = reached(problem, point, (), scales)
        if isinstance(found, EquilibriumPoint):
            return found
        best = min(best, found, key=lambda one: one.residual)
    return best


def reached(
    problem: StaticProblem,
    begin: Floats,
    closed: tuple[int, ...],
    scales: Scales,
) -> EquilibriumPoint | NoEquilibrium:
    """The point that a configuration leads to with these contacts closed, whatever the signs of lambda and g."""
    equations = RestEquations(problem, closed, scales)
    x = begun(equations, begin)
    found = None if x is None else newton.solve(equations, x)
    if found is None:
        return NoEquilibrium(np.inf, begin)
    return settled(equations, found)


def begun(equations: RestEquations, begin: Floats) -> Floats | None:
    """The unknowns at a configuration, with the multipliers that come closest to balance."""
    each = equations.multipliers(begin)
    return None if each is None else np.concatenate([begin, *each])


def settled(equations: RestEquations, found: NewtonEnd) -> EquilibriumPoint | NoEquilibrium:
    """The point where a search ended, if it is one."""
    problem = equations.problem
    q, each = equations.split(found.x)
    lam = equations.all_multipliers(each[0])
    residual = _largest(problem, q, lam, equations.acting)
    closed = tuple(equations.acting)
    point = EquilibriumPoint(q.copy(), lam, closed, residual)
    good = found.step <= PARAMETERS.settled and equations.unbalanced(found.x) <= doubles.ZERO
    if good and _holds_later(problem, q, closed, equations.scales):
        return point
    return NoEquilibrium(residual if np.isfinite(residual) else np.inf, q.copy())


def _largest(problem: StaticProblem, q: Floats, lam: Floats, closed: list[int]) -> float:
    """The largest |F + B^T lambda|, |c|, and |g| of closed contacts, as the equations are written."""
    values = problem.at(problem.t, q, lam)
    rows, by = (
        np.vstack([values.B, values.G[closed]]),
        lam[[*range(problem.C), *(problem.C + k for k in closed)]],
    )
    parts = [values.F + rows.T @ by, values.c, values.g[closed]]
    return float(max(np.abs(part).max(initial=0.0) for part in parts))


def _holds_later(problem: StaticProblem, q: Floats, closed: tuple[int, ...], scales: Scales) -> bool:
    """True if a point of rest is one at further times too."""
    for t in problem.later:
        values = problem.at(t, q, problem.nothing)
        rows = np.vstack([values.B, values.G[list(closed)]])
        left = np.abs(decompositions.residual(rows.T, values.F)).max(initial=0.0) / scales.force
        apart = np.abs(values.c / (scales.conditions * scales.length)).max(initial=0.0)
        if not max(left, apart) <= 1e-8:
            return False
    return True


def pushed(problem: StaticProblem, begin: Floats, scales: Scales) -> EquilibriumPoint | NoEquilibrium:
    """The point that a configuration leads to with contacts that push."""
    values = problem.at(problem.t, begin, problem.nothing)
    near = np.flatnonzero(values.g <= doubles.ZERO * scales.contacts * scales.length)
    guesses = [_complementary(problem, begin, scales), (begin, tuple(near.tolist())), (begin, ())]
    best: EquilibriumPoint | NoEquilibrium = NoEquilibrium(np.inf, begin)
    for point, closed in guesses:
        tried: set[tuple[int, ...]] = set()
        while closed not in tried and len(tried) < PARAMETERS.changes:
            tried.add(closed)
            found = reached(problem, point, closed, scales)
            if isinstance(found, NoEquilibrium):
                best = found if found.residual < best.residual else best
                break
            pulling, below = wrong_side(problem, found, scales)
            if not pulling and not below:
                return found
            point, closed = found.q, tuple(sorted((set(closed) - pulling) | below))
    return best


def wrong_side(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> tuple[set[int], set[int]]:
    """The contacts that pull at a point, and the open ones behind whose surface it lies."""
    values = problem.at(problem.t, point.q, point.lam)
    lam = point.lam[problem.C :]
    pulling = {k for k in point.closed if lam[k] * scales.contacts[k] < -doubles.ZERO * scales.force}
    limits = doubles.ZERO * scales.contacts * scales.length
    below = {k for k in range(problem.K) if k not in point.closed and not values.g[k] >= -limits[k]}
    return pulling, below


def touching(problem: StaticProblem, found: EquilibriumPoint, scales: Scales) -> tuple[int, ...]:
    """The contacts that touch at a point, those that carry nothing included."""
    g = problem.at(problem.t, found.q, found.lam).g
    near = np.flatnonzero(g <= doubles.ZERO * scales.contacts * scales.length)
    return tuple(sorted({*found.closed, *near.tolist()}))


def _complementary(problem: StaticProblem, begin: Floats, scales: Scales) -> tuple[Floats, tuple[int, ...]]:
    """The end of a search with all contacts, and those that are closed there."""
    equations = RestEquations(problem, None, scales)
    x = begun(equations, begin)
    found = None if x is None else newton.solve(equations, x)
    if found is None:
        return begin, ()
    q, each = equations.split(found.x)
    values = problem.at(problem.t, q, problem.nothing)
    push = each[0][problem.C :] * scales.contacts / scales.force * scales.length
    closed = np.flatnonzero(push > values.g / scales.contacts)
    return q, tuple(closed.tolist())
