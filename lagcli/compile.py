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
    land(t, y, p) -> y on f = 0 and B v + b = 0, y' there, and an outcome of two: the residual (largest
                     |f_i| / |B_i| over the largest |q|) and the sum of y', finite only where all of y' is
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
    parts = _parts(system)
    t, q, v, p = system.symbols.t, system.symbols.q, system.symbols.v, system.p
    y = ca.vertcat(q, v, ca.SX.sym("W"))
    inputs = [t, y, p]
    size, parameters = y.numel(), p.numel()
    rhs = ca.Function("rhs", inputs, [_derivative(parts)])
    position = ca.Function("position", inputs, [_position_step(parts, y)])
    landing = ca.Function("landing", inputs, _landing(parts, y))
    table = _table(system, parts, y)
    s = parts.f.numel()
    return NumericSystem(
        n=q.numel(),
        rhs=rhs,
        land=_land(position, landing, size, parameters),
        record=_record(position, landing, table, size, parameters),
        whole=ca.Function("whole", [t, q, p], [parts.f, parts.B[:s, :]]),
        rows=ca.Function("rows", [t, q, v, p], [parts.B, parts.b]),
        inertia=ca.Function("inertia", [t, q, v, p], [parts.M]),
        force=ca.Function("force", [t, q, v, p], [parts.h, parts.gamma]),
    )


@dataclasses.dataclass(frozen=True, slots=True)
class _Parts:
    """The expressions of (D.24) with their common subexpressions shared, and the reaction B^T lambda."""

    v: Any
    f: Any
    B: Any
    b: Any
    gamma: Any
    M: Any
    h: Any
    power: Any
    reaction: Callable[[Any], Any]


def _parts(system: System) -> _Parts:
    rows, dynamics = system.rows, system.dynamics
    # Shared here, before the factorizations, which are large and have nothing left to share.
    f, B, b, gamma, M, h, power, Q_R = ca.cse(
        [rows.f, rows.B, rows.b, rows.gamma, dynamics.M, dynamics.h, dynamics.power, system.Q_R]
    )
    return _Parts(
        system.symbols.v, f, B, b, gamma, M, h, power, lambda lam: ca.substitute(Q_R, system.lam, lam)
    )  # fmt: skip


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


@dataclasses.dataclass(frozen=True, slots=True)
class _Factors:
    """The solvers of M and of S = B M^-1 B^T."""

    inertia: Solve
    schur: Solve


def _factors(M: Any, B: Any) -> _Factors:
    solve_M = _solver(M)
    return _Factors(solve_M, _solver(B @ solve_M(B.T)))


def _acceleration(parts: _Parts, factors: _Factors) -> tuple[Any, Any]:
    """a and lambda of (D.24)."""
    free = factors.inertia(parts.h)
    if parts.B.shape[0] == 0:
        return free, ca.SX(0, 1)
    lam = ca.densify(factors.schur(parts.gamma - parts.B @ free))
    return factors.inertia(parts.h + parts.reaction(lam)), lam


def _state_rate(parts: _Parts, a: Any, lam: Any) -> Any:
    """y' = (v, a, power - lambda . b)."""
    return ca.densify(ca.vertcat(parts.v, a, parts.power - ca.dot(lam, parts.b)))


def _derivative(parts: _Parts) -> Any:
    return _state_rate(parts, *_acceleration(parts, _factors(parts.M, parts.B)))


def _position_step(parts: _Parts, y: Any) -> Any:
    """One Newton step onto f = 0 along M^-1 B^T: the nearest point in the mass-weighted norm."""
    s, n = parts.f.numel(), parts.v.numel()
    if s == 0:
        return y
    B = parts.B[:s, :]
    factors = _factors(parts.M, B)
    q = y[:n] - factors.inertia(B.T @ factors.schur(parts.f))
    return ca.densify(ca.vertcat(q, y[n:]))


