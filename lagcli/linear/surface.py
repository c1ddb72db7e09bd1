"""The one road onto a surface f = 0: `nearby` by Newton's steps, `descend` from far off, `walk` along it.

Equations are a function from a point, an array of floats or of numbers with many digits, to what they are there,
linearized; `nearby_all` takes many points of few coordinates at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np

from lagcli import doubles, progress
from lagcli.arrays import Floats
from lagcli.frozen import frozen
from lagcli.linear import decompositions
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse

Point = Floats  # or, as objects, numbers with many digits
# Of points (..., n) the values (..., m) of m equations, and their gradients (..., m, n).
Values = Callable[[Floats], tuple[Floats, Floats]]


class SurfaceParameters:
    """The way onto a surface and along it; lengths are parts of the size of the point. The tests are of
    `tests/unit/test_surface.py`."""

    __slots__ = ()

    newton_steps: int = 40
    """Newton's steps: beside a double zero each halves the distance. `test_forty_newton_steps_are_made`."""
    arrived: float = 1e-13
    """The distance at which Newton's steps end. `test_newton_ends_at_thirteen_digits`."""
    roundings: int = 64
    """Roundings of the values that may be left. `test_values_may_hold_some_roundings`."""
    squared: float = 0.02
    """What the last two steps leave of a distance, where they square it: beside a double zero they leave a quarter.
    `test_a_point_is_met_where_the_last_two_steps_square_the_distance`."""
    most_halvings: int = 30
    """Halvings of one of them. `test_a_step_of_a_descent_is_damped_thirty_times`."""
    bottom: float = 1e-14
    """The distance at which a descent ends, as a part of the size of the point: below the rounding of rows whose own
    coordinates are smaller. `test_a_descent_ends_at_fourteen_digits`."""
    first_damping: float = 1e-3
    """Damping, on rows of length one: where it begins. `test_a_step_of_a_descent_is_damped_thirty_times`."""
    stronger: float = 4.0
    """The factor by which it grows if a step goes up. `test_a_step_of_a_descent_is_damped_thirty_times`."""
    slow: float = 0.8
    """A descent ends where twenty steps have left more than this part of the residual: others go round a bend in
    fewer. `test_a_descent_that_is_slow_for_twenty_steps_ends`."""
    nearest_steps: int = 60
    """Steps to the point that is nearest to another one. `test_sixty_steps_lead_to_the_nearest_point`."""
    shortest: float = 2e-4
    """The shortest step along a surface: shorter ones would be within rounding of a singular place, where the rank
    cannot be seen. `test_a_step_along_a_surface_is_halved_down_to_four_digits`."""


PARAMETERS = SurfaceParameters()


class LinearEquations(Protocol):
    """Equations f = 0 at a point, with what is linear in them there."""

    @property
    def distance(self) -> float:
        """The distance from the surface, to first order, as a part of the size of the point."""

    @property
    def is_there(self) -> bool:
        """True if that is no more than rounding."""

    def step(self) -> Point | None:
        """The shortest step to where the linear equations vanish; None where there is none."""


E = TypeVar("E", bound=LinearEquations)


class Linearized:
    """f (s,) with sparse gradients B (s, n) in a metric, at a point of some size.

    rounding: by how much the rounding of the point moves f, a number or (s,).
    """

    def __init__(
        self, f: Floats, B: Sparse, metric: Metric, size: float = 1.0, rounding: float | Floats = 0.0
    ) -> None:
        self.f, self.B, self._metric, self._size, self._rounding = f, B, metric, size, rounding

    @cached_property
    def local(self) -> LocalRows:
        """The gradients by their entries."""
        return LocalRows(self.B)

    @cached_property
    def rows(self) -> MetricRows:
        """The gradients in the metric."""
        return MetricRows(self.B, self._metric)

    @property
    def is_finite(self) -> bool:
        """True if all values are numbers."""
        return bool(np.isfinite(self.f).all() and np.isfinite(self.local.values).all())

    @property
    def residuals(self) -> Floats:
        """|f_i| / |B_i|, (s,)."""
        return np.abs(self.f) / self.local.divisors

    @cached_property
    def distance(self) -> float:
        """The largest of them, as a part of the size."""
        return float(np.max(self.residuals, initial=0.0)) / self._size

    @property
    def is_there(self) -> bool:
        """True if each row is met to rounding."""
        lengths = PARAMETERS.arrived * self._size * self.local.divisors
        return bool((np.abs(self.f) <= lengths + PARAMETERS.roundings * self._rounding).all())

    def step(self) -> Floats:
        """The shortest step (n,) in the metric, by least squares if it must."""
        return self.rows.correction(self.f)

    def norm_of(self, other: Linearized) -> float:
        """|f| of this or another point, for the rows here of length one in the metric."""
        return float(np.linalg.norm(other.f / self.rows.lengths))

    def damped(self, damping: float) -> Floats:
        """The step (n,) damped as by Levenberg and Marquardt."""
        return self.rows.correction(self.f, damping)


