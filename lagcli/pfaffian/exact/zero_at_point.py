"""Tell if an expression vanishes at a point of doubles, but for the rounding of its coordinates: in one pass.

Each value goes with the sum of what it would change by if every coordinate and every intermediate result changed by
its own size. A value far below that is what cancellation leaves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import sympy

# In parts of that sum: a start is declared in decimals, and carries what they were rounded from.
ROUNDING = 1e-9

Pair = tuple[float, float]

_SLOPES: dict[type[sympy.Basic], tuple[Callable[[float], float], Callable[[float], float]]] = {
    sympy.sin: (math.sin, math.cos),
    sympy.cos: (math.cos, math.sin),
    sympy.tan: (math.tan, lambda u: 1 + math.tan(u) ** 2),
    sympy.exp: (math.exp, math.exp),
    sympy.log: (math.log, lambda u: 1 / u),
    sympy.sinh: (math.sinh, math.cosh),
    sympy.cosh: (math.cosh, math.sinh),
    sympy.tanh: (math.tanh, lambda u: 1 - math.tanh(u) ** 2),
    sympy.asin: (math.asin, lambda u: 1 / math.sqrt(1 - u * u)),
    sympy.acos: (math.acos, lambda u: 1 / math.sqrt(1 - u * u)),
    sympy.atan: (math.atan, lambda u: 1 / (1 + u * u)),
    sympy.Abs: (abs, lambda u: 1.0),
}


def vanishes(expression: sympy.Expr, point: Mapping[sympy.Symbol, float]) -> bool:
    """True if the expression is zero there but for rounding, or has no value."""
    try:
        value, size = _visit(expression, point)
    except (ArithmeticError, ValueError):
        return True
    return not abs(value) > ROUNDING * size


def is_nothing(expression: sympy.Expr, point: Mapping[sympy.Symbol, float]) -> bool:
    """True if the expression has a value there, and this is zero but for rounding."""
    try:
        value, size = _visit(expression, point)
    except (ArithmeticError, ValueError):
        return False
    return abs(value) <= ROUNDING * size


def _visit(e: sympy.Basic, point: Mapping[sympy.Symbol, float]) -> Pair:
    """The value and its size. Raises `ValueError` or `ArithmeticError` for what has none here."""
    if isinstance(e, sympy.Symbol):
        if e not in point:
            raise ValueError(f"{e} has no value")
        return point[e], abs(point[e])
    if isinstance(e, (sympy.Number, sympy.NumberSymbol)):
        number = float(e)
        return number, abs(number)
    parts = [_visit(a, point) for a in e.args]
    if isinstance(e, sympy.Add):
        return math.fsum(v for v, _ in parts), math.fsum(s for _, s in parts)
    if isinstance(e, sympy.Mul):
        value, size = 1.0, 0.0
        for v, s in parts:
            value, size = value * v, size * abs(v) + abs(value) * s
        return value, size
    if isinstance(e, sympy.Pow):
        return _power(*parts)
    if isinstance(e, sympy.atan2):
        (y, dy), (x, dx) = parts
        square = x * x + y * y
        value = math.atan2(y, x)
        return value, abs(value) + (abs(x) * dy + abs(y) * dx) / square
    if type(e) not in _SLOPES:
        raise ValueError(f"{e.func} is not treated")
    function, slope = _SLOPES[type(e)]
    ((u, du),) = parts
    value = function(u)
    return value, abs(value) + abs(slope(u)) * du


def _power(base: Pair, exponent: Pair) -> Pair:
    (b, db), (n, dn) = base, exponent
    if b == 0.0:
        if n <= 0.0:
            raise ZeroDivisionError
        return 0.0, db
    value = b**n
    if isinstance(value, complex):
        raise ValueError("a root of a negative number")
    size = abs(n * value / b) * db
    return value, size + (abs(value * math.log(abs(b))) * dn if n != round(n) else 0.0)
