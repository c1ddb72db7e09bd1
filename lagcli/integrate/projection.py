"""Moves a configuration or velocity onto the constraints, in the mass-weighted norm, also from far.

Near the surface the integrator's own compiled projection does this at every step; this room serves the start
(`--assemble`), and the walk over the surface on which degrees of freedom are counted.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli.compile import NumericSystem
from lagcli.constraint_rows import MetricRows, Rows
from lagcli.metric import Metric

Floats = npt.NDArray[np.float64]

MAX_STEPS = 200
MAX_HALVINGS = 30
# Residuals computed in all attempts on one surface; a search that has not ended by then does not end.
BUDGET = 2000
# Relative to the size of the configuration: where Newton's steps have reached rounding.
CONVERGED = 1e-13
NEAREST = 1e-12
# Where the rows are independent, Newton's steps from nearby square the residual: a few of them reach rounding.
NEARBY_STEPS, SQUARED = 8, 0.02


class NoConfiguration(Exception):
    """No point that satisfies the constraints was found; `worst` is the largest remaining |f_i| / |B_i|."""

    def __init__(self, q: Floats, worst: float) -> None:
        super().__init__("no configuration satisfies the holonomic constraints near the start")
        self.q, self.worst = q, worst


class Surface:
    """f = 0 at one time, with the metric of one configuration."""

    def __init__(self, numeric: NumericSystem, t: float, p: Floats, metric: Metric) -> None:
        self._numeric, self._t, self._p, self._metric = numeric, t, p, metric
        self._left = BUDGET

    def rows(self, q: Floats) -> tuple[Floats, Any]:
        """f (s,) and B (s, n), sparse."""
        f, B = self._numeric.whole(self._t, q, self._p)
        return np.array(f).ravel(), B

    def residual(self, q: Floats) -> float:
        """Largest |f_i| / |B_i|."""
        self._left -= 1
        f, B = self.rows(q)
        if not _are_finite(f, B):
            return float("inf")
        return float(np.max(np.abs(f) / Rows(B).divisors, initial=0.0))

    def feasible(self, q: Floats) -> Floats:
        """A point of the surface by damped Newton steps. Raises `NoConfiguration`."""
        size = float(np.abs(q).max(initial=0.0)) or 1.0
        residual = self.residual(q)
        for _ in range(MAX_STEPS):
            if residual <= CONVERGED * size:
                return q
            f, B = self.rows(q)
            if not _are_finite(f, B) or self._left < 0:
                break
            step = MetricRows(B, self._metric).correction(f)
            factor, new = 1.0, q
            for _ in range(MAX_HALVINGS):
                new = q + factor * step
                after = self.residual(new)
                if after < residual:
                    break
                factor /= 2
            else:
                break
            q, residual = new, after
        # The last steps stall at rounding; that is as far as doubles go.
        if residual <= 1e3 * CONVERGED * max(size, float(np.abs(q).max(initial=0.0))):
            return q
        raise NoConfiguration(q, residual)

    def nearby(self, q: Floats) -> Floats | None:
        """The point of the surface that a few full Newton steps reach, each squaring a small residual, or None.

        None from nearby shows that the surface is singular there: its rows are dependent on it and independent
        beside it, and Newton's steps only halve the distance.
        """
        size = float(np.abs(q).max(initial=0.0)) or 1.0
        before = residual = self.residual(q)
        for _ in range(NEARBY_STEPS):
            if residual <= CONVERGED * size and (residual <= SQUARED * before or before <= CONVERGED * size):
                return q
            f, B = self.rows(q)
            if not _are_finite(f, B):
                return None
            q = q + MetricRows(B, self._metric).correction(f)
            before, residual = residual, self.residual(q)
        return None

    def nearest(self, q0: Floats) -> Floats:
        """The point of the surface nearest to q0 in the metric: q - q0 = -M^-1 B^T mu at the point itself.

        Gauss-Newton on that condition from a feasible point; where it does not contract, the feasible point
        with the smaller distance is kept.
        """
        return self.refined(self.feasible(q0), q0)

    def refined(self, q: Floats, q0: Floats) -> Floats:
        """The same from a point q of the surface."""
        best = q
        size = float(np.abs(q0).max(initial=0.0)) or 1.0
        for _ in range(MAX_STEPS):
            f, B = self.rows(q)
            step = MetricRows(B, self._metric).correction(f + Rows(B).times(q0 - q))
            try:
                new = self.feasible(q0 + step)
            except NoConfiguration:
                break
            if self._metric.length(new - q0) >= self._metric.length(best - q0) * (1 + 1e-12) + NEAREST * size:
                break
            moved = float(np.abs(new - q).max(initial=0.0))
            best = q = new
            if moved <= NEAREST * size:
                break
        return best


def velocity(v: Floats, B: Any, b: Floats, metric: Metric) -> Floats:
    """The nearest v with B v + b = 0 in the metric. Shapes (n,), (C, n), (C,).

    Where the rows contradict each other the result leaves a residual.
    """
    rows = MetricRows(B, metric)
    for _ in range(2):  # the second pass removes the rounding of the first
        v = v + rows.correction(Rows(B).times(v) + b)
    return v


def _are_finite(f: Floats, B: Any) -> bool:
    return bool(np.isfinite(f).all() and np.isfinite(B.nonzeros()).all())
