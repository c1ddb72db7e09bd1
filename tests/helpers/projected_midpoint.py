"""A scheme that keeps the constraints within its step, which the package does not have: a user of the seam
`method.Method`.

The explicit midpoint rule whose middle lies on f = 0 and B v + b = 0: E. Hairer, Ch. Lubich, G. Wanner, Geometric
Numerical Integration, sec. IV.4 (projection within the step).
"""

from __future__ import annotations

import casadi as ca

from lagcli.compiled import NumericSystem
from lagcli.simulation.scheme import step_end
from lagcli.smoothness.sized_function import SizedFunction
from tests.helpers.runge_kutta_4 import RungeKutta4


class ProjectedMidpoint:
    """Order 2: the middle and the end are projected; its error is estimated by the trapezoidal rule."""

    name = "pm2"
    order = 2
    evaluations = 3
    dense_evaluations = 0
    dense_rows = 3

    def step(self, numeric: NumericSystem) -> ca.Function:
        """See `method.Method.step`."""
        inputs = step_end.inputs(numeric)
        t, h, y, k, _, p = inputs
        _, middle, *_ = numeric.project(t + h / 2, y + h / 2 * k, p)
        new = y + h * middle
        _, last, *_ = numeric.project(t + h, new, p)
        end = step_end.ended(numeric, inputs, new, ((k + last) / 2 - middle,), lambda h, e: h * e)
        return SizedFunction("step", list(inputs), end.outputs(1.0, ()))

    dense, interpolated = RungeKutta4.dense, RungeKutta4.interpolated
