"""System -> numeric functions: the only staircase from symbols to numbers.

Everything the integrator and the counter need is a CasADi function of (t, state, parameters), so that another
value of a parameter costs no build. The state is y = (q, v, W), shape (2n + 1,), with W the work of all that
may change the Jacobi energy; it certifies the run and does not steer it.

lambda at an instant, from (D.24) with the rows differentiated once:

    S lambda = gamma - B M^-1 h,    S = B M^-1 B^T,    a = M^-1 (h + B^T lambda)

S and M are factored as L D L^T by expanded graphs that use their sparsity.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import casadi as ca

from lagcli.mechanics.system import System

OPTIONS = {"cse": True}

# Newton steps of the position projection: the state comes from a step or an interpolation whose error is small,
# so that two quadratic steps reach rounding.
NEWTON_STEPS = 2

# Below this a norm is taken as zero where it divides; B has no row without entries.
TINY = 1e-300


@dataclasses.dataclass(frozen=True, slots=True)
class NumericSystem:
    """Compiled functions of one system.

    rhs(t, y, p) -> y'                              (2n + 1,)
    position(t, y, p) -> y on f = 0                 one mass-weighted Newton step
    land(t, y, p) -> y on f = 0 and B v + b = 0, y' there, residual (largest |f_i| / |B_i|)
    record(t, y, p) -> y projected, one row of the table without t, and (position drift, velocity drift,
                       Jacobi energy, T, V)
    whole(t, q, p) -> f (s,), B of the holonomic rows (s, n)
    rows(t, q, v, p) -> B (C, n), b (C,)
    inertia(t, q, v, p) -> M (n, n)
    force(t, q, v, p) -> h (n,), gamma (C,)
    """

    n: int
    rhs: Any
    land: Any
    record: Any
    whole: Any
    rows: Any
    inertia: Any
    force: Any


Solve = Callable[[Any], Any]


def compile_system(system: System) -> NumericSystem:
    """All functions of a system."""
    t, q, v, p = system.symbols.t, system.symbols.q, system.symbols.v, system.p
    W = ca.SX.sym("W")
    y = ca.vertcat(q, v, W)
    inputs = [t, y, p]
    rhs = ca.Function("rhs", inputs, [_derivative(system)], OPTIONS)
    position = ca.Function("position", inputs, [_position_step(system, y)], OPTIONS)
    landing = ca.Function("landing", inputs, _landing(system, y), OPTIONS)
    table = ca.Function("table", inputs, _table(system), OPTIONS)
    B, f = system.rows.B, system.rows.f
    s = system.holonomic_count
    return NumericSystem(
        n=q.numel(),
        rhs=rhs,
        land=_land(position, landing, y.numel(), p.numel()),
        record=_record(position, landing, table, y.numel(), p.numel()),
        whole=ca.Function("whole", [t, q, p], [f, B[:s, :]]),
        rows=ca.Function("rows", [t, q, v, p], [B, system.rows.b]),
        inertia=ca.Function("inertia", [t, q, v, p], [system.dynamics.M]),
        force=ca.Function("force", [t, q, v, p], [system.dynamics.h, system.rows.gamma]),
    )


def _solver(matrix: Any) -> Solve:
    """x -> matrix^-1 x for a symmetric positive definite matrix, by its sparse factors."""
    n = matrix.shape[0]
    if n == 0:
        return lambda right: right
    if matrix.sparsity().is_diag():
        diagonal = ca.diag(matrix)
        return lambda right: right / ca.repmat(diagonal, 1, right.shape[1])
    D, LT, order = ca.ldl(matrix)
    return lambda right: ca.ldl_solve(right, D, LT, order)


def _schur(B: Any, solve_M: Solve) -> Solve:
    """The solver of S = B M^-1 B^T."""
    return _solver(B @ solve_M(B.T))


def _derivative(system: System) -> Any:
    """y' = (v, a, power - lambda . b)."""
    a, lam = _acceleration(system, _solver(system.dynamics.M))
    return _state_rate(system, a, lam)


def _state_rate(system: System, a: Any, lam: Any) -> Any:
    power = system.dynamics.power - ca.dot(lam, system.rows.b)
    return ca.densify(ca.vertcat(system.symbols.v, a, power))


