"""Rigorous numbers: an interval (mpmath, 50 digits, rounded outward) that certainly holds the value of an expression at
a rational point. One without zero is a proof that the expression is not identically zero; so is one at a point of a
surface, found to many digits, that it does not vanish there."""

from __future__ import annotations

import functools
import math
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import sympy
from mpmath.ctx_iv import MPIntervalContext, ivmpf

from lagcli import doubles, memory
from lagcli.expression import enclosures, intervals
from lagcli.expression.enclosures import NoBounds
from lagcli.linear import surface
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms import notation

# Cancellation of thirty digits leaves a sign.
DIGITS = 50
# Zeros at so many points make it a case for the algebra.
POINTS = 12
# A fixed one: a proof must not change from run to run.
_SEED = 20240229
_NEAR = [(0, 1), (-1, 1), (1, 3), (-3, 3), (0, 1), (-1, 0), (2, 9), (-9, 9)]
_FAR = [(10, 100), (-100, -10), (-100, 100), (100, 1000), (-1000, 1000), (1000, 10_000), (-10_000, -1000)]
_SCALES = [*_NEAR * 3, *_FAR]
# Points whose symbols have scales of their own, after those of one scale.
_MIXED = 16

# Newton's method to a surface ends with nearly all digits; a sum of many terms loses some of them. At a start, which
# is known to all, what is this part of its terms is left of them where they cancel.
ZERO, CANCELLED = 1e-30, 1e-40
_FOUND, _ATTEMPTS = 4, 24
# What Newton's steps leave, and the longest of them.
_CLOSE, _LONGEST = 10.0 ** (3 - DIGITS), 1e6
_DENOMINATOR = 10 ** (2 * DIGITS)
_SURFACE_SEED = 20240511

# One context for all evaluations and threads: nothing used here changes its precision, and making one takes longer
# than most evaluations.
_INTERVALS = MPIntervalContext()
_INTERVALS.dps = DIGITS
_RESULT = functools.partial(enclosures.result, _INTERVALS)

Point = Mapping[sympy.Symbol, Fraction]


@dataclass(frozen=True, slots=True)
class NonZero:
    """A value proved to differ from zero: value, error bound and the rational point where it was taken."""

    value: float
    error: float
    point: tuple[tuple[str, Fraction], ...]


class NoValueError(Exception):
    """The expression has no real value at the point, or holds a function that has no enclosure."""


def points(symbols: Sequence[sympy.Symbol]) -> Iterator[dict[sympy.Symbol, Fraction]]:
    """The fixed sequence of random rational test points for some symbols, of different scales, as the domains of log,
    sqrt and asin are not known; at the end each symbol has a scale of its own."""
    generator = random.Random(_SEED)
    ordered = sorted(symbols, key=lambda s: s.name)

    def between(low: int, high: int) -> Fraction:
        return low + (high - low) * Fraction(generator.randrange(1, 997), 997)

    for low, high in _SCALES:
        yield {s: between(low, high) for s in ordered}
    for _ in range(_MIXED if len(ordered) > 1 else 0):
        yield {s: between(*generator.choice(_SCALES)) for s in ordered}


def nonzero(expression: sympy.Expr) -> NonZero | None:
    """A proof that `expression` is not identically zero, or None."""
    # With |u| both sides of the kink should be met. Otherwise three zeros make it a case for the algebra.
    most = POINTS if expression.has(sympy.Abs) else POINTS // 4
    there = points(list(expression.free_symbols))
    for tried, (point, interval) in enumerate(_intervals(expression, there), start=1):
        if not 0 in interval:  # noqa: E713 - mpmath intervals define `in` only
            names = tuple((s.name, v) for s, v in sorted(point.items(), key=lambda item: item[0].name))
            return NonZero(float(interval.mid), float(interval.delta), names)
        if not point or tried >= most:
            return None
    return None


def has_value(expression: sympy.Expr) -> bool:
    """True if the expression has a finite real value at one of the test points."""
    there = points(list(expression.free_symbols))
    return next(_intervals(expression, there), None) is not None


def _intervals(expression: sympy.Expr, points: Iterable[Point]) -> Iterator[tuple[Point, ivmpf]]:
    """The points at which an expression has a finite real value, with the interval of it."""
    for point in points:
        try:
            interval = Evaluator(point).value(expression)
        except NoValueError:
            continue
        yield point, interval


class Evaluator:
    """Evaluates expressions at one point; shared subexpressions are computed once."""

    def __init__(self, point: Point) -> None:
        self._memo: dict[sympy.Basic, ivmpf] = {}
        for symbol, value in point.items():
            self._memo[symbol] = _INTERVALS.mpf(value.numerator) / value.denominator

    def value(self, expression: sympy.Expr) -> ivmpf:
        """The interval of the value. Raises `NoValueError` at poles, off the real domain and for unknown functions."""
        try:
            interval = notation.folded(expression, _leaf, _RESULT, self._memo)
        except NoBounds as error:
            raise NoValueError(str(error)) from error
        if not all(math.isfinite(float(b)) for b in (interval.a, interval.b, interval.delta)):
            raise NoValueError("not finite")
        return interval


def _leaf(e: sympy.Basic) -> ivmpf:
    if isinstance(e, sympy.Rational):
        return _INTERVALS.mpf(int(e.p)) / int(e.q)
    if e is sympy.pi or e is sympy.E:
        return +(_INTERVALS.pi if e is sympy.pi else _INTERVALS.e)
    raise NoBounds(str(e))


