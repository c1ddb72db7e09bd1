"""Runs a model from a start, or on from where another run was marked, and hands out the rows of the grid.

Rows leave in blocks while the run goes on; the memory it needs does not grow with its length.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from lagcli.compiled.selection import Selection
from lagcli.equations.time_functions import TimeFunctions
from lagcli.model.model import Simulation
from lagcli.simulation.closed_contacts.row_gaps import RowGaps
from lagcli.simulation.events.event import Event
from lagcli.simulation.events.impulse_event import ImpulseEvent
from lagcli.simulation.events.singular_event import SingularEvent
from lagcli.simulation.events.switch_event import SwitchEvent
from lagcli.simulation.run import run_start
from lagcli.simulation.run.row_writer import RowWriter, TableRows
from lagcli.simulation.run.run_start import RunStart
from lagcli.simulation.run_state.angle_turns import Turns
from lagcli.simulation.run_state.checkpoint import CheckpointError, RunState
from lagcli.simulation.run_state.incident import Incident
from lagcli.simulation.run_state.run_stop import RunStop, StepFailure, Stop
from lagcli.simulation.run_state.statistics import Figures, RunStatistics
from lagcli.simulation.scheme import line_functions
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.stepping import grid as grids
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]

BLOCK_VALUES = 2**16  # numbers in a block of rows
NEARLY = 1.001  # a step of so many times the length proposed, that ends before the run, is not its last
PAUSE = 0.1  # seconds after which the rows so far, be there none, are handed out: for progress and interrupts


def _contacts(stepper: Stepper) -> Event | None:
    """One-sided constraints and declared events, whose modules other models do not load."""
    system = stepper.bound.held.integrals.system
    if not (system.contacts.count or system.event_values.numel()):
        return None
    from lagcli.simulation.events.contact_event import ContactEvent

    return ContactEvent.of(stepper)


# In the order in which they are asked; the first that finds a step leaves none to the others.
EVENTS: tuple[Callable[[Stepper], Event | None], ...] = (
    SwitchEvent.of,
    SingularEvent.of,
    ImpulseEvent.of,
    _contacts,
)


def start(
    held: EnforcedInvariants,
    begin: RunStart,
    settings: Simulation,
    rows: TableRows,
    notes: tuple[str, ...] = (),
    timed: TimeFunctions | None = None,
) -> Run:
    """A run from a consistent start.

    held: the functions, with the integrals that are held there; notes: what was said about them; timed: what the model
    says about t alone.
    """
    origin = grids.origin(settings, held.has_time)
    grid = _grid(settings, origin)
    state = RunState(
        t=grid.start,
        y=np.concatenate([begin.q, begin.v, [0.0]]),
        k=np.zeros(2 * begin.q.size + 1),
        step=0.0,
        pace_from=grid.start,
        steps=0,
        rejected=0,
        evaluations=0,
        row=-math.inf,
        figures=Figures(0.0, 0.0),
        selection=held.integrals.selection,
        levels=held.levels,
        notes=notes,
        origin=origin,
        turns=Turns(held.integrals.system).of(held.p),
    )
    stepper = Stepper(held, state, settings, grid, timed if held.has_time else None, begin.is_again)
    return Run(stepper, RowWriter(stepper, rows, 0), begin)


def resume(
    held: EnforcedInvariants,
    mark: RunState,
    settings: Simulation,
    columns: tuple[str, ...],
    timed: TimeFunctions | None = None,
) -> Run:
    """A run that goes on from where another was marked; held: as it was there. Else as `start`."""
    grid = _grid(settings, mark.origin)
    # The rows that another grid has between the last one handed out and the mark are lost.
    after = grid.after(mark.row)
    first = max(after, grid.first(mark.t))
    stepper = Stepper(held, mark, settings, grid, timed if held.has_time else None)
    return Run(stepper, RowWriter(stepper, TableRows(columns), first), None, mark.row, first - after)


def _grid(settings: Simulation, origin: float) -> grids.Grid:
    return grids.grid(dataclasses.replace(settings, start=settings.start - origin))


class Run:
    """One integration: iterate `blocks` once; `account` is filled as they come.

    begin: the start, where the first step is still to be proposed; row: time of the last row handed out; passed_over:
    rows that are lost to a grid other than that of the mark. Times in here, `t` and the grid too, are counted from
    `origin`.
    """

    def __init__(
        self,
        stepper: Stepper,
        writer: RowWriter,
        begin: RunStart | None,
        row: float = -math.inf,
        passed_over: int = 0,
    ) -> None:
        self._stepper, self._writer, self._begin = stepper, writer, begin
        self._row, self.passed_over = row, passed_over
        found = (of(stepper) for of in EVENTS)
        self._events = tuple(event for event in found if event is not None)
        self._looks_ahead = any(event.looks_ahead for event in self._events)
        held = stepper.bound.held
        self._gaps = RowGaps(held.integrals.system, held.plain.functions.numeric, held.p)
        # A row at an incident is to be written once the run is beyond it.
        self._is_due = False

    @property
    def origin(self) -> float:
        """The time from which times in here are counted."""
        return self._stepper.origin

    @property
    def grid(self) -> grids.Grid:
        """The times of the rows."""
        return self._stepper.grid

    @property
    def account(self) -> RunStatistics:
        """The account of the run, up to the last block."""
        return self._stepper.account

    @property
    def incidents(self) -> list[Incident]:
        """Incidents up to the last block that were not taken yet."""
        return self.account.incidents

    def take_incidents(self) -> list[Incident]:
        """Incidents up to the last block since they were last taken, in the order of time."""
        taken, self.account.incidents = self.account.incidents, []
        return taken

    @property
    def t(self) -> float:
        """The time reached."""
        return self._stepper.t

    @property
    def y(self) -> Floats:
        """The state reached, (2n + 1,)."""
        return self._stepper.bound.y.copy()

    @property
    def complete(self) -> int:
        """The rows of the grid that it is beyond."""
        return self._writer.complete

    @property
    def rate(self) -> Floats:
        """y' there, (2n + 1,)."""
        return self._stepper.bound.k.copy()

    @property
    def selection(self) -> Selection:
        """The independent rows it is stepped with."""
        return self._stepper.bound.held.integrals.selection

    @property
    def indeterminate(self) -> frozenset[int]:
        """Rows whose multipliers, or impulses, are not unique or were not at some time."""
        return self.selection.indeterminate.union(self._stepper.contacts.shared)

    def require_rows_left(self) -> None:
        """Raise `CheckpointError` where all rows of a resumed run were handed out before; before its first block."""
        if self._begin is None and self._writer.is_done:
            raise CheckpointError(
                f"nothing is left to do: it is at t = {self.origin + self.t:.9g} with its last row at"
                f" {self.origin + self._row:.9g}, and the run ends at {self.origin + self.grid.end:.9g}; a longer"
                " duration goes on"
            )

    def mark(self) -> RunState:
        """The state to go on from, with all rows handed out so far; for the time between two blocks."""
        figures = self.account.figures
        assert figures is not None, "the first block holds the first row"
        told = self.account.told
        return dataclasses.replace(self._stepper.state(), row=self._row, figures=figures, told=told)

    def blocks(self) -> Iterator[Floats]:
        """Blocks of complete rows, shape (k, 1 + columns), t first; one at least every `PAUSE`, maybe empty.

        Raises `RunStop` after the last good row.
        """
        writer, account = self._writer, self.account
        capacity = max(1, min(self.grid.count, BLOCK_VALUES // writer.width))
        stop: Stop | None = None
        going = True
        while going:
            began = time.perf_counter()
            writer.open(capacity)
            try:
                going = not self._fill(began + PAUSE)
            except StepFailure as failure:
                stop, going = self._stopped(failure), False
            block = writer.close()
            if len(block):
                account.keep(block[:, -line_functions.BEYOND : -1])
                account.keep_depth(self._gaps.deepest(block))
                self._row = self.grid.time(writer.next_row - 1)
            rows = block[:, : -line_functions.BEYOND]
            rows += 0.0  # no table shows -0.0
            account.solve_seconds += time.perf_counter() - began
            if len(block) or going or self.incidents:
                yield rows
        if stop is not None:
            raise RunStop(stop)

    def _fill(self, until: float) -> bool:
        """Take steps and put their rows into the block until it is full or the time is over; True at the end."""
        stepper, writer = self._stepper, self._writer
        found = stepper.found
        self._start()
        while True:
            if self._is_due and not self._put_state():
                return False
            if self.account.ended_by or (writer.is_done and not found.is_open):
                return True
            if not found.is_open:
                self._find_step()
                continue
            if not writer.put_rows():
                return False
            if writer.is_done:
                stepper.t = self.grid.end
                stepper.tell_within()
                for event in self._events:
                    event.end()
                return True
            self._is_due = found.is_jump
            stepper.accept()
            for event in self._events:
                event.act()
            if time.perf_counter() > until:
                return False

    def _start(self) -> None:
        """Begin, where that is still to be done."""
        if self._begin is None:
            return
        run_start.begin(self._stepper, self._begin)
        if not self._begin.is_singular:
            for event in self._events:
                event.begin()
            self._writer.put_begin()
        self._begin = None

    def _put_state(self) -> bool:
        """Write the row at an incident that the run is behind, if there is one; False where the block is full."""
        writer = self._writer
        is_put = writer.put_last() if self.account.ended_by else writer.put_state()
        self._is_due = not is_put
        return is_put

    def _find_step(self) -> None:
        self._stepper.found.within = []
        if any(event.passes() for event in self._events):
            self._cut()
            return
        stepper = self._stepper
        if self._looks_ahead and stepper.t + NEARLY * stepper.control.step >= self.grid.end:
            # What happens before the end is found in the step of a run that goes on.
            take_back = _unfound(stepper)
            try:
                stepper.advance(beyond=True)
                self._cut()
            except StepFailure:
                take_back()
            else:
                if not stepper.found.is_open or stepper.found.reached <= self.grid.end:
                    return
                take_back()
        stepper.advance()
        self._cut()

    def _cut(self) -> None:
        for event in self._events:
            event.cut()

    def _stopped(self, failure: StepFailure) -> Stop:
        t = self.origin + self.t
        where = f"stopped at t = {t:.9g} (after row {self._writer.complete} of {self.grid.count})"
        return Stop(t, f"{where}: {failure.reason}", failure.code)


def _unfound(stepper: Stepper) -> Callable[[], None]:
    """A call that takes back the step that is found next."""
    account, watch, foreseen = stepper.account, stepper.watch.state, stepper.foreseen
    counted = account.steps, account.rejected

    def take_back() -> None:
        account.steps, account.rejected = counted
        stepper.watch.state, stepper.foreseen = watch, foreseen
        stepper.found.is_open, stepper.found.is_jump, stepper.found.barrier = False, False, None
        stepper.found.within = []

    return take_back
