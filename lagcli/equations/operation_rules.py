"""Properties of a value that follow from its operations: the sizes of its terms, which may cancel; if it is finite
wherever the motion is; the functions in it that may jump, end or have a pole.

Where terms cancel the rounding of their sum is a part of them: a running error analysis (Higham, Accuracy and Stability
of Numerical Algorithms, 2nd ed., section 3.3).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca

from lagcli import doubles
from lagcli.equations.system import System
from lagcli.smoothness import operation_graph, switches
from lagcli.smoothness.operation_graph import Expression
from lagcli.smoothness.sized_function import SizedFunction

# A value and the size of its terms.
Sized = tuple[ca.SX, ca.SX]
# Operations that make finite numbers of finite ones, but for overflow; those that make no negative ones.
TOTAL = frozenset(
    {
        *(ca.OP_ASSIGN, ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_NEG, ca.OP_TWICE, ca.OP_SQ),
        *(code for code, row in operation_graph.FUNCTIONS.items() if row.is_total),
    }
)
SQUARES = frozenset({ca.OP_SQ, ca.OP_FABS, ca.OP_SQRT})
# Those that make no negative numbers of such.
KEEPING = frozenset({ca.OP_ASSIGN, ca.OP_ADD, ca.OP_MUL, ca.OP_TWICE, ca.OP_FMIN, ca.OP_FMAX})


def roundings(value: ca.SX, inputs: Sequence[ca.SX]) -> ca.SX:
    """By how many units of rounding a column (k, 1) of the `inputs` may be off, (k, 1), where these are exact."""
    return term_sizes(value, inputs, are_exact=True)


def term_sizes(value: ca.SX, inputs: Sequence[ca.SX], are_exact: bool = False) -> ca.SX:
    """The sizes of the terms of a column (k, 1) of the `inputs`, which have none where they are_exact, (k, 1)."""

    def leaf(number: int | None, value: float) -> Sized:
        x = ca.SX(value) if number is None else inputs[number][int(value)]
        return x, ca.SX(0) if are_exact else ca.fabs(x)

    def look(op: int, parts: list[Sized], expression: operation_graph.Expression) -> Sized:
        made, rule = expression(), _RULES.get(op)
        size = ca.fabs(made)
        return made, size if rule is None else ca.fmax(size, rule(made, *parts))

    found = operation_graph.folded(value, inputs, leaf, look)
    return ca.vertcat(ca.SX(0, 1), *(size for _, size in found))


def _product(_: ca.SX, a: Sized, b: Sized) -> ca.SX:
    # Of factors that are nothing but rounding it is the product of that.
    return ca.fmax(ca.fmax(ca.fabs(a[0]) * b[1], a[1] * ca.fabs(b[0])), 2**-53 * a[1] * b[1])


def _power(made: ca.SX, a: Sized, b: Sized) -> ca.SX:
    of_base = ca.fabs(made * b[0]) * a[1] / (ca.fabs(a[0]) + doubles.TINY)
    # Of a base that is nothing but rounding it is the power of that.
    return ca.fmax(of_base, ca.if_else(b[0] >= 1, (2**-53 * a[1]) ** b[0] * 2**53, 0))


_RULES: dict[int, Callable[..., ca.SX]] = {
    ca.OP_ADD: lambda _, a, b: a[1] + b[1],
    ca.OP_SUB: lambda _, a, b: a[1] + b[1],
    ca.OP_MUL: _product,
    ca.OP_DIV: lambda made, a, b: (a[1] + ca.fabs(made) * b[1]) / (ca.fabs(b[0]) + doubles.TINY),
    **dict.fromkeys((ca.OP_NEG, ca.OP_FABS), lambda _, a: a[1]),
    ca.OP_TWICE: lambda _, a: 2 * a[1],
    ca.OP_SQ: lambda made, a: _product(made, a, a),
    ca.OP_INV: lambda made, a: made * made * a[1],
    ca.OP_SQRT: lambda made, a: ca.fmin(a[1] / (made + doubles.TINY), ca.sqrt(a[1])),
    # An argument that is large has roundings that are.
    **dict.fromkeys((ca.OP_SIN, ca.OP_TANH), lambda _, a: ca.fmin(a[1], 1)),
    ca.OP_COS: lambda _, a: ca.fmin(a[1], 1) * ca.fmin(a[1], 1),
    ca.OP_TAN: lambda made, a: (1 + made * made) * ca.fmin(a[1], 1),
    ca.OP_EXP: lambda made, a: made * a[1],
    ca.OP_LOG: lambda _, a: a[1] / (ca.fabs(a[0]) + doubles.TINY),
    ca.OP_ATAN: lambda _, a: a[1] / (1 + a[0] * a[0]),
    ca.OP_POW: _power,
    ca.OP_CONSTPOW: _power,
    ca.OP_FMIN: lambda _, a, b: ca.if_else(a[0] <= b[0], a[1], b[1]),
    ca.OP_FMAX: lambda _, a, b: ca.if_else(a[0] >= b[0], a[1], b[1]),
    ca.OP_IF_ELSE_ZERO: lambda _, condition, a: ca.if_else(condition[0], a[1], 0),
}


class _Found(NamedTuple):
    """is_total: finite where the state is; is_fixed: of parameters alone; is_positive: nowhere negative."""

    is_total: bool
    is_fixed: bool
    is_positive: bool = False


def has_total_columns(system: System) -> bool:
    """True where energies and outputs are finite at any state, with any accelerations and multipliers. The other
    columns are finite where a step is: they are made of what steps are made of."""
    symbols = system.symbols
    value = ca.vertcat(ca.densify(system.dynamics.energy), ca.densify(system.outputs))
    inputs = [system.p, symbols.t, symbols.q, symbols.v, system.a, system.lam]

    def leaf(number: int | None, constant: float) -> _Found:
        if number is None:
            return _Found(math.isfinite(constant), True, constant >= 0)
        return _Found(True, number == 0)

    def look(op: int, parts: list[_Found], _: Expression) -> _Found:
        is_fixed = all(part.is_fixed for part in parts)
        is_known = op in TOTAL or is_fixed
        if op == ca.OP_DIV:
            is_known = parts[1].is_fixed
        elif op == ca.OP_SQRT:
            is_known = is_fixed or parts[0].is_positive
        is_positive = op in SQUARES or (op in KEEPING and all(part.is_positive for part in parts))
        return _Found(is_known and all(part.is_total for part in parts), is_fixed, is_positive)

    return all(each.is_total for each in operation_graph.folded(value, inputs, leaf, look))


def edge_calls(system: System, row: int) -> tuple[list[str], ca.Function]:
    """Names of K calls in a row, inner ones first; (t, q, v, p) -> their values, and rates at constant v (2 K,)."""
    s, is_holonomic = system.symbols, row < system.holonomic_count
    value = system.rows.f[row] if is_holonomic else system.rows.B[row, :] @ s.v + system.rows.b[row]
    inputs = [s.t, s.q, s.v, system.p]
    named = [each for each in switches.among(value, inputs) if each.kind.word]
    column, way = ca.vertcat(ca.SX(0, 1), *(each.value for each in named)), ca.vertcat(s.t, s.q)
    rate = ca.jtimes(column, way, ca.vertcat(1, s.v))
    words = [each.kind.word for each in named]
    return words, SizedFunction("calls", inputs, [ca.densify(ca.vertcat(column, rate))])
