"""The switches of functions of t, as an `Event`."""

from __future__ import annotations

from typing import Self

import numpy as np

from lagcli.simulation.events.event import Event
from lagcli.simulation.run_state.run_stop import NOT_FINITE, StepFailure
from lagcli.simulation.stepping import stop_diagnosis, switch_states
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.start.initial import State


class SwitchEvent(Event):
    """A time at which functions of t switch: the state is the same on its other side."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper

    @classmethod
    def of(cls, stepper: Stepper) -> Self | None:
        """See `Event`."""
        return cls(stepper) if stepper.timetable.is_any else None

    def passes(self) -> bool:
        """See `Event`."""
        run = self._stepper
        found = None if run.foreseen.is_here else run.timetable.switch(run.t)
        if found is None:
            return False
        middle, after = (min(t, run.grid.end) for t in found)
        bound, dt = run.bound, after - run.t
        y, k = bound.y, bound.k
        landed, rate, *_ = bound.landed_at(after, y)
        if self._is_pole(run.t, -dt) or self._is_pole(after, dt):
            raise StepFailure(stop_diagnosis.POLE, NOT_FINITE)
        here = run.state_at(run.t, y)
        if not switch_states.is_same((y, k), (landed, rate), dt, self._acceleration(here)):
            beyond = run.state_at(after, y)
            raise stop_diagnosis.impact(bound.held, here, beyond)
        bound.landed_at(after, y + (middle - run.t) * k + (after - middle) * rate)
        bound.new[:], bound.k_new[:] = landed, rate
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
        run.account.evaluations += len(rates)
        return switch_states.is_pole(rates)
