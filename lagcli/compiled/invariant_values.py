"""The charts of first integrals at numbers: what decides which of them a run can hold."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from lagcli.equations.level_functions import LevelExpression
from lagcli.equations.system import System


def function(system: System, charts: Sequence[LevelExpression]) -> ca.Function:
    """levels(t, q, p) -> above and below of K charts (K, 2), their gradients by q (K, n) and (K, n), and periods
    (K,), 0 where there is none."""
    s = system.symbols
    above, below = (
        ca.densify(ca.vertcat(*each)) for each in ([c.above for c in charts], [c.below for c in charts])
    )
    periods = [ca.SX(0) if c.period is None else c.period for c in charts]
    outputs = [ca.horzcat(above, below), ca.jacobian(above, s.q), ca.jacobian(below, s.q)]
    return ca.Function("levels", [s.t, s.q, system.p], [*outputs, ca.densify(ca.vertcat(*periods))])


def stacked(B: ca.DM, rows: Sequence[ca.DM]) -> ca.DM:
    """Sparse rows (C, n) with others (1, n) below them."""
    return ca.vertcat(B, *rows)
