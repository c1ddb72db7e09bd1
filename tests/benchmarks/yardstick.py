"""The least that a step can cost: a chain of point masses, written by hand for CasADi.

One step of DOP853 with error estimate and projection as one function, from the equations (D.24) of this one
system: no model file, no general mass matrix, no grid, no account. lagcli is measured against it, in turns in one
process.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from lagcli.compiled import dop853_tableau

GRAVITY = 9.81


def _functions(links: int) -> tuple[Any, Any, Any]:
    """y' and the two projections, of y = (x, v); f_k = (|u_k|^2 - 1)/2 for the rod u_k."""
    x, v = ca.SX.sym("x", 3 * links), ca.SX.sym("v", 3 * links)
    points = ca.reshape(x, 3, links)
    rods = points - ca.horzcat(ca.SX.zeros(3, 1), points[:, :-1])
    f = ((ca.sum1(rods**2) - 1) / 2).T
    B = ca.jacobian(f, x)
    gamma = -ca.jtimes(B @ v, x, v)
    F = ca.repmat(ca.DM([0, 0, -GRAVITY]), links, 1)
    D, LT, order = ca.ldl(B @ B.T)

    def solved(right: Any) -> Any:
        return ca.ldl_solve(right, D, LT, order)

    lam = solved(gamma - B @ F)
    y = ca.vertcat(x, v)
    rate = ca.Function("rate", [y], [ca.vertcat(v, F + B.T @ lam)], {"cse": True})
    position = ca.Function("position", [y], [ca.vertcat(x - B.T @ solved(f), v)])
    velocity = ca.Function("velocity", [y], [ca.vertcat(x, v - B.T @ solved(B @ v))])
    return rate, position, velocity


def _mix(weights: Sequence[float], stages: Sequence[Any]) -> Any:
    return sum(w * k for w, k in zip(weights, stages, strict=True) if w)


def step(links: int, tolerance: float) -> Any:
    """step(y, h) -> y new, error; the error is the root mean square, below 1 where the step may be accepted."""
    rate, position, velocity = _functions(links)
    y, h = ca.MX.sym("y", 6 * links), ca.MX.sym("h")
    stages = [rate(y)]
    for s in range(1, dop853_tableau.STAGES):
        stages.append(rate(y + h * _mix(dop853_tableau.A[s], stages)))
    new = y + h * _mix(dop853_tableau.B, stages)
    scale = tolerance + tolerance * ca.fmax(ca.fabs(y), ca.fabs(new))
    e5 = ca.sumsqr(_mix(dop853_tableau.E5, stages) / scale)
    e3 = ca.sumsqr(_mix(dop853_tableau.E3, stages) / scale)
    error = h * e5 / ca.sqrt((e5 + 0.01 * e3) * 6 * links + 1e-300)
    return ca.Function("step", [y, h], [velocity(position(position(new))), error])


class Stepper:
    """A step bound to memory: set `y` and `h`, call `trigger`, read `new` and `error`."""

    def __init__(self, function: Any) -> None:
        size = function.size1_in(0)
        self.y, self.h = np.zeros(size), np.zeros(1)
        self.new, self.error = np.zeros(size), np.zeros(1)
        self._function = function  # the buffer does not keep it alive
        self._buffer, self.trigger = function.buffer()
        for i, array in enumerate((self.y, self.h)):
            self._buffer.set_arg(i, memoryview(array.data))
        for i, array in enumerate((self.new, self.error)):
            self._buffer.set_res(i, memoryview(array.data))
