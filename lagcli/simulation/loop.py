"""The loop of a run, step by step, which hands out the rows of the grid.

Rows leave in blocks while the run goes on; the memory it needs does not grow with its length.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from lagcli.arrays import Floats
from lagcli.frozen import frozen
from lagcli.model.settings import Simulation
from lagcli.native import paying
from lagcli.simulation.events import events_of_run
from lagcli.simulation.row_writer import RowWriter, TableRows
from lagcli.simulation.run_state.between_steps import RunState, Turns
from lagcli.simulation.run_state.run_stop import RunStop, StepFailure, Stop
from lagcli.simulation.run_state.statistics import Incident
from lagcli.simulation.scheme import controller, method
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.singularity.singularity_monitor import PARAMETERS as MONITOR
from lagcli.simulation.singularity.singularity_monitor import SingularityMonitor
from lagcli.simulation.stepping import grid as grids
from lagcli.simulation.stepping.step_trial import MOST_RESIDUAL
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness.time_functions import TimeFunctions

if TYPE_CHECKING:
    from lagcli.simulation.native_steps import NativeSteps

BLOCK_VALUES = 2**16  # numbers in a block of rows
PAUSE = 0.1  # seconds after which the rows so far, be there none, are handed out: for progress and interrupts


@frozen
class RunBlock:
    """Rows (k, columns) as they are handed out, maybe none, and the incidents that come with them, in order."""

    rows: Floats
    incidents: list[Incident]


class Run:
    """One integration: iterate `blocks` once; `statistics` is filled as they come, and `stepper` goes on. begin: puts
    the start onto the constraints, proposes the first step, and is True where that is an ordinary one; None for a run
    that is resumed; row: time of the last row handed out; skipped_rows: lost to another grid than that of the run
    state. Times, the grid's too, are counted from `origin`."""

    def __init__(
        self,
        stepper: Stepper,
        writer: RowWriter,
        begin: Callable[[], bool] | None,
        row: float = -math.inf,
        skipped_rows: int = 0,
    ) -> None:
        self.stepper, self.writer, self._begin = stepper, writer, begin
        self.origin, self.grid, self.statistics = stepper.origin, stepper.grid, stepper.statistics
        self._row, self.skipped_rows = row, skipped_rows
        self._events = events_of_run.found(stepper)
        self._looks_ahead = any(event.looks_ahead for event in self._events)
        stepper.keeps_stages = any(event.keeps_stages for event in self._events)
        self._compile = stepper.compile
        self._native: NativeSteps | None = None
        # A row at an incident is to be written once the run is beyond it.
        self._is_due = False

    def require_rows_left(self) -> None:
        """Raise `CheckpointError` where all rows of a resumed run were handed out before; before its first block."""
        if self._begin is None and self.writer.is_done:
            from lagcli.simulation.run_state.checkpoint import CheckpointError

            raise CheckpointError(
                f"nothing is left to do: it is at t = {self.origin + self.stepper.t:.9g} with its last row at"
                f" {self.origin + self._row:.9g}, and the run ends at {self.origin + self.grid.end:.9g}; a longer"
                " duration goes on"
            )

    def run_state(self) -> RunState:
        """The state to go on from, with all rows handed out so far; for the time between two blocks."""
        extremes = self.statistics.extremes
        assert extremes is not None, "the first block holds the first row"
        reported = self.statistics.reported
        return dataclasses.replace(self.stepper.state(), row=self._row, extremes=extremes, reported=reported)

    def blocks(self) -> Iterator[RunBlock]:
        """Blocks of complete rows, shape (k, 1 + columns), t first; one at least every `PAUSE`, maybe empty. Raises
        `RunStop` after the last good row."""
        writer, statistics = self.writer, self.statistics
        capacity = max(1, min(self.grid.count, BLOCK_VALUES // writer.width))
        stop: Stop | None = None
        going = True
        while going:
            began, compiled = time.perf_counter(), statistics.compile_seconds
            writer.open(capacity)
            try:
                going = not self._fill(began + PAUSE)
            except StepFailure as failure:
                t, going = self.origin + self.stepper.t, False
                where = f"stopped at t = {t:.9g} (after row {writer.complete} of {self.grid.count})"
                stop = Stop(t, f"{where}: {failure.reason}", failure.code)
            block = writer.close()
            if len(block):
                statistics.take_rows(block[:, -method.BEYOND : -1], writer.deepest(block))
                self._row = writer.last
            rows = block[:, : -method.BEYOND]
            rows += 0.0  # no table shows -0.0
            spent = time.perf_counter() - began
            statistics.solve_seconds += spent - (statistics.compile_seconds - compiled)
            incidents, statistics.incidents = statistics.incidents, []
            if len(block) or going or incidents:
                yield RunBlock(rows, incidents)
        if stop is not None:
            raise RunStop(stop)

    def _fill(self, until: float) -> bool:
        """Take steps and put their rows into the block until it is full or the time is over; True at the end."""
        stepper, writer, has_advanced = self.stepper, self.writer, False
        if self._begin is not None:
            if self._begin():
                for event in self._events:
                    event.begin()
                stepper.found = next(filter(None, (event.leaves() for event in self._events)), None)
                if stepper.found is not None:
                    self._ask()
                    stepper.accept()
                writer.put_begin()
            self._begin = None
        while True:
            if self._is_due:
                # The run is behind an incident: its row is written, if there is one and the block is not full.
                if self.statistics.ended_by:
                    writer.put_last()
                elif not writer.put_state():
                    return False
                else:
                    self._is_due = False
            if self.statistics.ended_by or (writer.is_done and stepper.found is None):
                return True
            if stepper.found is None:
                # Behind the row of an incident, and never without a step.
                if has_advanced and time.perf_counter() > until:
                    return False
                if self._compile != "never":
                    self._advance_in_native_code()
                self._find_step()
                continue
            if not writer.put_rows(stepper.found):
                return False
            if writer.is_done:
                stepper.finish()
                return True
            self._is_due = stepper.found.is_jump
            stepper.accept()
            has_advanced = True

    def _advance_in_native_code(self) -> None:
        """Take ordinary steps in native code, none or more, once that pays: its library takes long to load. The last
        step of a run is none of them."""
        stepper = self.stepper
        functions = stepper.bound.enforced.functions
        functions.steps += 1
        if self._native is None:
            is_last = stepper.t + stepper.control.step >= self.grid.end
            if is_last or (self._compile != "always" and not paying.pays(functions.steps)):
                return
            from lagcli.simulation.native_steps import NativeSteps

            self._native = NativeSteps(stepper, self.writer, self._events, self._compile)
        self._native.advance()

    def _find_step(self) -> None:
        stepper, end = self.stepper, self.grid.end
        for event in self._events:
            stepper.found = event.passes()
            if stepper.found is not None:
                self._ask()
                return
        if self._looks_ahead and stepper.t + controller.NEARLY * stepper.control.step >= end:
            # What happens before the end is found in the step of a run that goes on.
            try:
                stepper.advance(beyond=True)
                self._ask()
            except StepFailure:
                stepper.found = None
            else:
                if stepper.found is None or stepper.found.reached <= end:
                    return
                stepper.found = None
        stepper.advance()
        self._ask()

    def _ask(self) -> None:
        """Ask all events what they make of the step that was found, each of it as those before have left it."""
        stepper = self.stepper
        for event in self._events:
            if stepper.found is None:
                return
            cut = event.found(stepper.found)
            if cut is not None:
                stepper.cut(cut)


# A step from a singular configuration moves by this part of its size, or less.
FIRST = 0.1


@frozen
class RunStart:
    """A consistent start, q and v (n,), and all that a run from there goes with. enforced: the functions, with the
    integrals that are enforced; timed: what the model says about t alone; is_singular: the rows are dependent there and
    not nearby; notes: on integrals; part: of the usual first step; is_again: it repeats another run."""

    enforced: EnforcedInvariants
    q: Floats
    v: Floats
    settings: Simulation
    timed: TimeFunctions | None = None
    is_singular: bool = False
    notes: tuple[str, ...] = ()
    part: float = 1.0
    is_again: bool = False


def start(begin: RunStart, rows: TableRows) -> Run:
    """A run from a consistent start."""
    enforced, settings = begin.enforced, begin.settings
    # Time counted from the start has the same roundings at every start, where no t occurs in what moves the model.
    origin = 0.0 if enforced.has_time else settings.start
    grid = grids.of_run(settings, origin)
    state = RunState(
        t=grid.start,
        y=np.concatenate([begin.q, begin.v, [0.0]]),
        k=np.zeros(2 * begin.q.size + 1),
        step=0.0,
        pace_from=grid.start,
        selection=enforced.selection,
        invariant_values=enforced.invariant_values,
        notes=begin.notes,
        origin=origin,
        turns=Turns(enforced.system).of(enforced.p),
    )
    timed = begin.timed if enforced.has_time else None
    stepper = Stepper(enforced, state, settings, grid, timed, begin.is_again)
    return Run(stepper, RowWriter(stepper, rows, 0), functools.partial(_begin, stepper, begin))


def resume(
    enforced: EnforcedInvariants,
    run_state: RunState,
    settings: Simulation,
    columns: tuple[str, ...],
    timed: TimeFunctions | None = None,
) -> Run:
    """A run that goes on from where another was marked; enforced: as it was there. Else as `start`."""
    grid = grids.of_run(settings, run_state.origin)
    # The rows that another grid has between the last one handed out and the state are lost.
    after = grid.after(run_state.row)
    first = max(after, grid.first(run_state.t))
    stepper = Stepper(enforced, run_state, settings, grid, timed if enforced.has_time else None)
    writer = RowWriter(stepper, TableRows(columns), first, run_state.row)
    return Run(stepper, writer, None, run_state.row, first - after)


def _begin(run: Stepper, start: RunStart) -> bool:
    """Put the start onto the constraints, and propose the first step; True where it is an ordinary one."""
    bound, control = run.bound, run.control
    if start.is_singular:
        n = bound.y.size // 2
        speed, size = float(np.abs(bound.y[n:-1]).max()), float(np.abs(bound.y[:n]).max() or 1.0)
        control.step = start.part * FIRST * size / speed
        run.watch = SingularityMonitor.standing(run.t)
        run.settle()
        return False
    # It may lie off the constraints by rounding; the first row and the first step begin on them.
    status, sizes = bound.put_on_constraints()
    smallest_angle, least = status[1:3].tolist()
    run.count(1)
    if not np.isfinite(bound.k).all():
        from lagcli.simulation.stepping import stop_diagnosis

        raise StepFailure(*stop_diagnosis.START_NOT_FINITE)
    run.count(1)
    given = bound.rhs, bound.k, sizes, run.tolerance, run.method.order
    control.step = start.part * controller.first_step(*given)
    if smallest_angle < MONITOR.certain**2:
        # No step is wasted towards a singular configuration so near: each amplifies rounding more. It is seen from the
        # start on by a look back, where Euler's step leads.
        tau = MONITOR.back * control.step
        status = bound.projected_at(run.t - tau, bound.y - tau * bound.k)[2]
        if status[0] <= MOST_RESIDUAL:
            run.watch = run.watch.after(run.t - tau, *status[1:3].tolist())
    run.watch = run.watch.after(run.t, smallest_angle, least)
    run.settle()
    return True
