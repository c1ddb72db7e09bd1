"""The protocol of a scheme, and the schemes there are: one is a file here, its line below and its name in
`settings.METHOD_NAMES`.

A method is a one-step method: between two steps a run keeps nothing of it but k = y'(t, y).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Protocol

import casadi as ca

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.model import settings
from lagcli.model.settings import Simulation
from lagcli.simulation.scheme import dop853, step_end
from lagcli.simulation.scheme.step_end import Compiled, Curve
from lagcli.smoothness.sized_function import SizedFunction

# What stands in a line after the row of the table: the account's figures, W, and a sum that is finite only where
# all of the line is, or overflows.
FIGURES = 5
BEYOND = FIGURES + 1
# A function that calls another for each of thousands of rows copies its arguments: `always_inline`, not `never_inline`.
INLINED = True, False
# Instructions up to which what is watched in a step is written out in one graph.
WRITTEN_OUT = 20_000
# The index of the Jacobi energy in a line.
JACOBI = -4


class Method(Protocol):
    """One step from y to a state on the constraints, and the states between. name: that users know it by; order: the
    error of a step is of order + 1 in h; evaluations: of y' in a step, and dense_evaluations in the dense output;
    dense_rows: its coefficients for each number of the state."""

    name: str
    order: int
    evaluations: int
    dense_evaluations: int
    dense_rows: int

    def step(self, numeric: NumericSystem) -> Compiled:
        """step(t, h, y, k, tolerance, p) -> y new, k new, (error, moved, hidden, status of `project`, the error of W),
        then stages (2n + 1,) each, any number, an output of its own so that none is copied where they are not wanted;
        k = y'(t, y), tolerance as `step_tolerance.of_steps`. `step_end.ended` does all but the stages.

        A step may be accepted where error < 1, the estimate of the method, and moved < 1: how far the projection moved
        the state, as a part of what it may. Where hidden < 0 rows have become dependent and independent again within
        the step. The error of W is a part of what rtol allows; it does not steer.
        """

    def dense(self, numeric: NumericSystem) -> Compiled:
        """dense(t, h, y, y new, k new, p, k, stages of `step`) -> coefficients (2n + 1, dense_rows)."""

    def interpolated(self, y: Curve, coefficients: Curve, x: Curve) -> Curve:
        """The state at the fraction x of a step from y (m,) with coefficients (m, dense_rows), for symbols and for
        arrays."""


METHODS: dict[str, Callable[[], Method]] = {
    "dop853": dop853.DormandPrince853,
}


def of(chosen: Simulation) -> Method:
    """The method of a run."""
    return METHODS[settings.method_name(chosen)]()


class Scheme:
    """The compiled functions of a method for one system, each built when a run first asks for it: its step, dense
    output, and rows of the table with what the account asks of them."""

    def __init__(self, method: Method, numeric: NumericSystem) -> None:
        self._method, self._numeric = method, numeric

    @cached_property
    def step(self) -> Compiled:
        """See `Method.step`."""
        return self._method.step(self._numeric)

    @cached_property
    def dense(self) -> Compiled:
        """See `Method.dense`."""
        return self._method.dense(self._numeric)

    @cached_property
    def line_at(self) -> Compiled:
        """line_at(t, y, p) -> t, the row of the table, the figures of `statistics`, W and a sum of them all."""
        t, y, p = step_end.symbols(self._numeric, "t y p")
        _, row, extremes = self._numeric.record.call([t, y, p], *INLINED)
        line = ca.vertcat(t, row, extremes, y[y.numel() - 1])
        return SizedFunction("line_at", [t, y, p], [ca.vertcat(line, ca.sum1(line))])

    @cached_property
    def line_inside(self) -> Compiled:
        """line_inside(t, x, y, coefficients, p) -> what `line_at` gives at the fraction x of a step from y."""
        t, x, y, p = step_end.symbols(self._numeric, "t x y p")
        coefficients = ca.MX.sym("coefficients", y.numel(), self._method.dense_rows)
        state = self._method.interpolated(y, coefficients, x)
        line = self.line_at.call([t, state, p], *INLINED)
        return SizedFunction("line_inside", [t, x, y, coefficients, p], line)

    @cached_property
    def defect(self) -> Compiled:
        """defect(t, x, h, y, coefficients, tolerance, p) -> how far y' of the dense output is from that of the
        equations at the fraction x of a step from y, times h, as a part of what the tolerance allows the largest
        component of (q, v). It is no less than the error of a step that has missed a force then, else of the order of
        the dense output in h."""
        numeric, method = self._numeric, self._method
        t, x, h, y, tolerance, p = step_end.symbols(numeric, "t x h y tolerance p")
        coefficients, n = ca.MX.sym("coefficients", y.numel(), method.dense_rows), numeric.n
        state = method.interpolated(y, coefficients, x)
        rate = numeric.rhs(t, state, p)
        off = ca.fabs(ca.jtimes(state, x, ca.MX(1)) - h * rate)
        noise = doubles.EPS * (ca.fabs(t) + ca.fabs(h)) * ca.fabs(rate)
        # The constants of levels that are enforced come behind the parameters.
        own = numeric.sizes.numel_in(3)
        sizes = numeric.sizes(t, state[:n], state[n : 2 * n], p[:own])
        scale = step_end.scales((y, state), h, sizes, tolerance) + noise[: 2 * n]
        worst = ca.mmax(off[: 2 * n] / scale) if n else ca.MX(0)
        found = SizedFunction("defect", [t, x, h, y, coefficients, tolerance, p], [ca.densify(worst)])
        # As one graph it costs two thirds, where y' is one.
        return found if numeric.stage is None else SizedFunction(found.expand())