def _landing(parts: _Parts, y: Any) -> list[Any]:
    """y with the velocity projected onto B v + b = 0, y' and lambda there, and the position residual.

    One factorization serves all, unless M depends on the velocity that is projected.
    """
    n = parts.v.numel()
    factors = _factors(parts.M, parts.B)
    v = parts.v
    if parts.B.shape[0]:
        v = v - factors.inertia(parts.B.T @ factors.schur(parts.B @ v + parts.b))
    v = ca.densify(v)
    h, gamma, power = ca.substitute([parts.h, parts.gamma, parts.power], [parts.v], [v])
    there = dataclasses.replace(parts, v=v, h=h, gamma=gamma, power=power)
    if ca.depends_on(parts.M, parts.v):
        M = ca.substitute(parts.M, parts.v, v)
        there, factors = dataclasses.replace(there, M=M), _factors(M, parts.B)
    a, lam = _acceleration(there, factors)
    rate = _state_rate(there, a, lam)
    return [ca.densify(ca.vertcat(y[:n], v, y[2 * n])), rate, lam, _residual(parts, y[:n])]


def _row_norms(B: Any) -> Any:
    return ca.sqrt(ca.sum2(B * B)) + TINY


def _residual(parts: _Parts, q: Any) -> Any:
    """Largest |f_i| / |B_i|, a length where q are lengths."""
    f = parts.f
    if f.numel() == 0:
        return ca.SX(0)
    return ca.mmax(ca.fabs(f) / _row_norms(parts.B[: f.numel(), :]))


def _velocity_residual(parts: _Parts) -> Any:
    if parts.B.shape[0] == 0:
        return ca.SX(0)
    return ca.mmax(ca.fabs(parts.B @ parts.v + parts.b) / _row_norms(parts.B))


def _table(system: System, parts: _Parts, y: Any) -> Any:
    """table(t, y, y', lambda, p) -> one row of the table without t, and the figures the account is made of."""
    model, dynamics, symbols = system.model, system.dynamics, system.symbols
    values = []
    for k in range(len(model.particles)):
        values += [system.r[3 * k : 3 * k + 3], system.r_dot[3 * k : 3 * k + 3]]
    n = symbols.q.numel()
    first = n - len(model.coordinates)
    for j in range(len(model.coordinates)):
        values += [symbols.q[first + j], symbols.v[first + j]]
    values += [system.lam, system.R, system.Q_R[first:], dynamics.energy, system.outputs]
    account = ca.vertcat(
        _residual(parts, symbols.q),
        _velocity_residual(parts),
        dynamics.jacobi,
        dynamics.kinetic,
        dynamics.potential,
    )
    rate = ca.SX.sym("rate", y.numel())
    row, account = ca.substitute(
        [ca.densify(ca.vertcat(*values)), ca.densify(account)], [system.a], [rate[n : 2 * n]]
    )
    return ca.Function("table", [symbols.t, y, rate, system.lam, system.p], [row, account], {"cse": True})


def _projected(position: Any, t: Any, y: Any, p: Any) -> Any:
    for _ in range(NEWTON_STEPS):
        y = position(t, y, p)
    return y


def _land(position: Any, landing: Any, size: int, parameters: int) -> Any:
    t, y, p = ca.MX.sym("t"), ca.MX.sym("y", size), ca.MX.sym("p", parameters)
    landed, rate, _, residual = landing(t, _projected(position, t, y, p), p)
    outcome = ca.vertcat(residual / (ca.norm_inf(landed[: size // 2]) + TINY), ca.sum1(rate))
    return ca.Function("land", [t, y, p], [landed, rate, outcome])


def _record(position: Any, landing: Any, table: Any, size: int, parameters: int) -> Any:
    t, y, p = ca.MX.sym("t"), ca.MX.sym("y", size), ca.MX.sym("p", parameters)
    landed, rate, lam, _ = landing(t, _projected(position, t, y, p), p)
    row, account = table(t, landed, rate, lam, p)
    return ca.Function("record", [t, y, p], [landed, row, account])
