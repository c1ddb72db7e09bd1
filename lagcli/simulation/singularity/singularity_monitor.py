"""Predicts when rows become dependent: the angle between them goes to zero in a line from afar.

A look ahead, which costs a part of the search for the instant, tells rows that only come close: the square of the angle
is a parabola in time near its minimum, zero there where rows become dependent.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lagcli.simulation.scheme import step_end


class MonitorParameters:
    """Thresholds at which a singular configuration is predicted. The tests are of
    `tests/unit/test_numbers_of_steps.py`."""

    __slots__ = ()

    fewer_nodes: int = 8
    """Gauss nodes of the step that one across is compared with. `test_an_instant_is_found_until_it_is_centered`."""
    narrow: float = 0.9
    """An angle (rad) between rows that is smaller is followed. `test_angles_that_are_wide_are_not_followed`."""
    ahead: float = 0.85
    """It may begin this part of its own reach before the instant. `test_a_step_across_begins_some_steps_before`."""
    earlier: float = 6.0
    """And so many times farther off where amplified rounding counts, the square of it where steps grow.
    `test_a_step_across_begins_some_steps_before`."""
    growing: float = 4.0
    """Steps grow where one is this many times as long as the last. `test_a_step_across_begins_some_steps_before`."""
    shorter: float = 0.6
    """An ordinary step goes this part of the way. `test_an_ordinary_step_goes_part_of_the_way_to_the_instant`."""
    back: float = 0.1
    """By this part of the first step. `test_close_rows_of_a_start_are_looked_at_before_it`."""
    looks: int = 4
    """Points where one is looked for after the first three. `test_a_minimum_is_looked_for_at_four_points`."""
    farthest: float = 2.0
    """How far it may lie, as a part of the time to the instant. `test_a_minimum_is_looked_for_up_to_twice_the_time`."""
    shallow: float = 0.01
    """One of less than this part of the square as it is may be zero.
    `test_a_minimum_of_a_hundredth_of_the_square_is_no_zero`."""
    certain: float = 0.1
    """Rows at a smaller angle (rad): steps towards them are not exact. `test_close_rows_are_searched_at_once`."""
    apart: float = 0.02
    """Closer than this part of the time to the instant. `test_looks_that_are_close_together_say_nothing_new`."""


PARAMETERS = MonitorParameters()
# Indices in the status of `project`.
SMALLEST_ANGLE, SMALLEST_DIAGONAL = 1, 2
STANDING = -1  # in place of them, at a start at which rows are dependent


class Prediction(NamedTuple):
    """An instant, which number of the status of `project` goes to zero there, how large its root was, the angle (or the
    part of that) that is left, and the length of the last step."""

    instant: float
    component: int
    most: float = 1.0
    angle: float = math.pi
    step: float = math.inf

    def shortened(self, t: float, h: float) -> float:
        """An ordinary step that does not lead across unseen."""
        left = self.instant - t
        return PARAMETERS.shorter * left if 0 < left < h / PARAMETERS.shorter else h

    @property
    def is_any(self) -> bool:
        """True if an instant is predicted at all."""
        return self.instant < math.inf

    @property
    def is_here(self) -> bool:
        """True if the run begins at the instant."""
        return self.component == STANDING

    def is_near(self, t: float, h: float, rtol: float, order: int) -> bool:
        """True if a step across from t is worth a try, where ordinary steps of a scheme of some order have the
        length h.

        The error of an ordinary step is a part (h / T)**order of the motion. That gives T, the time in which the motion
        changes. The error of a step across goes with its own order. The closer to the instant it begins, the more
        rounding is amplified: it may not come too close for its tolerance. Soon after the start of a run steps are
        short for no reason of the motion, and grow.
        """
        reach = PARAMETERS.ahead * h * rtol ** (1 / (2 * PARAMETERS.fewer_nodes) - 1 / order)
        if self.angle < (step_end.PARAMETERS.amplified / rtol) ** (1 / 3):
            reach *= PARAMETERS.earlier
        if h > PARAMETERS.growing * self.step:
            reach *= PARAMETERS.earlier**2
        return bool(self.instant - t < reach)


NEVER = Prediction(math.inf, 0)


class SingularityMonitor(NamedTuple):
    """What was seen of the rows up to a step, and what is foreseen from there: a value, so that of a step which is not
    taken nothing is left. seen: t, smallest angle and least diagonal after the last step, and the largest of the latter
    so far; empty before the first one."""

    seen: tuple[float, ...] = ()
    foreseen: Prediction = NEVER

    @classmethod
    def of(cls, state: tuple[float, ...]) -> SingularityMonitor:
        """The monitor whose `state` was kept."""
        if not state[4:]:
            return cls(state)
        instant, component, *rest = state[4:]
        return cls(state[:4], Prediction(instant, int(component), *rest))

    @property
    def state(self) -> tuple[float, ...]:
        """All that it takes to go on, as plain numbers."""
        return self.seen if self.foreseen is NEVER else (*self.seen, *map(float, self.foreseen))

    @classmethod
    def standing(cls, t: float) -> SingularityMonitor:
        """At a start at which rows are dependent."""
        return cls((t, 0.0, 0.0, 0.0), Prediction(t, STANDING, 1.0, 0.0, 0.0))

    @property
    def rank_margin(self) -> tuple[float, bool]:
        """The distance of rows from dependent ones after the last step, as an angle or a part of the length of the one
        that vanishes, and whether it is the latter."""
        if not self.seen:
            return 1.0, False
        _, smallest_angle, smallest_diagonal, largest = self.seen
        alone = math.sqrt(smallest_diagonal / largest) if largest > 0 else 1.0
        return min(math.sqrt(smallest_angle), alone), alone < math.sqrt(smallest_angle)

    def after(self, t: float, smallest_angle: float, smallest_diagonal: float) -> SingularityMonitor:
        """Behind one step more."""
        before = self.seen
        if not (smallest_angle >= 0.0 <= smallest_diagonal < math.inf):
            return SingularityMonitor(before)
        largest = before[3] if before and before[3] > smallest_diagonal else smallest_diagonal
        seen = t, smallest_angle, smallest_diagonal, largest
        if not before or t <= before[0]:
            return SingularityMonitor(seen)
        found = NEVER
        wide = math.sin(PARAMETERS.narrow) ** 2
        # Most steps of most runs ask for no more than this.
        if smallest_angle < before[SMALLEST_ANGLE] and smallest_angle < wide:
            found = _instant(before, t, smallest_angle, SMALLEST_ANGLE, 1.0)
        if smallest_diagonal < before[SMALLEST_DIAGONAL] and smallest_diagonal < wide * largest:
            found = min(found, _instant(before, t, smallest_diagonal, SMALLEST_DIAGONAL, largest))
        return SingularityMonitor(seen, found)


def _instant(before: tuple[float, ...], t: float, square: float, component: int, most: float) -> Prediction:
    """The prediction of when a number goes to zero, the square of a sine: the angle between rows goes to zero in a line
    from afar."""
    now, last = math.asin(math.sqrt(square / most)), math.asin(min(1.0, math.sqrt(before[component] / most)))
    step = t - before[0]
    if last <= now:
        return NEVER
    return Prediction(t + now * step / (last - now), component, math.sqrt(most), now, step)


def is_dip(square: Callable[[float], float], now: float, ahead: float) -> bool:
    """True if the square of an angle, `now` at the beginning, has a minimum well above zero. square(h) is that after a
    time h, nan where it is not known: then nothing is; ahead: the time after which the angle is expected to vanish."""
    found = {0.0: now, ahead / 2: square(ahead / 2), ahead: square(ahead)}

    def are_above() -> bool:
        return all(each > PARAMETERS.shallow * now for each in found.values())

    for _ in range(PARAMETERS.looks):
        if not are_above():
            return False
        lowest = sorted(found, key=found.__getitem__)[:3]
        curve = np.polyfit(np.array(lowest) / ahead, [found[h] / now for h in lowest], 2)
        if not curve[0] > 0.0:
            break  # it falls no more, or not yet
        least = min(max(-curve[1] / (2 * curve[0]), 0.0), PARAMETERS.farthest) * ahead
        if min(abs(least - h) for h in found) < PARAMETERS.apart * ahead:
            break
        found[least] = square(least)
    return are_above()
