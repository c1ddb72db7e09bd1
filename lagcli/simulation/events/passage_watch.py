"""The watched functions along a step across a singular configuration."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.simulation.events import passage_line
from lagcli.simulation.events.incident_log import IncidentLog, InstantLines
from lagcli.simulation.events.state_ahead import FixedAhead
from lagcli.simulation.events.watch_functions import WatchFunctions
from lagcli.simulation.run_state.incident import Incident
from lagcli.simulation.scheme import collocation
from lagcli.simulation.singularity.singularity_step import SingularStep
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]


class PassageWatch:
    """w (W,) of `WatchFunctions` along the step that was found."""

    def __init__(self, functions: WatchFunctions, run: Stepper, passage: SingularStep) -> None:
        self._functions, self._run, self._passage = functions, run, passage

    def inside(self, x: float) -> tuple[Floats, Floats]:
        """w and dw/dx at the fraction x of the step."""
        run, step = self._run, self._passage.step
        t = run.origin + step.t + x * step.h
        w, slope = self._functions.moving(t, step.state(x), step.slope(x), run.bound.held.p)
        return np.array(w).ravel(), step.h * np.array(slope).ravel()

    def event(self, x: float, name: str, log: IncidentLog) -> Incident:
        """A declared event at the fraction x."""
        run, step = self._run, self._passage.step
        t = step.t + x * step.h
        passage_line.put(run, self._passage, t)
        line = run.rows.line.copy()
        return log.incident(t, "event", name, InstantLines(line, line))

    @property
    def instant(self) -> float:
        """The fraction of the step at which it is singular."""
        return (self._passage.instant - self._passage.step.t) / self._passage.step.h

    def ahead(self, x: float, before: Floats | None) -> FixedAhead:
        """The state at the fraction x."""
        step = self._passage.step
        return FixedAhead(step.t + x * step.h, step.state(x), before)

    def end_at_instant(self) -> Floats:
        """The line of the table there, where the step is made to end; the rows have no projection there, and those that
        go on have one."""
        run, found, passage = self._run, self._run.found, self._passage
        passage_line.put(run, passage, passage.instant)
        run.bound.new[:], run.bound.k_new[:] = passage.middle, passage.step.slope(self.instant)
        found.reached, found.taken, found.is_jump = passage.instant, passage.instant - run.t, True
        return run.rows.line.copy()

    def end_at(self, x: float) -> bool:
        """End the step at the fraction x; False where the state there cannot be found on the constraints."""
        run, found, step = self._run, self._run.found, self._passage.step
        reached = step.t + x * step.h
        if collocation.landed(run.bound.aside, reached, step.state(x)) is None:
            return False
        landed, rate, *_ = run.bound.landed_at(reached, step.state(x))
        run.bound.new[:], run.bound.k_new[:] = landed, rate
        found.reached, found.taken, found.is_jump = reached, reached - run.t, True
        return True
