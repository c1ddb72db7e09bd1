"""Interval arithmetic: the values an expression can take while its argument goes through a cell.

A range is a pair of arrays (low, high) that broadcast; every operation rounds outwards, by more than two libraries of
elementary functions differ. Where a function has a pole or no value in a cell its range is everything.
R. E. Moore, Interval Analysis (1966).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Range = tuple[Floats, Floats]

# By this part of itself every result is widened: two roundings of an operation, or of a library function.
INTERVAL_ROUNDOFF = 4 * float(np.finfo(float).eps)
MOST_POWER = 64  # whole exponents up to this size are powers also of negative numbers


def constant(value: float | Floats) -> Range:
    """A number, or (K, 1) of them, as a range."""
    array = np.asarray(value, dtype=float)
    return array, array


def apply(name: str, *parts: Range) -> Range:
    """The range of an operation on ranges: `add`, `multiply`, `power`, or a function by its name in the format."""
    with np.errstate(all="ignore"):
        low, high = OPERATIONS[name](*parts)
        nothing = np.isnan(low) | np.isnan(high)
        return np.where(nothing, -np.inf, low), np.where(nothing, np.inf, high)


def _wide(low: Floats, high: Floats) -> Range:
    return low - INTERVAL_ROUNDOFF * np.abs(low), high + INTERVAL_ROUNDOFF * np.abs(high)


def _add(a: Range, b: Range) -> Range:
    return _wide(a[0] + b[0], a[1] + b[1])


def _subtract(a: Range, b: Range) -> Range:
    return _wide(a[0] - b[1], a[1] - b[0])


def _negate(a: Range) -> Range:
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


def _rising(function: Callable[[Floats], Floats]) -> Callable[[Range], Range]:
    return lambda a: _wide(function(a[0]), function(a[1]))


def _abs(a: Range) -> Range:
    low, high = np.abs(a[0]), np.abs(a[1])
    inside = (a[0] <= 0.0) & (a[1] >= 0.0)
    return np.where(inside, 0.0, np.minimum(low, high)), np.maximum(low, high)


def _cosh(a: Range) -> Range:
    low, high = _abs(a)
    return _wide(np.cosh(low), np.cosh(high))


def _sin(a: Range) -> Range:
    return _wave(np.sin, a, np.pi / 2)


def _cos(a: Range) -> Range:
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


def _tan(a: Range) -> Range:
    pole = _holds(a, np.pi / 2, np.pi)
    low, high = _wide(np.tan(a[0]), np.tan(a[1]))
    return np.where(pole, -np.inf, low), np.where(pole, np.inf, high)


def _acos(a: Range) -> Range:
    return _wide(np.arccos(_within(a[1])), np.arccos(_within(a[0])))


def _asin(a: Range) -> Range:
    return _wide(np.arcsin(_within(a[0])), np.arcsin(_within(a[1])))


def _within(value: Floats) -> Floats:
    """-1 to 1: beyond by rounding is no fault of the cell."""
    return np.asarray(np.clip(value, -1.0, 1.0))


def _log(a: Range) -> Range:
    return _wide(np.where(a[0] > 0.0, np.log(a[0]), -np.inf), np.log(a[1]))


def _sqrt(a: Range) -> Range:
    return _wide(np.sqrt(np.maximum(a[0], 0.0)), np.sqrt(a[1]))


def _atan2(y: Range, x: Range) -> Range:
    cut = (x[0] <= 0.0) & (y[0] <= 0.0) & (y[1] >= 0.0)
    low, high = _wide(*_corners(np.arctan2, y, x))
    return np.where(cut, -np.pi, low), np.where(cut, np.pi, high)


def _power(base: Range, exponent: Range) -> Range:
    low, high = exponent
    number = low.item() if low.size == 1 and np.array_equal(low, high) else None
    if number is None:
        return _exp(_multiply(exponent, _log(base)))
    if number == round(number) and abs(number) <= MOST_POWER:
        return _integer_power(base, round(number))
    powers = _corners(np.power, (np.maximum(base[0], 0.0), base[1]), exponent)
    return _wide(*powers)


def _integer_power(base: Range, exponent: int) -> Range:
    if exponent < 0:
        return _divide(constant(1.0), _integer_power(base, -exponent))
    if exponent % 2 == 0:
        base = _abs(base)
    return _wide(base[0] ** exponent, base[1] ** exponent)


_exp = _rising(np.exp)

OPERATIONS: dict[str, Callable[..., Range]] = {
    "add": _add,
    "subtract": _subtract,
    "negate": _negate,
    "multiply": _multiply,
    "divide": _divide,
    "power": _power,
    "sin": _sin,
    "cos": _cos,
    "tan": _tan,
    "asin": _asin,
    "acos": _acos,
    "atan": _rising(np.arctan),
    "sinh": _rising(np.sinh),
    "cosh": _cosh,
    "tanh": _rising(np.tanh),
    "exp": _exp,
    "log": _log,
    "sqrt": _sqrt,
    "abs": _abs,
    "sign": lambda a: (np.sign(a[0]), np.sign(a[1])),
    "min": lambda a, b: (np.minimum(a[0], b[0]), np.minimum(a[1], b[1])),
    "max": lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])),
    "atan2": _atan2,
}
