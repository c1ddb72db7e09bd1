"""One row of the table at a landed state, and the figures the account of a run is made of."""

from __future__ import annotations

import casadi as ca

from lagcli.compiled import parts as shared
from lagcli.compiled.parts import Parts
from lagcli.equations.system import System


def table(system: System, parts: Parts) -> ca.Function:
    """table(t, y, y', lambda, p) -> one row of the table without t, and the figures the account is made of."""
    model, dynamics, symbols = system.model, system.dynamics, system.symbols
    particles, n = system.r.numel() // 3, symbols.q.numel()
    first = n - len(model.generalized_names)
    moving = ca.vertcat(ca.reshape(system.r, 3, particles), ca.reshape(system.r_dot, 3, particles))
    generalized = ca.horzcat(symbols.q[first:], symbols.v[first:])
    values = [ca.vec(moving), ca.vec(generalized.T), system.lam, system.R, system.Q_R[first:]]
    values += [dynamics.energy, system.outputs]
    account = ca.vertcat(
        shared.position_residual(parts),
        shared.velocity_residual(parts),
        dynamics.jacobi,
        dynamics.rest,
    )
    rate = ca.vertcat(ca.SX.sym("v", n), system.a, ca.SX.sym("power"))
    inputs = [symbols.t, parts.y, rate, system.lam, parts.p]
    options = {"cse": parts.is_small}
    return ca.Function("table", inputs, [ca.densify(ca.vertcat(*values)), ca.densify(account)], options)
