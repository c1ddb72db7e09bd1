"""Points on the surface of holonomic constraints, to many digits: where an expression is not zero at one of
them it does not vanish on the surface.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

import mpmath
import sympy
from mpmath.ctx_iv import ivmpf

from lagcli.pfaffian.exact import enclosure
from lagcli.pfaffian.forms import form as forms

# Newton's method ends with nearly all digits; a sum of many terms loses some of them.
ZERO = 1e-30
_FOUND, _ATTEMPTS, _STEPS = 4, 24, 40
_CLOSE = mpmath.mpf(10) ** (3 - enclosure.DIGITS)
_DENOMINATOR = 10 ** (2 * enclosure.DIGITS)
_SEED = 20240511

Point = dict[sympy.Symbol, Fraction]


def values(expression: sympy.Expr, surface: Sequence[sympy.Expr]) -> list[float]:
    """The values of the expression at some real points where every expression of the surface vanishes.

    Other symbols have random values. Points where the expression has no finite real value are left out.
    """
    found = []
    for there in on(surface, sorted(expression.free_symbols, key=lambda s: s.name)):
        try:
            found.append(float(enclosure.Evaluator(there).value(expression).mid))
        except enclosure.NoValueError:
            continue
    return found


def on(surface: Sequence[sympy.Expr], symbols: Sequence[sympy.Symbol]) -> list[Point]:
    """Some points of the surface; symbols that do not occur in it have random values."""
    others = [s for s in symbols if s not in _symbols(surface)]
    generator = random.Random(_SEED)
    return [{**point, **_random(others, generator)} for point in _points(tuple(surface))]


def _symbols(expressions: Sequence[sympy.Expr]) -> list[sympy.Symbol]:
    return sorted(set().union(*(e.free_symbols for e in expressions)), key=lambda s: s.name)


def _random(symbols: Sequence[sympy.Symbol], generator: random.Random) -> Point:
    return {s: Fraction(generator.randrange(-2000, 2000), 997) for s in symbols}


@lru_cache(maxsize=32)
def _points(surface: tuple[sympy.Expr, ...]) -> tuple[Point, ...]:
    """Points by Newton's method with the smallest steps, from random places."""
    symbols = _symbols(surface)
    gradients = [[forms.partial(f, x) for x in symbols] for f in surface]
    generator = random.Random(_SEED)
    found: list[Point] = []
    for _ in range(_ATTEMPTS):
        point = _landed(_random(symbols, generator), surface, gradients)
        if point is not None:
            found.append(point)
        if len(found) == _FOUND:
            break
    return tuple(found)


def _landed(
    point: Point, surface: Sequence[sympy.Expr], gradients: Sequence[Sequence[sympy.Expr]]
) -> Point | None:
    with mpmath.workdps(enclosure.DIGITS):
        for _ in range(_STEPS):
            there = enclosure.Evaluator(point)
            try:
                f = mpmath.matrix([_middle(there.value(row)) for row in surface])
                B = mpmath.matrix([[_middle(there.value(entry)) for entry in row] for row in gradients])
                step = B.T * mpmath.lu_solve(B * B.T, f)
            except (enclosure.NoValueError, ArithmeticError, ValueError):
                return None
            moved = max(abs(d) for d in step)
            if not mpmath.isfinite(moved) or moved > 1e6:
                return None
            point = {x: old - _fraction(d) for (x, old), d in zip(point.items(), step, strict=True)}
            if moved < _CLOSE:
                return point
    return None


def _middle(interval: ivmpf) -> mpmath.mpf:
    return mpmath.mpf(interval.mid.a) if hasattr(interval.mid, "a") else mpmath.mpf(interval.mid)


def _fraction(value: mpmath.mpf) -> Fraction:
    return Fraction(int(mpmath.nint(value * _DENOMINATOR)), _DENOMINATOR)
