"""Continua of points of rest: their dimension at a point, and whether two points lie on one.

At an edge of one contacts touch and carry nothing: a table whose weight stands over one leg rests on it at any tilt.
Where a second leg touches too its multiplier is zero, and if it counts as closed the sides that it leaves say.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.contact import complementarity
from lagcli.linear import decompositions, rank
from lagcli.statics import point_type, precise_zeros, refine, rest_equations
from lagcli.statics.point_type import PointType
from lagcli.statics.rest_equations import LENGTHS, EquilibriumPoint, RestEquations


@dataclasses.dataclass(frozen=True, slots=True)
class FoundPoint:
    """A point with its type, the dimension of the continuum it stands for, and all contacts that touch there."""

    point: EquilibriumPoint
    type: PointType
    dimension: int
    touching: tuple[int, ...]


class KnownContinua:
    """Whether points of one search are connected; free: its equations without contacts."""

    def __init__(self, free: RestEquations, angles: tuple[bool, ...]) -> None:
        self._free, self._angles = free, np.array(angles, dtype=bool)

    def are_one(self, known: FoundPoint, found: FoundPoint) -> bool:
        """True if a walk along a continuum leads from one of two points of it to the other."""
        if known.dimension != found.dimension or known.point.closed != found.point.closed:
            return False
        return not self.differ(known.point, found.point) and (
            self._is_connected(found, known) or self._is_connected(known, found)
        )

    def is_on(self, larger: FoundPoint, smaller: FoundPoint) -> bool:
        """True if a point lies on a larger continuum; at an edge of it more contacts are closed."""
        if larger.dimension <= smaller.dimension or not set(larger.point.closed) <= set(smaller.touching):
            return False
        if smaller.type.is_regular and larger.point.closed == smaller.point.closed:
            return False  # near a regular point there is no other
        return not self.differ(larger.point, smaller.point) and self._is_connected(larger, smaller)

    def differ(self, a: EquilibriumPoint, b: EquilibriumPoint) -> bool:
        """True if two points lie on no one continuum by the values there: it is level where rows hold places."""
        problem, scales = self._free.problem, self._free.scales
        if not problem.laws.driving.is_zero() or not point_type.is_holonomic(self._free, a):
            return False
        one, other = problem.value(a.q), problem.value(b.q)
        return abs(one - other) > doubles.ROOT * max(scales.force * scales.length, abs(one), abs(other))

    def _is_connected(self, begin: FoundPoint, end: FoundPoint) -> bool:
        """True if a walk from a point of a continuum comes to another point, with the least turns of angles."""
        equations, goal = self._free.closing(begin.point.closed), np.array(end.point.q)
        goal[self._angles] += 2 * np.pi * np.round((begin.point.q - goal)[self._angles] / (2 * np.pi))
        return connected(equations, equations.unknowns(begin.point.q), goal, begin.dimension)


def directions(equations: RestEquations, x: Floats) -> Floats:
    """An orthonormal basis (n, d) of the changes of q that keep all equations to first order."""
    found = equations(x)
    n = equations.problem.n
    if found is None:
        return np.zeros((n, 0))
    J = found[1]
    widths = np.linalg.norm(J, axis=0)
    widths[:n] = widths[:n].max(initial=0.0)
    widths = np.where(widths > 0, widths, 1.0)
    flat = rank.null_basis(J / widths).T / widths
    return rank.row_basis(flat[:, :n] * widths[0]).T


def tangent(equations: RestEquations, x: Floats) -> Floats:
    """An orthonormal basis (n, d) of the directions of the continuum through a point: steps along them end at other
    points of rest, at which there are as many. d = 0 for a point alone."""
    basis = directions(equations, x)
    n, length = equations.problem.n, LENGTHS.near * equations.scales.length
    least, moved = basis.shape[1], []
    for direction in basis.T:
        ends = _ends(equations, x, direction, length)
        if not ends or not LENGTHS.stride * length < np.linalg.norm(ends[0][:n] - x[:n]):
            continue
        # Across a continuum curvatures may vanish too, and a step on a slant comes back onto it.
        moved.append((ends[0] - ends[1])[:n] / 2 if len(ends) == 2 else ends[0][:n] - x[:n])
        least = min(least, directions(equations, ends[0]).shape[1])
    if not moved:
        return np.zeros((n, 0))
    sizes, left = decompositions.column_axes(basis.T @ np.array(moved).T / length)
    return np.asarray(basis @ left[:, : min(least, int((sizes > LENGTHS.stride).sum()))])


def beside_crossing(equations: RestEquations, x: Floats) -> Floats:
    """A point of the continuum through x with fewer flat directions, where branches of it cross at x; else x."""
    basis, length = directions(equations, x), LENGTHS.walk * equations.scales.length
    others = [x, *(end for way in basis.T for end in _ends(equations, x, way, length))]
    return min(others, key=lambda each: directions(equations, each).shape[1])


def _ends(equations: RestEquations, x: Floats, way: Floats, length: float) -> list[Floats]:
    """The points of rest at a length both ways along a direction: zeros in many digits too, where these are known."""
    found, n = [], equations.problem.n
    for sign in (1, -1):
        end = stepped(equations, x, sign * length * way, 1.0)
        if end is not None:
            zero = precise_zeros.nearest(equations, end)
            if zero is None or np.linalg.norm((zero - end)[:n]) <= LENGTHS.stride * length:
                found.append(end)
    return found


def stepped(equations: RestEquations, x: Floats, step: Floats, off: float = LENGTHS.stride) -> Floats | None:
    """The point of rest next to x a step of q away; None where there is none within a part of the step."""
    n = equations.problem.n
    predicted = x[:n] + step
    begun = equations.begun(predicted)
    if begun is None or equations(begun) is None:
        return None
    end = refine.refined(equations, begun)
    near = np.linalg.norm(end.x[:n] - predicted) <= off * np.linalg.norm(step)
    settled = end.moved <= rest_equations.SETTLED and equations.unbalanced(end.x) <= doubles.ZERO
    return end.x if near and settled else None


def connected(equations: RestEquations, x: Floats, goal: Floats, size: int) -> bool:
    """True if a walk along the continuum through x, of the dimension `size`, comes to the configuration `goal` (n,)."""
    n, unit = equations.problem.n, equations.scales.length
    for _ in range(80):
        way = goal - x[:n]
        left = float(np.linalg.norm(way))
        if left <= doubles.ROOT * unit or is_straight(equations, x, way):
            return True
        # A further point that is nearer to the goal
        basis, there = directions(equations, x), None
        is_crossing = basis.shape[1] > size  # or across it is flat too
        for free in (basis, tangent(equations, x)) if is_crossing else (basis,):
            along = free @ (free.T @ way)
            length = float(np.linalg.norm(along))
            if free.size and length <= doubles.ROOT * left:  # across, as on a ring: either way will do
                along, length = free[:, 0], 1.0
            # Where the way is nearly across, what lies along is short and the continuum goes on, or it leads to a
            # crossing.
            far = min(left, LENGTHS.walk * unit) / length if length > 0.0 else 0.0
            for part in (far, 0.3 * far, 0.1 * far, 1.0) if far else ():
                end = stepped(equations, x, part * along, 1.0 if is_crossing else LENGTHS.stride)
                if end is not None and np.linalg.norm(goal - end[:n]) < left * (1 - 1e-8):
                    there = end
                    break
            if there is not None:
                break
        if there is None:
            return False
        x = there
    return False


def is_straight(equations: RestEquations, x: Floats, way: Floats) -> bool:
    """True if the continuum is flat along a way (n,) from x: all that was looked at on it rests."""
    n, least = equations.problem.n, doubles.ROOT * equations.scales.length
    basis = directions(equations, x)
    if np.linalg.norm(way - basis @ (basis.T @ way)) > least:
        return False
    for part in decompositions.generic_parts(8):
        end = stepped(equations, x, part * way)
        if end is None or np.linalg.norm(end[:n] - x[:n] - part * way) > least:
            return False
    return True


def with_own_contacts(equations: RestEquations, found: EquilibriumPoint) -> EquilibriumPoint:
    """A point where only contacts are closed that carry a force or leave no side free, if a continuum is there."""
    problem, carrying = equations.problem, point_type.carrying(equations, found)
    idle = [k for k in equations.touching(found) if k not in carrying]
    free = equations.closing(carrying)
    x = free.begun(found.q) if idle else None
    if x is None:
        return found
    basis = directions(free, x)
    G = decompositions.unit(problem.at(problem.t, found.q, found.lam).G[idle]) @ basis
    if not basis.shape[1] or not np.isfinite(G).all():
        return found
    # A contact is closed where G u >= 0 of all leaves it at 0: then its opposite is a sum of rows with weights that are
    # not negative (Farkas). Where one direction leaves all of them none is.
    sizes, nothing = np.linalg.norm(G, axis=1), rank.PARAMETERS.small
    rows, closed_too = G / np.where(sizes > nothing, sizes, 1.0)[:, None], []
    if not (rows @ rows.sum(axis=0) > nothing).all():
        for k, row in zip(idle, rows, strict=True):
            left = complementarity.residual(rows.T, -row)
            if left is not None and float(np.linalg.norm(left)) <= nothing:
                closed_too.append(k)
    closed = tuple(sorted((*carrying, *closed_too)))
    if closed == found.closed:
        return found
    bounded, own = equations.closing(closed), equations.closing(found.closed)
    begun = bounded.begun(found.q)
    if begun is None or not (point := bounded.settled(begun)).rests:
        return found
    if tangent(bounded, begun).size:
        return point
    unknowns = own.begun(found.q)
    return point if unknowns is not None and tangent(own, unknowns).size else found
