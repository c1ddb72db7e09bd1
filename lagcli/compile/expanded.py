"""The functions of a system with their factorizations expanded into the graph: the fastest way while S is small."""

from __future__ import annotations

import dataclasses
from typing import Any

import casadi as ca

from lagcli.compile import parts as shared
from lagcli.compile import solving
from lagcli.compile.parts import Parts
from lagcli.compile.solving import Factors


def rhs(parts: Parts) -> Any:
    """rhs(t, y, p) -> y'."""
    a, lam = _acceleration(parts, solving.factors(parts.M, parts.B))
    return ca.Function("rhs", parts.inputs, [shared.state_rate(parts, a, lam)])


def position(parts: Parts) -> Any:
    """position(t, y, p) -> y after one Newton step onto f = 0 along M^-1 B^T.

    That is towards the nearest point in the mass-weighted norm.
    """
    y, n = parts.y, parts.v.numel()
    if parts.f.numel() == 0:
        return ca.Function("position", parts.inputs, [y])
    B = parts.B_whole
    factors = solving.factors(parts.M, B)
    q = y[:n] - factors.inertia(B.T @ factors.schur(parts.f))
    return ca.Function("position", parts.inputs, [ca.densify(ca.vertcat(q, y[n:]))])


def landing(parts: Parts) -> Any:
    """landing(t, y, p) -> y with the velocity projected onto B v + b = 0, y' and lambda there, and the residual of f.

    One factorization serves all, unless M depends on the velocity that is projected.
    """
    y, v, n = parts.y, parts.v, parts.v.numel()
    factors = solving.factors(parts.M, parts.B)
    if parts.B.shape[0]:
        v = v - factors.inertia(parts.B.T @ factors.schur(parts.B @ v + parts.b))
    v = ca.densify(v)
    h, gamma, power = ca.substitute([parts.h, parts.gamma, parts.power], [parts.v], [v])
    there = dataclasses.replace(parts, v=v, h=h, gamma=gamma, power=power)
    if ca.depends_on(parts.M, parts.v):
        M = ca.substitute(parts.M, parts.v, v)
        there, factors = dataclasses.replace(there, M=M), solving.factors(M, parts.B)
    a, lam = _acceleration(there, factors)
    landed = ca.densify(ca.vertcat(y[:n], v, y[2 * n]))
    outputs = [landed, shared.state_rate(there, a, lam), lam, shared.position_residual(parts)]
    return ca.Function("landing", parts.inputs, outputs)


def _acceleration(parts: Parts, factors: Factors) -> tuple[Any, Any]:
    """a and lambda of (D.24)."""
    free = factors.inertia(parts.h)
    if parts.B.shape[0] == 0:
        return free, ca.SX(0, 1)
    lam = ca.densify(factors.schur(parts.gamma - parts.B @ free))
    return factors.inertia(parts.h + parts.reaction(lam)), lam
