"""The contacts that bound a continuum of points of rest: at an edge of it they touch and carry nothing.

A table whose weight stands over one leg rests on that leg at any tilt. Where a second leg touches too, its multiplier
is zero, and whether it counts as closed is for the sides that it leaves to say, not for the sign of that zero.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.contact import least_distance
from lagcli.statics import continuum, newton, point_type, refine
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import RestEquations, Scales
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]

# Lengths of rows, and of what is left of one of length one, that are rounding.
NO_SIDE = 1e-7


def told_with_its_continuum(
    problem: StaticProblem, found: EquilibriumPoint, scales: Scales
) -> EquilibriumPoint:
    """A point with only those contacts closed that carry a force or leave no side of themselves free.

    A point that touches nothing without a force, or through which no continuum goes, is returned as it is.
    """
    near = refine.touching(problem, found, scales)
    carrying = point_type.carrying(problem, found, scales)
    idle = [k for k in near if k not in carrying]
    if not idle:
        return found
    free = RestEquations(problem, carrying, scales)
    x = refine.begun(free, found.q)
    if x is None:
        return found
    basis = continuum.directions(free, x)
    G = point_type.unit(problem.at(problem.t, found.q, found.lam).G[idle]) @ basis
    if not basis.shape[1] or not np.isfinite(G).all():
        return found
    held = [k for k, is_held in zip(idle, _without_side(G), strict=True) if is_held]
    closed = tuple(sorted((*carrying, *held)))
    if closed == found.closed:
        return found
    bounded = RestEquations(problem, closed, scales)
    begun = refine.begun(bounded, found.q)
    point = None if begun is None else refine.settled(bounded, newton.NewtonEnd(begun, 0.0, 0.0))
    if begun is None or not isinstance(point, EquilibriumPoint):
        return found
    own = RestEquations(problem, found.closed, scales)
    unknowns = refine.begun(own, found.q)
    is_one = continuum.dimension(bounded, begun) > 0
    return point if is_one or (unknowns is not None and continuum.dimension(own, unknowns)) else found


def _without_side(G: Floats) -> list[bool]:
    """For each row of G (k, d), whether G u >= 0 of all rows leaves it at 0: then its opposite is a sum of rows with
    weights that are not negative (Farkas)."""
    sizes = np.linalg.norm(G, axis=1)
    rows = G / np.where(sizes > NO_SIDE, sizes, 1.0)[:, None]
    left = (least_distance.residual(rows.T, -row) for row in rows)
    return [rest is not None and float(np.linalg.norm(rest)) <= NO_SIDE for rest in left]
