"""A zero of a residual from a start: damped least-squares steps, then Newton's down to rounding.

The damped steps (Levenberg, Marquardt) go downhill from anywhere; near a zero Newton's shortest step is taken, which
serves where rows are redundant (multipliers are not unique) and where zeros form a continuum.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.linear import decompositions, surface

Floats = npt.NDArray[np.float64]
Residual = Callable[[Floats], tuple[Floats, Floats] | None]


class NewtonParameters:
    """Numbers of a search for a zero; parts are of no unit.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py` and
    `tests/unit/test_numbers_of_statics.py`.
    """

    __slots__ = ()

    most_damped: int = 200
    """Damped steps of one search: from afar some tens are the rule, and a valley that bends takes more.
    `test_two_hundred_damped_steps_are_made_of_a_search` fails at 20 and 2000."""
    least: float = 1e-13
    """The least damping, so that the normal equations have a solution.
    `test_the_least_damping_holds_back_what_is_seven_digits_weaker` fails at 1e-14 and 1e-12."""
    dense: int = 120
    """Of more unknowns the normal equations are solved by sparse algebra, which costs less from here on.
    `test_above_a_hundred_and_twenty_unknowns_algebra_is_sparse` fails at 12 and 1200."""


PARAMETERS = NewtonParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class NewtonEnd:
    """The end of a search: x, the norm of the residual, and the last Newton step, the largest part of an unknown."""

    x: Floats
    residual: float
    step: float


def solve(residual: Residual, x: Floats, damped: int = PARAMETERS.most_damped) -> NewtonEnd | None:
    """The zero that damped steps lead to, refined; or the point with the least residual met. None where the residual
    has no value at the start."""
    begun = residual(x)
    if begun is None:
        return None
    r, J = begun
    with np.errstate(over="ignore", invalid="ignore"):
        # Newton's steps double the digits from there.
        x, r, J = _lowered(residual, x, (r, J), damped, doubles.ROOT)
        end, left = refined(residual, x), np.linalg.norm(r)
        # A double zero is as far as the root of the residual: what seems farther is so by rounding alone.
        if 2 * end.residual > left and end.step**2 > doubles.ROOT >= left:
            # Beside a continuum gradients are dependent but for the distance, and the shortest step goes far along it.
            x, r, _ = _lowered(residual, x, (r, J), damped, 0.0)
            again = refined(residual, x)
            end = min(end, again, key=lambda each: each.residual)
        return end


def _lowered(
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
        step = _damped(J, slope, damping, unit)
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


def _damped(J: Floats, slope: Floats, damping: float, unit: Floats) -> Floats:
    """The step that is shortest in the scaled norm for its gain."""
    if unit.size > PARAMETERS.dense:
        return _damped_sparse(J, slope, damping, unit)
    scaled = J / unit
    normal = scaled.T @ scaled
    normal[np.diag_indices_from(normal)] += max(damping, PARAMETERS.least)
    return np.asarray(-np.linalg.solve(normal, slope / unit) / unit)


def _damped_sparse(J: Floats, slope: Floats, damping: float, unit: Floats) -> Floats:
    """The step where most entries of J are zero, as in a large model."""
    from scipy import sparse
    from scipy.sparse import linalg

    scaled = sparse.csc_array(J / unit)
    normal = sparse.csc_matrix(scaled.T @ scaled + max(damping, PARAMETERS.least) * sparse.eye(unit.size))
    return np.asarray(-linalg.splu(normal).solve(slope / unit) / unit)


def refined(residual: Residual, x: Floats) -> NewtonEnd:
    """The end of Newton's steps from x as long as they lead downhill."""

    def at(x: Floats) -> _Linear | None:
        found = residual(x)
        return None if found is None else _Linear(*found)

    end = surface.approach(at, x, may_rise=False)
    assert end is not None
    return NewtonEnd(end.x, end.distance, end.moved)


class _Linear:
    """A residual r (k,) with its gradient J (k, n) at a point."""

    def __init__(self, r: Floats, J: Floats) -> None:
        self._r, self._J = r, J
        self.distance = float(np.linalg.norm(r))
        self.is_there = self.distance == 0.0

    def step(self) -> Floats:
        """The shortest step (n,)."""
        return decompositions.least_squares(self._J, -self._r)