D = TypeVar("D", bound=Linearized)


class InDigits:
    """f (s,) in many digits, `Decimal`: each step brings as many digits as doubles have.

    rows: the gradients in doubles at a point near by, of those equations, by their numbers, that are independent;
    lengths (s,): the sizes of all gradients; rounding: the distance that counts as none in so many digits.
    """

    def __init__(
        self, f: list[Decimal], rows: MetricRows, independent: list[int], lengths: Floats, rounding: Decimal
    ) -> None:
        self._moving, self._rows = [f[i] for i in independent], rows
        parts = (abs(value) / Decimal(length) for value, length in zip(f, lengths.tolist(), strict=True))
        largest = max(parts, default=Decimal(0))
        self.distance, self.is_there = float(largest), largest <= rounding

    def step(self) -> Point | None:
        """The shortest step (n,), of `Decimal`."""
        largest = max(map(abs, self._moving), default=Decimal(0))
        if not largest:
            return None
        step = self._rows.whole_correction(np.array([float(value / largest) for value in self._moving]))
        return np.array([Decimal(x) * largest for x in step.tolist()])


@frozen
class NewtonEnd:
    """The end of Newton's steps: the nearest point, its distance from the surface, and the largest part by which a
    further step would move an unknown.

    is_met: the steps ended on the surface, and squared the distance. creeps: they came near and did not square it, as
    where rows are dependent on the surface and independent beside it.
    """

    x: Point
    distance: float
    moved: float
    is_met: bool
    creeps: bool


def approach(
    at: Callable[[Point], E | None],
    x: Point,
    may_rise: bool = True,
    steps: int = PARAMETERS.newton_steps,
) -> NewtonEnd | None:
    """The point nearest to a surface that Newton's steps from x come to; None where the equations have no value at x.

    They go on down to rounding, and may rise far off, but not where may_rise is False.
    """
    here = at(x)
    if here is None:
        return None
    best, nearest_yet, before = x, here, math.inf
    last, moved = math.inf, math.inf
    rounding, small = (doubles.EPS, doubles.VALUE) if x.dtype == np.float64 else (0.0, 0.0)
    for _ in range(steps):
        step = None if here.is_there else here.step()
        if step is None:
            break
        # Each unknown by itself: beside a large one all steps of the others would be rounding.
        length = float((np.abs(step) / (1 + np.abs(x))).max(initial=0.0))
        there = at(x + step)
        is_closer = there is not None and there.distance < here.distance
        if there is None or not (is_closer or (here.distance > doubles.ZERO and may_rise)):
            moved = min(moved, length)
            break
        x, last, here, before = x + step, here.distance, there, last
        if here.distance < nearest_yet.distance:
            best, nearest_yet, moved = x, here, length
        if length <= rounding or (length <= small and here.distance > last / 2):
            break  # rounding, which now and then falls a little
    is_met = here.is_there and here.distance <= PARAMETERS.squared * before
    is_near = nearest_yet.is_there or nearest_yet.distance <= doubles.ZERO
    moved = 0.0 if nearest_yet.is_there else moved
    return NewtonEnd(best, nearest_yet.distance, moved, is_met, is_near and not is_met)


