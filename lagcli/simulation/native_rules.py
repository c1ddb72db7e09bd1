"""The rules by which steps follow one another as expressions, for a loop that asks nobody between two steps.

They are those of `controller`, `step_trial` and `singularity_monitor`, number by number in the same order, so that the
loop takes the steps of these to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import reduce, wraps

import casadi as ca

from lagcli import doubles, memory
from lagcli.simulation.scheme import step_end, step_tolerance
from lagcli.simulation.scheme.controller import PARAMETERS as LENGTH
from lagcli.simulation.singularity.singularity_monitor import (
    NEVER,
    SMALLEST_ANGLE,
    SMALLEST_DIAGONAL,
    Prediction,
)
from lagcli.simulation.singularity.singularity_monitor import PARAMETERS as MONITOR
from lagcli.simulation.stepping.step_trial import HIDDEN, HIDING, MOST_RESIDUAL
from lagcli.smoothness.sized_function import SizedFunction


class Control(IntEnum):
    """Where numbers stand in the memory that the loop shares with its caller.

    STEP: the step proposed; SEEN, FORESEEN: the four and five numbers of a `SingularityMonitor`; ROW, ROW_TIME: number
    and time of the next row; LAST_ROW: time of the row written last, BEGUN: where the last step began; FILLED: lines
    of the block that are written; STEPS, REJECTED, EVALUATIONS: counts that the loop adds to.
    Read alone: END and ORIGIN of the run, GRID (start, step, number of the last row), CAPACITY of the block, MOST steps
    to take, DEEPEST: the largest -g_j known; AHEAD: steps before the end that are not taken; REACH,
    AMPLIFIED: see `reach`; FREE, LONGEST: see `Timetable.free`.
    """

    STEP = 0
    SEEN = 1
    FORESEEN = 5
    ROW = 10
    ROW_TIME = 11
    LAST_ROW = 12
    BEGUN = 13
    FILLED = 14
    STEPS = 15
    REJECTED = 16
    EVALUATIONS = 17
    END = 18
    ORIGIN = 19
    GRID = 20
    CAPACITY = 23
    MOST = 24
    DEEPEST = 25
    AHEAD = 26
    REACH = 27
    AMPLIFIED = 28
    FREE = 29
    LONGEST = 30


SIZE = max(Control) + 1
# What stands for what was seen where nothing was: no later time follows it, and any diagonal is larger.
UNSEEN = math.inf, math.inf, math.inf, -math.inf
INSTANT, ANGLE, LAST_STEP = (Prediction._fields.index(name) for name in ("instant", "angle", "step"))


Number = ca.SX | float


def _exactly(make: Callable[..., SizedFunction]) -> Callable[..., SizedFunction]:
    """Have a rule made of the operations as they are written: CasADi would multiply its constants first, which rounds
    otherwise."""

    @wraps(make)
    def function(*arguments: object) -> SizedFunction:
        simplifies = ca.GlobalOptions.getSimplificationOnTheFly()
        ca.GlobalOptions.setSimplificationOnTheFly(False)
        try:
            return make(*arguments)
        finally:
            ca.GlobalOptions.setSimplificationOnTheFly(simplifies)

    return function


def reach(rtol: float, order: int) -> tuple[float, float]:
    """Of `Prediction.is_near`, what depends on the tolerance of a step: lengths of it that a step across reaches, as a
    part of `ahead`, and the angle below which amplified rounding counts."""
    amplified: float = (step_end.PARAMETERS.amplified / rtol) ** (1 / 3)
    return rtol ** (1 / (2 * MONITOR.fewer_nodes) - 1 / order), amplified


@memory.remembered()
@_exactly
def plan() -> SizedFunction:
    """plan(t, control) -> 1 where a singular configuration is near, as `Prediction.is_near`, or the end of the run
    `AHEAD` steps away, and the length of the next step, as `Prediction.shortened`."""
    t, control = ca.SX.sym("t"), ca.SX.sym("control", SIZE)
    instant, angle, last_step = (control[Control.FORESEEN + i] for i in (INSTANT, ANGLE, LAST_STEP))
    h = control[Control.STEP]
    reached = MONITOR.ahead * h * control[Control.REACH]
    reached = ca.if_else(angle < control[Control.AMPLIFIED], reached * MONITOR.earlier, reached)
    reached = ca.if_else(h > MONITOR.growing * last_step, reached * MONITOR.earlier**2, reached)
    left = instant - t
    is_over = ca.logic_or(
        _all(instant < math.inf, left < reached), t + control[Control.AHEAD] * h >= control[Control.END]
    )
    is_shorter = _all(left > 0, left < h / MONITOR.shorter)
    return SizedFunction("plan", [t, control], [is_over, ca.if_else(is_shorter, MONITOR.shorter * left, h)])


@memory.remembered()
@_exactly
def verdict(fewest: int, order: int, has_integrals: bool) -> SizedFunction:
    """verdict(t, taken, reached, status, grow, control) -> 1 where a step may be taken, as in `StepTrial.attempt`; the
    step to be tried in its place, and 1 where there is none, or integrals may be the reason; the step proposed behind
    it, of at most `grow` times its length; and 1 where W is not right in it."""
    t, taken, reached, grow = (ca.SX.sym(name) for name in ("t", "taken", "reached", "grow"))
    status, control = ca.SX.sym("status", 8), ca.SX.sym("control", SIZE)
    scheme_error, moved, hidden, residual, _, _, everything, of_work = ca.vertsplit(status)
    projected = residual <= MOST_RESIDUAL
    error = ca.if_else(moved > scheme_error, moved, scheme_error)
    is_hidden = ca.logic_and(hidden < 0.0, taken > HIDING * control[Control.STEP])
    error = ca.if_else(ca.logic_and(is_hidden, error < HIDDEN), HIDDEN, error)
    is_right = _all(error < 1.0, projected, ca.fabs(everything) < math.inf)
    is_known = _all(ca.fabs(error) < math.inf, error >= 1.0, projected)
    # One power for both: of a step that may be taken no smaller one is asked for.
    wished = LENGTH.safety * ca.if_else(is_right, ca.fmax(error, 1e-10), error) ** (-1.0 / order)
    part = ca.fmin(0.9, ca.fmax(LENGTH.shrink, wished))
    smaller = taken * ca.if_else(is_known, part, 0.25)
    is_end = t + smaller / fewest == t
    if fewest == 1:
        is_end = ca.logic_or(is_end, t + smaller >= reached)
    if has_integrals:
        is_end = ca.logic_or(is_end, status[0] < doubles.ROOT)
    part = ca.fmin(grow, ca.fmax(LENGTH.shrink, wished))
    outputs = [is_right, smaller, is_end, taken * part, of_work > step_tolerance.COARSE_WORK]
    return SizedFunction("verdict", [t, taken, reached, status, grow, control], outputs)


@memory.remembered()
@_exactly
def watched() -> SizedFunction:
    """watched(t, status, control) -> what is seen behind a step, with nothing foreseen: the four and five numbers of
    `SingularityMonitor.after`; and 1 where `foreseen` is to be asked, which few steps of few runs are."""
    inputs, seen, are_asked = _sight()
    return SizedFunction("watched", inputs, [ca.vertcat(*seen, *NEVER), ca.logic_or(*are_asked)])


@memory.remembered()
@_exactly
def foreseen() -> SizedFunction:
    """foreseen(t, status, control) -> the nine numbers of `watched` with what is foreseen."""
    inputs, seen, are_asked = _sight()
    (t, _, control), (_, angle, diagonal, largest) = inputs, seen
    before = [control[Control.SEEN + i] for i in range(4)]

    def instant(component: int, square: ca.SX, most: ca.SX, is_asked: ca.SX) -> list[ca.SX]:
        now, last = (ca.asin(ca.fmin(1.0, ca.sqrt(s / most))) for s in (square, before[component]))
        step = t - before[0]
        found = (t + now * step / (last - now), component, ca.sqrt(most), now, step)
        return _either(_all(is_asked, last > now), found, NEVER)

    of_angle = instant(SMALLEST_ANGLE, angle, ca.SX(1), are_asked[0])
    of_diagonal = instant(SMALLEST_DIAGONAL, diagonal, largest, are_asked[1])
    first = _either(of_diagonal[INSTANT] < of_angle[INSTANT], of_diagonal, of_angle)
    return SizedFunction("foreseen", inputs, [ca.vertcat(*seen, *first)])


def _sight() -> tuple[list[ca.SX], list[ca.SX], list[ca.SX]]:
    """t, status, control; what is seen behind the step; and where an instant may be foreseen at which the angle, and
    the diagonal, goes to zero."""
    t, status, control = ca.SX.sym("t"), ca.SX.sym("status", 8), ca.SX.sym("control", SIZE)
    angle, diagonal = status[3 + SMALLEST_ANGLE], status[3 + SMALLEST_DIAGONAL]
    before = [control[Control.SEEN + i] for i in range(4)]
    largest = ca.if_else(before[3] > diagonal, before[3], diagonal)
    is_sound = _all(angle >= 0.0, diagonal >= 0.0, diagonal < math.inf)
    is_later = _all(is_sound, t > before[0])
    wide = math.sin(MONITOR.narrow) ** 2
    are_asked = [
        _all(is_later, angle < before[SMALLEST_ANGLE], angle < wide),
        _all(is_later, diagonal < before[SMALLEST_DIAGONAL], diagonal < wide * largest),
    ]
    return [t, status, control], _either(is_sound, (t, angle, diagonal, largest), before), are_asked


def pushes(width: int, multipliers: Sequence[int]) -> SizedFunction:
    """pushes(line) -> the least of the multipliers of contacts in a line of the table (width,), by their places."""
    line = ca.SX.sym("line", width)
    return SizedFunction("pushes", [line], [ca.mmin(ca.vertcat(*(line[place] for place in multipliers)))])


def _all(*conditions: ca.SX) -> ca.SX:
    return reduce(ca.logic_and, conditions)


def _either(condition: ca.SX, first: Sequence[Number], second: Sequence[Number]) -> list[ca.SX]:
    return [ca.if_else(condition, a, b) for a, b in zip(first, second, strict=True)]
