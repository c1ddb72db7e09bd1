"""The switches of functions of t, as an `Event`."""

from __future__ import annotations

import functools

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.force_switches import ForceSwitches
from lagcli.simulation.events.event import Event, Screen
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.stepping import stop_diagnosis
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper

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

    def screen(self) -> Screen | None:
        """See `Event`: steps that the timetable leaves free meet none."""
        run = self._stepper
        return Screen(holds=lambda: run.timetable.switch(run.t) is None)

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
        for t, away in ((run.t, -dt), (after, dt)):
            # Does y' grow without bound towards a switch, half of this way behind?
            rates = run.rates([t + part * away for part in (0.0, 1.0, 4.0)])
            if stop_diagnosis.is_pole(rates, acceleration):
                raise StepFailure(*stop_diagnosis.POLE)

        def is_same(new: Floats, rate: Floats) -> bool:
            """True if the state is the same on both sides but for the time between them; the forces alone count where
            these balance, for velocities are rounding there."""
            n = y.size // 2
            for part, least in ((slice(0, n), 0.0), (slice(n, 2 * n), acceleration)):
                size = np.abs(y[part]).max(initial=0.0)
                fastest = np.maximum(np.abs(k[part]), np.abs(rate[part])).max(initial=least)
                change = np.abs(new[part] - y[part]).max(initial=0.0)
                if not change <= doubles.ZERO * size + LONGER * dt * fastest:
                    return False
            return True

        if not is_same(projected, rate):
            project = functools.partial(opened, run)
            projected, rate = project(after, y)
            beside, numeric = run.state_at(after, y), bound.numeric
            # The wall of a closed contact may not be on the wrong side beyond, however fast it may be.
            first = len(bound.enforced.system.rows.rows)
            closed = [i - first for i in numeric.lying_rows]
            (g, G, g_t), (g_beyond, G_beyond, g_t_beyond) = (
                [np.array(each)[closed] for each in numeric.contacts(s.t, s.q, s.v, s.p)[:3]]
                for s in (here, beside)
            )
            speed = np.abs(G @ here.v + g_t.ravel()) + np.abs(G_beyond @ here.v + g_t_beyond.ravel())
            size = float(np.abs(here.q).max(initial=0.0))
            room = doubles.ZERO * size + LONGER * (beside.t - here.t) * speed
            if not ((g_beyond - g).ravel() >= -room).all() or not is_same(projected, rate):
                raise stop_diagnosis.impact(bound.enforced, here, beside)
        ahead = y + (middle - run.t) * k + (after - middle) * rate
        new, rate, *_ = project(after, ahead)
        return run.still(after, new, rate)


def opened(run: Stepper, t: float, y: Floats) -> list[Floats]:
    """A state y (2n + 1,), and y', on the equality rows alone: what a wall that is suddenly faster or slower, or has
    another direction, does to it is no matter of rows but of contacts."""
    bound = run.bound
    rows = len(bound.enforced.system.rows.rows)
    enforced = bound.enforced.keeping(bound.enforced.selection.opened(rows))
    found = enforced.functions.numeric.project(t, y, enforced.parameters)[:2]
    run.count(1)
    return [np.array(each).ravel() for each in found]


class StickingEvent(Event):
    """A switch of a force that the motion cannot leave."""

    def __init__(self, stepper: Stepper, switches: ForceSwitches) -> None:
        self._stepper, self._switches = stepper, switches
        self._drawn: tuple[BoundStep, BoundFunction] | None = None

    def screen(self) -> Screen | None:
        """See `Event`."""
        return Screen(self._switches.clear())

    def found(self, step: FoundStep) -> None:
        """See `Event`."""
        run, bound = self._stepper, self._stepper.bound
        if not step.is_ordinary:
            return
        if self._drawn is None or self._drawn[0] is not bound:
            _, h, y, k, _, _ = bound.arguments
            function = self._switches.drawn
            p = bound.p[: function.size1_in(6)]
            arguments = [np.zeros(1), h, y, k, bound.new, bound.k_new, p]
            self._drawn = bound, BoundFunction(function, arguments)
        drawn = self._drawn[1]
        drawn.arguments[0][0] = run.origin + run.t
        drawn.trigger()
        if drawn.results[0].any():
            stop_diagnosis.require_not_stuck(bound, self._switches, run.origin + run.t)
