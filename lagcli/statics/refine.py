"""Ways to points of rest: damped least-squares steps from a start, then Newton's down to rounding; and others.

The damped steps (Levenberg, Marquardt) go downhill from anywhere; near a zero Newton's shortest step is taken, which
serves where rows are redundant (multipliers are not unique) and where zeros form a continuum.

Newton's homotopy has the real paths F(x) = s F(x_0), which begin at a start with s = 1. A path is followed past s = 0:
it turns, comes back, and goes through further zeros, which nothing else may lead to (Keller, *Global homotopies and
Newton methods*, 1978; Allgower and Georg, *Numerical Continuation Methods*, 1990).

Deflation takes known zeros out of the equations (Farrell, Birkisson and Funke, SIAM J. Sci. Comput. 37 (2015) A2026):
the residual is multiplied by prod (1 + 1/d_i^2), d_i the distance of q to a known point: it is zero there no more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.linear import decompositions, rank, surface
from lagcli.linear.surface import NewtonEnd
from lagcli.start import configuration_search
from lagcli.statics import rest_equations, static_problem
from lagcli.statics.rest_equations import LENGTHS, EquilibriumPoint, RestEquations
from lagcli.statics.static_problem import StaticProblem

Residual = Callable[[Floats], tuple[Floats, Floats] | None]
OFFSETS = configuration_search.PARAMETERS.offsets
# What a point of a path may be off it.
OFF = 100 * doubles.ZERO


def solve(residual: Residual, x: Floats, damped: int = 200) -> NewtonEnd | None:
    """The zero that so many damped steps lead to, refined, or the least residual met; None without a value at x."""
    begun = residual(x)
    if begun is None:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        # Newton's steps double the digits from there.
        x, r, J = lowered(residual, x, begun, damped, doubles.ROOT)
        end, left = refined(residual, x), np.linalg.norm(r)
        # A double zero is as far as the root of the residual: what seems farther is so by rounding alone.
        if 2 * end.distance > left and end.moved**2 > doubles.ROOT >= left:
            # Beside a continuum gradients are dependent but for the distance, and the shortest step goes far along it.
            x, r, _ = lowered(residual, x, (r, J), damped, 0.0)
            again = refined(residual, x)
            end = min(end, again, key=lambda each: each.distance)
        return end


def lowered(
    residual: Residual, x: Floats, begun: tuple[Floats, Floats], damped: int, near: float
) -> tuple[Floats, Floats, Floats]:
    """The point that damped steps lead to, as far as a residual is near, with this and its gradient."""
    r, J = begun
    damping, growth = 1e-3, 2.0
    widths = np.zeros(x.size)
    for _ in range(damped):
        size = float(np.linalg.norm(r))
        if size <= near:
            break
        widths = np.maximum(widths, np.linalg.norm(J, axis=0))
        unit = np.where(widths > 0, widths, 1.0)
        slope = J.T @ r
        if np.abs(slope / unit).max(initial=0.0) < doubles.SUM * size:
            break  # the bottom of a valley
        # The step that is shortest in the scaled norm for its gain; with some damping the normal equations have one.
        scaled, least = J / unit, max(damping, doubles.VALUE)
        if unit.size <= static_problem.DENSE:
            normal = scaled.T @ scaled
            normal[np.diag_indices_from(normal)] += least
            step = -np.linalg.solve(normal, slope / unit) / unit
        else:  # most entries of J are zero in a large model
            from scipy import sparse
            from scipy.sparse import linalg

            columns = sparse.csc_array(scaled)
            few = sparse.csc_matrix(columns.T @ columns + least * sparse.eye(unit.size))
            step = -linalg.splu(few).solve(slope / unit) / unit
        there = residual(x + step)
        expected = size**2 - float(np.linalg.norm(r + J @ step)) ** 2
        gained = size**2 - (np.inf if there is None else float(np.linalg.norm(there[0])) ** 2)
        if there is not None and gained > 0 and gained > 1e-4 * expected:
            x, (r, J) = x + step, there
            agreement = min(1.0, gained / max(expected, doubles.TINY))
            damping *= max(1 / 9, 1 - (2 * agreement - 1) ** 3)
            growth = 2.0
        else:
            damping, growth = damping * growth, growth * 2
            if damping > 1e30:
                break
    return x, r, J


def refined(residual: Residual, x: Floats) -> NewtonEnd:
    """The end of Newton's steps from x as long as they lead downhill."""

    def at(x: Floats) -> _Linear | None:
        found = residual(x)
        return None if found is None else _Linear(*found)

    end = surface.approach(at, x, may_rise=False)
    assert end is not None
    return end


class _Linear:
    """A residual r (k,) with its gradient J (k, n) at a point."""

    def __init__(self, r: Floats, J: Floats) -> None:
        self._r, self._J = r, J
        self.distance = float(np.linalg.norm(r))
        self.is_there = self.distance == 0.0

    def step(self) -> Floats:
        """The shortest step (n,)."""
        return decompositions.least_squares(self._J, -self._r)


def nearest_equilibrium(
    problem: StaticProblem, begin: Floats, asides: Sequence[float] = OFFSETS
) -> EquilibriumPoint:
    """The point of rest reached from a configuration, or from beside it; 0 <= lambda, 0 <= g, one of them zero."""
    free = RestEquations(problem, (), rest_equations.scales(problem, begin))
    random = np.random.default_rng(20061)
    tried: list[EquilibriumPoint] = []
    for part in (0.0, *asides):
        point = begin + part * free.scales.length * random.standard_normal(begin.size)
        found = pushed(free, point) if problem.K else reached(free, point)
        if found.rests:
            return found
        tried.append(found)
    return min(tried, key=lambda one: one.residual)


