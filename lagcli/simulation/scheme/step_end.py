"""The end of a step, whatever the method: projection onto f = 0 and B v + b = 0, and what its error is compared with.

The error of a step is the largest component of (q, v), and not the root mean square: a coordinate at rest then does not
loosen the tolerance of the others, and a model takes the same steps however many idle coordinates it is written in.
The work W does not steer the step: it is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.simulation.scheme import step_tolerance as tolerances
from lagcli.smoothness.sized_function import SizedFunction


class StepEndParameters:
    """The end of a step, and what counts as its error; parts are of no unit. The tests are of
    `tests/unit/test_numbers_of_steps.py`."""

    __slots__ = ()

    moved: float = 100.0
    """The projection may move a state by this many tolerances. `test_a_projection_moves_little`."""
    moved_rounding: float = 1e-10
    """And by this part of its size. `test_a_projection_moves_little`."""
    jump: int = 1024
    """A step of so many roundings of the time may hold a jump. `test_a_step_of_a_few_roundings_may_hold_a_jump`."""
    balanced: float = 1e-14
    """The rounding of forces that hold all at the origin. `test_forces_hold_positions_at_the_origin`."""
    close: float = 1e-2
    """Rows at a smaller angle (rad) amplify rounding, and may be why a run stops.
    `test_close_rows_amplify_rounding`."""
    amplified: float = 1e-16
    """About this part of accelerations, over the cube of the angle. `test_close_rows_amplify_rounding`."""
    written_out: int = 1000
    """Indices of a state up to which a step is one graph. `test_steps_of_a_thousand_numbers_are_written_out`."""


PARAMETERS = StepEndParameters()

# Short states are written out, in SX.
Expression = TypeVar("Expression", ca.SX, ca.MX)
# Symbols or numbers.
Curve = TypeVar("Curve", ca.SX, ca.MX, npt.NDArray[np.float64])
# combined(h, sizes of the estimates) -> the error of the step: how a method makes one number of its estimates.
Combined = Callable[..., Any]
Compiled = ca.Function


class StepEnd(NamedTuple):
    """The state on the constraints and its derivative (2n + 1,), the status of `NumericSystem.project`, and error,
    moved, error of W (3,) as in `method.Method.step`."""

    projected: ca.MX
    k_new: ca.MX
    status: ca.MX
    judged: ca.MX

    def outputs(self, hidden: ca.MX | float, stages: Sequence[ca.MX]) -> list[ca.MX]:
        """The results of a step as in `method.Method.step`."""
        statistics = ca.vertcat(self.judged[:2], hidden, self.status, self.judged[2])
        return [self.projected, self.k_new, statistics, *stages]


def inputs(numeric: NumericSystem) -> list[ca.MX]:
    """The arguments of a step: t, h, y and k = y'(t, y) (2n + 1,), `step_tolerance.of_steps` (8,), p."""
    return symbols(numeric, "t h y k tolerance p")


def symbols(numeric: NumericSystem, names: str) -> list[ca.MX]:
    """Symbols of some names: for p, the tolerance, for t, h and x, which are numbers, and for states (2n + 1,)."""
    sizes = {"t": 1, "h": 1, "x": 1, "tolerance": tolerances.COUNT, "p": numeric.rhs.size1_in(2)}
    return [ca.MX.sym(name, sizes.get(name, 2 * numeric.n + 1)) for name in names.split()]


def ended(
    numeric: NumericSystem, step: list[ca.MX], new: ca.MX, estimates: Sequence[ca.MX], combined: Combined
) -> StepEnd:
    """The end of a step that has come to `new`, with estimates of its error over h, (2n + 1,) each."""
    t, h, y, k, tolerance, p = step
    projected, k_new, status, sizes = numeric.project(t + h, new, p)
    # Rows are left by a part of the velocities; where these are the rounding of forces that hold all at the origin, by
    # no more than that.
    q, v, a = (sizes[numeric.n + i] for i in range(3))
    tiny = doubles.TINY
    part = ca.if_else(q < doubles.ROOT * h * h * a, v / (v + doubles.ROOT * h * a + tiny), 1)
    status = ca.vertcat(part * status[0], status[1:])
    # Stages are taken at times rounded to doubles, which may be so far apart that the state is not known better.
    near_t = doubles.EPS * ca.fabs(t + h) if numeric.has_time else 0.0
    noise = near_t * _within(near_t, h, (y, k, k_new)) * ca.fabs(k_new - k) if numeric.has_time else 0.0 * k
    noise = noise + _amplified(numeric.n, status[1], sizes, h)
    # Rows that move are where they are at one of these times.
    blur = near_t * ca.fabs(k_new)
    form = y.numel(), len(estimates), combined
    judge = _judge(ca.SX, *form) if y.numel() <= PARAMETERS.written_out else _judge(ca.MX, *form)
    return StepEnd(
        projected, k_new, status, judge(y, new, projected, h, sizes, tolerance, noise, blur, *estimates)
    )


def _amplified(n: int, smallest_angle: ca.MX, sizes: ca.MX, h: ca.MX) -> ca.MX:
    """The rounding of a step (2n + 1,) on rows that are nearly dependent, 0 on others: their forces are known no
    better."""
    units, a = sizes[:n], sizes[n + 2]
    delta = ca.sqrt(smallest_angle + doubles.TINY)
    gained = ca.if_else(delta < PARAMETERS.close, PARAMETERS.amplified / delta**3, 0.0) * h * a
    return gained * ca.vertcat(h * units, units, 0)


