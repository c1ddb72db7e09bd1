"""The numbers between which the result of an operation lies, whatever state and parameters are."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import casadi as ca

Bounds = tuple[float, float]

ANY: Bounds = (-math.inf, math.inf)
_RANGES: dict[int, Bounds] = {
    ca.OP_EXP: (0.0, math.inf),
    ca.OP_SQRT: (0.0, math.inf),
    ca.OP_COSH: (1.0, math.inf),
    ca.OP_SIN: (-1.0, 1.0),
    ca.OP_COS: (-1.0, 1.0),
    ca.OP_TANH: (-1.0, 1.0),
    ca.OP_SIGN: (-1.0, 1.0),
}


def of(op: int, parts: Sequence[Bounds]) -> Bounds:
    """The bounds of a result from those of its operands."""
    known = _RANGES.get(op)
    if known is not None:
        return known
    rule = _RULES.get(op)
    return ANY if rule is None else rule(*parts)


def is_one_sided(bounds: Bounds) -> bool:
    """True for what changes its sign nowhere, though it may touch zero."""
    return bounds[0] >= 0.0 or bounds[1] <= 0.0


def _plus(a: Bounds, b: Bounds) -> Bounds:
    return a[0] + b[0], a[1] + b[1]


def _minus(a: Bounds) -> Bounds:
    return -a[1], -a[0]


def _times(a: Bounds, b: Bounds) -> Bounds:
    # Bounds are infinite where there are none: nothing is infinite itself, and zero times it is zero.
    corners = [x * y if x and y else 0.0 for x in a for y in b]
    return min(corners), max(corners)


def _over(a: Bounds, b: Bounds) -> Bounds:
    if b[1] <= 0.0:
        a, b = _minus(a), _minus(b)
    if b[0] < 0.0:
        return ANY
    return _times(a, (1.0 / b[1] if b[1] else math.inf, 1.0 / b[0] if b[0] else math.inf))


def _size(a: Bounds) -> Bounds:
    low, high = sorted((abs(a[0]), abs(a[1])))
    return (low if is_one_sided(a) else 0.0), high


def _square(a: Bounds) -> Bounds:
    size = _size(a)
    return _times(size, size)


def _power(a: Bounds, b: Bounds) -> Bounds:
    is_even = b[0] == b[1] and b[0] % 2.0 == 0.0
    return (0.0, math.inf) if is_even or a[0] >= 0.0 else ANY


_RULES: dict[int, Callable[..., Bounds]] = {
    ca.OP_ADD: _plus,
    ca.OP_SUB: lambda a, b: _plus(a, _minus(b)),
    ca.OP_NEG: _minus,
    ca.OP_MUL: _times,
    ca.OP_TWICE: lambda a: _times((2.0, 2.0), a),
    ca.OP_DIV: _over,
    ca.OP_INV: lambda a: _over((1.0, 1.0), a),
    ca.OP_FABS: _size,
    ca.OP_SQ: _square,
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
    ca.OP_FMIN: lambda a, b: (min(a[0], b[0]), min(a[1], b[1])),
    ca.OP_FMAX: lambda a, b: (max(a[0], b[0]), max(a[1], b[1])),
}
