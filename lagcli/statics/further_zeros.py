"""Ways to zeros that Newton's steps from afar do not find: downhill, along paths, and without the zeros that are known.

Newton's homotopy has the real paths F(x) = s F(x_0), which begin at a start with s = 1. A path is followed past s = 0:
it turns, comes back, and goes through further zeros, which nothing else may lead to (Keller, *Global homotopies and
Newton methods*, 1978; Allgower and Georg, *Numerical Continuation Methods*, 1990). Predictor and corrector: a step
along the tangent, then the shortest Newton steps back onto the path.

Deflation takes known zeros out of the equations (Farrell, Birkisson and Funke, SIAM J. Sci. Comput. 37 (2015) A2026):
the residual is multiplied by prod (1 + 1/d_i^2), d_i the distance of q to a known point: it is zero there no more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lagcli.linear import decompositions, rank
from lagcli.statics import refine
from lagcli.statics.rest_equations import RestEquations, Scales
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]


class DescentParameters:
    """Numbers of the way downhill. The tests are of `tests/unit/test_numbers_of_rest_searches.py`."""

    __slots__ = ()

    most_steps: int = 80
    """Steps of one way: Newton's steps go on from wherever it ends. `test_a_way_downhill_has_eighty_steps`
    fails at 8 and 800."""
    halvings: int = 12
    """Halvings of one step until it goes down: it is then 1/4096 of the size of things.
    `test_a_step_that_does_not_go_down_is_halved_twelve_times` fails at 1 and 120."""
    stride: float = 0.5
    """The longest step, as a part of the size of things: farther off the curvatures say nothing.
    `test_a_step_downhill_is_half_of_the_size_of_things` fails at 0.05 and 5."""
    level: float = 1e-5
    """A slope of this part of the forces is the bottom, for Newton's steps to go on.
    `test_where_forces_are_balanced_to_five_digits_is_the_bottom` fails at 1e-6 and 0.0001."""
    enough: float = 1e-4
    """The part of the slope by which a step must go down (Armijo).
    `test_a_step_goes_down_by_a_part_of_its_slope` fails at 1e-5 and 0.001."""
    flat: float = 1e-7
    """The part of the largest curvature below which one is taken for more: a chain of n links has some of 1/n^2.
    `test_a_curvature_seven_digits_smaller_is_taken_for_more` fails at 1e-8 and 1e-6."""
    far: float = 1e3
    """Sizes of things: what goes down farther goes down for ever.
    `test_what_goes_down_a_thousand_sizes_goes_down_for_ever` fails at 100 and 10000."""


class FurtherZerosParameters:
    """Lengths are parts of the size of things. The tests are of `tests/unit/test_numbers_of_rest_searches.py`."""

    __slots__ = ()

    most_steps: int = 160
    """Steps of one way along a path. `test_a_path_has_a_hundred_and_sixty_steps` fails at 16 and 1600."""
    corrections: int = 4
    """Corrections of one step: more of them mean that it was too long. `test_a_step_is_corrected_four_times`
    fails at 0 and 40."""
    first: float = 0.05
    """The length of the first step. `test_a_path_that_asks_for_steps_of_a_hundred_thousandth_is_given_up`
    fails at 0.005 and 0.5."""
    longest: float = 0.3
    """The length of the longest step. `test_steps_along_a_path_grow_up_to_a_third` fails at 0.03 and 3."""
    shortest: float = 1e-5
    """A path that asks for shorter steps is given up.
    `test_a_path_that_asks_for_steps_of_a_hundred_thousandth_is_given_up` fails at 1e-6 and 0.0001."""
    off: float = 1e-7
    """What a corrected point may be off its path. `test_a_start_that_is_a_zero_has_no_path` fails at 1e-8 and
    1e-6."""
    far: float = 30.0
    """How far a path is followed. `test_a_path_is_followed_for_thirty_sizes` fails at 3 and 300."""
    bent: float = 0.7
    """Of two tangents the least cosine: a step that bends more may have come onto another path.
    `test_a_step_that_bends_much_is_made_shorter` fails at 0.07 and 7."""
    least: float = 1e-8
    """Distances below this are not divided by. `test_a_known_zero_is_not_divided_by_closer_than_eight_digits`
    fails at 1e-9 and 1e-7."""
    most_known: int = 60
    """Points that are taken out, the latest: each costs a gradient at every step.
    `test_the_latest_sixty_known_points_are_taken_out` fails at 6 and 600."""


DESCENT, PARAMETERS = DescentParameters(), FurtherZerosParameters()


def onto(problem: StaticProblem, q: Floats, closed: tuple[int, ...], scales: Scales) -> Floats | None:
    """The configuration near q that satisfies the conditions; None where none is met."""
    if not problem.laws.c.numel() and not closed:
        return q
    contacts = list(closed)

    def conditions(q: Floats) -> tuple[Floats, Floats] | None:
        """The residual of the conditions alone, and of closed contacts, and its gradient."""
        residuals, gradients = [], []
        for t in problem.times:
            values = problem.at(t, q, problem.nothing)
            units = np.concatenate([scales.conditions, scales.contacts[contacts]])
            residuals.append(np.concatenate([values.c, values.g[contacts]]) / units)
            gradients.append(np.vstack([values.dc, values.G[contacts]]) / units[:, None])
        r, J = np.concatenate(residuals), np.vstack(gradients)
        return (r, J) if np.isfinite(r).all() and np.isfinite(J).all() else None

    end = refine.solve(conditions, q)
    return end.x if end is not None and end.residual <= 1e-8 * scales.length else None


def lowest(equations: RestEquations, q: Floats, sign: float) -> Floats | None:
    """A configuration near the bottom (sign 1) or the top (-1) that lies downhill or uphill of q; None where the
    surface is not met."""
    problem, scales, closed = equations.problem, equations.scales, tuple(equations.acting)
    point = onto(problem, q, closed, scales)
    if point is None:
        return None
    height = sign * problem.value(point)
    for _ in range(DESCENT.most_steps):
        step, slope = _downhill(equations, point, sign)
        if float(np.abs(point).max(initial=0.0)) > DESCENT.far * scales.length:
            return None
        if step is None or slope <= DESCENT.level * scales.force * scales.length:
            break
        length = float(np.linalg.norm(step))
        part = min(1.0, DESCENT.stride * scales.length / length) if length else 1.0
        for _ in range(DESCENT.halvings):
            there = onto(problem, point + part * step, closed, scales)
            lower = np.inf if there is None else sign * problem.value(there)
            if there is not None and lower < height - DESCENT.enough * part * slope:
                point, height = there, lower
                break
            part /= 2
        else:
            break
    return point


def _downhill(equations: RestEquations, q: Floats, sign: float) -> tuple[Floats | None, float]:
    """Newton's step along the surface with all curvatures taken as positive, and the fall it promises."""
    problem = equations.problem
    each = equations.multipliers(q)
    if each is None:
        return None, 0.0
    values = problem.at(problem.t, q, equations.all_multipliers(each[0]))
    if not values.finite:
        return None, 0.0
    Z = rank.null_basis(decompositions.unit(np.vstack([values.B, values.G[equations.acting]])))
    if not Z.shape[1]:
        return None, 0.0
    H = -sign * Z.T @ values.K @ Z
    curvatures, axes = np.linalg.eigh((H + H.T) / 2)
    length = equations.scales.length
    least = DESCENT.flat * max(np.abs(curvatures).max(), equations.scales.force / length)
    downhill = axes.T @ (sign * Z.T @ values.F)
    # One axis that is nearly flat must not shorten the step along all others.
    longest = DESCENT.stride * length
    along = np.clip(downhill / np.maximum(np.abs(curvatures), least), -longest, longest)
    return Z @ (axes @ along), float(downhill @ along)


