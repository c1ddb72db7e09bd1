"""Rows of the table and what the account asks of them, at the ends of a step and within it, whatever the method."""

from __future__ import annotations

from typing import Protocol, TypeVar

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.simulation.scheme import step_end, step_tolerance
from lagcli.smoothness.sized_function import SizedFunction

# What stands in a line after the row of the table: the account's figures, W, and a sum that is finite only where
# all of the line is, or overflows.
FIGURES = 5
BEYOND = FIGURES + 1
# A function that calls another for each of thousands of rows copies its arguments: `always_inline`, not `never_inline`.
INLINED = True, False
# The index of the Jacobi energy in a line.
JACOBI = -4


# Symbols or numbers.
Curve = TypeVar("Curve", ca.SX, ca.MX, npt.NDArray[np.float64])


class Interpolation(Protocol):
    """The part of a `method.Method` that gives the state within a step."""

    @property
    def dense_rows(self) -> int:
        """Coefficients of each number of the state."""

    def interpolated(self, y: Curve, coefficients: Curve, x: Curve) -> Curve:
        """The state at the fraction x of a step from y (m,) with coefficients (m, dense_rows)."""


def line_at(numeric: NumericSystem) -> ca.Function:
    """line_at(t, y, p) -> t, the row of the table, the figures of `statistics`, W and a sum of them all."""
    size, parameters = step_end.sizes_of(numeric)
    t, y, p = ca.MX.sym("t"), ca.MX.sym("y", size), ca.MX.sym("p", parameters)
    _, row, extremes = numeric.record.call([t, y, p], *INLINED)
    line = ca.vertcat(t, row, extremes, y[size - 1])
    return SizedFunction("line_at", [t, y, p], [ca.vertcat(line, ca.sum1(line))])


def line_inside(numeric: NumericSystem, at: ca.Function, method: Interpolation) -> ca.Function:
    """line_inside(t, x, y, coefficients, p) -> what `line_at` gives, `at`, at the fraction x of a step from y."""
    size, parameters = step_end.sizes_of(numeric)
    t, x, y = ca.MX.sym("t"), ca.MX.sym("x"), ca.MX.sym("y", size)
    coefficients, p = ca.MX.sym("coefficients", size, method.dense_rows), ca.MX.sym("p", parameters)
    state = method.interpolated(y, coefficients, x)
    return SizedFunction("line_inside", [t, x, y, coefficients, p], at.call([t, state, p], *INLINED))


def defect(numeric: NumericSystem, method: Interpolation) -> ca.Function:
    """defect(t, x, h, y, coefficients, tolerance, p) -> how far y' of the dense output is from that of the equations at
    the fraction x of a step from y, times h, as a part of what the tolerance allows the largest component of (q, v).

    It is no less than the error of a step that has missed a force at that time, and of the order of the dense output in
    h otherwise.
    """
    size, parameters = step_end.sizes_of(numeric)
    t, x, h = ca.MX.sym("t"), ca.MX.sym("x"), ca.MX.sym("h")
    y, coefficients = ca.MX.sym("y", size), ca.MX.sym("coefficients", size, method.dense_rows)
    tolerance, p = ca.MX.sym("tolerance", step_tolerance.COUNT), ca.MX.sym("p", parameters)
    state = method.interpolated(y, coefficients, x)
    rate = numeric.rhs(t, state, p)
    off = ca.fabs(ca.jtimes(state, x, ca.MX(1)) - h * rate)
    noise = step_end.PARAMETERS.time_rounding * (ca.fabs(t) + ca.fabs(h)) * ca.fabs(rate)
    n = size // 2
    own = numeric.sizes.numel_in(3)  # the constants of levels that are enforced come behind the parameters
    sizes = numeric.sizes(t, state[:n], state[n : 2 * n], p[:own])
    scale = step_end.scales((y, state), h, sizes, tolerance) + noise[: 2 * n]
    worst = ca.mmax(off[: 2 * n] / scale) if n else ca.MX(0)
    found = SizedFunction("defect", [t, x, h, y, coefficients, tolerance, p], [ca.densify(worst)])
    # As one graph it costs two thirds, where y' is one.
    return found if numeric.stage is None else SizedFunction(found.expand())
