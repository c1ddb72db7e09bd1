"""Points that were found, and whether two of them lie on one continuum."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.statics import continuum, point_type, refine
from lagcli.statics.point_type import PointType
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import RestEquations, Scales
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class FoundPoint:
    """A point with its type, the dimension of the continuum it stands for, and the contacts that touch there, those
    that carry nothing included."""

    point: EquilibriumPoint
    type: PointType
    dimension: int
    touching: tuple[int, ...]


class KnownContinua:
    """The question whether points of one search are connected; angles: which coordinates are angles."""

    def __init__(self, problem: StaticProblem, scales: Scales, angles: tuple[bool, ...]) -> None:
        self._problem, self._scales = problem, scales
        self._angles = np.array(angles, dtype=bool)

    def are_one(self, known: FoundPoint, found: FoundPoint) -> bool:
        """True if a walk along a continuum leads from one of two points of it to the other."""
        if known.dimension != found.dimension or known.point.closed != found.point.closed:
            return False
        return not self.differ(known.point, found.point) and (
            self._is_connected(found, known) or self._is_connected(known, found)
        )

    def is_on(self, larger: FoundPoint, smaller: FoundPoint) -> bool:
        """True if a point alone, or one of a smaller continuum, lies on a larger one, of which it is an edge where more
        contacts are closed."""
        if larger.dimension <= smaller.dimension or not set(larger.point.closed) <= set(smaller.touching):
            return False
        if smaller.type.is_regular and larger.point.closed == smaller.point.closed:
            return False  # near a regular point there is no other
        return not self.differ(larger.point, smaller.point) and self._is_connected(larger, smaller)

    def differ(self, a: EquilibriumPoint, b: EquilibriumPoint) -> bool:
        """True if two points lie on no one continuum by the values there: it is level where rows hold places."""
        problem = self._problem
        if not problem.laws.driving.is_zero() or not point_type.is_holonomic(problem, a):
            return False
        one, other = problem.value(a.q), problem.value(b.q)
        size = max(self._scales.force * self._scales.length, abs(one), abs(other))
        return abs(one - other) > doubles.ROOT * size

    def _is_connected(self, begin: FoundPoint, end: FoundPoint) -> bool:
        """True if a walk from a point of a continuum comes to another point, with the least turns of angles."""
        equations = RestEquations(self._problem, begin.point.closed, self._scales)
        goal = np.array(end.point.q)
        goal[self._angles] += 2 * np.pi * np.round((begin.point.q - goal)[self._angles] / (2 * np.pi))
        return continuum.connected(equations, unknowns(equations, begin.point), goal, begin.dimension)


def unknowns(equations: RestEquations, point: EquilibriumPoint) -> Floats:
    """q and the multipliers that balance best there, as one vector."""
    begun = refine.begun(equations, point.q)
    assert begun is not None
    return begun
