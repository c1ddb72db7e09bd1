"""The switches of functions of t, as an `Event`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.simulation.events.event import Event
from lagcli.simulation.run_state.run_stop import NOT_FINITE, StepFailure
from lagcli.simulation.stepping import stop_diagnosis
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

# Positions and velocities may differ by this part of their size, and by what they change in so many times the time.
SAME, LONGER = 1e-9, 16.0


class SwitchEvent(Event):
    """A time at which functions of t switch: the state is the same on its other side."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper

    def passes(self) -> bool:
        """See `Event`."""
        run = self._stepper
        found = None if run.predicted.is_here else run.timetable.switch(run.t)
        if found is None:
            return False
        middle, after = (min(t, run.grid.end) for t in found)
        bound, dt = run.bound, after - run.t
        y, k = bound.y, bound.k
        projected, rate, *_ = bound.projected_at(after, y)
        if self._is_pole(run.t, -dt) or self._is_pole(after, dt):
            raise StepFailure(stop_diagnosis.POLE, NOT_FINITE)
        here = run.state_at(run.t, y)
        if not _is_same((y, k), (projected, rate), dt, self._acceleration(here)):
            beyond = run.state_at(after, y)
            raise stop_diagnosis.impact(bound.enforced, here, beyond)
        bound.projected_at(after, y + (middle - run.t) * k + (after - middle) * rate)
        bound.new[:], bound.k_new[:] = projected, rate
        step = run.found
        step.is_open = step.is_still = True
        step.reached, step.taken, step.proposed = after, dt, run.control.step
        return True

    def _acceleration(self, here: State) -> float:
        """The largest that forces alone make of a coordinate."""
        sizes = np.array(self._stepper.bound.numeric.sizes(here.t, here.q, here.v, here.p)).ravel()
        return float(sizes[: here.q.size].max(initial=0.0) * sizes[-1])

    def _is_pole(self, t: float, away: float) -> bool:
        """True if y' at the state grows without bound towards a switch, half of `away` behind a time."""
        run, bound = self._stepper, self._stepper.bound
        rates = [
            np.array(bound.numeric.rhs(t + part * away, bound.y, bound.p)).ravel() for part in (0.0, 1.0, 4.0)
        ]
        run.statistics.evaluations += len(rates)
        return stop_diagnosis.is_pole(rates)


def _is_same(
    before: tuple[Floats, Floats], after: tuple[Floats, Floats], dt: float, acceleration: float
) -> bool:
    """True if y (2n + 1,) of two pairs y, y' is the same on both sides but for the time dt between them; acceleration:
    the largest of the forces alone, for where these balance velocities are rounding."""
    (y, k), (new, k_new) = before, after
    n = y.size // 2
    for part, least in ((slice(0, n), 0.0), (slice(n, 2 * n), acceleration)):
        size = np.abs(y[part]).max(initial=0.0)
        rate = np.maximum(np.abs(k[part]), np.abs(k_new[part])).max(initial=least)
        if not np.abs(new[part] - y[part]).max(initial=0.0) <= SAME * size + LONGER * dt * rate:
            return False
    return True
