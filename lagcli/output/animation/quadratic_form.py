"""Functions of positions up to the second degree, the root of one, and no others; and the distances that they say.

The left sides of simple rows are such functions: planes, spheres, cylinders, distances. Coefficients are numbers, or
arrays (T,) over the instants of an animation where they depend on t. A distance is factor (|u|^2 - length^2) with
u = sum_k weight_k r_k + shift, of all three components or of two.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lagcli import doubles

Floats = npt.NDArray[np.float64]
Coefficient = Floats | np.float64  # (T,) or a number
ZERO = np.float64(0.0)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Quadratic:
    """constant + sum linear_i x_i + sum quadratic_ij x_i x_j (i <= j) + factor sqrt(under).

    x_3k, x_3k+1, x_3k+2 are the components of the position of particle k. known: False for every other function.
    """

    constant: Coefficient = ZERO
    linear: Mapping[int, Coefficient] = dataclasses.field(default_factory=dict)
    quadratic: Mapping[tuple[int, int], Coefficient] = dataclasses.field(default_factory=dict)
    factor: Coefficient = ZERO
    under: Quadratic | None = None
    known: bool = True

    @property
    def is_constant(self) -> bool:
        """True if no position is in it."""
        return self.known and not (self.linear or self.quadratic or self.under)

    @property
    def is_polynomial(self) -> bool:
        """True if there is no root in it."""
        return self.known and self.under is None

    def __neg__(self) -> Quadratic:
        return self.scaled(np.float64(-1.0))

    def __add__(self, other: Quadratic) -> Quadratic:
        if not (self.known and other.known):
            return OTHER
        factor, under = self.factor, self.under or other.under
        if self.under is None:
            factor = other.factor
        elif other.under is not None:
            if other.under is not self.under:
                return OTHER
            factor = factor + other.factor
        return Quadratic(
            self.constant + other.constant,
            _added(self.linear, other.linear),
            _added(self.quadratic, other.quadratic),
            factor,
            under,
        )

    def __sub__(self, other: Quadratic) -> Quadratic:
        return self + -other

    def __mul__(self, other: Quadratic) -> Quadratic:
        if other.is_constant:
            return self.scaled(other.constant)
        if self.is_constant:
            return other.scaled(self.constant)
        are_bare = not any(f.linear or f.quadratic or np.any(f.constant) for f in (self, other))
        if self.under is not None and self.under is other.under and are_bare:
            return self.under.scaled(self.factor * other.factor)
        if not (self.is_polynomial and other.is_polynomial) or self.quadratic or other.quadratic:
            return OTHER
        square: dict[tuple[int, int], Coefficient] = {}
        for (i, a), (j, b) in itertools.product(self.linear.items(), other.linear.items()):
            key = (min(i, j), max(i, j))
            square[key] = square.get(key, ZERO) + a * b
        linear = _added(
            {i: a * other.constant for i, a in self.linear.items()},
            {j: b * self.constant for j, b in other.linear.items()},
        )
        return Quadratic(self.constant * other.constant, linear, _nonzero(square))

    def __truediv__(self, other: Quadratic) -> Quadratic:
        return self.scaled(1.0 / other.constant) if other.is_constant else OTHER

    def scaled(self, by: Coefficient) -> Quadratic:
        """The form times a number."""
        if not self.known:
            return OTHER
        return Quadratic(
            self.constant * by,
            _nonzero({i: a * by for i, a in self.linear.items()}),
            _nonzero({i: a * by for i, a in self.quadratic.items()}),
            self.factor * by,
            self.under,
        )

    @property
    def coefficients(self) -> list[Coefficient]:
        """All of them, of the form under the root too."""
        own = [self.constant, self.factor, *self.linear.values(), *self.quadratic.values()]
        return own if self.under is None else own + self.under.coefficients

    @property
    def is_at_rest(self) -> bool:
        """True if no coefficient depends on t."""
        return not any(np.ndim(part) and np.ptp(part) for part in self.coefficients)

    def values(self, points: Floats) -> Floats:
        """The values (T, k) with the only particle in it at points (T, k, 3); T = 1 for one that is at rest."""
        found = np.zeros(points.shape[:-1]) + _over_points(self.constant)
        for i, a in self.linear.items():
            found = found + _over_points(a) * points[..., i % 3]
        for (i, j), a in self.quadratic.items():
            found = found + _over_points(a) * points[..., i % 3] * points[..., j % 3]
        if self.under is not None:
            found = found + _over_points(self.factor) * np.sqrt(self.under.values(points))
        return np.asarray(found)


OTHER = Quadratic(known=False)


def number(value: float | Coefficient) -> Quadratic:
    """A constant."""
    return Quadratic(value if isinstance(value, np.ndarray) else np.float64(value))


def _over_points(value: Coefficient) -> Coefficient:
    """A coefficient as it multiplies values (T, k): a number where it is the same at all instants."""
    numbers = np.asarray(value)
    if not numbers.ndim or not np.ptp(numbers):
        return np.float64(numbers.flat[0])
    return numbers[:, None]


K = TypeVar("K")


def _added(one: Mapping[K, Coefficient], two: Mapping[K, Coefficient]) -> dict[K, Coefficient]:
    keys = dict.fromkeys((*one, *two))
    return _nonzero({key: one.get(key, ZERO) + two.get(key, ZERO) for key in keys})


def _nonzero(terms: Mapping[K, Coefficient]) -> dict[K, Coefficient]:
    return {key: value for key, value in terms.items() if np.any(value)}


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


def distance(form: Quadratic, one_sided: bool) -> SquareDistance | None:
    """The distance that a row is of, or None."""
    pair = squared(form, one_sided)
    if pair is None or not pair[0].quadratic:
        return None
    polynomial, sign = pair
    if any(np.ptp(value) for value in polynomial.quadratic.values()):
        return None
    square = {key: float(np.ravel(value)[0]) for key, value in polynomial.quadratic.items()}
    # factor, weights of the particles and components, where the square is factor |sum_k weight_k r_k|^2
    particles = sorted({i // 3 for key in square for i in key})
    axes = tuple(sorted({i % 3 for i, j in square if i == j}))
    if len(axes) < 2 or any(i % 3 != j % 3 for i, j in square):
        return None
    first = particles[0]
    factor = square.get((3 * first + axes[0],) * 2, 0.0)
    if not factor:
        return None
    weights = {first: 1.0}
    for k in particles[1:]:
        weights[k] = square.get((3 * first + axes[0], 3 * k + axes[0]), 0.0) / (2.0 * factor)
    largest = max(map(abs, square.values()))
    for axis, (k, other) in itertools.product(axes, itertools.combinations_with_replacement(particles, 2)):
        wanted = factor * weights[k] * weights[other] * (1.0 if k == other else 2.0)
        if abs(square.get((3 * k + axis, 3 * other + axis), 0.0) - wanted) > doubles.ZERO * largest:
            return None
    # The shift from the linear terms 2 factor weight_k shift . r_k
    linear = polynomial.linear
    if any(i % 3 not in axes or i // 3 not in weights for i in linear):
        return None
    parts = [linear.get(3 * first + axis, ZERO) / (2.0 * factor) for axis in range(3)]
    size = max((float(np.abs(value).max()) for value in linear.values()), default=0.0)
    for (axis, part), (k, weight) in itertools.product(enumerate(parts), weights.items()):
        off = linear.get(3 * k + axis, ZERO) - 2.0 * factor * weight * part
        if np.any(np.abs(off) > doubles.ZERO * size):
            return None
    shift = np.stack(np.broadcast_arrays(*parts), axis=-1)
    inside = (shift**2).sum(axis=-1) - polynomial.constant / factor
    if not np.all(inside >= 0):
        return None
    upper = sign * np.sign(factor)
    return SquareDistance(weights, shift, np.sqrt(inside), axes, bool(upper < 0), bool(upper > 0))
