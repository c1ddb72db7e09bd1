"""Power series of what expressions are along a motion: their Taylor coefficients, operation by operation, by the
recurrences of automatic differentiation (Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 13).

Beside each coefficient goes the size of its terms, for terms may cancel. A series that says nothing is empty. Where a
function switches, the branch is that of the time just after.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.smoothness import operation_graph


class PowerSeries(NamedTuple):
    """Coefficients c_0, c_1, ... of powers of the time from the instant on, and the sizes of their terms."""

    c: Floats
    size: Floats

    @property
    def known(self) -> int:
        """The number of coefficients."""
        return int(self.c.size)


def constant(value: float, count: int) -> PowerSeries:
    """A number, with so many coefficients."""
    c = np.zeros(count)
    c[:1] = value
    return PowerSeries(c, np.abs(c))


NOTHING = PowerSeries(np.zeros(0), np.zeros(0))


class UnderflowError(Exception):
    """A value is zero, or constant, because doubles end there."""


class SeriesFunction:
    """The power series of a function's results, from those of its arguments. is_strict: `UnderflowError` is raised for
    an operation with a result that varies and is below all doubles, or does not vary in doubles any more. has_switches:
    operations ask on which side of zero the first coefficients lie."""

    def __init__(self, function: ca.Function, is_strict: bool = False) -> None:
        self._is_strict = is_strict
        self._instructions = operation_graph.instructions(function)
        self._sizes = [function.nnz_out(i) for i in range(function.n_out())]
        self.has_switches = any(op in _SWITCHING for op, *_ in self._instructions)

    def at(
        self, arguments: Sequence[Sequence[PowerSeries]], count: int, rounding: float
    ) -> list[list[PowerSeries]]:
        """The series of all results, entry by entry, with up to `count` coefficients. rounding: coefficients that are
        this part of their terms are zero where a switch is decided. Raises `UnderflowError`."""
        work: dict[int, PowerSeries] = {}
        found = [[constant(0.0, count)] * size for size in self._sizes]
        with np.errstate(all="ignore"):
            for op, operands, result, value in self._instructions:
                if op == ca.OP_OUTPUT:
                    found[result[0]][result[1]] = work[operands[0]]
                elif op == ca.OP_INPUT:
                    work[result[0]] = arguments[operands[0]][operands[1]]
                elif op == ca.OP_CONST:
                    work[result[0]] = constant(value, count)
                else:
                    parts = [work[index] for index in operands]
                    made = _result(op, parts, count, rounding)
                    if self._is_strict and _is_lost(op, parts, made):
                        raise UnderflowError
                    work[result[0]] = made if np.isfinite(made.size).all() else NOTHING
        return found


def _result(op: int, parts: list[PowerSeries], count: int, rounding: float) -> PowerSeries:
    """An operation on series; one that is not known says nothing."""

    def side(u: PowerSeries) -> float:
        """The sign just after the instant: that of the first coefficient that is not zero."""
        leading = np.flatnonzero(np.abs(u.c) > rounding * u.size)
        return float(np.sign(u.c[leading[0]])) if leading.size else 0.0

    if op in (ca.OP_FABS, ca.OP_SIGN):
        sign = side(parts[0])
        return _scaled(parts[0], sign) if op == ca.OP_FABS else constant(sign, count)
    if op in (ca.OP_FMIN, ca.OP_FMAX):
        a, b = parts
        return a if side(_sum(a, b, -1.0)) * (1.0 if op == ca.OP_FMAX else -1.0) >= 0.0 else b
    if op in _COMPARED:
        return constant(float(_COMPARED[op](side(_sum(parts[0], parts[-1], -1.0)), 0.0)), count)
    if op in _LOGICAL:
        truths = [side(part) != 0.0 for part in parts]
        if op == ca.OP_IF_ELSE_ZERO:
            return parts[1] if truths[0] else constant(0.0, count)
        truth = not truths[0] if op == ca.OP_NOT else (all if op == ca.OP_AND else any)(truths)
        return constant(float(truth), count)
    rule = _RULES.get(op)
    return NOTHING if rule is None or not all(part.known for part in parts) else rule(*parts)


def _is_lost(op: int, parts: list[PowerSeries], made: PowerSeries) -> bool:
    """True if the result of an operation on series that vary has left the doubles."""
    if op not in _MULTIPLYING or not made.known or not any(part.c[1:].any() for part in parts):
        return False
    if op == ca.OP_TANH:
        return bool(1.0 - abs(made.c[0]) <= doubles.VALUE)
    of_none = op != ca.OP_EXP and any(part.c[0] == 0.0 for part in parts)
    return not of_none and bool(abs(made.c[0]) < doubles.LOST)


_MULTIPLYING = frozenset(
    {ca.OP_EXP, ca.OP_TANH, ca.OP_MUL, ca.OP_SQ, ca.OP_DIV, ca.OP_INV, ca.OP_POW, ca.OP_CONSTPOW}
)
_COMPARED: dict[int, Callable[[float, float], bool]] = {
    ca.OP_LT: operator.lt,
    ca.OP_LE: operator.le,
    ca.OP_EQ: operator.eq,
    ca.OP_NE: operator.ne,
}
_LOGICAL = (ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_IF_ELSE_ZERO)
_SWITCHING = frozenset({ca.OP_FABS, ca.OP_SIGN, ca.OP_FMIN, ca.OP_FMAX, *_LOGICAL, *_COMPARED})


def _sum(a: PowerSeries, b: PowerSeries, sign: float = 1.0) -> PowerSeries:
    n = min(a.known, b.known)
    return PowerSeries(a.c[:n] + sign * b.c[:n], a.size[:n] + b.size[:n])


def _scaled(a: PowerSeries, factor: float) -> PowerSeries:
    return PowerSeries(factor * a.c, abs(factor) * a.size)


def _shifted(a: PowerSeries, value: float) -> PowerSeries:
    return _sum(a, constant(value, a.known))


def product(a: PowerSeries, b: PowerSeries) -> PowerSeries:
    """a b. Each factor's rounding counts as often as the other: the square of what is nearly zero is exact."""
    n = min(a.known, b.known)
    if not n:
        return NOTHING
    c, sizes = a.c[:n], a.size[:n]
    size = np.convolve(np.abs(c), b.size[:n])[:n] + np.convolve(sizes, np.abs(b.c[:n]))[:n]
    return PowerSeries(np.convolve(c, b.c[:n])[:n], size)


