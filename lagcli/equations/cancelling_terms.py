"""Sizes of the terms that a value is made of: where they cancel, its rounding is a part of them and not of it.

A running error analysis in units of rounding (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section
3.3): of a sum the sizes of its parts, of a product and a quotient what those of its factors make of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

from lagcli.equations import operation_graph

# A value and the size of its terms.
Sized = tuple[ca.SX, ca.SX]
# A divisor of zero leaves no size.
TINY = 1e-300


def term_sizes(value: ca.SX, inputs: Sequence[ca.SX]) -> ca.SX:
    """The sizes of the terms of a column (k, 1) of the `inputs`, (k, 1), no smaller than its absolute values."""
    return _sizes(value, inputs, ca.fabs)


def roundings(value: ca.SX, inputs: Sequence[ca.SX]) -> ca.SX:
    """By how many units of rounding a column (k, 1) of the `inputs` may be off, (k, 1), where these are exact."""
    return _sizes(value, inputs, lambda x: ca.SX(0))


def _sizes(value: ca.SX, inputs: Sequence[ca.SX], of_leaf: Callable[[ca.SX], ca.SX]) -> ca.SX:
    symbols = [each for part in inputs if part.numel() for each in ca.vertsplit(ca.vec(part))]

    def leaf(number: int | None, constant: float) -> Sized:
        x = ca.SX(constant) if number is None else symbols[number]
        return x, of_leaf(x)

    def look(op: int, parts: list[Sized], expression: operation_graph.Expression) -> Sized:
        made, rule = expression(), _RULES.get(op)
        size = ca.fabs(made)
        return made, size if rule is None else ca.fmax(size, rule(made, *parts))

    found = operation_graph.folded(value, symbols, leaf, look)
    return ca.vertcat(ca.SX(0, 1), *(size for _, size in found))


def _sum(_: ca.SX, a: Sized, b: Sized) -> ca.SX:
    return a[1] + b[1]


def _product(_: ca.SX, a: Sized, b: Sized) -> ca.SX:
    return ca.fmax(ca.fabs(a[0]) * b[1], a[1] * ca.fabs(b[0]))


def _quotient(made: ca.SX, a: Sized, b: Sized) -> ca.SX:
    return (a[1] + ca.fabs(made) * b[1]) / (ca.fabs(b[0]) + TINY)


def _wave(_: ca.SX, a: Sized) -> ca.SX:
    # An argument that is large has roundings that are.
    return ca.fmin(a[1], 1)


_RULES: dict[int, Callable[..., ca.SX]] = {
    ca.OP_ADD: _sum,
    ca.OP_SUB: _sum,
    ca.OP_MUL: _product,
    ca.OP_DIV: _quotient,
    ca.OP_NEG: lambda _, a: a[1],
    ca.OP_FABS: lambda _, a: a[1],
    ca.OP_TWICE: lambda _, a: 2 * a[1],
    ca.OP_SQ: lambda _, a: ca.fabs(a[0]) * a[1],
    ca.OP_INV: lambda made, a: made * made * a[1],
    ca.OP_SQRT: lambda made, a: ca.fmin(a[1] / (made + TINY), ca.sqrt(a[1])),
    ca.OP_SIN: _wave,
    ca.OP_COS: lambda _, a: ca.fmin(a[1], 1) * ca.fmin(a[1], 1),
    ca.OP_TAN: lambda made, a: (1 + made * made) * ca.fmin(a[1], 1),
}
