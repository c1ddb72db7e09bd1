"""Bounds of an expression over all real values of its symbols: what lies above or below zero never vanishes."""

from __future__ import annotations

import math
from functools import reduce

import sympy

from lagcli.pfaffian.forms import notation

Range = tuple[float, float]

_EVERYTHING: Range = (-math.inf, math.inf)
# A sum of doubles of size 1 is off by less than this.
# `tests/unit/test_special_points.py::test_what_keeps_off_zero_by_more_than_round_off_never_vanishes` fails at 1e-10 and
# at 1e-8.
MARGIN = 1e-9


def never_vanishes(expression: sympy.Expr) -> bool:
    """True if an expression of real symbols is certainly other than zero wherever it has a value."""
    if expression.is_positive or expression.is_negative or isinstance(expression, sympy.exp):
        return True
    low, high = _range(expression)
    return low > MARGIN or high < -MARGIN


def _range(e: sympy.Basic) -> Range:
    if isinstance(e, (sympy.Number, sympy.NumberSymbol)):
        return float(e), float(e)
    parts = [_range(a) for a in e.args]
    if isinstance(e, sympy.Add):
        return math.fsum(low for low, _ in parts), math.fsum(high for _, high in parts)
    if isinstance(e, sympy.Mul):
        return reduce(_product, parts)
    if isinstance(e, sympy.Pow):
        return _power(parts[0], e.exp)
    if isinstance(e, sympy.Abs):
        ((low, high),) = parts
        return max(0.0, low, -high), max(-low, high)
    if isinstance(e, sympy.exp):
        return _exp(parts[0][0]), _exp(parts[0][1])
    return notation.ROWS[type(e)].bounds if type(e) in notation.ROWS else _EVERYTHING


def _product(one: Range, other: Range) -> Range:
    ends = [0.0 if 0.0 in (a, b) else a * b for a in one for b in other]
    return min(ends), max(ends)


def _power(base: Range, exponent: sympy.Expr) -> Range:
    if not (exponent.is_Rational and exponent.is_positive):
        return _EVERYTHING
    if exponent.q % 2 == 0:
        return 0.0, math.inf
    if exponent.is_Integer and exponent.p % 2 == 0:
        nearest = max(0.0, base[0], -base[1])
        return _raised(nearest, exponent.p), _raised(max(-base[0], base[1]), exponent.p)
    return _EVERYTHING


def _raised(base: float, exponent: int) -> float:
    try:
        return base**exponent
    except OverflowError:
        return math.inf


def _exp(u: float) -> float:
    return math.exp(u) if u < 700.0 else math.inf