def never_vanishes(expression: sympy.Expr) -> bool:
    """True if an expression of real symbols is certainly other than zero wherever it has a value."""
    if expression.is_positive or expression.is_negative or isinstance(expression, sympy.exp):
        return True

    def leaf(e: sympy.Basic) -> intervals.Ends:
        number = float(e) if isinstance(e, (sympy.Number, sympy.NumberSymbol)) else None
        return (-math.inf, math.inf) if number is None else (number, number)

    low, high = notation.folded(expression, leaf, intervals.FLOATS.result, {})
    return bool(low > doubles.ZERO or high < -doubles.ZERO)


def middle(expression: sympy.Expr, point: Point) -> mpmath.mpf:
    """The value at a point to nearly all digits of the terms it is made of. Raises `NoValueError`."""
    with mpmath.workdps(DIGITS):
        return _middle(Evaluator(point).value(expression))


def decimal_of(expression: sympy.Expr, point: Point) -> Decimal:
    """The same as a decimal. Raises `NoValueError`."""
    return Decimal(mpmath.nstr(middle(expression, point), DIGITS))


def fraction(number: sympy.Expr) -> Fraction:
    """A real number to twice as many digits as are computed with, exactly where it is rational."""
    if isinstance(number, sympy.Rational):
        return Fraction(int(number.p), int(number.q))
    return Fraction(str(number.evalf(2 * DIGITS)))


def values_on(expression: sympy.Expr, surface: Sequence[sympy.Expr]) -> list[float]:
    """The values of the expression at some real points of a surface, without those where it has none."""
    there = points_on(surface, sorted(expression.free_symbols, key=lambda s: s.name))
    return [float(interval.mid) for _, interval in _intervals(expression, there)]


def points_on(surface: Sequence[sympy.Expr], symbols: Sequence[sympy.Symbol]) -> list[Point]:
    """Some points of the surface; symbols that do not occur in it have random values."""
    own = set().union(*(e.free_symbols for e in surface))
    others = [s for s in symbols if s not in own]
    drawn = random.Random(_SURFACE_SEED)
    return [
        {**point, **{s: Fraction(drawn.randrange(-2000, 2000), 997) for s in others}}
        for point in _points(tuple(surface))
    ]


@memory.remembered(32)
def _points(surface: tuple[sympy.Expr, ...]) -> tuple[Point, ...]:
    """Points by Newton's method with the smallest steps, from random points."""
    symbols = sorted(set().union(*(e.free_symbols for e in surface)), key=lambda s: s.name)
    gradients = [[forms.partial(f, x) for x in symbols] for f in surface]
    drawn = random.Random(_SURFACE_SEED)
    found: list[Point] = []
    for _ in range(_ATTEMPTS):
        begin = {s: Fraction(drawn.randrange(-2000, 2000), 997) for s in symbols}
        point = _projected(begin, surface, gradients)
        if point is not None:
            found.append(point)
        if len(found) == _FOUND:
            break
    return tuple(found)


def nearest(
    begin: Point, origin: Point, surface: Sequence[sympy.Expr], inertia: Sequence[Sequence[Fraction]]
) -> Point | None:
    """The point of a surface nearest to `origin` in the metric of an inertia (n, n), from a point close to it; None
    where rows depend on others there. The points hold the symbols that may move, with which the inertia begins."""
    gradients, n = [[forms.partial(f, x) for x in begin] for f in surface], len(begin)
    with mpmath.workdps(DIGITS):
        try:
            W = mpmath.inverse(
                mpmath.matrix([[mpmath.mpf(a.numerator) / a.denominator for a in row] for row in inertia])
            )[:n, :n]
        except ZeroDivisionError:
            return None
    # Where the way is long and the surface curved the steps do not contract: then a point of the surface is given.
    return _projected(begin, surface, gradients, W, origin) or _projected(begin, surface, gradients, W)


class _Step:
    """Newton's step (n,) at a point, of fractions, the largest part of it, and whether that is rounding."""

    def __init__(self, whole: surface.Point, distance: float) -> None:
        self._whole, self.distance, self.is_there = whole, distance, distance < _CLOSE

    def step(self) -> surface.Point:
        return self._whole


def _projected(
    begin: Point,
    equations: Sequence[sympy.Expr],
    gradients: Sequence[Sequence[sympy.Expr]],
    W: mpmath.matrix | None = None,
    origin: Point | None = None,
) -> Point | None:
    """Newton's method, q - W B^T (B W B^T)^-1 f, or with an origin q0 - W B^T (B W B^T)^-1 (f + B (q0 - q)): its end is
    the point nearest to q0, which needs W B^T mu for the way there."""

    def at(q: surface.Point) -> _Step | None:
        there = Evaluator(dict(zip(begin, q, strict=True)))
        try:
            f = mpmath.matrix([_middle(there.value(row)) for row in equations])
            B = mpmath.matrix([[_middle(there.value(entry)) for entry in row] for row in gradients])
            ways = [origin[x] - old if origin else Fraction(0) for x, old in zip(begin, q, strict=True)]
            back = mpmath.matrix([mpmath.mpf(way.numerator) / way.denominator for way in ways])
            weighted = B.T if W is None else W * B.T
            step = back - weighted * mpmath.lu_solve(B * weighted, f + B * back)
        except (NoValueError, ArithmeticError, ValueError):
            return None
        moved = max(abs(d) for d in step)
        if not mpmath.isfinite(moved) or moved > _LONGEST:
            return None
        whole = [Fraction(int(mpmath.nint(d * _DENOMINATOR)), _DENOMINATOR) for d in step]
        return _Step(np.array(whole), float(moved) / max(1.0, float(np.abs(q).max())))

    with mpmath.workdps(DIGITS):
        q = surface.nearby(at, np.array(list(begin.values())))
    return None if q is None else dict(zip(begin, q, strict=True))


def _middle(interval: ivmpf) -> mpmath.mpf:
    return mpmath.mpf(interval.mid.a) if hasattr(interval.mid, "a") else mpmath.mpf(interval.mid)
