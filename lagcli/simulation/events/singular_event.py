"""The passing of a singular configuration as an `Event`: a step across the one that is predicted, or away from it."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.selection import Selection
from lagcli.simulation.events.event import Event
from lagcli.simulation.events.incident_log import IncidentLog, InstantLines
from lagcli.simulation.run_state.incident import Incident
from lagcli.simulation.run_state.run_stop import SINGULAR, StepFailure
from lagcli.simulation.singularity import singularity_monitor
from lagcli.simulation.singularity.singularity_monitor import NEVER, SingularityMonitor
from lagcli.simulation.stepping.stepper import MOST_RESIDUAL, Stepper

if TYPE_CHECKING:
    # Loaded where they are used: most runs meet no singular configuration.
    from lagcli.simulation.singularity.singularity_step import Crossing, Point


class SingularEvent(Event):
    """A configuration at which rows become dependent."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper, self._log = stepper, IncidentLog(stepper)
        # The crossing of the step that was found.
        self._crossed: Crossing | None = None

    def passes(self) -> bool:
        """See `Event`."""
        run = self._stepper
        predicted = run.watch.foreseen
        if predicted is NEVER or not predicted.is_any:
            return False
        if predicted.is_here:
            self._leave()
            return True
        if not predicted.is_near(run.t, run.control.step, run.tolerance[0], run.method.order):
            return False
        if predicted.angle > singularity_monitor.PARAMETERS.certain and self._is_dip():
            return False
        bound = run.bound
        from lagcli.simulation.singularity import singularity_step

        found = singularity_step.across(bound.numeric, bound.scratch, self._point, predicted)
        run.count_scratch()
        if isinstance(found, Selection):
            run.bind(bound.enforced.keeping(found))
            run.watch = SingularityMonitor()
        elif found is not None:
            self._cross(found)
        elif bound.enforced.is_any:
            return self._pass_without_integrals()
        return isinstance(found, singularity_step.Crossing)

    def act(self) -> None:
        """See `Event`."""
        run, crossed = self._stepper, self._crossed
        self._crossed = None
        if crossed is not None and crossed.singular_step.instant > run.t:
            # The step has ended before.
            run.statistics.crossings = run.statistics.crossings[:-1]
            run.watch = SingularityMonitor()
            run.settle()

    def _incidents(self, crossed: Crossing) -> list[Incident]:
        """The incidents of a crossing, one for each row that takes part; none where the run begins."""
        run, singular_step = self._stepper, crossed.singular_step
        if singular_step.is_start:
            return []
        from lagcli.simulation.stepping import interpolate_rows

        interpolate_rows.put_in_singular_step(run, singular_step, singular_step.instant)
        names = [row.name for row in run.bound.enforced.system.multiplier_rows]
        lines = InstantLines(run.rows.line.copy(), run.rows.line.copy())
        rows = crossed.loss.participants
        return [self._log.incident(singular_step.instant, "crossing", names[row], lines) for row in rows]

    def _is_dip(self) -> bool:
        """True if ordinary steps show that rows only come closer to dependent ones, and part again."""
        run, bound, component = self._stepper, self._stepper.bound, self._stepper.watch.foreseen.component

        def square(h: float) -> float:
            bound.h[0] = h
            bound.step.trigger()
            run.statistics.evaluations += run.method.evaluations
            _, _, _, residual, *there, _, _ = bound.status
            return there[component - 1] if residual <= MOST_RESIDUAL else math.nan

        return singularity_monitor.is_dip(
            square, run.watch.seen[component], run.watch.foreseen.instant - run.t
        )

    def _pass_without_integrals(self) -> bool:
        """Pass it where integrals are the reason why there is no step: they may have no direction at the instant.

        Those that hold beyond it are retained, else they are released.
        """
        from lagcli.simulation.scheme import collocation
        from lagcli.simulation.singularity import singularity_step

        run, bound = self._stepper, self._stepper.bound
        enforced = bound.enforced.plain
        plain = enforced.functions.numeric
        project = BoundFunction(plain.project, [np.zeros(1), np.zeros(bound.y.size), enforced.parameters])
        found = singularity_step.across(plain, project, self._point, run.watch.foreseen)
        run.statistics.evaluations += project.used
        if not isinstance(found, singularity_step.Crossing):
            return False
        step = found.singular_step.step
        reached, new = step.t + step.h, step.state(1.0)
        if collocation.projected(bound.scratch, reached, new) is not None:
            self._cross(found)
            return True
        run.let_go(reached, new)
        return self.passes()

    def _leave(self) -> None:
        """Take the first step from a singular configuration."""
        from lagcli.simulation.singularity import singularity_step

        run, bound = self._stepper, self._stepper.bound
        found = singularity_step.away(bound.numeric, bound.scratch, self._point, run.control.step)
        run.count_scratch()
        if found is None:
            from lagcli.simulation.stepping import stop_diagnosis

            raise StepFailure(stop_diagnosis.NO_BRANCH, SINGULAR)
        self._cross(found)

    @property
    def _point(self) -> Point:
        from lagcli.simulation.singularity.singularity_step import Point

        run, bound = self._stepper, self._stepper.bound
        return Point(run.t, bound.y, bound.k, bound.enforced.p, run.tolerance)

    def _cross(self, crossing: Crossing) -> None:
        """Make a step across the step just found."""
        run, bound = self._stepper, self._stepper.bound
        step = crossing.singular_step.step
        reached = step.t + step.h
        projected, rate, status, _ = bound.projected_at(reached, step.state((reached - step.t) / step.h))
        bound.new[:], bound.k_new[:] = projected, rate
        run.watch = run.watch.after(reached, status[1], status[2])
        run.statistics.steps += 1
        run.statistics.crossings += (dataclasses.replace(crossing.loss, t=run.origin + crossing.loss.t),)
        self._crossed = crossing
        found = run.found
        found.is_open, found.singular_step = True, crossing.singular_step
        found.reached, found.taken, found.proposed = reached, step.h, run.control.step
        found.within += self._incidents(crossing)
