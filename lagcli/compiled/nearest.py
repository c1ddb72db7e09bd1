"""The nearest configuration in the mass-weighted norm, as an optimization problem for IPOPT.

minimize (q - q0)^T M (q - q0) / 2   subject to   f(q, t) = 0
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from lagcli.arrays import Flags, Floats
from lagcli.equations.system import System

OPTIONS: dict[str, bool | float | str] = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-10,
    "ipopt.max_iter": 1000,
    # Without a success the caller keeps the feasible point it began with.
    "error_on_fail": False,
    "show_eval_warnings": False,
    "calc_lam_p": False,
}

# Newton's matrix is not symmetric definite, and its rows differ in size.
SOLVER = "qr"


def unit(n: int) -> ca.DM:
    """The metric in which all coordinates weigh the same, (n, n)."""
    return ca.DM.eye(n)


def newton(H: ca.DM, B: ca.DM, gradient: Floats, f: Floats, free: Flags) -> Floats | None:
    """One Newton step (n,) for the conditions of a nearest point; None where their matrix is singular. H (n, n): M +
    sum of mu_i d2f_i/dq2; B (r, n) independent rows; gradient (n,): M (q - q0); f (r,); only `free` coordinates move.
    With the new mu: H step + B^T mu = -gradient, B step = -f."""
    among = np.flatnonzero(free).tolist()
    rows = B[:, among]
    matrix = ca.vertcat(ca.horzcat(H[among, among], rows.T), ca.horzcat(rows, ca.DM(f.size, f.size)))
    right = -np.concatenate([gradient[among], f])
    try:
        found = np.array(ca.solve(matrix, ca.DM(right), SOLVER)).ravel()
    except RuntimeError:  # what CasADi raises where the factorization fails
        return None
    if not np.isfinite(found).all():
        return None
    step = np.zeros(free.size)
    step[among] = found[: len(among)]
    return step


class Problem:
    """The problem of one system; `solve` it for all holonomic rows or some, from any point. pattern: of M."""

    def __init__(self, system: System, pattern: ca.Sparsity) -> None:
        s = system.symbols
        q0 = ca.SX.sym("q0", s.q.numel())
        entries = ca.SX.sym("M", pattern.nnz())
        M = ca.SX(pattern, entries)
        weights = ca.SX.sym("weights", system.holonomic_count)
        d = s.q - q0
        problem = {
            "x": s.q,
            "p": ca.vertcat(s.t, q0, entries, weights, system.p),
            "f": ca.dot(d, ca.mtimes(M, d)) / 2,
            "g": system.f * weights,
        }
        self._solver: ca.Function = ca.nlpsol("nearest", "ipopt", problem, OPTIONS)

    def solve(
        self, begin: Floats, q0: Floats, given: tuple[float, ca.DM, Floats, Floats], fixed: Flags
    ) -> Floats | None:
        """A local minimum near `begin` (n,), or None; `fixed` (n,) coordinates keep the values of q0 (n,).

        given: t, M (n, n) that is measured with, numbers (s,) the rows are multiplied by, 0 where one is not asked for,
        and p. The others must be independent: else the equations of the interior point method are singular.
        """
        t, M, weights, p = given
        values = ca.vertcat(t, q0, ca.DM(M.nonzeros()), weights, p)
        low, high = np.where(fixed, q0, -np.inf), np.where(fixed, q0, np.inf)
        free = np.where(weights == 0, np.inf, 0.0)
        found = self._solver(x0=begin, p=values, lbx=low, ubx=high, lbg=-free, ubg=free)
        return np.array(found["x"]).ravel() if self._solver.stats()["success"] else None
