"""Forces that switch in the velocities, as an `Event`: where both sides of a switch push the motion onto it, the run
ends."""

from __future__ import annotations

import numpy as np

from lagcli.compiled.bound_function import BoundFunction, cells
from lagcli.compiled.force_switches import ForceSwitches
from lagcli.simulation.events.event import Event
from lagcli.simulation.stepping import sticking
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper


class StickingEvent(Event):
    """A switch of a force that the motion cannot leave."""

    def __init__(self, stepper: Stepper, switches: ForceSwitches) -> None:
        self._stepper, self._switches = stepper, switches
        self._bind()

    def _bind(self) -> None:
        self._bound = bound = self._stepper.bound
        _, h, y, k, _, _ = bound.step.arguments
        drawn = self._switches.drawn
        p = bound.p[: drawn.size1_in(6)]
        self._drawn = BoundFunction(drawn, [np.zeros(1), h, y, k, bound.new, bound.k_new, p])
        self._t = cells(self._drawn.arguments[0])

    def found(self, step: FoundStep) -> None:
        """See `Event`."""
        run = self._stepper
        if not step.is_ordinary:
            return
        if run.bound is not self._bound:
            self._bind()
        self._t[0] = run.origin + run.t
        self._drawn.trigger()
        if self._drawn.results[0].any():
            sticking.require_step(run.bound, self._switches, run.origin + run.t)
