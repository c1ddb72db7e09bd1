"""The functions in a row that may jump, end or have a pole."""

from __future__ import annotations

import casadi as ca

from lagcli.equations import operation_graph
from lagcli.equations.system import System

QUOTIENT = "a quotient"
CALLS = {
    ca.OP_ATAN2: "atan2",
    ca.OP_ATAN: "atan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_FABS: "abs",
    ca.OP_SIGN: "sign",
    ca.OP_FMIN: "min",
    ca.OP_FMAX: "max",
    ca.OP_SQRT: "sqrt",
    ca.OP_LOG: "log",
    ca.OP_TAN: "tan",
    ca.OP_POW: "**",
    ca.OP_CONSTPOW: "**",
    ca.OP_DIV: QUOTIENT,
    ca.OP_INV: QUOTIENT,
}


def of_row(system: System, row: int) -> tuple[list[str], ca.Function]:
    """Names of K calls in a row, inner ones first; (t, q, v, p) -> their values, and rates at constant v (2 K,)."""
    s, whole = system.symbols, row < system.holonomic_count
    value = system.rows.f[row] if whole else system.rows.B[row, :] @ s.v + system.rows.b[row]
    names: list[str] = []
    nodes: list[ca.SX] = []

    def visit(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        if op in CALLS:
            names.append(CALLS[op])
            nodes.append(result)
        return result

    inputs = [s.t, s.q, s.v, system.p]
    operation_graph.replayed(ca.densify(value), inputs, visit)
    column, way = ca.vertcat(ca.SX(0, 1), *nodes), ca.vertcat(s.t, s.q)
    rate = ca.jtimes(column, way, ca.vertcat(1, s.v))
    return names, ca.Function("calls", inputs, [ca.densify(ca.vertcat(column, rate))])
