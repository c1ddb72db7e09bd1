"""Downhill on the constraint surface: a way to points of rest that Newton's steps from afar do not find."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.linear import decompositions, rank
from lagcli.statics import newton
from lagcli.statics.rest_equations import RestEquations, Scales
from lagcli.statics.static_problem import StaticProblem, Values

Floats = npt.NDArray[np.float64]


class DescentParameters:
    """Numbers of the way downhill; parts are of no unit.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py`.
    """

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
    """The part of the largest curvature below which one is not taken for more. A chain of n links has
    curvatures down to about 1/n^2 of the largest: with more it would go down in hundreds of steps.
    `test_a_curvature_seven_digits_smaller_is_taken_for_more` fails at 1e-8 and 1e-6."""
    far: float = 1e3
    """Sizes of things: what goes down farther goes down for ever.
    `test_what_goes_down_a_thousand_sizes_goes_down_for_ever` fails at 100 and 10000."""


PARAMETERS = DescentParameters()


class SurfaceConditions:
    """The conditions alone, and closed contacts, as a residual of q."""

    def __init__(self, problem: StaticProblem, closed: tuple[int, ...], scales: Scales) -> None:
        self._problem, self._closed, self._scales = problem, list(closed), scales

    def __call__(self, q: Floats) -> tuple[Floats, Floats] | None:
        """Residual and gradient."""
        residuals, gradients = [], []
        for t in self._problem.times:
            values = self._problem.at(t, q, self._problem.nothing)
            g, G = values.g[self._closed], values.G[self._closed]
            r = np.concatenate([values.c / self._scales.conditions, g / self._scales.contacts[self._closed]])
            J = np.vstack(
                [
                    values.dc / self._scales.conditions[:, None],
                    G / self._scales.contacts[self._closed][:, None],
                ]
            )
            residuals.append(r)
            gradients.append(J)
        r, J = np.concatenate(residuals), np.vstack(gradients)
        return (r, J) if np.isfinite(r).all() and np.isfinite(J).all() else None


def onto(problem: StaticProblem, q: Floats, closed: tuple[int, ...], scales: Scales) -> Floats | None:
    """The configuration near q that satisfies the conditions; None where none is met."""
    if not problem.laws.c.numel() and not closed:
        return q
    end = newton.solve(SurfaceConditions(problem, closed, scales), q)
    return end.x if end is not None and end.residual <= 1e-8 * scales.length else None


def lowest(equations: RestEquations, q: Floats, sign: float) -> Floats | None:
    """A configuration near the bottom (sign 1) or the top (-1) that lies downhill or uphill of q; None where the
    surface is not met."""
    problem, scales, closed = equations.problem, equations.scales, tuple(equations.acting)
    point = onto(problem, q, closed, scales)
    if point is None:
        return None
    height = sign * problem.value(point)
    for _ in range(PARAMETERS.most_steps):
        step, slope = _step(equations, point, sign)
        if float(np.abs(point).max(initial=0.0)) > PARAMETERS.far * scales.length:
            return None
        if step is None or slope <= PARAMETERS.level * scales.force * scales.length:
            break
        length = float(np.linalg.norm(step))
        part = min(1.0, PARAMETERS.stride * scales.length / length) if length else 1.0
        for _ in range(PARAMETERS.halvings):
            there = onto(problem, point + part * step, closed, scales)
            lower = np.inf if there is None else sign * problem.value(there)
            if there is not None and lower < height - PARAMETERS.enough * part * slope:
                point, height = there, lower
                break
            part /= 2
        else:
            break
    return point


def _step(equations: RestEquations, q: Floats, sign: float) -> tuple[Floats | None, float]:
    """Newton's step along the surface with all curvatures taken as positive, and the fall it promises."""
    problem = equations.problem
    each = equations.multipliers(q)
    if each is None:
        return None, 0.0
    values: Values = problem.at(problem.t, q, equations.all_multipliers(each[0]))
    if not values.finite:
        return None, 0.0
    rows = np.vstack([values.B, values.G[equations.acting]])
    Z = rank.null_basis(decompositions.unit(rows))
    if not Z.shape[1]:
        return None, 0.0
    H = -sign * Z.T @ values.K @ Z
    curvatures, axes = np.linalg.eigh((H + H.T) / 2)
    length = equations.scales.length
    least = PARAMETERS.flat * max(np.abs(curvatures).max(), equations.scales.force / length)
    downhill = axes.T @ (sign * Z.T @ values.F)
    # One axis that is nearly flat must not shorten the step along all others.
    longest = PARAMETERS.stride * length
    along = np.clip(downhill / np.maximum(np.abs(curvatures), least), -longest, longest)
    step: Floats = Z @ (axes @ along)
    return step, float(downhill @ along)