def _within(near_t: ca.MX | float, h: ca.MX, states: tuple[ca.MX, ca.MX, ca.MX]) -> ca.MX:
    """By how much the rounding of the time counts: 1, and more where a step of a few roundings holds a jump, which
    changes velocities by next to nothing, or sets a body at rest in motion. A pole does neither. states: y, and y' at
    both ends."""
    y, k, k_new = states
    n = y.numel() // 2
    gained, speed = h * ca.mmax(ca.fabs(k_new - k)[n : 2 * n]), ca.mmax(ca.fabs(y[n : 2 * n]))
    is_jump = ca.logic_or(gained <= doubles.ZERO * speed, speed <= doubles.ZERO * gained)
    return 1 + is_jump * near_t * PARAMETERS.jump**2 / h


def _judge(sort: type[Expression], size: int, count: int, combined: Combined) -> ca.Function:
    """judge(y, new, projected, h, sizes, tolerance, noise, blur, estimates) -> (error, moved, error of W). noise, blur
    (2n + 1,): what the rounding of t makes of the error, and of the state; of estimates there are `count`."""
    n = size // 2
    y, new, projected, noise, blur = (
        sort.sym(name, size) for name in ("y", "new", "projected", "noise", "blur")
    )
    estimates: list[Expression] = [sort.sym(f"e{i}", size) for i in range(count)]
    h, sizes = sort.sym("h"), sort.sym("sizes", n + 3)
    tolerance = sort.sym("tolerance", tolerances.COUNT)
    scale = scales((y, new), h, sizes, tolerance)
    # The projection puts a state where rows are, to their rounding.
    units, off = sizes[:n], tolerance[tolerances.BLURRED]
    room = blur[: 2 * n] + ca.vertcat(units * (off[0] + h * off[1]), units * off[1])
    moved = _moved(projected - new, scale + room, sizes)
    # The energy at hand: what has been done up to here, or that of the motion; and what rounding makes of rest.
    energy = ca.fabs(y[2 * n]) + sizes[n + 1] ** 2
    rounded = doubles.EPS * ca.fmax(sizes[n + 2], tolerance[4]) * sizes[n]
    of_work = combined(h, *(ca.fabs(estimate[2 * n]) for estimate in estimates)) / (
        tolerance[0] * energy + rounded + doubles.TINY
    )
    allowed = scale + noise[: 2 * n]
    error = combined(h, *(ca.mmax(ca.fabs(estimate[: 2 * n] / allowed)) for estimate in estimates))
    inputs: list[Expression] = [y, new, projected, h, sizes, tolerance, noise, blur]
    inputs += estimates
    return SizedFunction("judge", inputs, [ca.vertcat(error, moved, of_work)])


def scales(
    states: Sequence[Expression], h: Expression, sizes: Expression, tolerance: Expression
) -> Expression:
    """The sizes that errors of (q, v) are compared with (2n,): of the states (2n + 1,) at both ends of a step of length
    h, `parts.Sizes.packed` at its end, and `step_tolerance.of_steps`."""
    n = (states[0].numel() - 1) // 2
    rtol, atol, part, rounding, resting, _, _, blurred = (tolerance[i] for i in range(tolerances.COUNT))
    units, (q, v, a) = sizes[:n], (sizes[n + i] for i in range(3))
    speed = ca.fmax(v, h * a)
    largest = ca.fmax(*(ca.fabs(y[: 2 * n]) for y in states))
    # The rounding of forces that balance is no error of the step, whether the rows hold the system at the origin, where
    # no size of q covers it, or at rest elsewhere, where no speed does.
    forced = ca.fmax(a, resting)
    is_small, is_resting = q < doubles.ROOT * h * h * a, v * v < doubles.VALUE**2 * forced * q
    # What rounding pushes comes back in the time in which the forces would have moved it by its size.
    lasting = ca.if_else(
        is_small, h, ca.if_else(is_resting, ca.fmin(h, ca.sqrt(q / (forced + doubles.TINY))), 0)
    )
    balanced = PARAMETERS.balanced * lasting * forced
    # What the rounding of the forces makes of a step is not known better, however small the motion is as yet.
    blur = h * blurred
    # An `atol` above the rounding of positions is meant as it stands; what is no number stays none.
    rounding = ca.if_else(atol >= rounding * q, 0, rounding)
    floors = ca.vertcat(
        units * (part * h * speed + rounding * q + lasting * balanced + h * blur),
        units * (part * speed + rounding * q / h + balanced + blur),
    )
    return rtol * largest + atol + floors + doubles.TINY


def _moved(by: Expression, scale: Expression, sizes: Expression) -> Expression:
    """The way the projection moved (q, v), as a part of what it may: a step that is right lies about as close to the
    constraints, and one that is moved much farther has come to another branch, or to no motion at all."""
    n2 = scale.numel()
    n = n2 // 2
    units = sizes[:n]
    allowed = PARAMETERS.moved * scale + PARAMETERS.moved_rounding * ca.vertcat(
        units * sizes[n], units * sizes[n + 1]
    )
    return ca.mmax(ca.fabs(by[:n2]) / allowed)
