"""A second explicit scheme with step control, which the package does not have: a user of the seam `method.Method`.

P. Bogacki, L. F. Shampine: A 3(2) pair of Runge-Kutta formulas, Applied Mathematics Letters 2 (1989), 321 to 325.
"""

from __future__ import annotations

import casadi as ca

from lagcli.compiled import NumericSystem
from lagcli.simulation.scheme import step_end
from lagcli.smoothness.sized_function import SizedFunction
from tests.helpers.runge_kutta_4 import RungeKutta4


class BogackiShampine:
    """Order 3, with an error estimate of order 2 and the cubic through both ends and their derivatives."""

    name = "bs23"
    order = 3
    evaluations = 3
    dense_evaluations = 0
    dense_rows = 3

    def step(self, numeric: NumericSystem) -> ca.Function:
        """See `method.Method.step`."""
        inputs = step_end.inputs(numeric)
        t, h, y, k, _, p = inputs
        k2 = numeric.rhs(t + h / 2, y + h / 2 * k, p)
        k3 = numeric.rhs(t + 3 * h / 4, y + 3 * h / 4 * k2, p)
        change = (2 * k + 3 * k2 + 4 * k3) / 9
        new = y + h * change
        k4 = numeric.rhs(t + h, new, p)
        error = change - (7 * k / 24 + k2 / 4 + k3 / 3 + k4 / 8)
        end = step_end.ended(numeric, inputs, new, (error,), lambda h, e: h * e)
        return SizedFunction("step", list(inputs), end.outputs(1.0, ()))

    dense, interpolated = RungeKutta4.dense, RungeKutta4.interpolated
