"""Ways to zeros that Newton's steps from afar do not find: downhill, along paths, and without the zeros that are known.

Newton's homotopy has the real paths F(x) = s F(x_0), which begin at a start with s = 1. A path is followed past s = 0:
it turns, comes back, and goes through further zeros, which nothing else may lead to (Keller, *Global homotopies and
Newton methods*, 1978; Allgower and Georg, *Numerical Continuation Methods*, 1990).

Deflation takes known zeros out of the equations (Farrell, Birkisson and Funke, SIAM J. Sci. Comput. 37 (2015) A2026):
the residual is multiplied by prod (1 + 1/d_i^2), d_i the distance of q to a known point: it is zero there no more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.linear import decompositions, rank
from lagcli.statics import refine, rest_equations
from lagcli.statics.refine import Residual
from lagcli.statics.rest_equations import LENGTHS, RestEquations, Scales
from lagcli.statics.static_problem import StaticProblem

# What a point of a path may be off it.
OFF = 100 * doubles.ZERO


def onto(problem: StaticProblem, q: Floats, closed: Sequence[int], scales: Scales) -> Floats | None:
    """The configuration near q that satisfies the conditions; None where none is met."""
    contacts = list(closed)
    if not problem.laws.c.numel() and not contacts:
        return q
    units = np.concatenate([scales.conditions, scales.contacts[contacts]])

    def conditions(q: Floats) -> tuple[Floats, Floats] | None:
        """The residual of the conditions alone, and of closed contacts, and its gradient."""
        each = [problem.at(t, q, problem.nothing) for t in problem.times]
        r = np.concatenate([np.concatenate([at.c, at.g[contacts]]) / units for at in each])
        J = np.vstack([np.vstack([at.dc, at.G[contacts]]) / units[:, None] for at in each])
        return (r, J) if np.isfinite(r).all() and np.isfinite(J).all() else None

    end = refine.solve(conditions, q)
    return end.x if end is not None and end.distance <= 10 * doubles.ZERO * scales.length else None


def lowest(equations: RestEquations, q: Floats, sign: float) -> Floats | None:
    """A configuration near the bottom (sign 1) or the top (-1) that lies downhill or uphill of q; None where the
    surface is not met."""
    problem, scales, closed = equations.problem, equations.scales, equations.contacts
    point = onto(problem, q, closed, scales)
    if point is None:
        return None
    height = sign * problem.value(point)
    for _ in range(80):
        step, slope = _downhill(equations, point, sign)
        if float(np.abs(point).max(initial=0.0)) > rest_equations.FAR * scales.length:
            return None
        if step is None or slope <= rest_equations.SETTLED * scales.force * scales.length:
            break
        length = float(np.linalg.norm(step))
        part = min(1.0, 0.5 * scales.length / length) if length else 1.0
        for _ in range(12):
            there = onto(problem, point + part * step, closed, scales)
            lower = np.inf if there is None else sign * problem.value(there)
            # By a part of its slope (Armijo)
            if there is not None and lower < height - 100 * doubles.ROOT * part * slope:
                point, height = there, lower
                break
            part /= 2
        else:
            break
    return point


def _downhill(equations: RestEquations, q: Floats, sign: float) -> tuple[Floats | None, float]:
    """Newton's step along the surface with all curvatures taken as positive, and the fall it promises."""
    problem, length = equations.problem, equations.scales.length
    each = equations.multipliers(q)
    if each is None:
        return None, 0.0
    values = problem.at(problem.t, q, equations.all_multipliers(each[0]))
    if not values.finite:
        return None, 0.0
    Z = rank.null_basis(decompositions.unit(values.rows(equations.contacts)))
    if not Z.shape[1]:
        return None, 0.0
    H = -sign * Z.T @ values.K @ Z
    curvatures, axes = np.linalg.eigh((H + H.T) / 2)
    least = rest_equations.FLAT * max(np.abs(curvatures).max(), equations.scales.force / length)
    downhill = axes.T @ (sign * Z.T @ values.F)
    # One axis that is nearly flat must not shorten the step along all others.
    longest = 0.5 * length
    along = np.clip(downhill / np.maximum(np.abs(curvatures), least), -longest, longest)
    return Z @ (axes @ along), float(downhill @ along)


def near_zeros(equations: RestEquations, x: Floats) -> Iterator[Floats]:
    """Points next to zeros of the equations, on both ways of the path through x.

    None where the equations are not as many as the unknowns, or x is a zero itself.
    """
    found = equations(x)
    if found is None or found[1].shape[0] != found[1].shape[1] or np.linalg.norm(found[0]) <= OFF:
        return
    first, J = found
    widths = np.linalg.norm(J, axis=0)
    units = np.where(widths > 0, 1 / np.where(widths > 0, widths, 1.0), 1.0)
    units[: equations.problem.n] = equations.scales.length

    def path(z: Floats) -> tuple[Floats, Floats] | None:
        """F(x) - s F(x_0) with its gradient at z = (x / units, s)."""
        found = equations(z[:-1] * units)
        if found is None:
            return None
        F, J = found
        return F - z[-1] * first, np.column_stack([J * units, -first])

    for sense in (1.0, -1.0):
        for z in _crossings(path, np.append(x / units, 1.0), sense):
            yield z[:-1] * units


def _crossings(path: Residual, z: Floats, sense: float) -> Iterator[Floats]:
    """The points z = (.., s) at which s changes its sign on one way of a path: a step along the tangent, then the
    shortest Newton steps back onto it."""
    begun = path(z)
    if begun is None:
        return
    along, length = sense * decompositions.axes(begun[1])[1][-1], LENGTHS.stride / 6
    for _ in range(160):
        there, values = z + length * along, path(z + length * along)
        for _ in range(4):
            if values is None or np.linalg.norm(values[0]) <= OFF:
                break
            there = there - decompositions.least_squares(values[1], values[0])
            values = path(there)
        is_met = values is not None and np.linalg.norm(values[0]) <= OFF
        turned = decompositions.axes(values[1])[1][-1] if values is not None and is_met else 0 * along
        # A step that turns by more than an eighth of a turn may have come onto another path.
        if turned @ along < 0:
            turned = -turned
        if turned @ along < np.cos(np.pi / 4):
            length /= 3
            if length < rest_equations.SETTLED:
                return
            continue
        if (z[-1] > 0) != (there[-1] > 0):
            yield z + z[-1] / (z[-1] - there[-1]) * (there - z)
        z, along, length = there, turned, min(1.6 * length, LENGTHS.stride)
        if np.abs(z).max() > 100 * LENGTHS.stride:
            return


def deflated(equations: RestEquations, known: Sequence[Floats], angles: Sequence[bool]) -> Residual:
    """The residual of some equations without the zeros at known configurations, the latest of them; angles count by
    their sines."""
    n, size, are_angles = equations.problem.n, equations.scales.length, np.array(angles, dtype=bool)

    def residual(x: Floats) -> tuple[Floats, Floats] | None:
        found = equations(x)
        if found is None:
            return None
        r, J = found
        factor, slope = 1.0, np.zeros(x.size)
        for q in known[-60:]:  # each costs a gradient at every step
            way = (x[:n] - q) / size
            along = way / size
            half = (x[:n] - q)[are_angles] / 2
            way[are_angles], along[are_angles] = 2 * np.sin(half), np.sin(2 * half)
            square = max(float(way @ way), (10 * doubles.ZERO) ** 2)
            factor *= 1 + 1 / square
            slope[:n] += -2 * along / square**2 / (1 + 1 / square)
        return (factor * r, factor * (J + np.outer(r, slope))) if np.isfinite(factor) else None

    return residual
