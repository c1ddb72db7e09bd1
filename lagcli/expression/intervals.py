"""Interval arithmetic: the values an expression can take while its argument goes through a cell.

A range is a pair of arrays (low, high) that broadcast; every operation rounds outwards, by more than two libraries of
elementary functions differ. Where a function has a pole or no value in a cell its range is everything.
R. E. Moore, Interval Analysis (1966).
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Range = tuple[Floats, Floats]
Rule = Callable[[Range], Range]

# By this part of itself every result is widened: two roundings of an operation, or of a library function.
INTERVAL_ROUNDOFF = 4 * float(np.finfo(float).eps)
MOST_POWER = 64  # whole exponents up to this size are powers also of negative numbers


def constant(value: float | Floats) -> Range:
    """A number, or (K, 1) of them, as a range."""
    array = np.asarray(value, dtype=float)
    return array, array


def apply(rule: Callable[..., Range], *parts: Range) -> Range:
    """The range of an operation on ranges: one of `OPERATIONS`, or the rule of a function."""
    with np.errstate(all="ignore"):
        low, high = rule(*parts)
        nothing = np.isnan(low) | np.isnan(high)
        return np.where(nothing, -np.inf, low), np.where(nothing, np.inf, high)


def _wide(low: Floats, high: Floats) -> Range:
    return low - INTERVAL_ROUNDOFF * np.abs(low), high + INTERVAL_ROUNDOFF * np.abs(high)


def _add(a: Range, b: Range) -> Range:
    return _wide(a[0] + b[0], a[1] + b[1])


def _subtract(a: Range, b: Range) -> Range:
    return _wide(a[0] - b[1], a[1] - b[0])


def negative(a: Range) -> Range:
    """-a."""
    return -a[1], -a[0]


def _multiply(a: Range, b: Range) -> Range:
    return _wide(*_corners(np.multiply, a, b))


def _divide(a: Range, b: Range) -> Range:
    pole = (b[0] <= 0.0) & (b[1] >= 0.0)
    low, high = _wide(*_corners(np.divide, a, b))
    return np.where(pole, -np.inf, low), np.where(pole, np.inf, high)


def _corners(function: Callable[[Floats, Floats], Floats], a: Range, b: Range) -> Range:
    """Least and largest of a function, monotone in both arguments, at the corners of a box."""
    values = [function(x, y) for x in a for y in b]
    return np.minimum.reduce(values), np.maximum.reduce(values)


def rising(function: Callable[[Floats], Floats]) -> Rule:
    """The range of a function that rises wherever it has a value."""
    return lambda a: _wide(function(a[0]), function(a[1]))


def falling(function: Callable[[Floats], Floats]) -> Rule:
    """The range of a function that falls wherever it has a value."""
    return lambda a: _wide(function(a[1]), function(a[0]))


def even(rule: Rule) -> Rule:
    """The range of a function of the size of its argument."""
    return lambda a: rule(size(a))


def within(rule: Rule) -> Rule:
    """The range of a function of -1 to 1: beyond by rounding is no fault of the cell."""
    return lambda a: rule((np.clip(a[0], -1.0, 1.0), np.clip(a[1], -1.0, 1.0)))


def size(a: Range) -> Range:
    """The range of `abs`."""
    low, high = np.abs(a[0]), np.abs(a[1])
    inside = (a[0] <= 0.0) & (a[1] >= 0.0)
    return np.where(inside, 0.0, np.minimum(low, high)), np.maximum(low, high)


def sine(a: Range) -> Range:
    """The range of `sin`."""
    return _wave(np.sin, a, np.pi / 2)


def cosine(a: Range) -> Range:
    """The range of `cos`."""
    return _wave(np.cos, a, 0.0)


def _wave(function: Callable[[Floats], Floats], a: Range, crest: float) -> Range:
    """A sine with a crest at a point: it takes 1 or -1 where the cell holds a crest or a trough."""
    values = function(a[0]), function(a[1])
    low, high = _wide(np.minimum(*values), np.maximum(*values))
    # A point that the cell holds may be lost to rounding, where the value is the same to rounding.
    high = np.where(_holds(a, crest, 2 * np.pi), 1.0, np.minimum(high, 1.0))
    low = np.where(_holds(a, crest + np.pi, 2 * np.pi), -1.0, np.maximum(low, -1.0))
    endless = ~np.isfinite(a[1] - a[0])
    return np.where(endless, -1.0, low), np.where(endless, 1.0, high)


def _holds(a: Range, point: float, period: float) -> npt.NDArray[np.bool_]:
    """True if a cell holds a point or one that is whole periods away."""
    return np.asarray(np.floor((a[1] - point) / period) > np.floor((a[0] - point) / period))


def tangent(a: Range) -> Range:
    """The range of `tan`."""
    pole = _holds(a, np.pi / 2, np.pi)
    low, high = _wide(np.tan(a[0]), np.tan(a[1]))
    return np.where(pole, -np.inf, low), np.where(pole, np.inf, high)


def logarithm(a: Range) -> Range:
    """The range of `log`."""
    return _wide(np.where(a[0] > 0.0, np.log(a[0]), -np.inf), np.log(a[1]))


def root(a: Range) -> Range:
    """The range of `sqrt`."""
    return _wide(np.sqrt(np.maximum(a[0], 0.0)), np.sqrt(a[1]))


def sign(a: Range) -> Range:
    """The range of `sign`."""
    return np.sign(a[0]), np.sign(a[1])


def angle(y: Range, x: Range) -> Range:
    """The range of `atan2`."""
    cut = (x[0] <= 0.0) & (y[0] <= 0.0) & (y[1] >= 0.0)
    low, high = _wide(*_corners(np.arctan2, y, x))
    return np.where(cut, -np.pi, low), np.where(cut, np.pi, high)


def least(*ranges: Range) -> Range:
    """The range of `min`."""
    return functools.reduce(np.minimum, (a[0] for a in ranges)), functools.reduce(
        np.minimum, (a[1] for a in ranges)
    )


def largest(*ranges: Range) -> Range:
    """The range of `max`."""
    return negative(least(*map(negative, ranges)))


def _power(base: Range, exponent: Range) -> Range:
    low, high = exponent
    number = low.item() if low.size == 1 and np.array_equal(low, high) else None
    if number is None:
        return rising(np.exp)(_multiply(exponent, logarithm(base)))
    if number == round(number) and abs(number) <= MOST_POWER:
        return _integer_power(base, round(number))
    powers = _corners(np.power, (np.maximum(base[0], 0.0), base[1]), exponent)
    return _wide(*powers)


def _integer_power(base: Range, exponent: int) -> Range:
    if exponent < 0:
        return _divide(constant(1.0), _integer_power(base, -exponent))
    if exponent % 2 == 0:
        base = size(base)
    return _wide(base[0] ** exponent, base[1] ** exponent)


OPERATIONS: dict[str, Callable[..., Range]] = {
    "add": _add,
    "subtract": _subtract,
    "negate": negative,
    "multiply": _multiply,
    "divide": _divide,
    "power": _power,
}