def _acceleration(system: System, solve_M: Solve, solve_S: Solve | None = None) -> tuple[Any, Any]:
    """a and lambda of (D.24)."""
    rows, h = system.rows, system.dynamics.h
    if solve_S is None:
        solve_S = _schur(rows.B, solve_M)
    free = solve_M(h)
    lam = solve_S(rows.gamma - rows.B @ free)
    a = solve_M(h + ca.substitute(system.Q_R, system.lam, lam)) if rows.B.shape[0] else free
    return a, ca.densify(lam)


def _position_step(system: System, y: Any) -> Any:
    """One Newton step onto f = 0 along M^-1 B^T: the nearest point in the mass-weighted norm."""
    f = system.rows.f
    if f.numel() == 0:
        return y
    B = system.rows.B[: system.holonomic_count, :]
    solve_M = _solver(system.dynamics.M)
    q = system.symbols.q - solve_M(B.T @ _schur(B, solve_M)(f))
    return ca.densify(ca.vertcat(q, y[q.numel() :]))


def _landing(system: System, y: Any) -> list[Any]:
    """Velocity projected onto B v + b = 0, y' there, and the position residual; one factorization for all."""
    rows, v = system.rows, system.symbols.v
    solve_M = _solver(system.dynamics.M)
    solve_S = _schur(rows.B, solve_M)
    n = v.numel()
    landed = v
    if rows.B.shape[0]:
        landed = v - solve_M(rows.B.T @ solve_S(rows.B @ v + rows.b))
    a, lam = _acceleration(system, solve_M, solve_S)
    rate = _state_rate(system, a, lam)
    new_v = ca.densify(landed)
    # a and lambda are taken at the projected velocity; B and S do not depend on v.
    rate = ca.substitute(rate, v, new_v)
    return [ca.densify(ca.vertcat(y[:n], new_v, y[2 * n])), rate, _residual(system)]


def _row_norms(B: Any) -> Any:
    return ca.sqrt(ca.sum2(B * B)) + TINY


def _residual(system: System) -> Any:
    """Largest |f_i| / |B_i|: a length where q are lengths."""
    f = system.rows.f
    if f.numel() == 0:
        return ca.SX(0)
    return ca.mmax(ca.fabs(f) / _row_norms(system.rows.B[: f.numel(), :]))


def _velocity_residual(system: System) -> Any:
    rows = system.rows
    if rows.B.shape[0] == 0:
        return ca.SX(0)
    return ca.mmax(ca.fabs(rows.B @ system.symbols.v + rows.b) / _row_norms(rows.B))


def _table(system: System) -> list[Any]:
    """One row of the table without t, and the figures the account is made of."""
    a, lam = _acceleration(system, _solver(system.dynamics.M))
    model, dynamics = system.model, system.dynamics
    parts = []
    for k in range(len(model.particles)):
        parts += [system.r[3 * k : 3 * k + 3], system.r_dot[3 * k : 3 * k + 3]]
    first = system.symbols.q.numel() - len(model.coordinates)
    for j in range(len(model.coordinates)):
        parts += [system.symbols.q[first + j], system.symbols.v[first + j]]
    parts += [system.lam, system.R, system.Q_R[first:], dynamics.energy, system.outputs]
    row = ca.substitute([ca.densify(ca.vertcat(*parts))], [system.lam, system.a], [lam, ca.densify(a)])[0]
    account = ca.vertcat(
        _residual(system), _velocity_residual(system), dynamics.jacobi, dynamics.kinetic, dynamics.potential
    )
    return [row, ca.densify(account)]


def _projected(position: Any, t: Any, y: Any, p: Any) -> Any:
    for _ in range(NEWTON_STEPS):
        y = position(t, y, p)
    return y


def _land(position: Any, landing: Any, size: int, parameters: int) -> Any:
    t, y, p = ca.MX.sym("t"), ca.MX.sym("y", size), ca.MX.sym("p", parameters)
    return ca.Function("land", [t, y, p], list(landing(t, _projected(position, t, y, p), p)))


def _record(position: Any, landing: Any, table: Any, size: int, parameters: int) -> Any:
    t, y, p = ca.MX.sym("t"), ca.MX.sym("y", size), ca.MX.sym("p", parameters)
    landed = landing(t, _projected(position, t, y, p), p)[0]
    row, account = table(t, landed, p)
    return ca.Function("record", [t, y, p], [landed, row, account])
