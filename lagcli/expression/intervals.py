"""Interval arithmetic: the values an expression can take while what it is made of goes through ranges (R. E. Moore,
Interval Analysis, 1966).

The rules are written once, for operations by their names in a `Program` and functions of the language; a kind of
numbers says what least, largest, a choice and rounding are. Operations round outwards, by more than two libraries of
functions differ. Where there is a pole or no value, or an operation is not known, the range is everything.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.expression import functions
from lagcli.expression.functions import Function

Range = tuple[Floats, Floats]
End = functions.Number  # of one kind
Ends = tuple[End, End]
Operation = Callable[..., End]

# By this part of itself every result is widened: two roundings of an operation, or of a library function.
INTERVAL_ROUNDOFF = 4 * doubles.EPS
HALF_TURN = math.nextafter(math.pi, 4.0)  # pi itself lies between two doubles
MOST_POWER = 64  # whole exponents up to this size are powers also of negative numbers


def constant(value: float | Floats) -> Range:
    """A number, or (K, 1) of them, as a range of arrays."""
    array = np.asarray(value, dtype=float)
    return array, array


def _float_power(x: float, exponent: float) -> float:
    try:
        return float(x**exponent)
    except OverflowError:
        return math.inf if x > 0 or exponent % 2 == 0 else -math.inf
    except ZeroDivisionError:
        return math.inf


class Intervals:
    """The arithmetic of ranges of floats; of other numbers by other methods. most: the bound where there is none."""

    most = math.inf
    least: Operation = staticmethod(min)
    largest: Operation = staticmethod(max)
    where: Operation = staticmethod(lambda holds, one, other: one if holds else other)
    both: Operation = staticmethod(lambda one, other: one and other)
    # Zero of zero and an end that is infinite because there is no bound.
    times: Operation = staticmethod(lambda x, y: x * y if x and y else 0.0)
    power: Operation = staticmethod(_float_power)

    def result(self, name: str, *parts: Ends) -> Ends:
        """The range of an operation by its name in a `Program`."""
        if name in _RULES:
            return self.told(*_RULES[name](self, *parts))
        if name in functions.BY_OPERATION:
            row = functions.BY_OPERATION[name]
            return self.told(*_FUNCTIONS[row.range](self, row, *parts))
        return self.told(-self.most, self.most)

    def told(self, low: End, high: End) -> Ends:
        """A range, which is everything where an end is no number."""
        return (low, high) if low <= high else (-math.inf, math.inf)

    def wide(self, low: End, high: End) -> Ends:
        return low - INTERVAL_ROUNDOFF * abs(low), high + INTERVAL_ROUNDOFF * abs(high)

    def call(self, row: Function, *x: End) -> End:
        """A function of the language, infinite where it overflows and no number where it has none."""
        try:
            return row.value(*x)
        except OverflowError:
            return math.copysign(math.inf, x[0])
        except ValueError:
            return math.nan

    def number(self, a: Ends) -> float | None:
        """The number that a range is, None where it is several."""
        return a[0] if a[0] == a[1] else None

    def multiply(self, a: Ends, b: Ends) -> Ends:
        return self.wide(*self.corners(self.times, a, b))

    def divide(self, a: Ends, b: Ends) -> Ends:
        """a / b; of a divisor that touches zero from one side the quotient has bounds."""
        if b[1] <= 0.0:
            a, b = _negative(self, a), _negative(self, b)
        if b[0] < 0.0 or b[1] == 0.0:
            return -math.inf, math.inf
        return self.multiply(a, (1.0 / b[1], 1.0 / b[0] if b[0] else math.inf))

    def corners(self, function: Callable[[End, End], End], a: Ends, b: Ends) -> Ends:
        """Least and largest of a function, monotone in both arguments, at the corners of a box."""
        values = [function(x, y) for x in a for y in b]
        return self.least(*values), self.largest(*values)

    def wave(self, row: Function, a: Ends, crest: float) -> Ends:
        """A sine with a crest at a point: it takes 1 or -1 where the range holds a crest or a trough."""
        values = self.call(row, a[0]), self.call(row, a[1])
        low, high = self.wide(self.least(*values), self.largest(*values))
        # A point that the range holds may be lost to rounding, where the value is the same to rounding.
        high = self.where(_holds(a, crest, 2 * np.pi), 1.0, self.least(high, 1.0))
        low = self.where(_holds(a, crest + np.pi, 2 * np.pi), -1.0, self.largest(low, -1.0))
        endless = np.isinf(a[1] - a[0]) | np.isnan(a[1] - a[0])
        return self.where(endless, -1.0, low), self.where(endless, 1.0, high)


class ArrayIntervals(Intervals):
    """The arithmetic of ranges of arrays, which broadcast."""

    least = staticmethod(lambda *numbers: functools.reduce(np.minimum, numbers))
    largest = staticmethod(lambda *numbers: functools.reduce(np.maximum, numbers))
    where, both = staticmethod(np.where), staticmethod(operator.and_)
    times, power = staticmethod(operator.mul), staticmethod(operator.pow)

    def result(self, name: str, *parts: Range) -> Range:
        with np.errstate(all="ignore"):
            return super().result(name, *parts)

    def told(self, low: Floats, high: Floats) -> Range:
        nothing = np.isnan(low) | np.isnan(high)
        return np.where(nothing, -np.inf, low), np.where(nothing, np.inf, high)

    def call(self, row: Function, *x: Floats) -> Floats:
        return row.array(*x)

    def number(self, a: Range) -> float | None:
        return float(a[0].item()) if a[0].size == 1 and np.array_equal(a[0], a[1]) else None

    def divide(self, a: Range, b: Range) -> Range:
        pole = (b[0] <= 0.0) & (b[1] >= 0.0)
        low, high = self.wide(*self.corners(np.divide, a, b))
        return np.where(pole, -np.inf, low), np.where(pole, np.inf, high)


FLOATS, ARRAYS = Intervals(), ArrayIntervals()


def _holds(a: Ends, point: float, period: float) -> End:
    """True if a range holds a point or one that is whole periods away."""
    return np.floor((a[1] - point) / period) > np.floor((a[0] - point) / period)


def _add(of: Intervals, a: Ends, b: Ends) -> Ends:
    return of.wide(a[0] + b[0], a[1] + b[1])


def _negative(of: Intervals, a: Ends) -> Ends:
    return -a[1], -a[0]


def _size(of: Intervals, a: Ends) -> Ends:
    return of.largest(a[0], -a[1], 0.0), of.largest(-a[0], a[1])


def _power(of: Intervals, base: Ends, exponent: Ends) -> Ends:
    number = of.number(exponent)
    if number is None:
        logarithm = _logarithm(of, functions.TABLE["log"], base)
        return _rising(of, functions.TABLE["exp"], of.multiply(exponent, logarithm))
    if number == round(number) and abs(number) <= MOST_POWER:
        return _integer_power(of, base, round(number))
    return of.wide(*of.corners(of.power, (of.largest(base[0], 0.0), base[1]), exponent))


def _integer_power(of: Intervals, base: Ends, exponent: int) -> Ends:
    if exponent < 0:
        return of.divide((1.0, 1.0), _integer_power(of, base, -exponent))
    if exponent % 2 == 0:
        base = _size(of, base)
    return of.wide(of.power(base[0], exponent), of.power(base[1], exponent))


_RULES: dict[str, Callable[..., Ends]] = {
    "add": _add,
    "sub": lambda of, a, b: _add(of, a, _negative(of, b)),
    "neg": _negative,
    "mul": lambda of, a, b: of.multiply(a, b),
    "twice": lambda of, a: (2 * a[0], 2 * a[1]),
    "sq": lambda of, a: _integer_power(of, a, 2),
    "div": lambda of, a, b: of.divide(a, b),
    "inv": lambda of, a: of.divide((1.0, 1.0), a),
    "pow": _power,
    "constpow": _power,
    "assign": lambda of, a: a,
}


def _rising(of: Intervals, row: Function, a: Ends, falls: bool = False) -> Ends:
    """A function that rises, or falls; arguments that are beyond its domain by rounding are at the end of it."""
    if row.domain is not None:
        low, high = row.domain
        a = of.least(of.largest(a[0], low), high), of.least(of.largest(a[1], low), high)
    first, last = (a[1], a[0]) if falls else a
    return of.wide(of.call(row, first), of.call(row, last))


def _logarithm(of: Intervals, row: Function, a: Ends) -> Ends:
    return of.wide(of.where(a[0] > 0.0, of.call(row, a[0]), -of.most), of.call(row, a[1]))


def _tangent(of: Intervals, row: Function, a: Ends) -> Ends:
    pole = _holds(a, np.pi / 2, np.pi)
    low, high = of.wide(of.call(row, a[0]), of.call(row, a[1]))
    return of.where(pole, -of.most, low), of.where(pole, of.most, high)


def _angle(of: Intervals, row: Function, y: Ends, x: Ends) -> Ends:
    cut = of.both(of.both(x[0] <= 0.0, y[0] <= 0.0), y[1] >= 0.0)
    low, high = of.wide(*of.corners(functools.partial(of.call, row), y, x))
    return of.where(cut, -HALF_TURN, low), of.where(cut, HALF_TURN, high)


# By the word of a row of `functions` for its range.
_FUNCTIONS: dict[str, Callable[..., Ends]] = {
    "rises": _rising,
    "falls": lambda of, row, a: _rising(of, row, a, falls=True),
    "rises both ways": lambda of, row, a: _rising(of, row, _size(of, a)),
    "sine": lambda of, row, a: of.wave(row, a, np.pi / 2),
    "cosine": lambda of, row, a: of.wave(row, a, 0),
    "tangent": _tangent,
    "logarithm": _logarithm,
    "root": lambda of, row, a: of.wide(of.call(row, of.largest(a[0], 0)), of.call(row, a[1])),
    "size": lambda of, row, a: _size(of, a),
    "sign": lambda of, row, a: (of.call(row, a[0]), of.call(row, a[1])),
    "angle": _angle,
    "least": lambda of, row, *a: (of.least(*(x for x, _ in a)), of.least(*(x for _, x in a))),
    "largest": lambda of, row, *a: (of.largest(*(x for x, _ in a)), of.largest(*(x for _, x in a))),
}
