"""The watched functions along a step across a singular configuration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli.contact import zero_search
from lagcli.simulation.events.incident_log import IncidentLog, InstantLines
from lagcli.simulation.events.step_watch import FixedAhead
from lagcli.simulation.events.watch_functions import WatchFunctions
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.incident import Incident
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme import collocation
from lagcli.simulation.singularity.singularity_step import SingularStep
from lagcli.simulation.stepping import interpolate_rows
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

# Parts of the step before the instant, and of that behind it, at which multipliers are looked at: at the instant they
# have no values.
PARTS = (0.25, 0.5, 0.75, 1.0)


class SingularStepWatch:
    """w (W,) of `WatchFunctions` along the step that was found."""

    def __init__(self, functions: WatchFunctions, run: Stepper, singular_step: SingularStep) -> None:
        self._functions, self._run, self._step_across = functions, run, singular_step

    def inside(self, x: float) -> tuple[Floats, Floats]:
        """w and dw/dx at the fraction x of the step."""
        run, step = self._run, self._step_across.step
        t = run.origin + step.t + x * step.h
        w, slope = self._functions.moving(t, step.state(x), step.slope(x), run.bound.p)
        return np.array(w).ravel(), step.h * np.array(slope).ravel()

    def event(self, x: float, name: str, log: IncidentLog) -> Incident:
        """A declared event at the fraction x."""
        run, step = self._run, self._step_across.step
        t = step.t + x * step.h
        interpolate_rows.put_in_singular_step(run, self._step_across, t)
        line = run.trial.rows.line.copy()
        return log.incident(t, "event", name, InstantLines(line, line))

    @property
    def instant(self) -> float:
        """The fraction of the step at which it is singular."""
        return (self._step_across.instant - self._step_across.step.t) / self._step_across.step.h

    def ahead(self, x: float, before: Floats | None) -> FixedAhead:
        """The state at the fraction x."""
        step = self._step_across.step
        return FixedAhead(step.t + x * step.h, step.state(x), before)

    def ended_at_instant(self, found: FoundStep) -> tuple[FoundStep, Floats]:
        """The step ended there, and the line of the table: the rows have no projection there, and those that go on have
        one."""
        run, singular_step = self._run, self._step_across
        interpolate_rows.put_in_singular_step(run, singular_step, singular_step.instant)
        run.trial.put_end(singular_step.middle, singular_step.step.slope(self.instant))
        return self._ended(found, singular_step.instant), run.trial.rows.line.copy()

    def ended_at(self, found: FoundStep, x: float) -> FoundStep | None:
        """The step ended at the fraction x; None where the state there cannot be found on the constraints."""
        run, step = self._run, self._step_across.step
        reached, state = step.t + x * step.h, step.state(x)
        if collocation.projected(run.bound.scratch, reached, state) is None:
            return None
        run.trial.project_end(reached, state)
        return self._ended(found, reached)

    def _ended(self, found: FoundStep, reached: float) -> FoundStep:
        return found._replace(reached=reached, taken=reached - self._run.t, is_jump=True)


class LiftOff(NamedTuple):
    """x: the fraction of the step; indices: of the functions of contacts that open there; beyond: a fraction behind it
    at which they pull."""

    x: float
    indices: Indices
    beyond: float


def first_lift_off(curve: SingularStepWatch, indices: Indices, rounding: Floats) -> LiftOff | None:
    """The first lift of closed contacts, by their indices among the functions (W,) that are watched, whose rounding
    is given (W,)."""
    instant = curve.instant
    if not (indices.size and instant > 0):
        return None
    noise = rounding[indices]
    before = [0.0, *(part * instant for part in PARTS[:-1])]
    behind = [instant + part * (1.0 - instant) for part in PARTS]
    last = before[0]
    for x in (*before[1:], *behind):
        pulls = curve.inside(x)[0][indices] < -noise
        if pulls.any():
            if x == behind[0]:
                return LiftOff(instant, indices[pulls], x)
            return _between(curve, indices, noise, (last, x)) or LiftOff(x, indices[pulls], x)
        last = x
    return None


def ended_at_lift_off(
    curve: SingularStepWatch, found: FoundStep, lift_off: LiftOff
) -> tuple[FoundStep, FixedAhead]:
    """The step ended at a lift, and the state behind it. Raises `StepFailure` where there is no state on the
    constraints."""
    if lift_off.x == curve.instant:
        step, before = curve.ended_at_instant(found)
        return step, curve.ahead(lift_off.beyond, before)
    ended = curve.ended_at(found, lift_off.x)
    if ended is None:
        raise StepFailure("a contact opens where a singular configuration is passed", run_stop.CONTACT)
    return ended, curve.ahead(lift_off.beyond, None)


def _between(
    curve: SingularStepWatch, indices: Indices, noise: Floats, span: tuple[float, float]
) -> LiftOff | None:
    begin, width = span[0], span[1] - span[0]

    def values(u: float) -> tuple[Floats, Floats]:
        w, slope = curve.inside(begin + u * width)
        return w[indices], slope[indices] * width

    crossing = zero_search.first_crossing(values, noise)
    if crossing.x is None:
        return None
    return LiftOff(begin + crossing.x * width, indices[list(crossing.rows)], span[1])
