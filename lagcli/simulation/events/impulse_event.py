"""Jumps of a potential, the Lagrangian or a place as an `Event`: the force there is an impulse, and the run ends."""

from __future__ import annotations

from typing import Self

from lagcli.equations.energy_jumps import Crossings, Way
from lagcli.simulation.events import jump_curve
from lagcli.simulation.events.event import Event
from lagcli.simulation.stepping.stepper import Stepper


class ImpulseEvent(Event):
    """A jump of what the equations take for smooth."""

    def __init__(self, stepper: Stepper, crossings: Crossings) -> None:
        self._stepper, self._crossings = stepper, crossings
        self._functions = jump_curve.CurveFunctions(crossings, stepper.method)
        self._curve = jump_curve.StepCurve(self._functions, stepper)

    @classmethod
    def of(cls, stepper: Stepper) -> Self | None:
        """See `Event`."""
        jumps = stepper.bound.held.integrals.system.jumps
        crossings = None if jumps is None else jumps.crossings
        return None if crossings is None else cls(stepper, crossings)

    def cut(self) -> None:
        """See `Event`."""
        run, found = self._stepper, self._stepper.found
        if found.is_still:
            return
        if not self._curve.is_of(run):
            self._curve = jump_curve.StepCurve(self._functions, run)
        if found.passage is None and not found.has_dense:
            if not self._curve.is_crossed():
                return
            run.bound.staged.trigger()
            run.account.evaluations += run.method.evaluations
            run.make_dense()
        found.barrier = self._crossings.first(self._way(), jump_curve.PARTS)
        if found.barrier is not None:
            found.reached = run.t + found.barrier.part * found.taken

    def _way(self) -> Way:
        if self._stepper.found.passage is not None:
            return jump_curve.PassageCurve(self._crossings, self._stepper)
        return self._curve
