"""Interval arithmetic in many digits, for proofs, by the intervals of mpmath, which round outwards. Where a rule is not
certain of all numbers of a range it raises, and gives no range that is everything."""

from __future__ import annotations

from collections.abc import Callable

from mpmath.ctx_iv import MPIntervalContext, ivmpf
from mpmath.libmp import ComplexResult

MOST_POWER = 10_000  # higher powers are given up


class NoBounds(Exception):
    """An operation has no bounds here, or is not known."""


class NoValue(NoBounds):
    """An operation has no value anywhere here."""


def result(context: MPIntervalContext, name: str, *parts: ivmpf) -> ivmpf:
    """The range of an operation by its name in a `Program`, in the digits of a context. Raises `NoBounds`."""
    if name not in _RULES:
        raise NoBounds(name)
    try:
        return _RULES[name](context, *parts)
    except (ComplexResult, ArithmeticError, ValueError, NotImplementedError) as error:
        raise NoBounds(name) from error


def _quotient(of: MPIntervalContext, a: ivmpf, b: ivmpf) -> ivmpf:
    if 0 in b:
        raise NoBounds("div")
    return a / b


def _root(of: MPIntervalContext, a: ivmpf) -> ivmpf:
    if a.b < 0:
        raise NoValue("sqrt")
    if a.a < 0:
        raise NoBounds("sqrt")
    return of.sqrt(a)


def _logarithm(of: MPIntervalContext, a: ivmpf) -> ivmpf:
    if a.b < 0:
        raise NoValue("log")
    if not a.a > 0:
        raise NoBounds("log")
    return of.log(a)


def _sign(of: MPIntervalContext, a: ivmpf) -> ivmpf:
    if 0 in a:
        raise NoBounds("sign")  # it jumps, and so does the slope of a modulus
    return of.mpf(1 if a.a > 0 else -1)


def _is_less(a: ivmpf, b: ivmpf) -> bool:
    if a.b >= b.a and b.b >= a.a:
        raise NoBounds("a switch")
    return bool(a.b < b.a)


def _power(of: MPIntervalContext, a: ivmpf, b: ivmpf) -> ivmpf:
    if b.a == b.b and float(b.a) == round(float(b.a)):
        exponent = int(float(b.a))
        if abs(exponent) > MOST_POWER:
            raise NoBounds("pow")
        return a**exponent if exponent >= 0 else _quotient(of, of.mpf(1), a**-exponent)
    return of.exp(b * _logarithm(of, a))


_RULES: dict[str, Callable[..., ivmpf]] = {
    "add": lambda of, a, b: a + b,
    "sub": lambda of, a, b: a - b,
    "mul": lambda of, a, b: a * b,
    "div": _quotient,
    "neg": lambda of, a: -a,
    "sq": lambda of, a: a**2,
    "twice": lambda of, a: 2 * a,
    "assign": lambda of, a: a,
    "inv": lambda of, a: _quotient(of, of.mpf(1), a),
    "pow": _power,
    "constpow": _power,
    "sqrt": _root,
    "log": _logarithm,
    "exp": lambda of, a: of.exp(a),
    "sin": lambda of, a: of.sin(a),
    "cos": lambda of, a: of.cos(a),
    "tan": lambda of, a: _quotient(of, of.sin(a), of.cos(a)),
    "sinh": lambda of, a: (of.exp(a) - of.exp(-a)) / 2,
    "cosh": lambda of, a: (of.exp(a) + of.exp(-a)) / 2,
    "tanh": lambda of, a: 1 - 2 / (of.exp(2 * a) + 1),
    "asin": lambda of, a: of.atan2(a, _root(of, 1 - a**2)),
    "acos": lambda of, a: of.atan2(_root(of, 1 - a**2), a),
    "atan": lambda of, a: of.atan2(a, of.mpf(1)),
    "atan2": lambda of, y, x: of.atan2(y, x),
    "fabs": lambda of, a: abs(a),
    "sign": _sign,
    **dict.fromkeys(("lt", "le"), lambda of, a, b: of.mpf(int(_is_less(a, b)))),
    "fmin": lambda of, a, b: a if _is_less(a, b) else b,
    "fmax": lambda of, a, b: b if _is_less(a, b) else a,
    "if_else_zero": lambda of, condition, value: condition * value,
}
