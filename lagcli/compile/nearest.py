"""The nearest configuration in the mass-weighted norm, as an optimization problem for IPOPT.

minimize (q - q0)^T M (q - q0) / 2   subject to   f(q, t) = 0
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.mechanics.system import System

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-10,
    "ipopt.max_iter": 300,
    # Without a success the caller keeps the feasible point it began with.
    "error_on_fail": False,
    "show_eval_warnings": False,
    "calc_lam_p": False,
}


class Problem:
    """The problem of one system, built once; `solve` it from any point."""

    def __init__(self, system: System) -> None:
        s = system.symbols
        q0 = ca.SX.sym("q0", s.q.numel())
        entries = ca.SX.sym("M", system.dynamics.M.nnz())
        M = ca.SX(system.dynamics.M.sparsity(), entries)
        d = s.q - q0
        problem = {
            "x": s.q,
            "p": ca.vertcat(s.t, q0, entries, system.p),
            "f": ca.dot(d, ca.mtimes(M, d)) / 2,
            "g": system.rows.f,
        }
        self._solver: Any = ca.nlpsol("nearest", "ipopt", problem, OPTIONS)

    def solve(self, begin: Floats, t: float, q0: Floats, M: Any, p: Floats, held: Flags) -> Floats | None:
        """A local minimum near `begin` (n,), or None; `held` (n,) coordinates keep the values of q0 (n,)."""
        given = ca.vertcat(t, q0, ca.DM(M.nonzeros()), p)
        low, high = np.where(held, q0, -np.inf), np.where(held, q0, np.inf)
        found = self._solver(x0=begin, p=given, lbx=low, ubx=high, lbg=0, ubg=0)
        return np.array(found["x"]).ravel() if self._solver.stats()["success"] else None
