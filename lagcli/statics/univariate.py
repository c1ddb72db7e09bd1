"""The real zeros of a finite algebra of functions, each exactly: all unknowns are functions of one, t.

Rational univariate representation (Rouillier, *Solving zero-dimensional systems*, 1999): t is a sum of the unknowns
with whole weights, f the squarefree part of the characteristic polynomial of multiplication by t, and any function v is
g_v(t)/g_1(t) at a zero, with polynomials g_v of traces. A sign is that of an enclosure without zero, or zero where g_v
and f have the root in common.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Sequence
from fractions import Fraction

from sympy.polys.densetools import dup_diff
from sympy.polys.domains import ZZ
from sympy.polys.euclidtools import dup_gcd
from sympy.polys.rootisolation import dup_isolate_real_roots_sqf
from sympy.polys.sqfreetools import dup_sqf_part

Whole = list[int]
Rows = tuple[list[Whole], int]  # a matrix of whole numbers over one denominator
Enclosure = tuple[Fraction, Fraction]
# Binary digits of t behind the point: at the last ones a sign is given up that is not zero.
BITS = tuple(2**k for k in range(7, 15))


class NotCounted(Exception):
    """The zeros are too many to be counted, or something is not decided exactly; the message says which."""


class Representation:
    """f, and g_v for elements v of a finite algebra over the rationals with a basis of D elements, the first of which
    is 1. Raises `NotCounted`.

    generators: matrices of multiplication by the unknowns (rows: the products with the basis), whole numbers over one
    denominator; traces (D, D): the traces of all products of two elements of the basis, likewise.
    """

    def __init__(self, generators: Sequence[Rows], traces: Rows) -> None:
        self._traces = traces
        (table, divisor), D = traces, len(traces[0])
        common = math.lcm(*(below for _, below in generators))
        drawn, weights = random.Random(0), list(range(1, len(generators) + 1))
        for _ in range(12):  # weights at random serve but for zeros in a few directions of each other
            matrix = [[0] * D for _ in range(D)]
            for w, (rows, below) in zip(weights, generators, strict=True):
                for own, row in zip(matrix, rows, strict=True):
                    for j, x in enumerate(row):
                        own[j] += w * x * (common // below)
            one = [1] + [0] * (D - 1)
            self._powers = [one]  # 1, t, ..., t^(D - 1) as elements
            for _ in range(D):
                self._powers.append(combined(self._powers[-1], matrix))
            sums = [dot(power, table[0]) // divisor for power in self._powers]  # whole, as t is
            self._powers.pop()
            # The monic polynomial with these sums of powers of its roots (Newton), highest power first
            characteristic = [1]
            for k in range(1, len(sums)):
                total = sum(characteristic[k - i] * sums[i] for i in range(1, k + 1))
                characteristic.append(-total // k)
            self.f: Whole = [int(x) for x in dup_sqf_part(characteristic, ZZ)]
            self._horner = [self.f[: k + 1] for k in range(len(self.f) - 1)]
            self.one = self.of(one)
            # t tells all zeros apart where x g_1(t) - g_x(t) vanishes at them: the trace of its product with each
            # element is zero. An unknown times its denominator is the product with 1.
            g = self._at_t(self.one)
            rests = (
                [a - b for a, b in zip(combined(g, rows), self._at_t(self.of(rows[0])), strict=True)]
                for rows, _ in generators
            )
            if len(self.f) - 1 == D or not any(any(combined(rest, table)) for rest in rests):
                return
            weights = [drawn.randint(-9, 9) for _ in generators]
        raise NotCounted("their zeros could not be told apart")

    def of(self, element: Whole) -> Whole:
        """g_v, times the denominator of the traces, of an element with whole coefficients (D,)."""
        weights = combined(element, self._traces[0])
        degree = len(self.f) - 1
        found = [0] * degree
        for i in range(degree):
            factor = dot(self._powers[i], weights)
            for k, coefficient in enumerate(self._horner[degree - 1 - i]):
                found[i + k] += factor * coefficient
        return found

    def _at_t(self, g: Whole) -> Whole:
        """g(t) as an element."""
        found = [0] * len(self._traces[0])
        for power, factor in zip(self._powers, reversed(g), strict=False):
            for j, x in enumerate(power):
                found[j] += factor * x
        return found

    def roots(self) -> list[RealRoot]:
        """All real zeros."""
        degree = len(self.f) - 1
        # In a unit in which no root is much larger than 1: of large roots the isolation makes a step a digit.
        bits = max(-(-abs(x).bit_length() // k) for k, x in enumerate(self.f) if k)
        scaled = [ZZ(x << bits * (degree - k)) for k, x in enumerate(self.f)]
        isolated = dup_isolate_real_roots_sqf(scaled, ZZ)
        return [RealRoot(self, *(Fraction(str(end)) * 2**bits for end in ends)) for ends in isolated]


class RealRoot:
    """One real zero: a root of f that is alone between low and high."""

    def __init__(self, representation: Representation, low: Fraction, high: Fraction) -> None:
        self._all = representation
        self._low, self._high = low, high
        self._left = _sign_after(representation.f, low)

    def sign(self, g: Whole) -> int:
        """The sign of g at the root, exactly."""
        for bits in BITS:
            low, high = self._enclosed(g, bits)
            if low > 0 or high < 0 or low == high:
                return (low > 0) - (high < 0)
            if bits == BITS[0] and self._is_common(g):
                return 0
        raise NotCounted("a sign needs too many digits")

    def enclosure(self, g: Whole, scale: int, digits: int) -> Enclosure:
        """Bounds of g/(scale g_1) with so many binary digits, both zero where it is zero."""
        if not self.sign(g):
            return Fraction(0), Fraction(0)
        for bits in BITS:
            low, high = self._enclosed(g, bits)
            below, above = self._enclosed(self._all.one, bits)
            if low <= 0 <= high or below <= 0 <= above:
                continue
            ends = [x / y / scale for x in (low, high) for y in (below, above)]
            least, most = min(ends), max(ends)
            if (most - least) * 2**digits <= min(abs(least), abs(most)):
                return least, most
        raise NotCounted("a value needs too many digits")

    def _is_common(self, g: Whole) -> bool:
        """True if g vanishes at the root."""
        stripped = [ZZ(x) for x in itertools.dropwhile(lambda x: not x, g)]
        common = dup_gcd(stripped, [ZZ(x) for x in self._all.f], ZZ)
        if self._low == self._high:
            return not _sign(common, self._low)
        # A factor of f has no other root between, and changes its sign at this one; at the ends it may have others.
        mirrored = [-x if k % 2 else x for k, x in enumerate(reversed(common))][::-1]
        return len(common) > 1 and _sign_after(common, self._low) * _sign_after(mirrored, -self._high) < 0

    def _enclosed(self, g: Whole, bits: int) -> Enclosure:
        """Bounds of g at the root, by its value in the middle and a bound of its slope."""
        # The root between closer bounds: halves, and what is beside the end of a Newton step on the side without it
        f, slope = self._all.f, None
        while (self._high - self._low) * 2**bits > 1:
            width = self._high - self._low
            digits = max(2, 3 + width.denominator.bit_length() - width.numerator.bit_length())
            middle = _rounded((self._low + self._high) / 2, digits)
            if not self._low < middle < self._high:
                middle = (self._low + self._high) / 2
            slope = slope or dup_diff(f, 1, ZZ)
            steep = _value(slope, middle)
            digits = min(2 * digits, bits + 2)
            end = _rounded(middle - _value(f, middle) / steep, digits) if steep else middle
            for x in (middle, end - Fraction(1, 2**digits), end + Fraction(1, 2**digits)):
                if not self._low < x < self._high:
                    continue
                # The part beside x without the root is left out.
                sign = _sign(f, x)
                self._high = x if sign != self._left else self._high
                self._low = x if sign != -self._left else self._low
        middle, radius = (self._low + self._high) / 2, (self._high - self._low) / 2
        value = _value(g, middle)
        size = abs(middle) + radius
        slope = _value([abs(x) for x in dup_diff(g, 1, ZZ)], size)
        return value - radius * slope, value + radius * slope


def combined(element: Whole, rows: Sequence[Whole]) -> Whole:
    """The sum of rows with these factors."""
    found = [0] * len(rows[0])
    for factor, row in zip(element, rows, strict=True):
        if factor:
            for j, x in enumerate(row):
                if x:
                    found[j] += factor * x
    return found


def dot(a: Whole, b: Whole) -> int:
    """The sum of products."""
    return sum(x * y for x, y in zip(a, b, strict=True) if x and y)


def _scaled_value(polynomial: Sequence[int], x: Fraction) -> int:
    """The polynomial at x times the denominator of x to its degree: whole."""
    above, below, power, total = x.numerator, x.denominator, 1, 0
    for coefficient in polynomial:
        total = total * above + int(coefficient) * power
        power *= below
    return total


def _value(polynomial: Sequence[int], x: Fraction) -> Fraction:
    degree = max(len(polynomial) - 1, 0)
    return Fraction(_scaled_value(polynomial, x), x.denominator**degree)


def _sign(polynomial: Sequence[int], x: Fraction) -> int:
    value = _scaled_value(polynomial, x)
    return (value > 0) - (value < 0)


def _sign_after(polynomial: Sequence[int], x: Fraction) -> int:
    """The sign beyond x, of a polynomial that has no double root there."""
    return _sign(polynomial, x) or _sign(dup_diff(polynomial, 1, ZZ), x)


def _rounded(x: Fraction, bits: int) -> Fraction:
    return Fraction(round(x * 2**bits), 2**bits)