def nearby(at: Callable[[Point], E | None], x: Point) -> Point | None:
    """The point of a surface that Newton's steps reach, each squaring a small distance; None where they do not."""
    end = approach(at, x)
    return end.x if end is not None and end.is_met else None


def nearby_all(at: Values, points: Floats, size: float) -> tuple[Floats, Floats]:
    """Points (..., n), spread over a size, on m surfaces by Newton's steps, else nan; and the gradients (..., m, n)."""
    for _ in range(PARAMETERS.newton_steps):
        f, B = at(points)
        lengths = np.linalg.norm(B, axis=-1)
        is_known = (
            np.isfinite(f).all(axis=-1) & np.isfinite(lengths).all(axis=-1) & (lengths > 0).all(axis=-1)
        )
        with np.errstate(invalid="ignore"):
            is_met = is_known & (np.abs(f) <= doubles.VALUE * size * lengths).all(axis=-1)
        moving = is_known & ~is_met
        if not moving.any():
            break
        inverse = decompositions.pseudo_inverse(np.where(moving[..., None, None], B, 0.0))
        step = (inverse @ np.where(moving[..., None], f, 0.0)[..., None])[..., 0]
        points = np.where(is_known[..., None], points - step, np.nan)
    return np.where(is_met[..., None], points, np.nan), B


def descend(at: Callable[[Floats], D | None], x: Floats, to_the_end: bool = False) -> tuple[Floats, D | None]:
    """A point of the surface from far, or else one where the sum of squares is locally least, and the equations there:
    by Gauss-Newton steps, damped as by Levenberg and Marquardt. to_the_end: small steps do not end it, its last point
    is given."""
    damping, passed = 0.0, math.inf
    here = at(x)
    best = x, here
    least = math.inf if here is None else here.distance
    for taken in range(200):
        progress.require_time()
        if here is None or least <= PARAMETERS.bottom:
            break
        norm = here.norm_of(here)
        if taken % 20 == 0:
            if norm > PARAMETERS.slow * passed and not to_the_end:
                break
            passed = norm
        for _ in range(PARAMETERS.most_halvings):
            step = here.damped(damping)
            there = at(x + step)
            if there is not None and here.norm_of(there) < norm:
                break
            damping = max(PARAMETERS.stronger * damping, PARAMETERS.first_damping)
        else:
            break
        x, here = x + step, there
        damping = damping / (2 * PARAMETERS.stronger) if damping > doubles.ZERO else 0.0
        if here is not None and (to_the_end or here.distance <= least):
            best, least = (x, here), here.distance
    return best


def nearest(
    toward: Callable[[Point], Point | None],
    length: Callable[[Point], float],
    q: Point,
    q0: Point,
    steps: int = PARAMETERS.nearest_steps,
) -> Point:
    """The point of a surface nearest to q0, from a point q of it, as long as that comes nearer.

    toward: from a point of the surface to the one where Gauss and Newton place the nearest, on the condition
    q - q0 = -M^-1 B^T mu at the point itself, or None; length: of a step.
    """
    size = float(np.abs(q0).max(initial=0.0)) or 1.0
    for _ in range(steps):
        new = toward(q)
        if new is None or length(new - q0) >= length(q - q0) * (1 + doubles.VALUE) + doubles.VALUE * size:
            break
        moved = float(np.abs(new - q).max(initial=0.0))
        q = new
        if moved <= doubles.VALUE * size:
            break
    return q


def walk(
    meet: Callable[[Floats], Floats | None], x: Floats, step: Floats, size: float = 1.0
) -> Floats | None:
    """The point of a surface that a step (n,) along its tangent at x leads to, halved until its end is met near by.

    meet: from a point beside the surface to one on it, or None. None where short steps lead nowhere either.
    """
    largest = float(np.abs(step).max(initial=0.0))
    if largest == 0.0:
        return meet(x)
    while largest >= PARAMETERS.shortest * size:
        there = meet(x + step)
        if there is not None:
            off = float(np.linalg.norm(there - x - step))
            if off < float(np.linalg.norm(step)):
                return there
        step, largest = step / 2, largest / 2
    return None