def reached(equations: RestEquations, begin: Floats) -> EquilibriumPoint:
    """The point that a configuration leads to, whatever the signs of lambda and g."""
    x = equations.begun(begin)
    found = None if x is None else solve(equations, x)
    if found is None:
        return EquilibriumPoint(begin, equations.problem.nothing, (), np.inf, rests=False)
    return equations.settled(found.x, found.moved)


def pushed(free: RestEquations, begin: Floats) -> EquilibriumPoint:
    """The point that a configuration leads to with contacts that push; `free`: the equations without contacts."""
    problem, scales = free.problem, free.scales
    near = np.flatnonzero(problem.at(problem.t, begin, problem.nothing).g <= scales.touch)
    guesses = [(begin, tuple(near.tolist())), (begin, ())]
    # First the end of a search with all contacts, and those that are closed there
    equations = free.closing(None)
    x = equations.begun(begin)
    end = None if x is None else solve(equations, x)
    if end is not None:
        q, each = equations.split(end.x)
        g = problem.at(problem.t, q, problem.nothing).g
        push = each[0][problem.C :] * scales.contacts / scales.force * scales.length
        guesses.insert(0, (q, tuple(np.flatnonzero(push > g / scales.contacts).tolist())))
    best = EquilibriumPoint(begin, problem.nothing, (), np.inf, rests=False)
    for point, closed in guesses:
        tried: set[tuple[int, ...]] = set()
        while closed not in tried and len(tried) < 12:
            tried.add(closed)
            found = reached(free.closing(closed), point)
            if not found.rests:
                best = found if found.residual < best.residual else best
                break
            pulling, below = free.wrong_side(found)
            if not pulling and not below:
                return found
            point, closed = found.q, tuple(sorted((set(closed) - pulling) | below))
    return best


# Downhill, along paths, and without the zeros that are known


def onto(equations: RestEquations, q: Floats) -> Floats | None:
    """The configuration near q that satisfies the conditions and is on closed contacts; None where none is met."""
    problem, scales, contacts = equations.problem, equations.scales, equations.contacts
    if not problem.laws.c.numel() and not contacts:
        return q
    units = np.concatenate([scales.conditions, scales.contacts[contacts]])

    def conditions(q: Floats) -> tuple[Floats, Floats] | None:
        each = [problem.at(t, q, problem.nothing) for t in problem.times]
        r = np.concatenate([np.concatenate([at.c, at.g[contacts]]) / units for at in each])
        J = np.vstack([np.vstack([at.dc, at.G[contacts]]) / units[:, None] for at in each])
        return (r, J) if np.isfinite(r).all() and np.isfinite(J).all() else None

    end = solve(conditions, q)
    return end.x if end is not None and end.distance <= 10 * doubles.ZERO * scales.length else None


def lowest(equations: RestEquations, q: Floats, sign: float) -> Floats | None:
    """A configuration near the bottom (sign 1) or top (-1) downhill or uphill of q; None off the surface."""
    problem, scales = equations.problem, equations.scales
    point = onto(equations, q)
    if point is None:
        return None
    height = sign * problem.value(point)
    for _ in range(80):
        # Newton's step along the surface with all curvatures taken as positive, and the fall it promises
        each = equations.multipliers(point)
        values = None if each is None else problem.at(problem.t, point, equations.all_multipliers(each[0]))
        if float(np.abs(point).max(initial=0.0)) > rest_equations.FAR * scales.length:
            return None
        if values is None or not values.finite:
            break
        Z = rank.null_basis(decompositions.unit(values.rows(equations.contacts)))
        if not Z.shape[1]:
            break
        H = -sign * Z.T @ values.K @ Z
        curvatures, axes = np.linalg.eigh((H + H.T) / 2)
        least = rest_equations.FLAT * max(np.abs(curvatures).max(), scales.force / scales.length)
        downhill = axes.T @ (sign * Z.T @ values.F)
        # One axis that is nearly flat must not shorten the step along all others.
        longest = 0.5 * scales.length
        along = np.clip(downhill / np.maximum(np.abs(curvatures), least), -longest, longest)
        step, slope = Z @ (axes @ along), float(downhill @ along)
        if slope <= rest_equations.SETTLED * scales.force * scales.length:
            break
        length = float(np.linalg.norm(step))
        part = min(1.0, longest / length) if length else 1.0
        for _ in range(12):
            there = onto(equations, point + part * step)
            lower = np.inf if there is None else sign * problem.value(there)
            # By a part of its slope (Armijo)
            if there is not None and lower < height - 100 * doubles.ROOT * part * slope:
                point, height = there, lower
                break
            part /= 2
        else:
            break
    return point


def near_zeros(equations: RestEquations, x: Floats) -> Iterator[Floats]:
    """Points next to zeros on both ways of the path through x; none of equations that are not as many as x, or at 0."""
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

    # On each way a step along the tangent, then the shortest Newton steps back; s changes its sign next to a zero.
    for sense in (1.0, -1.0):
        z = np.append(x / units, 1.0)
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
                    break
                continue
            if (z[-1] > 0) != (there[-1] > 0):
                yield (z + z[-1] / (z[-1] - there[-1]) * (there - z))[:-1] * units
            z, along, length = there, turned, min(1.6 * length, LENGTHS.stride)
            if np.abs(z).max() > 100 * LENGTHS.stride:
                break


def deflated(equations: RestEquations, known: Sequence[Floats], angles: Sequence[bool]) -> Residual:
    """The equations without the zeros at known configurations, the latest of them; angles count by their sines."""
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
