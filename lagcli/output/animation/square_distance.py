"""Rows that say how far something is from something: factor (|u|^2 - length^2), u of the first degree in positions.

u = sum_k weight_k r_k + shift, of all three components or of two.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.output.animation.quadratic_form import Quadratic

Floats = npt.NDArray[np.float64]
SAME = 1e-9  # a part of the largest coefficient below which two are the same


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SquareDistance:
    """weights: of particles by number; shift (3,) or (T, 3); length () or (T,); axes: the components that count.

    at_most: of an inequality, the distance may be less; at_least: it may be more; neither of an equation.
    """

    weights: dict[int, float]
    shift: Floats
    length: Floats
    axes: tuple[int, ...]
    at_most: bool = False
    at_least: bool = False


def squared(form: Quadratic, one_sided: bool) -> tuple[Quadratic, int] | None:
    """The polynomial P with P = 0 where the form is, and the sign of P where an inequality allows it (0 else)."""
    if form.under is None:
        return form, (1 if one_sided else 0)
    if form.linear or form.quadratic or np.ptp(np.sign(form.factor)) or not np.all(form.factor):
        return None
    length = -form.constant / form.factor
    if not np.all(length >= 0):
        return None
    sign = 1 if np.all(form.factor > 0) else -1
    square = Quadratic(length**2)
    return form.under - square, (sign if one_sided else 0)


def found(form: Quadratic, one_sided: bool) -> SquareDistance | None:
    """The distance that a row is of, or None."""
    pair = squared(form, one_sided)
    if pair is None or not pair[0].quadratic:
        return None
    whole, sign = pair
    if any(np.ptp(value) for value in whole.quadratic.values()):
        return None
    square = {key: float(np.ravel(value)[0]) for key, value in whole.quadratic.items()}
    rows = _weights(square)
    if rows is None:
        return None
    factor, weights, axes = rows
    shift = _shift(whole, factor, weights, axes)
    if shift is None:
        return None
    inside = (shift**2).sum(axis=-1) - whole.constant / factor
    if not np.all(inside >= 0):
        return None
    upper = sign * np.sign(factor)
    return SquareDistance(weights, shift, np.sqrt(inside), axes, bool(upper < 0), bool(upper > 0))


def _weights(square: dict[tuple[int, int], float]) -> tuple[float, dict[int, float], tuple[int, ...]] | None:
    """factor, weights of the particles and components, where the square is factor |sum_k weight_k r_k|^2."""
    particles = sorted({i // 3 for key in square for i in key})
    axes = tuple(sorted({i % 3 for i, j in square if i == j}))
    if len(axes) < 2 or any(i % 3 != j % 3 for i, j in square):
        return None
    first = particles[0]
    largest = max(map(abs, square.values()))
    factor = square.get((3 * first + axes[0],) * 2, 0.0)
    if not factor:
        return None
    weights = {first: 1.0}
    for k in particles[1:]:
        weights[k] = square.get((3 * first + axes[0], 3 * k + axes[0]), 0.0) / (2.0 * factor)
    for axis in axes:
        for place, k in enumerate(particles):
            for other in particles[place:]:
                wanted = factor * weights[k] * weights[other] * (1.0 if k == other else 2.0)
                if abs(square.get((3 * k + axis, 3 * other + axis), 0.0) - wanted) > SAME * largest:
                    return None
    return factor, weights, axes


def _shift(
    whole: Quadratic, factor: float, weights: dict[int, float], axes: tuple[int, ...]
) -> Floats | None:
    """The shift (3,) or (T, 3), from the linear terms 2 factor weight_k shift . r_k."""
    if any(i % 3 not in axes or i // 3 not in weights for i in whole.linear):
        return None
    parts = []
    zero = np.float64(0.0)
    size = max((float(np.abs(value).max()) for value in whole.linear.values()), default=0.0)
    for axis in range(3):
        first = next(iter(weights))
        part = whole.linear.get(3 * first + axis, zero) / (2.0 * factor)
        for k, weight in weights.items():
            linear = whole.linear.get(3 * k + axis, zero)
            if np.any(np.abs(linear - 2.0 * factor * weight * part) > SAME * size):
                return None
        parts.append(part)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)
