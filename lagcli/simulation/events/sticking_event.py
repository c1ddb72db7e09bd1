"""Forces that switch in the velocities, as an `Event`: where both sides of a switch push the motion onto it, the run
ends."""

from __future__ import annotations

import numpy as np

from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.force_switches import ForceSwitches
from lagcli.simulation.events.event import Event
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.stepping import sticking
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper


class StickingEvent(Event):
    """A switch of a force that the motion cannot leave."""

    def __init__(self, stepper: Stepper, switches: ForceSwitches) -> None:
        self._stepper, self._switches = stepper, switches
        self._drawn: tuple[BoundStep, BoundFunction] | None = None

    def found(self, step: FoundStep) -> None:
        """See `Event`."""
        run, bound = self._stepper, self._stepper.bound
        if not step.is_ordinary:
            return
        if self._drawn is None or self._drawn[0] is not bound:
            _, h, y, k, _, _ = bound.step.arguments
            function = self._switches.drawn
            p = bound.p[: function.size1_in(6)]
            arguments = [np.zeros(1), h, y, k, bound.new, bound.k_new, p]
            self._drawn = bound, BoundFunction(function, arguments)
        drawn = self._drawn[1]
        drawn.arguments[0][0] = run.origin + run.t
        drawn.trigger()
        if drawn.results[0].any():
            sticking.require_step(bound, self._switches, run.origin + run.t)
