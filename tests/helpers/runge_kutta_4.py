"""The classical scheme of Runge and Kutta as a `Method` for tests: fixed steps, it has no estimate of its error."""

from typing import Any

import casadi as ca

from lagcli.compiled import NumericSystem
from lagcli.simulation.scheme import step_end
from lagcli.smoothness.sized_function import SizedFunction


class RungeKutta4:
    """Order 4, with the cubic polynomial through the ends of a step and their derivatives as dense output."""

    name = "rk4"
    order = 4
    evaluations = 4
    dense_evaluations = 0
    dense_rows = 3

    def step(self, numeric: NumericSystem) -> Any:
        inputs = step_end.inputs(numeric)
        t, h, y, k, _, p = inputs
        second = numeric.rhs(t + h / 2, y + h / 2 * k, p)
        third = numeric.rhs(t + h / 2, y + h / 2 * second, p)
        fourth = numeric.rhs(t + h, y + h * third, p)
        new = y + h / 6 * (k + 2 * second + 2 * third + fourth)
        end = step_end.ended(numeric, inputs, new, (), lambda h: 0.0 * h)
        return SizedFunction("step", list(inputs), end.outputs(1.0, ()))

    def dense(self, numeric: NumericSystem) -> Any:
        inputs = step_end.inputs(numeric)
        t, h, y, k, _, p = inputs
        new, k_new = (ca.MX.sym(name, y.numel()) for name in ("new", "k_new"))
        change = new - y
        rows = ca.horzcat(change, h * k - change, change - h * k_new)
        return SizedFunction("dense", [t, h, y, new, k_new, p, k], [rows])

    def interpolated(self, y: Any, coefficients: Any, x: Any) -> Any:
        chord, first, last = (coefficients[:, i] for i in range(3))
        return y + x * chord + x * (1 - x) * ((1 - x) * first + x * last)
