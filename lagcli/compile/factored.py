"""The functions of a system with S factored numerically at each call: for systems whose expanded factors would be
too large to build.

Each function is a short chain: an expanded part that gives S and a right-hand side, a solve node, an expanded
part that uses the solution.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from lagcli.compile import parts as shared
from lagcli.compile import solving
from lagcli.compile.parts import Parts

SOLVER = "ldl"


def rhs(parts: Parts) -> Any:
    """rhs(t, y, p) -> y'."""
    inputs = _inputs(parts)
    rate, _ = _acceleration(parts)(*inputs)
    return ca.Function("rhs", inputs, [rate])


def position(parts: Parts) -> Any:
    """position(t, y, p) -> y after one Newton step onto f = 0 along M^-1 B^T."""
    y, n, s = parts.y, parts.v.numel(), parts.f.numel()
    if s == 0:
        return ca.Function("position", parts.inputs, [y])
    B = parts.B_whole
    solve_M = solving.solver(parts.M)
    mu = ca.SX.sym("mu", s)
    before = ca.Function("before", parts.inputs, [B @ solve_M(B.T), parts.f])
    moved = ca.densify(ca.vertcat(y[:n] - solve_M(B.T @ mu), y[n:]))
    after = ca.Function("after", [*parts.inputs, mu], [moved])
    inputs = _inputs(parts)
    return ca.Function("position", inputs, [after(*inputs, _solved(before, inputs))])


def landing(parts: Parts) -> Any:
    """landing(t, y, p) -> y with velocity on B v + b = 0, y' and lambda there, and the residual of f."""
    y, v, n = parts.y, parts.v, parts.v.numel()
    solve_M = solving.solver(parts.M)
    mu = ca.SX.sym("mu", parts.B.shape[0])
    S = parts.B @ solve_M(parts.B.T)
    before = ca.Function("before", parts.inputs, [S, ca.densify(parts.B @ v + parts.b)])
    landed = ca.densify(ca.vertcat(y[:n], v - solve_M(parts.B.T @ mu), y[2 * n]))
    after = ca.Function("after", [*parts.inputs, mu], [landed])
    residual = ca.Function("residual", parts.inputs, [shared.position_residual(parts)])
    t, state, p = inputs = _inputs(parts)
    there = after(*inputs, _solved(before, inputs))
    rate, lam = _acceleration(parts)(t, there, p)
    return ca.Function("landing", inputs, [there, rate, lam, residual(t, state, p)])


def _inputs(parts: Parts) -> list[Any]:
    return [ca.MX.sym(name, symbol.numel()) for name, symbol in zip("typ", parts.inputs, strict=True)]


def _acceleration(parts: Parts) -> Any:
    """(t, y, p) -> y' and lambda of (D.24)."""
    solve_M = solving.solver(parts.M)
    free = solve_M(parts.h)
    S = parts.B @ solve_M(parts.B.T)
    before = ca.Function("before", parts.inputs, [S, ca.densify(parts.gamma - parts.B @ free)])
    lam = ca.SX.sym("lam", parts.B.shape[0])
    a = solve_M(parts.h + parts.reaction(lam))
    after = ca.Function("after", [*parts.inputs, lam], [shared.state_rate(parts, a, lam)])
    inputs = _inputs(parts)
    found = _solved(before, inputs)
    return ca.Function("acceleration", inputs, [after(*inputs, found), found])


def _solved(before: Any, inputs: list[Any]) -> Any:
    """The solution x of S x = r for the pair (S, r) that `before` gives."""
    S, r = before(*inputs)
    return ca.solve(S, r, SOLVER)
