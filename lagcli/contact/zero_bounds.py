"""Bounds of functions on a piece of a step, from values and slopes at its ends and a misfit measured inside.

With u in [0, 1] along it a function lies within p(u) +- 16 d u^2 (1 - u)^2: p is the cubic through the values and
slopes of both ends (Hermite), d the largest misfit. Both bounds have degree 4; a polynomial lies within its Bernstein
coefficients and has at most as many roots as these change sign (Descartes). Of the five d moves that in the middle, by
8 d / 3. The formulas hold for one function, in floats, and for many, in arrays (k,).
"""

from __future__ import annotations

import functools
from typing import TypeVar

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats

# One function, or many.
Number = TypeVar("Number", float, Floats)


class ZeroBoundParameters:
    """Bounds of a function on a piece of a step. The tests are of `tests/unit/test_numbers_of_contacts.py`."""

    __slots__ = ()

    safety: float = 4.0
    """The misfit of the parts of a piece is so many times what a kink would leave
    (`test_the_misfit_of_a_piece_is_four_times_what_it_shows`)."""
    trusted: float = 0.1
    """A cubic says how often a function leaves its side, and where the next value is worth most, if the misfit about it
    is this part of its range (`test_a_cubic_is_trusted_to_a_tenth_of_its_range`)."""
    wary: float = 0.5
    """After the first cut the misfit is at the least this part of what the cubics bend
    (`test_the_misfit_of_a_piece_is_half_of_its_bend_or_more`)."""


PARAMETERS = ZeroBoundParameters()


def largest(first: Number, *others: Number | float) -> Number:
    """The largest of numbers, or of each entry of arrays."""
    if isinstance(first, float):
        return max(first, *others)
    return functools.reduce(np.maximum, others, first)


def least(first: Number, *others: Number | float) -> Number:
    """The smallest of numbers, or of each entry of arrays."""
    if isinstance(first, float):
        return min(first, *others)
    return functools.reduce(np.minimum, others, first)


# The cubic of one or many functions on a piece, by its Bernstein coefficients.
Cubic = tuple[Number, Number, Number, Number]
# Values and slopes at the begin and at the end of a piece, its length taken as 1.
Ends = tuple[Number, Number, Number, Number]


def cubic(ends: Ends[Number]) -> Cubic[Number]:
    """The cubic with these values and slopes."""
    begin, begin_slope, end, end_slope = ends
    return begin, begin + begin_slope / 3, end - end_slope / 3, end


def bend(b: Cubic[Number]) -> Number:
    """The bend of a cubic: the larger of two second differences."""
    return largest(abs(b[0] - 2 * b[1] + b[2]), abs(b[1] - 2 * b[2] + b[3]))


def rounding(b: Cubic[Number]) -> Number:
    """The rounding of the coefficients themselves."""
    return 4 * doubles.EPS * largest(abs(b[1]), abs(b[2]))


def extent(b: Cubic[Number], misfit: Number) -> tuple[Number, Number]:
    """Below and above which no function goes; not a number where nothing can be said."""
    b0, b1, b2, b3 = b
    c1, c3 = (b0 + 3 * b1) / 4, (3 * b2 + b3) / 4
    middle, reach = (b1 + b2) / 2, 8 / 3 * misfit
    return least(b0, c1, c3, b3, middle - reach), largest(b0, c1, c3, b3, middle + reach)


def misfit(ends: Ends[Number], c: float, inner: tuple[Number, Number], noise: Number) -> Number:
    """The misfit (A + B (u - c)) u^2 (1 - u)^2 that value and slope at the part c of the piece, inner, show; in its
    parts it is c and 1 - c times this. noise: rounding of the function, which is no misfit."""
    (g, m0, end, m1), (value, slope) = ends, inner
    rise = end - g
    steep, bent = 3 * rise - 2 * m0 - m1, m0 + m1 - 2 * rise
    value_off = value - (g + c * (m0 + c * (steep + c * bent)))
    slope_off = slope - (m0 + c * (2 * steep + 3 * c * bent))
    allowed = 3 * noise + 8 * doubles.EPS * largest(abs(g), abs(rise), abs(m0), abs(m1))
    misfit = largest(abs(value_off) - allowed, 0.0)
    turn = largest(abs(slope_off) - 2 * allowed, 0.0) + misfit * abs(2 / c - 2 / (1 - c))
    return PARAMETERS.safety * (misfit + max(c, 1 - c) * turn) / (16 * (c * (1 - c)) ** 2)


def turns_once(b: Cubic[float], misfit: float, is_up: bool) -> bool:
    """True if a function leaves its side, the upper one or the lower one, and does so at one point alone. One that
    begins at zero, rounding on the wrong side of it, is taken to begin on its side."""
    b0, b1, b2, b3 = b if is_up else (-b[0], -b[1], -b[2], -b[3])
    level = min(b0, 0.0)
    c0, c1, c3, c4 = b0 - level, (b0 + 3 * b1) / 4 - level, (3 * b2 + b3) / 4 - level, b3 - level
    middle, reach = (b1 + b2) / 2 - level, 8 / 3 * misfit
    if not misfit <= PARAMETERS.trusted * (max(c0, c1, middle, c3) - c4):
        return False
    outer = (c3 > 0) + 0, (c4 > 0) + 0
    for c2 in (middle - reach, middle + reach):
        second, third = c1 > 0, c2 > 0
        changes = ((c0 >= 0) != second) + (second != third) + (third != outer[0]) + (outer[0] != outer[1])
        if changes != 1:
            return False
    return True


def fall(b: Cubic[float]) -> float:
    """The point in the piece, in [0, 1], at which a cubic that falls to below zero once does so."""
    b0, b1, b2, b3 = b
    level = min(b0, 0.0)
    low, high = 0.0, 1.0
    u = b0 / (b0 - b3) if 0.0 < b0 < b0 - b3 else 0.5
    for _ in range(60):  # of a threefold root each step leaves two thirds of the distance
        v = 1 - u
        value = v * v * (v * b0 + 3 * u * b1) + u * u * (3 * v * b2 + u * b3) - level
        low, high = (u, high) if value > 0 else (low, u)
        slope = 3 * (v * v * (b1 - b0) + 2 * u * v * (b2 - b1) + u * u * (b3 - b2))
        step = -value / slope if slope < 0 else 2.0
        if abs(step) <= doubles.EPS or high - low <= doubles.EPS:
            break
        u = u + step if low < u + step < high else (low + high) / 2
    return u


def lowest(b: Cubic[float], misfit: float, is_up: bool) -> float | None:
    """The point in the piece, in (0, 1), at which the cubic that comes near leaving its side turns back; None where
    that is not known."""
    b0, b1, b2, b3 = b if is_up else (-b[0], -b[1], -b[2], -b[3])
    if not misfit <= PARAMETERS.trusted * (max(b0, b1, b2, b3) - min(b0, b1, b2, b3)):
        return None
    d0, d1, d2 = b1 - b0, b2 - b1, b3 - b2
    # The slope is d0 + 2 turn u + bend u^2; it rises at the root that is the lowest point.
    turn, bend, root = d1 - d0, d0 - 2 * d1 + d2, d1 * d1 - d0 * d2
    if not root > 0 or (turn <= 0 and bend <= 0):
        return None
    root = root**0.5
    u = -d0 / (turn + root) if turn > 0 else (root - turn) / bend
    return u if 0 < u < 1 else None
