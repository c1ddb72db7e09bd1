"""d omega of one constraint row at numbers: what decides whether it can be integrated on a surface (D.3)."""

from __future__ import annotations

from typing import Any

import casadi as ca

from lagcli.mechanics.system import System


def function(system: System, row: int) -> Any:
    """curvature(t, q, v, p) -> J - J^T (n + 1, n + 1) of one row, and all rows (C, n + 1), over (q, t).

    With the row as omega = A . d(q, t) and J = dA / d(q, t), d omega(X, Y) = X^T (J^T - J) Y.
    """
    s = system.symbols
    whole = ca.densify(ca.horzcat(system.rows.B, system.rows.b))
    J = ca.jacobian(whole[row, :].T, ca.vertcat(s.q, s.t))
    return ca.Function("curvature", [s.t, s.q, s.v, system.p], [ca.densify(J - J.T), whole])
