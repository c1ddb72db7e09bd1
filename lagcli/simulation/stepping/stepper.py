"""One step after the other: tried, accepted or rejected, and the state between two of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.model.settings import Simulation
from lagcli.simulation.run_state.between_steps import RunState, Turns
from lagcli.simulation.run_state.run_stop import NO_SOLUTION, StepFailure
from lagcli.simulation.run_state.statistics import RunStatistics, counted, named
from lagcli.simulation.scheme import invariants, method, step_tolerance
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.scheme.controller import PARAMETERS as LENGTH
from lagcli.simulation.scheme.controller import StepController
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.singularity.singularity_monitor import NEVER, SingularityMonitor
from lagcli.simulation.stepping.found_step import Cut, FoundStep
from lagcli.simulation.stepping.grid import Grid, Witnesses
from lagcli.simulation.stepping.step_trial import UNSEEN, StepTrial
from lagcli.simulation.stepping.timetable import Timetable
from lagcli.smoothness.time_functions import TimeFunctions
from lagcli.start.initial import State

if TYPE_CHECKING:
    # Most runs meet no singular configuration.
    from lagcli.simulation.singularity.singularity_step import SingularStep


NONE_TRIED: invariants.Tried = frozenset()


class Stepper:
    """A run between two steps, and the step that is `found` next, None where it is still to be found; times are counted
    from `origin` of the state. trial: it tries steps with the functions that the run has now; t: the time reached;
    row_time: of the next row, for a step that holds rows keeps its stages; keeps_stages: all do; longest: what the next
    step is not longer than, whatever is proposed."""

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
        resting = enforced.resting_forces
        self.tolerance = step_tolerance.of_steps(settings, resting.acceleration)
        self.method, self.compile = method.of(settings), settings.compile
        self.timetable = Timetable(timed, grid.start, grid.step, settings.max_step or math.inf, 1 - is_again)
        self._witnesses = Witnesses(grid, timed, self.origin, is_again)
        self._turns = Turns(enforced.system)
        self.t, self.row_time, self.keeps_stages = state.t, math.inf, False
        self.found: FoundStep | None = None
        self.longest, self._rejected = math.inf, 0
        self.control = StepController(self.method.order, state.step, state.pace_from)
        extremes = state.extremes if math.isfinite(state.row) else None
        self.statistics = RunStatistics(extremes=extremes, resting=resting.energy, **named(counted(state)))
        self._bind(enforced, state.y, state.k, state.is_blurred)
        self._turns.resume(self.bound.enforced.p, state.turns)
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
        self._witnesses.bind(self.bound)
        self.trial = StepTrial(self.bound, self.method, self._witnesses, self.control, self.statistics)
        self.bound.begin(self.t, k, self.grid.step, blurred)

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
        """Find an acceptable step from the current state. The last step is cut to end where the run does. Where it is
        rejected the whole step is tried, as a longer run would have tried it, so that the steps up to the last do not
        depend on the end. beyond: the end plays no part. Raises `StepFailure`."""
        self._rejected = 0
        try:
            self.found = self._next(beyond)
        except StepFailure:
            self.statistics.rejected += 0 if beyond else self._rejected
            raise

    def _next(self, beyond: bool) -> FoundStep:
        t, end, wished = self.t, self.grid.end, self.control.step
        if self.watch.foreseen is not NEVER:
            wished = self.watch.foreseen.shortened(t, wished)
        h = min(self.timetable.shortened(t, wished) if self.timetable.is_any else wished, self.longest)
        grow, shorter = LENGTH.grow, 0.0
        while True:
            # The step ends at a time that is a double, so that t and the state go on together.
            reached = t + h
            taken = reached - t
            if not taken > 0.0:
                from lagcli.simulation.stepping import stop_diagnosis

                raise StepFailure(*stop_diagnosis.BELOW_ROUNDING)
            last = not beyond and (reached >= end or end - reached < doubles.VALUE * h)
            is_cut = last and not shorter
            if is_cut:
                reached, taken = end, end - t
            has_stages = self.keeps_stages or self.row_time < reached
            error, smaller = self.trial.attempt(reached, taken, has_stages, self.longest)
            status = self.bound.status
            if not smaller:
                if is_cut or not last:
                    break
                # Beyond the end there is a good step, and none up to it: from here on the end matters.
                self._undisturbed = self._undisturbed or self._here()
                h = shorter
                continue
            self._rejected += 1
            if self.bound.enforced.is_any and error != UNSEEN and status[0] < doubles.ROOT:
                # Its projection failed though it is right, and so are rows that are independent: integrals may be the
                # reason, which are left then.
                new = self.trial.plain_end()
                if new is not None:
                    if last:
                        # A longer run may be in another state when it comes to this.
                        self._undisturbed = self._undisturbed or self._here()
                    self.let_go(t + self.bound.h[0], new)
                    continue
            grow = 1.0
            if self.trial.is_too_short(smaller, reached):
                raise self._no_step(error, status[3])
            if is_cut:
                shorter = smaller
            else:
                h = smaller
        grown = self.control.grown(taken, error, grow)
        # Where the timetable or an edge has cut a step, and not its error, the next one has the length that was wished.
        proposed = max(grown, wished if h < wished and grow > 1.0 else 0.0)
        watch = self.watch.after(reached, status[4], status[5])
        step = FoundStep(reached, taken, proposed, watch, self._rejected)
        return self.trial.with_work(step) if status[7] > step_tolerance.COARSE_WORK else step

    def _no_step(self, error: float, residual: float) -> StepFailure:
        """The failure where no step can be taken, by what the last one that was tried had. Raises it where the motion
        sticks at a switch of a force, or a function of t has a pole."""
        from lagcli.simulation.stepping import causes_of_stops, stop_diagnosis

        bound = self.bound
        here, ahead = self.state_at(self.t, bound.y), self.state_at(self.t + bound.h[0], bound.new)
        switches = bound.enforced.plain.functions.numeric.force_switches
        if switches is not None:
            stop_diagnosis.require_not_stuck(bound, switches, here.t)
        self._require_no_pole()
        soon = stop_diagnosis.SOON * (self.grid.end - self.grid.start)
        is_soon, last = self.watch.foreseen.instant - self.t < soon, self.origin + self.contacts.last
        tried = (error, residual, here, ahead, *self.rank_margin, is_soon, last)
        return StepFailure(*causes_of_stops.reason(stop_diagnosis.Rejection(bound.enforced, *tried)))

    def _require_no_pole(self) -> None:
        """Raise `StepFailure` where y' grows without bound towards a switch of a function of t ahead."""
        from lagcli.simulation.stepping import stop_diagnosis

        soon = stop_diagnosis.SOON * (self.grid.end - self.grid.start)
        switch = self.timetable.ahead(self.t, self.t + soon)
        if switch is None:
            return
        # At the distance from it, three times and nine times as far.
        rates = self.rates([switch - part * (switch - self.t) for part in (1.0, 3.0, 9.0)])
        here = self.state_at(self.t, self.bound.y)
        if stop_diagnosis.is_pole(rates, stop_diagnosis.of_forces(self.bound.numeric, here)):
            raise StepFailure(*stop_diagnosis.POLE)

    def rates(self, times: Sequence[float]) -> list[Floats]:
        """y' (2n + 1,) of the state where the run stands at some times."""
        bound = self.bound
        self.count(len(times))
        return [np.array(bound.numeric.rhs(t, bound.y, bound.p)).ravel() for t in times]

    def still(self, reached: float, y: Floats, k: Floats) -> FoundStep:
        """A step over a switch to a time, and a state with its rate (2n + 1,) there."""
        self.trial.put_end(y, k)
        return FoundStep(reached, reached - self.t, self.control.step, self.watch, is_still=True)

    def across(self, singular_step: SingularStep) -> FoundStep:
        """A step across a singular configuration."""
        step = singular_step.step
        reached = step.t + step.h
        status = self.trial.project_end(reached, step.state((reached - step.t) / step.h))
        watch = self.watch.after(reached, status[1], status[2])
        return FoundStep(reached, step.h, self.control.step, watch, singular_step=singular_step)

    @property
    def has_turns(self) -> bool:
        """True if angles are counted through all turns, behind each step."""
        return self._turns.is_any

    @property
    def rank_margin(self) -> tuple[float, bool]:
        """See `SingularityMonitor`; behind the step that was found, where there is one."""
        return (self.watch if self.found is None else self.found.watch).rank_margin

    def count(self, evaluations: int) -> None:
        """Count evaluations of the right-hand side."""
        self.statistics.evaluations += evaluations

    def note(self, **changes: Any) -> None:
        """Go on with other fields of the contacts."""
        self.contacts = dataclasses.replace(self.contacts, **changes)

    def let_go(self, reached: float, new: Floats) -> None:
        """Leave the integrals that do not lead to a state ahead, or take other charts of them."""
        bound = self.bound
        here, ahead = self.state_at(self.t, bound.y), self.state_at(reached, new)
        enforced, notes, self.tried = invariants.let_go(bound.enforced, here, ahead, self.tried)
        self.statistics.notes += notes
        self.bind(enforced)

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
            raise StepFailure(
                f"{step.barrier.description}: the force is an impulse, which the equations of motion do not describe",
                NO_SOLUTION,
            )
        self.stand(step.reached, bound.new, bound.k_new)
        control.step = step.proposed
        self._keep(step)
        if self._turns.is_any:
            t, q, p = self.origin + self.t, bound.y[: bound.y.size // 2], bound.enforced.p
            self.statistics.notes = self._turns.settle(t, q, p, self.statistics.notes)
        self.settle()
        if self.statistics.steps % LENGTH.pace == 0 and not step.is_still:
            advanced = control.is_too_slow(self.t, self.grid.end, self.grid.step)
            if advanced is not None and not self.contacts.crowd(self.t - advanced):
                # Steps like the last ones would never lead to the end.
                from lagcli.simulation.stepping import stop_diagnosis

                self._require_no_pole()
                here, left = self.state_at(self.t, bound.y), self.grid.end - self.t
                raise stop_diagnosis.hopeless(bound.enforced, here, LENGTH.pace, advanced, left)
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

    def _keep(self, step: FoundStep) -> None:
        """Take over what was seen and counted on the way to a step, and tell of the incidents within it, up to its end
        and that of the run."""
        statistics, self.found, self.longest = self.statistics, None, math.inf
        self.watch = step.watch
        statistics.steps += not step.is_still
        statistics.rejected += step.rejected
        if not step.is_balanced:
            # From here on W is not known.
            statistics.is_balanced = False
            if statistics.extremes is not None:
                statistics.extremes = dataclasses.replace(statistics.extremes, unbalanced=1.0)
        if step.deepest > self.contacts.deepest:
            self.note(deepest=step.deepest)
        if step.singular_step is not None:
            if step.singular_step.instant > self.t:
                self.watch = SingularityMonitor()  # it is to be seen again: the step has ended before
            else:
                loss = step.singular_step.loss
                statistics.crossings += (dataclasses.replace(loss, t=self.origin + loss.t),)
        last = self.origin + min(step.reached, self.grid.end)
        for incident in sorted(step.within, key=lambda incident: incident.t):
            if incident.t <= last:
                statistics.add(incident)
