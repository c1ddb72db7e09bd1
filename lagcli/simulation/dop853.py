"""One step of DOP853 with projection, its dense output and its rows, each as one compiled function.

Dormand and Prince 8(5,3); Hairer, Norsett, Wanner, Solving ODEs I, sec. II.5 (error estimate) and II.6 (dense
output of order 7). After the step the state is projected onto f = 0 and B v + b = 0; the derivative at the
landed state is the first stage of the next step.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.simulation import dop853_tableau
from lagcli.simulation import step_tolerance as tolerances

Floats = npt.NDArray[np.float64]

ORDER = 8
DENSE_ROWS = 7
# The projection may move a state by this many tolerances, and by this part of its size.
MOVED, MOVED_ROUNDING = 100.0, 1e-10
# Stages are taken at times rounded to doubles: where t occurs, y' is off by this part of |t| times its change over the
# step, divided by the step, in each of them.
TIME_ROUNDING = 2**-52
# A step of so many roundings of the time may hold a jump; the part of a speed that is nothing there.
JUMP, NEGLIGIBLE = 1024, 1e-9
# Stages at which the nearness of the rows to dependent ones is looked at, in the order of their times.
WATCHED = (1, 3, 6, 5, 9, 8, 10)
DIP = 0.3
WRITTEN_OUT = 1000  # numbers of a state
# What stands in a line after the row of the table: the account's figures, W, and a sum that is finite only where
# all of the line is, or overflows.
FIGURES = 5
BEYOND = FIGURES + 1


@dataclasses.dataclass(frozen=True, slots=True)
class Scheme:
    """Compiled step, dense output and rows.

    step(t, h, y, k, tolerance, p) -> y new, k new, (error, moved, hidden, outcome of `land`, the error of W), then the
    stages 2 to 12, each an output (2n + 1,) of its own, so that none is copied where they are not wanted
    dense(t, h, y, y new, k new, p, k, stages 2 to 12) -> coefficients (2n + 1, 7)
    line_at(t, y, p) -> t, the row of the table, the figures of `account`, W and a sum of them all
    line_inside(t, x, y, coefficients, p) -> the same at the fraction x of a step from y
    with k = y'(t, y) and `step_tolerance.of_steps`. A step may be accepted where error < 1, the estimate of the scheme,
    and moved < 1: how far the projection moved the state, as a part of what it may. Where hidden < 0 rows have become
    dependent and independent again within the step. The error of W is a part of what rtol allows; it does not steer.
    """

    step: Any
    dense: Any
    line_at: Any
    line_inside: Any


def scheme(numeric: NumericSystem) -> Scheme:
    """The scheme for a system."""
    line_at = _line_at(numeric)
    return Scheme(_step(numeric), _dense(numeric), line_at, _line_inside(numeric, line_at))


def _mix(weights: Sequence[float], stages: Sequence[Any]) -> Any:
    return sum(w * k for w, k in zip(weights, stages, strict=True) if w)


def _sizes(numeric: NumericSystem) -> tuple[int, int]:
    return 2 * numeric.n + 1, numeric.rhs.size1_in(2)


def _step(numeric: NumericSystem) -> Any:
    size, parameters = _sizes(numeric)
    t, h = ca.MX.sym("t"), ca.MX.sym("h")
    y, k = ca.MX.sym("y", size), ca.MX.sym("k", size)
    tolerance, p = ca.MX.sym("tolerance", 4), ca.MX.sym("p", parameters)
    stages, near = [k], {}
    for s in range(1, dop853_tableau.STAGES):
        inputs = t + dop853_tableau.C[s] * h, y + h * _mix(dop853_tableau.A[s], stages), p
        if s in WATCHED and numeric.stage is not None:
            rate, near[s] = numeric.stage(*inputs)
        else:
            rate = numeric.rhs(*inputs)
        stages.append(rate)
    change = _mix(dop853_tableau.B, stages)
    new = y + h * change
    # The weights of order 3 are those of order 8 but for three entries.
    e3 = change + _mix(
        [low - high for low, high in zip(dop853_tableau.E3, dop853_tableau.B, strict=True)], stages
    )
    landed, k_new, outcome, sizes = numeric.land(t + h, new, p)
    # The doubles around t may be so far apart that the state is not known better.
    near_t = TIME_ROUNDING * ca.fabs(t + h) if numeric.has_time else 0.0
    noise = near_t * _within(near_t, h, (y, k, k_new)) * ca.fabs(k_new - k) if numeric.has_time else 0.0 * k
    # Rows that move are where they are at one of these times.
    blur = near_t * ca.fabs(k_new)
    e5 = _mix(dop853_tableau.E5, stages)
    judged = _judge(size)(y, new, landed, h, e5, e3, sizes, tolerance, noise, blur)
    hidden = _hidden()(ca.horzcat(*(near[s] for s in WATCHED), outcome[1:3])) if near else 1.0
    outputs = [landed, k_new, ca.vertcat(judged[:2], hidden, outcome, judged[2]), *stages[1:]]
    return ca.Function("step", [t, h, y, k, tolerance, p], outputs)


def _within(near_t: Any, h: Any, states: tuple[Any, Any, Any]) -> Any:
    """By how much the rounding of the time counts: 1, and more where a step of a few roundings holds a jump.

    A jump changes velocities by next to nothing in such a step, or is what sets a body at rest in motion. A pole does
    neither: it must be met. states: y, and y' at both ends.
    """
    y, k, k_new = states
    n = y.numel() // 2
    gained, speed = h * ca.mmax(ca.fabs(k_new - k)[n : 2 * n]), ca.mmax(ca.fabs(y[n : 2 * n]))
    is_jump = ca.logic_or(gained <= NEGLIGIBLE * speed, speed <= NEGLIGIBLE * gained)
    return 1 + is_jump * near_t * JUMP**2 / h


def _judge(size: int) -> Any:
    """judge(y, new, landed, h, E5, E3, sizes, tolerance, noise, blur) -> (error, moved, error of W), written out for a
    short state.

    noise, blur (2n + 1,): what the rounding of t makes of the error, and of the state.
    """
    sort: Any = ca.SX if size <= WRITTEN_OUT else ca.MX
    n = size // 2
    y, new, landed, e5, e3, noise, blur = states = [
        sort.sym(name, size) for name in ("y", "new", "landed", "e5", "e3", "noise", "blur")
    ]
    h, sizes, tolerance = sort.sym("h"), sort.sym("sizes", n + 3), sort.sym("tolerance", 4)
    scale = _scales((y, new), h, sizes, tolerance)
    moved = _moved(landed - new, scale + blur[: 2 * n], sizes)
    # The energy at hand: what has been done up to here, or that of the motion.
    energy = ca.fabs(y[2 * n]) + sizes[n + 1] ** 2
    of_work = _combined(h, ca.fabs(e5[2 * n]), ca.fabs(e3[2 * n])) / (tolerance[0] * energy + tolerances.TINY)
    all_three = ca.vertcat(_error(h, (e5, e3), scale + noise[: 2 * n]), moved, of_work)
    return ca.Function("judge", [*states[:3], h, e5, e3, sizes, tolerance, noise, blur], [all_three])


def _scales(states: Sequence[Any], h: Any, sizes: Any, tolerance: Any) -> Any:
    """What the errors of (q, v) are compared with (2n,): expressions of the states (2n + 1,) at both ends of a step of
    length h, of `parts.Sizes.packed` at its end, and of `step_tolerance.of_steps`."""
    n = (states[0].numel() - 1) // 2
    rtol, atol, part, rounding = (tolerance[i] for i in range(4))
    units, (q, v, a) = sizes[:n], (sizes[n + i] for i in range(3))
    speed = ca.fmax(v, h * a)
    largest = ca.fmax(*(ca.fabs(y)[: 2 * n] for y in states))
    floors = ca.vertcat(units * (part * h * speed + rounding * q), units * (part * speed + rounding * q / h))
    return rtol * largest + atol + floors + tolerances.TINY


def _hidden() -> Any:
    """Clearance and least row (2, 8) at the watched stages and at the end -> how far they are from having gone through
    zero within the step and come back; below zero where they may have.

    Their roots then go to zero and rise again in a line: lines through two of them lead below zero on the other side
    of a gap, or one root is much smaller than both beside it.
    """
    squares = ca.SX.sym("squares", 2, len(WATCHED) + 1)
    roots = ca.sqrt(ca.fmax(squares, 0.0))
    at = [*(dop853_tableau.C[s] for s in WATCHED), 1.0]
    last = len(at) - 1

    def line(i: int, j: int, t: float) -> Any:
        return roots[:, i] + (roots[:, j] - roots[:, i]) * ((t - at[i]) / (at[j] - at[i]))

    gaps = [line(0, 1, 0.0)]
    for i in range(last + 1):
        if 0 < i < last:
            gaps.append(roots[:, i] - DIP * ca.fmin(roots[:, i - 1], roots[:, i + 1]))
        if i > 1:
            gaps.append(line(i - 2, i - 1, at[i]) + DIP * roots[:, i])
        if i < last - 1:
            gaps.append(line(i + 1, i + 2, at[i]) + DIP * roots[:, i])
    return ca.Function("hidden", [squares], [ca.mmin(ca.vertcat(*gaps))])


def _error(h: Any, estimates: tuple[Any, Any], scale: Any) -> Any:
    """Hairer's combination of the error estimates of order 5 and 3, over the largest component of (q, v).

    The largest component, and not the root mean square: a coordinate at rest then does not loosen the
    tolerance of the others, and a model takes the same steps however many idle coordinates it is written in.
    The work W does not steer the step: it is left out.
    """
    return _combined(h, *(ca.mmax(ca.fabs(estimate[: scale.numel()] / scale)) for estimate in estimates))


def _combined(h: Any, e5: Any, e3: Any) -> Any:
    return h * e5 * e5 / ca.sqrt(e5 * e5 + 0.01 * e3 * e3 + 1e-300)


def _moved(by: Any, scale: Any, sizes: Any) -> Any:
    """How far the projection moved (q, v), as a part of what it may.

    A step that is right to the tolerance lies about as close to the constraints. One that is moved much farther has
    come to another branch, or to no motion at all.
    """
    n2 = scale.numel()
    n = n2 // 2
    units = sizes[:n]
    allowed = MOVED * scale + MOVED_ROUNDING * ca.vertcat(units * sizes[n], units * sizes[n + 1])
    return ca.mmax(ca.fabs(by)[:n2] / allowed)


def _dense(numeric: NumericSystem) -> Any:
    size, parameters = _sizes(numeric)
    t, h = ca.MX.sym("t"), ca.MX.sym("h")
    y, new, k_new = (ca.MX.sym(name, size) for name in ("y", "new", "k_new"))
    given = [ca.MX.sym(f"k{i}", size) for i in range(1, dop853_tableau.STAGES + 1)]
    p = ca.MX.sym("p", parameters)
    stages = [*given, k_new]
    for extra, row in enumerate(dop853_tableau.A_DENSE):
        node = dop853_tableau.C[dop853_tableau.STAGES + 1 + extra]
        stages.append(numeric.rhs(t + node * h, y + h * _mix(row, stages), p))
    change = new - y
    rows = [change, h * stages[0] - change, 2 * change - h * (k_new + stages[0])]
    rows += [h * _mix(row, stages) for row in dop853_tableau.D_DENSE]
    return ca.Function("dense", [t, h, y, new, k_new, p, *given], [ca.horzcat(*rows)])


def defect(numeric: NumericSystem) -> Any:
    """defect(t, x, h, y, coefficients, tolerance, p) -> how far y' of the dense output is from that of the equations at
    the fraction x of a step from y, times h, as a part of what the tolerance allows the largest component of (q, v).

    It is no less than the error of a step that has missed a force at that time, and of order 7 in h otherwise.
    """
    size, parameters = _sizes(numeric)
    t, x, h = ca.MX.sym("t"), ca.MX.sym("x"), ca.MX.sym("h")
    y, coefficients = ca.MX.sym("y", size), ca.MX.sym("coefficients", size, DENSE_ROWS)
    tolerance, p = ca.MX.sym("tolerance", 4), ca.MX.sym("p", parameters)
    state = interpolated(y, coefficients, x)
    rate = numeric.rhs(t, state, p)
    off = ca.fabs(ca.jtimes(state, x, ca.MX(1)) - h * rate)
    noise = TIME_ROUNDING * (ca.fabs(t) + ca.fabs(h)) * ca.fabs(rate)
    n = size // 2
    sizes = numeric.sizes(t, state[:n], state[n : 2 * n], p)
    scale = _scales((y, state), h, sizes, tolerance) + noise[: 2 * n]
    worst = ca.mmax(off[: 2 * n] / scale) if n else ca.MX(0)
    return ca.Function("defect", [t, x, h, y, coefficients, tolerance, p], [ca.densify(worst)])


def _line_at(numeric: NumericSystem) -> Any:
    size, parameters = _sizes(numeric)
    t, y, p = ca.MX.sym("t"), ca.MX.sym("y", size), ca.MX.sym("p", parameters)
    _, row, figures = numeric.record(t, y, p)
    line = ca.vertcat(t, row, figures, y[size - 1])
    return ca.Function("line_at", [t, y, p], [ca.vertcat(line, ca.sum1(line))])


def _line_inside(numeric: NumericSystem, line_at: Any) -> Any:
    size, parameters = _sizes(numeric)
    t, x, y = ca.MX.sym("t"), ca.MX.sym("x"), ca.MX.sym("y", size)
    coefficients, p = ca.MX.sym("coefficients", size, DENSE_ROWS), ca.MX.sym("p", parameters)
    return ca.Function(
        "line_inside", [t, x, y, coefficients, p], [line_at(t, interpolated(y, coefficients, x), p)]
    )


def interpolated(y: Any, coefficients: Any, x: Any) -> Any:
    """The state at the fraction x of a step from y (m,) with dense coefficients (m, 7)."""
    result: Any = 0.0
    for i in range(DENSE_ROWS - 1, -1, -1):
        result = (result + coefficients[:, i]) * (x if i % 2 == 0 else 1.0 - x)
    return result + y
