"""System -> numeric functions: the only staircase from symbols to numbers.

Everything the integrator and the counter need is a CasADi function of (t, state, parameters), so that another
value of a parameter costs no build. The state is y = (q, v, W), shape (2n + 1,), with W the work of all that
may change the Jacobi energy; it certifies the run and does not steer it.

lambda at an instant, from (D.24) with the rows differentiated once:

    S lambda = gamma - B M^-1 h,    S = B M^-1 B^T,    a = M^-1 (h + B^T lambda)

S and M are factored as L D L^T with their sparsity: S by expanded graphs while those are small.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import casadi as ca

from lagcli.compile import expanded, factored, solving, table
from lagcli.compile import parts as shared
from lagcli.mechanics.system import System

# Newton steps of the position projection: the state comes from a step or an interpolation whose error is small,
# so that two quadratic steps reach rounding.
NEWTON_STEPS = 2

# Up to this many multiplications the factorization of S is written out in the graph. Beyond, the graph takes
# longer to build than a run takes, and a numeric factorization is no slower.
EXPANDED_OPERATIONS = 3e5


@dataclasses.dataclass(frozen=True, slots=True)
class NumericSystem:
    """Compiled functions of one system.

    rhs(t, y, p) -> y'                              (2n + 1,)
    position(t, y, p) -> y on f = 0                 one mass-weighted Newton step
    land(t, y, p) -> y on f = 0 and B v + b = 0, y' there, and an outcome of two: the residual (largest
                     |f_i| / |B_i| over the largest |q|) and the sum of y', finite only where all of y' is
    record(t, y, p) -> y projected, one row of the table without t, and (position drift, velocity drift,
                       Jacobi energy, its part without velocities)
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


def compile_system(system: System) -> NumericSystem:
    """All functions of a system."""
    parts = shared.parts(system)
    is_small = solving.operations(parts.M, parts.B) <= EXPANDED_OPERATIONS
    way = expanded if is_small else factored
    position, landing = way.position(parts), way.landing(parts)
    t, q, v, p = system.symbols.t, system.symbols.q, system.symbols.v, system.p
    return NumericSystem(
        n=q.numel(),
        rhs=way.rhs(parts),
        land=_land(position, landing),
        record=_record(position, landing, table.table(system, parts)),
        whole=ca.Function("whole", [t, q, p], [parts.f, parts.B_whole]),
        rows=ca.Function("rows", [t, q, v, p], [parts.B, parts.b]),
        inertia=ca.Function("inertia", [t, q, v, p], [parts.M]),
        force=ca.Function("force", [t, q, v, p], [parts.h, parts.gamma]),
    )


def _inputs(function: Any) -> list[Any]:
    return [ca.MX.sym(name, function.size1_in(i)) for i, name in enumerate("typ")]


def _projected(position: Any, t: Any, y: Any, p: Any) -> Any:
    for _ in range(NEWTON_STEPS):
        y = position(t, y, p)
    return y


def _land(position: Any, landing: Any) -> Any:
    t, y, p = inputs = _inputs(landing)
    landed, rate, _, residual = landing(t, _projected(position, t, y, p), p)
    outcome = ca.vertcat(residual / (ca.norm_inf(landed[: y.numel() // 2]) + shared.TINY), ca.sum1(rate))
    return ca.Function("land", inputs, [landed, rate, ca.densify(outcome)])


def _record(position: Any, landing: Any, row_of: Any) -> Any:
    t, y, p = inputs = _inputs(landing)
    landed, rate, lam, _ = landing(t, _projected(position, t, y, p), p)
    row, account = row_of(t, landed, rate, lam, p)
    return ca.Function("record", inputs, [landed, row, account])
