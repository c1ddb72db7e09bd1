"""Columns of a table that are finite wherever the motion is: nobody has to look at each row to know."""

from __future__ import annotations

import math
from typing import NamedTuple

import casadi as ca

from lagcli.equations import operation_graph
from lagcli.equations.operation_graph import Expression
from lagcli.equations.system import System

# Operations that make finite numbers of finite ones, but for overflow; those that make no negative ones.
TOTAL = frozenset(
    {
        ca.OP_ASSIGN, ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_NEG, ca.OP_TWICE, ca.OP_SQ, ca.OP_SIN, ca.OP_COS,
        ca.OP_ATAN, ca.OP_TANH, ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX, ca.OP_SIGN,
    }
)  # fmt: skip
SQUARES = frozenset({ca.OP_SQ, ca.OP_FABS, ca.OP_SQRT})
# Those that make no negative numbers of such.
KEEPING = frozenset({ca.OP_ASSIGN, ca.OP_ADD, ca.OP_MUL, ca.OP_TWICE, ca.OP_FMIN, ca.OP_FMAX})


class _Found(NamedTuple):
    """is_total: finite where the state is; is_fixed: of parameters alone, and so the same in all rows; is_positive:
    nowhere negative."""

    is_total: bool
    is_fixed: bool
    is_positive: bool = False


def are_all(system: System) -> bool:
    """True where energies and outputs are finite at any state, with any accelerations and multipliers.

    The other columns are finite where a step is: they are made of what steps are made of.
    """
    symbols = system.symbols
    value = ca.vertcat(ca.densify(system.dynamics.energy), ca.densify(system.outputs))
    inputs = [system.p, symbols.t, symbols.q, symbols.v, system.a, system.lam]
    return all(each.is_total for each in operation_graph.folded(value, inputs, _leaf, _look))


def _leaf(number: int | None, constant: float) -> _Found:
    if number is None:
        return _Found(math.isfinite(constant), True, constant >= 0)
    return _Found(True, number == 0)


def _look(op: int, parts: list[_Found], _: Expression) -> _Found:
    is_fixed = all(part.is_fixed for part in parts)
    is_known = op in TOTAL or is_fixed
    if op == ca.OP_DIV:
        is_known = parts[1].is_fixed
    elif op == ca.OP_SQRT:
        is_known = is_fixed or parts[0].is_positive
    is_positive = op in SQUARES or (op in KEEPING and all(part.is_positive for part in parts))
    return _Found(is_known and all(part.is_total for part in parts), is_fixed, is_positive)