def near_zeros(equations: RestEquations, x: Floats) -> Iterator[Floats]:
    """Points next to zeros of the equations, on both ways of the path through x.

    None where the equations are not as many as the unknowns, or x is a zero itself.
    """
    found = equations(x)
    if found is None or found[1].shape[0] != found[1].shape[1]:
        return
    if np.linalg.norm(found[0]) > PARAMETERS.off:
        path = _Path(equations, x, found)
        for sense in (1.0, -1.0):
            yield from path.followed(sense)


class _Path:
    """z = (x / units, s) with F(x) - s F(x_0) = 0."""

    def __init__(self, equations: RestEquations, x: Floats, found: tuple[Floats, Floats]) -> None:
        self._equations = equations
        self._first, J = found
        n = equations.problem.n
        widths = np.linalg.norm(J, axis=0)
        self._units = np.where(widths > 0, 1 / np.where(widths > 0, widths, 1.0), 1.0)
        self._units[:n] = equations.scales.length
        self._begin = np.append(x / self._units, 1.0)

    def followed(self, sense: float) -> Iterator[Floats]:
        """The points x at which s changes its sign along one way."""
        z = self._begin
        along = self._tangent(z)
        if along is None:
            return
        along, length = sense * along, PARAMETERS.first
        for _ in range(PARAMETERS.most_steps):
            there = self._corrected(z + length * along)
            turned = None if there is None else self._tangent(there)
            if there is None or turned is None or abs(turned @ along) < PARAMETERS.bent:
                length /= 3
                if length < PARAMETERS.shortest:
                    return
                continue
            turned *= np.sign(turned @ along)
            if (z[-1] > 0) != (there[-1] > 0):
                part = z[-1] / (z[-1] - there[-1])
                yield (z + part * (there - z))[:-1] * self._units
            z, along, length = there, turned, min(1.6 * length, PARAMETERS.longest)
            if np.abs(z).max() > PARAMETERS.far:
                return

    def _values(self, z: Floats) -> tuple[Floats, Floats] | None:
        found = self._equations(z[:-1] * self._units)
        if found is None:
            return None
        F, J = found
        return F - z[-1] * self._first, np.column_stack([J * self._units, -self._first])

    def _tangent(self, z: Floats) -> Floats | None:
        values = self._values(z)
        return None if values is None else decompositions.axes(values[1])[1][-1]

    def _corrected(self, z: Floats) -> Floats | None:
        for _ in range(PARAMETERS.corrections + 1):
            values = self._values(z)
            if values is None:
                return None
            if np.linalg.norm(values[0]) <= PARAMETERS.off:
                return z
            z = z - decompositions.least_squares(values[1], values[0])
        return None


class DeflatedEquations:
    """The residual of some equations without the zeros at `known` configurations; angles count by their sines."""

    def __init__(self, equations: RestEquations, known: Sequence[Floats], angles: Sequence[bool]) -> None:
        self._equations, self._known = equations, list(known)[-PARAMETERS.most_known :]
        self._angles = np.array(angles, dtype=bool)

    def __call__(self, x: Floats) -> tuple[Floats, Floats] | None:
        """Residual and gradient."""
        found = self._equations(x)
        if found is None:
            return None
        r, J = found
        n, size = self._equations.problem.n, self._equations.scales.length
        factor, slope = 1.0, np.zeros(x.size)
        for q in self._known:
            way = (x[:n] - q) / size
            along = way / size
            half = (x[:n] - q)[self._angles] / 2
            way[self._angles], along[self._angles] = 2 * np.sin(half), np.sin(2 * half)
            square = max(float(way @ way), PARAMETERS.least**2)
            factor *= 1 + 1 / square
            slope[:n] += -2 * along / square**2 / (1 + 1 / square)
        if not np.isfinite(factor):
            return None
        return factor * r, factor * (J + np.outer(r, slope))
