"""The passing of a singular configuration as an `Event`: a step across the one that is predicted, or away from it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.selection import Selection
from lagcli.simulation.events.event import Event, IncidentLog, InstantLines, Screen
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.singularity import singularity_monitor
from lagcli.simulation.singularity.singularity_monitor import NEVER, SingularityMonitor
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.step_trial import MOST_RESIDUAL
from lagcli.simulation.stepping.stepper import Stepper

if TYPE_CHECKING:
    # Loaded where they are used: most runs meet no singular configuration.
    from lagcli.simulation.singularity.singularity_step import Point, SingularStep


class SingularEvent(Event):
    """A configuration at which rows become dependent."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper, self._log = stepper, IncidentLog(stepper)

    def passes(self) -> FoundStep | None:
        """See `Event`."""
        run, bound = self._stepper, self._stepper.bound
        predicted = run.watch.foreseen
        if predicted is NEVER or not predicted.is_any:
            return None
        if not predicted.is_here:
            if not predicted.is_near(run.t, run.control.step, run.tolerance[0], run.method.order):
                return None
            if predicted.angle > singularity_monitor.PARAMETERS.certain and self._is_dip():
                return None
        from lagcli.simulation.singularity import singularity_step

        if predicted.is_here:
            left = singularity_step.away(bound.numeric, bound.scratch, self._point, run.control.step)
            run.trial.count_scratch()
            if left is None:
                from lagcli.simulation.stepping import stop_diagnosis

                raise StepFailure(*stop_diagnosis.NO_BRANCH)
            return self._across(left)
        found = singularity_step.across(bound.numeric, bound.scratch, self._point, predicted)
        run.trial.count_scratch()
        if isinstance(found, Selection):
            run.bind(bound.enforced.keeping(found))
            run.watch = SingularityMonitor()
            return None
        if found is not None:
            return self._across(found)
        if not bound.enforced.is_any:
            return None
        # Integrals may be the reason why there is no step, for they may have no direction at the instant. Those that
        # hold beyond it are retained, else they are released.
        from lagcli.simulation.scheme import collocation

        enforced = bound.enforced.plain
        plain = enforced.functions.numeric
        project = BoundFunction(plain.project, [np.zeros(1), np.zeros(bound.y.size), enforced.parameters])
        found = singularity_step.across(plain, project, self._point, predicted)
        run.count(project.used)
        if not isinstance(found, singularity_step.SingularStep):
            return None
        reached, new = found.step.t + found.step.h, found.step.state(1.0)
        if collocation.projected(bound.scratch, reached, new) is not None:
            return self._across(found)
        run.let_go(reached, new)
        return self.passes()

    def screen(self) -> Screen | None:
        """See `Event`: where none is near is seen of the steps before."""
        return Screen()

    def _across(self, singular_step: SingularStep) -> FoundStep:
        """The step across, with an incident for each row that takes part; none where the run begins."""
        run = self._stepper
        step = run.across(singular_step)
        if singular_step.is_start:
            return step
        from lagcli.simulation.stepping import interpolate_rows

        interpolate_rows.put_in_singular_step(run, singular_step, singular_step.instant)
        names = [row.name for row in run.bound.enforced.system.multiplier_rows]
        lines, t = InstantLines(run.trial.rows.line.copy(), run.trial.rows.line.copy()), singular_step.instant
        taking_part = [names[row] for row in singular_step.loss.participants]
        return step._replace(
            within=tuple(self._log.incident(t, "crossing", each, lines) for each in taking_part)
        )

    def _is_dip(self) -> bool:
        """True if ordinary steps show that rows only come closer to dependent ones, and part again."""
        run, bound, component = self._stepper, self._stepper.bound, self._stepper.watch.foreseen.component

        def square(h: float) -> float:
            bound.h[0] = h
            bound.step.trigger()
            run.count(run.method.evaluations)
            _, _, _, residual, *there, _, _ = bound.status
            return there[component - 1] if residual <= MOST_RESIDUAL else math.nan

        left = run.watch.foreseen.instant - run.t
        return singularity_monitor.is_dip(square, run.watch.seen[component], left)

    @property
    def _point(self) -> Point:
        from lagcli.simulation.singularity.singularity_step import Point

        run, bound = self._stepper, self._stepper.bound
        return Point(run.t, bound.y, bound.k, bound.enforced.p, run.tolerance)