def _quotient(a: PowerSeries, b: PowerSeries) -> PowerSeries:
    n = min(a.known, b.known)
    if not n or b.c[0] == 0.0:
        return NOTHING
    c, steep = _divided(a.c[:n], b.c[:n]), -np.abs(b.c[:n])
    steep[0] *= -1.0
    return PowerSeries(c, _divided(a.size[:n] + np.convolve(np.abs(c), b.size[:n])[:n], steep))


def _divided(a: Floats, b: Floats) -> Floats:
    """The coefficients (n,) of which the products with b (n,) are a (n,)."""
    c = np.zeros(a.size)
    for k in range(a.size):
        c[k] = (a[k] - c[:k] @ b[k:0:-1]) / b[0]
    return c


def _root(a: PowerSeries) -> PowerSeries:
    if not a.known or not a.c[0] > 0.0:
        return constant(0.0, a.known) if not a.size.any() else NOTHING
    c, size = np.zeros(a.known), np.zeros(a.known)
    c[0], size[0] = np.sqrt(a.c[0]), a.size[0] / np.sqrt(a.c[0])
    for k in range(1, a.known):
        inner, divisor = slice(1, k), 2 * float(c[0])
        c[k] = (a.c[k] - c[inner] @ c[inner][::-1]) / divisor
        size[k] = (a.size[k] + size[inner] @ size[inner][::-1] + abs(c[k]) * size[0]) / divisor
    return PowerSeries(c, size)


def _exponential(a: PowerSeries) -> PowerSeries:
    c, size = np.zeros(a.known), np.zeros(a.known)
    c[:1] = np.exp(a.c[:1])
    size[:1] = c[:1] * (1.0 + a.size[:1])
    for k in range(1, a.known):
        weights = np.arange(1, k + 1) / k
        slope, rounding = weights * a.c[1 : k + 1], weights * a.size[1 : k + 1]
        before, sizes = c[:k][::-1], size[:k][::-1]
        c[k], size[k] = slope @ before, np.abs(slope) @ sizes + rounding @ np.abs(before)
    return PowerSeries(c, size)


def _wave(a: PowerSeries, is_hyperbolic: bool = False) -> tuple[PowerSeries, PowerSeries]:
    """sin and cos, or sinh and cosh, of a series."""
    n = a.known
    if not n:
        return NOTHING, NOTHING
    # The sign is that of the second derivative.
    of, other, sign = (np.sinh, np.cosh, 1.0) if is_hyperbolic else (np.sin, np.cos, -1.0)
    c, size = np.zeros((2, n)), np.zeros((2, n))
    c[:, 0] = of(a.c[0]), other(a.c[0])
    if sign < 0:  # the rounding of a large angle is that of its size
        size[:, 0] = np.maximum(np.minimum(1.0, a.size[0]), a.size[0] * np.abs(c[::-1, 0]))
    else:
        size[:, 0] = np.abs(c[:, 0]) + a.size[0] * c[1, 0]
    size[1, 0] = max(size[1, 0], abs(c[1, 0]))
    for k in range(1, n):
        weights = np.arange(1, k + 1) / k
        u, sizes = weights * a.c[1 : k + 1], weights * a.size[1 : k + 1]
        c[:, k] = u @ c[1, :k][::-1], sign * (u @ c[0, :k][::-1])
        size[:, k] = sizes @ size[1, :k][::-1], sizes @ size[0, :k][::-1]
    return PowerSeries(c[0], size[0]), PowerSeries(c[1], size[1])


