"""One step after the other: tried, accepted or rejected, and the state between two of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.compiled.bound_function import BoundFunction
from lagcli.model.settings import Simulation
from lagcli.simulation.run_state.angle_turns import Turns
from lagcli.simulation.run_state.between_steps import RunState
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.run_state.statistics import RunStatistics, counted, named
from lagcli.simulation.scheme import invariants, method, step_tolerance
from lagcli.simulation.scheme.bound_scheme import BoundRows, BoundStep
from lagcli.simulation.scheme.controller import PARAMETERS as LENGTH
from lagcli.simulation.scheme.controller import StepController
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.singularity.singularity_monitor import NEVER, SingularityMonitor
from lagcli.simulation.stepping.compared_times import ComparedTimes
from lagcli.simulation.stepping.found_step import Cut, FoundStep
from lagcli.simulation.stepping.grid import Grid, Witnesses
from lagcli.simulation.stepping.timetable import Timetable
from lagcli.smoothness import named_functions
from lagcli.smoothness.time_functions import TimeFunctions
from lagcli.start.initial import State

if TYPE_CHECKING:
    # Most runs meet no singular configuration.
    from lagcli.simulation.singularity.singularity_step import Crossing

Floats = npt.NDArray[np.float64]

# A projected state off the constraints by more than this part of its size was not reached by Newton: a smaller step.
MOST_RESIDUAL = 1e-9
# A step of this error is right, and so are rows that are independent: where its projection fails, integrals may be the
# reason.
CERTAIN = 1e-6
# A step in which rows have been dependent unseen counts as one of this error, which halves it; down to this part of
# the step proposed, for rounding may look the same.
HIDDEN, HIDING = 100.0, 1e-3
# A step is wrong where the dense output is off the equations by so many tolerances at a row, and counts as one of
# this error then.
FORGIVEN, UNSEEN = 3e3, -1.0
NONE_TRIED: invariants.Tried = frozenset()


class Stepper:
    """A run between two steps, and the step that is `found` next, None where it is still to be found; times are counted
    from `origin` of the state.

    t: the time reached; row_time: of the next row, for a step that holds rows keeps its stages; keeps_stages: all do;
    longest: what the next step is not longer than, whatever is proposed.
    """

    def __init__(
        self,
        enforced: EnforcedInvariants,
        state: RunState,
        settings: Simulation,
        grid: Grid,
        timed: TimeFunctions | None,
        is_again: bool = False,
    ) -> None:
        self.origin, self.grid = state.origin, grid
        resting = step_tolerance.resting_forces(enforced.system, enforced.functions.numeric)
        self.tolerance = step_tolerance.of_steps(settings, resting.acceleration)
        self.method = method.of(settings)
        self.timetable = Timetable(timed, grid.start, grid.step, settings.max_step or math.inf, 1 - is_again)
        self._witnesses = Witnesses(grid, timed, is_again)
        self._turns = Turns(enforced.system)
        self.t, self.row_time, self.keeps_stages = state.t, math.inf, False
        self.found: FoundStep | None = None
        self.longest = math.inf
        self._has_dense, self._rejected = False, 0
        self._bind(enforced, state.y, state.k, state.is_blurred)
        self._turns.resume(self.bound.enforced.p, state.turns)
        self.control = StepController(self.method.order, state.step, state.pace_from)
        extremes = state.extremes if math.isfinite(state.row) else None
        self.statistics = RunStatistics(extremes=extremes, resting=resting.energy, **named(counted(state)))
        self.contacts = state.contacts
        self.watch = SingularityMonitor.of(state.watch)
        # The state before the last step that is what a longer run would have taken; None where that is the last.
        self._undisturbed: RunState | None = None
        self.settle()

    def bind(self, enforced: EnforcedInvariants) -> None:
        """Step with other functions from where the run stands."""
        self._bind(enforced, self.bound.y, self.bound.k)

    def _bind(self, enforced: EnforcedInvariants, y: Floats, k: Floats, blurred: bool | None = None) -> None:
        self.bound = BoundStep(enforced, self.method, y.copy(), self.tolerance)
        self._witnesses.choose(enforced.functions.numeric.has_narrow_functions)
        self.rows = BoundRows(self.bound, self.method, self._witnesses.is_any)
        self._compared = ComparedTimes(self.bound, self.grid, self.origin, self._witnesses)
        self.bound.begin(self.t, k, self.grid.step, blurred)
        # Where t occurs, a step has its stages at times that are told apart; without, the jump of a force may be
        # crossed in one rounding. That of a row may not: the velocity would have to jump.
        has_time, model = self.bound.numeric.has_time, enforced.system.model
        self._fewest = 1 if not has_time and named_functions.only_forces_may_jump(model) else 64

    def state(self) -> RunState:
        """The run to go on from, but for its last row: as a longer one would be where the end has cut the last step."""
        return self._undisturbed or self._here()

    def _here(self) -> RunState:
        bound, control = self.bound, self.control
        enforced, watch, contacts, counts = self._settled
        return RunState(
            t=bound.t[0],
            y=bound.y.copy(),
            k=bound.k.copy(),
            step=control.step,
            pace_from=control.pace_from,
            selection=enforced.selection,
            invariant_values=enforced.invariant_values,
            watch=watch.state,
            origin=self.origin,
            turns=self._turns.of(bound.enforced.p),
            contacts=contacts,
            is_blurred=bound.is_blurred,
            **named(counts),
        )

    def settle(self) -> None:
        """Keep what belongs to the state from which the next step is tried."""
        self._settled = self.bound.enforced, self.watch, self.contacts, counted(self.statistics)
        self.tried: invariants.Tried = NONE_TRIED

    def state_at(self, t: float, y: Floats) -> State:
        """A state of the motion as others take it, its time not counted from `origin`."""
        n = y.size // 2
        return State(self.origin + t, y[:n], y[n : 2 * n], self.bound.enforced.p)

    def advance(self, beyond: bool = False) -> None:
        """Find an acceptable step from the current state.

        The last step is cut to end where the run does. Where it is rejected the whole step is tried, as a
        longer run would have tried it, so that the steps up to the last do not depend on the end. beyond: the end
        plays no part. Raises `StepFailure`.
        """
        self._rejected = 0
        try:
            self.found = self._next(beyond)
        except StepFailure:
            self.statistics.rejected += 0 if beyond else self._rejected
            raise

    def _next(self, beyond: bool) -> FoundStep:
        t, end = self.t, self.grid.end
        (h, wished), grow, shorter = self._lengths(t), LENGTH.grow, 0.0
        while True:
            # The step ends at a time that is a double, so that t and the state go on together.
            reached = t + h
            taken = reached - t
            if not taken > 0.0:
                from lagcli.simulation.stepping import stop_diagnosis

                raise StepFailure(*stop_diagnosis.BELOW_ROUNDING)
            last = not beyond and (reached >= end or end - reached < 1e-12 * h)
            is_cut = last and not shorter
            if is_cut:
                reached, taken = end, end - t
            error, smaller = self._try(reached, taken)
            status = self.bound.status
            if not smaller:
                if is_cut or not last:
                    break
                # Beyond the end there is a good step, and none up to it: from here on the end matters.
                self._undisturbed = self._undisturbed or self._here()
                h = shorter
                continue
            self._rejected += 1
            if self.bound.enforced.is_any and error != UNSEEN and status[0] < CERTAIN and self._let_go(last):
                continue
            grow = 1.0
            if t + smaller / self._fewest == t or (self._fewest == 1 and t + smaller >= reached):
                raise self._no_step(error, status[3])
            if is_cut:
                shorter = smaller
            else:
                h = smaller
        grown = self.control.grown(taken, error, grow)
        # Where the timetable or an edge has cut a step, and not its error, the next one has the length that was wished.
        proposed = max(grown, wished if h < wished and grow > 1.0 else 0.0)
        step = FoundStep(
            reached, taken, proposed, self.watch.after(reached, status[4], status[5]), self._rejected
        )
        return self.with_work(step) if status[7] > step_tolerance.COARSE_WORK else step

    def _lengths(self, t: float) -> tuple[float, float]:
        """The length of a step to be tried from t, and what it would be without the timetable and edges."""
        wished = self.control.step
        if self.watch.foreseen is not NEVER:
            wished = self.watch.foreseen.shortened(t, wished)
        h = self.timetable.shortened(t, wished) if self.timetable.is_any else wished
        return min(h, self.longest), wished

    def _try(self, reached: float, taken: float) -> tuple[float, float]:
        """The error of a step, and the length of a smaller one that should be tried; 0 where it may be taken.

        The error is `UNSEEN` where only a witness speaks against it.
        """
        bound = self.bound
        bound.h[0], self._has_dense = taken, False
        bound.look_at_rounding()
        is_witnessed = self.rows.defect is not None
        has_stages = self.keeps_stages or self.row_time < reached or is_witnessed
        (bound.staged if has_stages else bound.step).trigger()
        self.statistics.evaluations += self.method.evaluations
        scheme_error, moved, hidden, residual, _, _, everything, _ = bound.status
        projected, error = residual <= MOST_RESIDUAL, max(scheme_error, moved)
        if hidden < 0.0 and taken > HIDING * min(self.control.step, self.longest):
            error = max(error, HIDDEN)
        if error < 1.0 and projected and math.isfinite(everything):
            if not is_witnessed:
                return error, 0.0
            unseen = self._unseen(reached, taken, self.control.grown(taken, error, math.inf) > 2 * taken)
            return (error, 0.0) if unseen == math.inf else (UNSEEN, unseen - self.t)
        # `not error < 1` also holds for nan: then nothing is known but that the step was too large.
        is_known = math.isfinite(error) and error >= 1.0 and projected
        return error, self.control.smaller(taken, error, is_known)

    def _unseen(self, reached: float, taken: float, is_growing: bool) -> float:
        """The first time within a step at which the forces are not those it was made of; infinite where they are."""
        rows, defect = self.rows, self.rows.defect
        assert defect is not None, "a run with witnesses compares"
        for at in self._compared.within(self.t, reached, self._dense, is_growing):
            self.make_dense()
            rows.at[0], rows.x[0] = self.origin + at, (at - self.t) / taken
            defect.trigger()
            self.count(1)
            if defect.results[0][0] > FORGIVEN:
                return at
        return math.inf

    def _dense(self) -> Callable[[float], Floats]:
        """The states (2n + 1,) at parts of the step."""
        self.make_dense()
        begin, coefficients = self.bound.y[:, None], self.rows.dense.results[0][:, :, None]
        return lambda x: np.asarray(self.method.interpolated(begin, coefficients, np.array([x]))).ravel()

    def again(self, step: FoundStep, reached: float) -> FoundStep:
        """A step taken again, up to a time within it: nothing jumps in that before its end."""
        bound = self.bound
        bound.h[0], self._has_dense = reached - self.t, False
        bound.staged.trigger()
        self.count(self.method.evaluations)
        return step._replace(
            reached=reached, taken=reached - self.t, work=None, is_balanced=True, barrier=None
        )

    def put_end(self, y: Floats, k: Floats) -> None:
        """Let the step that is found end at a state with its rate, (2n + 1,) each."""
        self.bound.new[:], self.bound.k_new[:] = y, k

    def project_end(self, reached: float, y: Floats) -> Floats:
        """Let it end at a time on the constraints, near a state (2n + 1,); the status of `NumericSystem.project`."""
        projected, rate, status, _ = self.bound.projected_at(reached, y)
        self.put_end(projected, rate)
        return status

    def still(self, reached: float, y: Floats, k: Floats) -> FoundStep:
        """A step over a switch to a time, and a state with its rate (2n + 1,) there."""
        self.put_end(y, k)
        return FoundStep(reached, reached - self.t, self.control.step, self.watch, is_still=True)

    def across(self, crossing: Crossing) -> FoundStep:
        """A step across a singular configuration."""
        step = crossing.singular_step.step
        reached = step.t + step.h
        status = self.project_end(reached, step.state((reached - step.t) / step.h))
        watch = self.watch.after(reached, status[1], status[2])
        return FoundStep(reached, step.h, self.control.step, watch, crossing=crossing)

    def with_work(self, step: FoundStep) -> FoundStep:
        """A step with W integrated over it on its dense output, where the scheme's own W is not right to the tolerance
        of the run."""
        if not self.statistics.is_balanced:
            return step
        from lagcli.simulation.scheme import work_integral

        bound, taken = self.bound, step.taken
        bound.staged.trigger()
        self.make_dense()
        span = self.t, taken, self.tolerance[0]
        begin, coefficients = bound.y[:, None], self.rows.dense.results[0][:, :, None]
        work = work_integral.within(
            bound.scratch, span, bound.y, lambda x: self.method.interpolated(begin, coefficients, x).T
        )
        self.count_scratch()
        if work is not None:
            bound.new[-1] = work.end
        return step._replace(work=work, is_balanced=work is not None)

    def make_dense(self) -> None:
        """Make the dense output of the step, once."""
        if not self._has_dense:
            self.rows.dense.trigger()
            self.count(self.method.dense_evaluations)
            self._has_dense = True

    @property
    def has_dense(self) -> bool:
        """True if the dense output of the step that was tried last is made."""
        return self._has_dense

    @property
    def rank_margin(self) -> tuple[float, bool]:
        """See `SingularityMonitor`; behind the step that was found, where there is one."""
        return (self.watch if self.found is None else self.found.watch).rank_margin

    def count(self, evaluations: int) -> None:
        """Count evaluations of the right-hand side."""
        self.statistics.evaluations += evaluations

    def count_scratch(self) -> None:
        """Count the evaluations that were made beside the step."""
        self.count(self.bound.scratch.used)
        self.bound.scratch.used = 0

    def _let_go(self, is_last: bool) -> bool:
        """After a step whose projection failed though it is right: leave the integrals that are the reason, if any."""
        bound, t, h = self.bound, self.t, self.bound.h[0]
        plain, y, k = bound.enforced.plain, bound.y, bound.k
        arguments = [np.array([t]), np.array([h]), y, k, self.tolerance, plain.parameters]
        step = BoundFunction(plain.functions.scheme(self.method).step, arguments, wanted=3)
        step.trigger()
        self.count(self.method.evaluations)
        new, _, (error, moved, _, residual, _, _, everything, _) = step.results
        if not (max(error, moved) < 1.0 and residual <= MOST_RESIDUAL and math.isfinite(everything)):
            return False
        if is_last:
            # A longer run may be in another state when it comes to this.
            self._undisturbed = self._undisturbed or self._here()
        self.let_go(t + h, new)
        return True

    def let_go(self, reached: float, new: Floats) -> None:
        """Leave the integrals that do not lead to a state ahead, or take other charts of them."""
        bound = self.bound
        here, ahead = self.state_at(self.t, bound.y), self.state_at(reached, new)
        enforced, notes, self.tried = invariants.let_go(bound.enforced, here, ahead, self.tried)
        self.statistics.notes += notes
        self.bind(enforced)

    def take(self, step: FoundStep) -> None:
        """Take a step that an event has found for the next one."""
        self.found = step

    def forget(self) -> None:
        """Take the step back that was found: where the run stands nothing has changed."""
        self.found = None

    def cut(self, cut: Cut) -> None:
        """End the step that was found as an event says, or give it up and act where the run stands."""
        if cut.step is not None:
            acts = () if cut.act is None else (cut.act,)
            at_end = () if cut.at_end is None else (cut.at_end,)
            self.found = cut.step._replace(acts=cut.step.acts + acts, at_end=cut.step.at_end + at_end)
            return
        if self.found is not None:
            self.statistics.rejected += self.found.rejected
        self.found = None
        if cut.act is not None:
            cut.act()

    def accept(self) -> None:
        """Go to the end of the step that was found, and act there."""
        step, bound, control = self.found, self.bound, self.control
        assert step is not None, "a step was found"
        if step.barrier is not None:
            self.t = step.reached
            self._keep(step)
            from lagcli.simulation.stepping import stop_diagnosis

            raise stop_diagnosis.impulse(step.barrier.description)
        self.stand(step.reached, bound.new, bound.k_new)
        control.step = step.proposed
        self._keep(step)
        if self._turns.is_any:
            self._count_turns()
        self.settle()
        if self.statistics.steps % LENGTH.pace == 0 and not step.is_still:
            self._require_pace()
        for act in step.acts:
            act()

    def finish(self) -> None:
        """End the run within the step that was found, or at its end."""
        step = self.found
        assert step is not None, "a step was found"
        self.t = self.grid.end
        self._keep(step)
        for told in step.at_end:
            told()

    def stand(self, t: float, y: Floats, k: Floats) -> None:
        """Stand at a time with a state and a rate, (2n + 1,) each."""
        bound = self.bound
        bound.t[0] = self.t = t
        bound.y[:], bound.k[:] = y, k

    def project_from(self, v: Floats) -> None:
        """Stand at the same place on the constraints, near other velocities (n,)."""
        bound, n = self.bound, v.size
        bound.y[n : 2 * n] = v
        bound.project.trigger()
        bound.y[:], bound.k[:], *_ = bound.project.results
        self.count(1)

    def _keep(self, step: FoundStep) -> None:
        """Take over what was seen and counted on the way to a step, and tell of the incidents within it, up to its end
        and that of the run."""
        statistics, self.found, self.longest = self.statistics, None, math.inf
        self.watch = step.watch
        statistics.steps += not step.is_still
        statistics.rejected += step.rejected
        if not step.is_balanced:
            statistics.mark_work_unknown()
        if step.deepest > self.contacts.deepest:
            self.contacts = dataclasses.replace(self.contacts, deepest=step.deepest)
        if step.crossing is not None:
            self._pass(step.crossing)
        if step.within:
            last = self.origin + min(step.reached, self.grid.end)
            for incident in sorted(step.within, key=lambda incident: incident.t):
                if incident.t <= last:
                    statistics.add(incident)

    def _pass(self, crossing: Crossing) -> None:
        """Count a singular configuration that was passed; where the step has ended before, it is to be seen again."""
        if crossing.singular_step.instant > self.t:
            self.watch = SingularityMonitor()
            return
        loss = dataclasses.replace(crossing.loss, t=self.origin + crossing.loss.t)
        self.statistics.crossings += (loss,)

    def _require_pace(self) -> None:
        """Raise `StepFailure` where steps like the last ones would never lead to the end."""
        advanced = self.control.is_too_slow(self.t, self.grid.end, self.grid.step)
        if advanced is None or self.contacts.crowd(self.t - advanced):
            return
        from lagcli.simulation.stepping import stop_diagnosis

        if self._is_before_pole():
            raise StepFailure(*stop_diagnosis.POLE)
        here = self.state_at(self.t, self.bound.y)
        left = self.grid.end - self.t
        raise stop_diagnosis.hopeless(self.bound.enforced, here, LENGTH.pace, advanced, left)

    def _count_turns(self) -> None:
        bound = self.bound
        p, n = bound.enforced.p, bound.y.size // 2
        notes = self.statistics.notes
        self.statistics.notes = self._turns.settle(self.origin + self.t, bound.y[:n], p, notes)

    def _no_step(self, error: float, residual: float) -> StepFailure:
        from lagcli.simulation.stepping import causes_of_stops, sticking, stop_diagnosis

        bound, grid = self.bound, self.grid
        switches = bound.enforced.plain.functions.numeric.force_switches
        if switches is not None:
            sticking.require_step(bound, switches, self.origin + self.t)
        here, ahead = self.state_at(self.t, bound.y), self.state_at(self.t + bound.h[0], bound.new)
        if self._is_before_pole():
            return StepFailure(*stop_diagnosis.POLE)
        is_soon = self.watch.foreseen.instant - self.t < stop_diagnosis.SOON * (grid.end - grid.start)
        tried = stop_diagnosis.Rejection(
            bound.enforced,
            error,
            residual,
            MOST_RESIDUAL,
            here,
            ahead,
            *self.rank_margin,
            is_soon,
            self.origin + self.contacts.last,
        )
        return causes_of_stops.no_step(tried)

    def _is_before_pole(self) -> bool:
        """True if a function of t ahead is the reason: y' grows without bound towards its switch."""
        from lagcli.simulation.stepping import stop_diagnosis

        bound, grid, t = self.bound, self.grid, self.t
        ahead = self.timetable.ahead(t, t + stop_diagnosis.SOON * (grid.end - grid.start))
        if ahead is None:
            return False
        # At the distance from it, three times and nine times as far.
        times = (ahead - part * (ahead - t) for part in (1.0, 3.0, 9.0))
        rates = [np.array(bound.numeric.rhs(at, bound.y, bound.p)).ravel() for at in times]
        self.statistics.evaluations += len(rates)
        acceleration = stop_diagnosis.of_forces(bound.numeric, self.state_at(t, bound.y))
        return stop_diagnosis.is_pole(rates, acceleration)
