"""The switches of functions of t, as an `Event`."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.simulation.events.event import Event
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.stepping import stop_diagnosis
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

# Positions and velocities may differ by what they change in so many times the time, beside rounding.
LONGER = 16.0


class SwitchEvent(Event):
    """A time at which functions of t switch: the state is the same on its other side."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper

    def begin(self) -> None:
        """A start with contacts that stands at a switch is taken on its other side: there they are decided."""
        run = self._stepper
        if run.bound.enforced.system.contacts.count and (step := self.passes()):
            run.stand(step.reached, run.bound.new, run.bound.k_new)

    def passes(self) -> FoundStep | None:
        """See `Event`."""
        run = self._stepper
        found = None if run.watch.foreseen.is_here else run.timetable.switch(run.t)
        if found is None:
            return None
        middle, after = (min(t, run.grid.end) for t in found)
        bound, dt = run.bound, after - run.t
        y, k = bound.y, bound.k
        project = bound.projected_at
        projected, rate, *_ = project(after, y)
        here = run.state_at(run.t, y)
        acceleration = stop_diagnosis.of_forces(bound.numeric, here)
        if self._is_pole(run.t, -dt, acceleration) or self._is_pole(after, dt, acceleration):
            raise StepFailure(*stop_diagnosis.POLE)
        if not _is_same((y, k), (projected, rate), dt, acceleration):
            project = functools.partial(opened, run)
            projected, rate = project(after, y)
            beside = run.state_at(after, y)
            if self._jumps(here, beside) or not _is_same((y, k), (projected, rate), dt, acceleration):
                raise stop_diagnosis.impact(bound.enforced, here, beside)
        ahead = y + (middle - run.t) * k + (after - middle) * rate
        new, rate, *_ = project(after, ahead)
        return run.still(after, new, rate)

    def _jumps(self, here: State, beyond: State) -> bool:
        """True where the wall of a closed contact is on the wrong side beyond, however fast it may be."""
        numeric = self._stepper.bound.numeric
        first = len(self._stepper.bound.enforced.system.rows.rows)
        closed = [i - first for i in (*numeric.closed_rows, *numeric.idle_rows)]
        found = [numeric.contacts(s.t, s.q, s.v, s.p) for s in (here, beyond)]
        (g, *_), (g_beyond, *_) = sides = [[np.array(each)[closed] for each in side] for side in found]
        speed = sum(np.abs(G @ here.v + g_t.ravel()) for _, G, g_t, *_ in sides)
        room = doubles.ZERO * float(np.abs(here.q).max(initial=0.0)) + LONGER * (beyond.t - here.t) * speed
        return not bool(((g_beyond - g).ravel() >= -room).all())

    def _is_pole(self, t: float, away: float, acceleration: float) -> bool:
        """True if y' at the state grows without bound towards a switch, half of `away` behind a time."""
        run, bound = self._stepper, self._stepper.bound
        rates = [
            np.array(bound.numeric.rhs(t + part * away, bound.y, bound.p)).ravel() for part in (0.0, 1.0, 4.0)
        ]
        run.count(len(rates))
        return stop_diagnosis.is_pole(rates, acceleration)


def opened(run: Stepper, t: float, y: Floats) -> list[Floats]:
    """A state y (2n + 1,), and y', on the equality rows alone: what a wall that is suddenly faster or slower, or has
    another direction, does to it is no matter of rows but of contacts."""
    bound = run.bound
    rows = len(bound.enforced.system.rows.rows)
    enforced = bound.enforced.keeping(bound.enforced.selection.opened(rows))
    found = enforced.functions.numeric.project(t, y, enforced.parameters)[:2]
    run.count(1)
    return [np.array(each).ravel() for each in found]


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
        if not np.abs(new[part] - y[part]).max(initial=0.0) <= doubles.ZERO * size + LONGER * dt * rate:
            return False
    return True