def _integral(rate: PowerSeries, value: float, argument: PowerSeries) -> PowerSeries:
    """The function with this value at the instant whose rate is `rate` times that of its argument."""
    n = argument.known
    if not n:
        return NOTHING
    steps = np.arange(1, n)
    own = PowerSeries(argument.c[1:] * steps, argument.size[1:] * steps)
    slope = product(rate, own) if n > 1 else NOTHING
    m = slope.known
    c = np.concatenate([[value], slope.c / steps[:m]])
    size = abs(value) + float(np.abs(rate.c[:1]).sum()) * argument.size[0]
    return PowerSeries(c, np.concatenate([[size], slope.size / steps[:m]]))


def _inverse(a: PowerSeries) -> PowerSeries:
    return _quotient(constant(1.0, a.known), a)


def _arc(a: PowerSeries, sign: float) -> PowerSeries:
    """asin with the sign 1, acos with -1."""
    under = _shifted(_scaled(product(a, a), -1.0), 1.0)
    value = np.arcsin(a.c[0]) if sign > 0 else np.arccos(a.c[0])
    return _integral(_scaled(_inverse(_root(under)), sign), float(value), a)


def _logarithm(a: PowerSeries) -> PowerSeries:
    if not a.c[0] > 0.0:
        return NOTHING
    return _integral(_inverse(a), float(np.log(a.c[0])), a)


def _power(a: PowerSeries, b: PowerSeries) -> PowerSeries:
    exponent = float(b.c[0])
    if not b.c[1:].any() and exponent == int(exponent):
        # By products: a logarithm of what is nearly zero would lose all digits.
        made, square, left = constant(1.0, a.known), a, abs(int(exponent))
        while left:
            made, left = product(made, square) if left % 2 else made, left // 2
            square = product(square, square) if left else square
        return made if exponent >= 0 else _inverse(made)
    return _exponential(product(_logarithm(a), b))


def _tanh(a: PowerSeries) -> PowerSeries:
    made = constant(float(np.tanh(a.c[0])), 1)
    for k in range(1, a.known):
        # Each turn knows one coefficient more of 1 - tanh^2.
        rate = _shifted(_scaled(product(made, made), -1.0), 1.0)
        made = _integral(rate, float(made.c[0]), PowerSeries(a.c[: k + 1], a.size[: k + 1]))
    return made


def _angle(y: PowerSeries, x: PowerSeries) -> PowerSeries:
    """atan2(y, x), of the turned quotient that has a divisor."""
    value = float(np.arctan2(y.c[0], x.c[0]))
    if abs(x.c[0]) >= abs(y.c[0]):
        a = _arctangent(_quotient(y, x))
    else:
        a = _scaled(_arctangent(_quotient(x, y)), -1)
    if not a.known:
        return NOTHING
    size = np.concatenate([a.size[:1] + abs(value), a.size[1:]])
    return PowerSeries(np.concatenate([[value], a.c[1:]]), size)


def _arctangent(a: PowerSeries) -> PowerSeries:
    if not a.known:
        return NOTHING
    return _integral(_inverse(_shifted(product(a, a), 1.0)), float(np.arctan(a.c[0])), a)


_RULES: dict[int, Callable[..., PowerSeries]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: _sum,
    ca.OP_SUB: lambda a, b: _sum(a, b, -1),
    ca.OP_NEG: lambda a: _scaled(a, -1),
    ca.OP_TWICE: lambda a: _scaled(a, 2),
    ca.OP_MUL: product,
    ca.OP_SQ: lambda a: product(a, a),
    ca.OP_DIV: _quotient,
    ca.OP_INV: _inverse,
    ca.OP_SQRT: _root,
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
    ca.OP_EXP: _exponential,
    ca.OP_LOG: _logarithm,
    ca.OP_SIN: lambda a: _wave(a)[0],
    ca.OP_COS: lambda a: _wave(a)[1],
    ca.OP_TAN: lambda a: _quotient(*_wave(a)),
    ca.OP_SINH: lambda a: _wave(a, is_hyperbolic=True)[0],
    ca.OP_COSH: lambda a: _wave(a, is_hyperbolic=True)[1],
    ca.OP_TANH: _tanh,
    ca.OP_ASIN: lambda a: _arc(a, 1),
    ca.OP_ACOS: lambda a: _arc(a, -1),
    ca.OP_ATAN: _arctangent,
    ca.OP_ATAN2: _angle,
}
