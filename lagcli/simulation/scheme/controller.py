"""The length of steps: of the first one, how it follows their errors, and when a run would have no end.

The first step is found from the times in which positions, velocities and accelerations change by their sizes, as in
Hairer, Norsett, Wanner, Solving ODEs I, sec. II.4, but that no size is one of a unit.
"""

from __future__ import annotations

import math

import numpy as np

from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction


class StepLengthParameters:
    """The length of steps; parts are of no unit. The tests are of `tests/unit/test_numbers_of_steps.py` and
    `tests/unit/test_step_length.py`."""

    __slots__ = ()

    safety: float = 0.9
    """The part of the step that the error asks for which is taken: few are rejected.
    `test_a_tenth_of_the_step_is_left`."""
    shrink: float = 0.2
    """A step is not shortened by more: its error says little. `test_a_long_step_is_shortened_little_by_little`."""
    grow: float = 10.0
    """A step is not made longer by more at once: it is not known what lies beyond. `test_steps_grow_by_ten_at_once`."""
    pace: int = 5000
    """After so many steps a run is asked how many more it would take. `test_a_run_that_would_take_days_is_too_slow`."""
    hopeless: float = 1e10
    """So many steps would take days: the run stops. `test_a_run_that_would_take_days_is_too_slow`."""
    rowless: float = 1e8
    """Nor is a row waited for that is so many steps away: hours. `test_a_row_that_is_hours_away_is_too_slow`."""
    rest: float = 1e-6
    """The first step where no scale of time is known, in units of time. `test_where_nothing_moves_time_is_a_scale`."""
    rest_of_time: float = 1e-10
    """Or this part of the time itself. `test_where_nothing_moves_time_is_a_scale`."""
    roundings: int = 256
    """A step is so many roundings of the time at least. `test_a_step_is_hundreds_of_roundings_of_the_time`."""
    look: float = 1e-3
    """A look ahead by this part of the shortest time that is known. `test_forces_are_looked_at_a_thousandth_ahead`."""
    slow: float = 1e-8
    """Less than this part of what accelerations make is rounding. `test_speeds_of_rounding_shorten_no_first_step`."""
    balanced: float = 1e-13
    """Of what the forces alone would make this part is rounding. `test_balanced_forces_give_the_scale_of_time`."""
    part: float = 0.01
    """Of the shortest time this part, to the power of the order, is the error.
    `test_the_first_step_is_as_exact_as_asked`."""


PARAMETERS = StepLengthParameters()


# A step of so many times the length proposed, that ends before the run, is not its last.
NEARLY = 1.001


class StepController:
    """The step proposed for a method of some order, and the time of the last look at the pace."""

    def __init__(self, order: int, step: float, pace_from: float) -> None:
        self._exponent = -1.0 / order
        self.step, self.pace_from = step, pace_from

    def smaller(self, taken: float, error: float, is_known: bool) -> float:
        """The step to be tried after one that was rejected; is_known: for its error, of 1 or more."""
        wished: float = PARAMETERS.safety * error**self._exponent if is_known else 0.25
        return taken * min(0.9, max(PARAMETERS.shrink, wished))

    def grown(self, taken: float, error: float, most: float) -> float:
        """The step to be tried after one that was accepted, no more than `most` times as long."""
        wished: float = PARAMETERS.safety * max(error, 1e-10) ** self._exponent
        return taken * min(most, max(PARAMETERS.shrink, wished))

    def is_too_slow(self, t: float, end: float, row: float) -> float | None:
        """To be asked every `pace` steps: by how much they advanced, where that would never lead to the end, or to the
        next row; row: the time between two."""
        advanced, self.pace_from = t - self.pace_from, t
        most = max((end - t) / PARAMETERS.hopeless, min(end - t, row) / PARAMETERS.rowless)
        return advanced if most * PARAMETERS.pace > advanced else None


def first_step(rhs: BoundFunction, k: Floats, sizes: Floats, tolerance: Floats, order: int) -> float:
    """The length of the first step from where `rhs` stands on its arrays (t, y, p), with k = y'(t, y) (2n + 1,),
    `parts.Sizes.packed` there (n + 3,), `step_tolerance.of_steps` and the order of the method. `rhs` is evaluated once,
    and its arguments are left as they were. The end of the run plays no part in it."""
    t = float(rhs.arguments[0][0])
    n = k.size // 2
    units, (q, v, forced) = sizes[:n], sizes[n:].tolist()
    rtol, resting = float(tolerance[0]), float(tolerance[4])

    def size(accelerations: Floats) -> float:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is asked for below
            return float(np.abs(accelerations / units).max(initial=0.0))

    a = size(k[n : 2 * n])
    v = v if v > PARAMETERS.slow * math.sqrt(q * a) else 0.0
    if not v and a <= PARAMETERS.balanced * max(forced, resting):
        a = max(forced, resting)
    times = [_ratio(q, v), _ratio(v, a), math.sqrt(_ratio(q, a))]
    # A time of which the part that is looked ahead is no number is none.
    known = min((time for time in times if 0.0 < PARAMETERS.look * time < math.inf), default=0.0)
    step = max(PARAMETERS.rest, PARAMETERS.rest_of_time * abs(t))
    if known:
        # After a step of Euler's.
        t_cell, y_cells, _ = rhs.arguments
        y, h = y_cells.copy(), PARAMETERS.look * known
        t_cell[0], y_cells[:] = t + h, y + h * k
        rhs.trigger()
        t_cell[0], y_cells[:] = t, y
        turned = _ratio(a, size(rhs.results[0][n : 2 * n] - k[n : 2 * n]) / h)
        if math.isfinite(turned):
            known = min(known, turned or known)
        step = known * (PARAMETERS.part * rtol) ** (1.0 / order)
    return max(step, PARAMETERS.roundings * math.ulp(t))


def _ratio(size: float, rate: float) -> float:
    return size / rate if rate > 0.0 else math.inf
