"""The tables of a run, its rows and its incidents, on their way out, and the checkpoints that agree with them."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.output.files import atomic_file, interrupts, write_guard
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import incident_table, provenance
from lagcli.running import safe_table
from lagcli.running.run_request import RunRequest
from lagcli.running.safe_table import RowsBefore, SafeTable, TablePlan
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state import checkpoint
from lagcli.simulation.run_state.statistics import KINDS, Incident

if TYPE_CHECKING:
    # Most runs keep no checkpoints and are not drawn.
    from lagcli.output.figures.chart import DecimatedRows
    from lagcli.running.checkpoint_file import CheckpointWriter

Floats = npt.NDArray[np.float64]
NO_INCIDENTS: tuple[Incident, ...] = ()


def table(run: SimulationRun, request: RunRequest, names: Sequence[str]) -> TablePlan | None:
    """The table of rows, if one is written."""
    if request.file is None and not request.to_stdout:
        return None
    return TablePlan("--output", request.file, tuple(names), {}, run.grid.step, request.event_rows)


def events(run: SimulationRun, request: RunRequest) -> TablePlan | None:
    """The table of incidents, if one is written. Raises `BadRequest` where two of its columns have one name."""
    if request.events is None:
        return None
    names = run.incident_columns.names
    twice = [name for name in names if names.count(name) > 1] if len(set(names)) < len(names) else []
    if twice:
        raise BadRequest(
            f"--events {request.events}: two of its columns would be called `{twice[0]}`: rename the particle or the"
            " constraint"
        )
    model = run.model
    multipliers = [name.removeprefix(incident_table.IMPULSE) for name in names if name.startswith("impulse.")]
    words = {"kind": KINDS, "name": [*multipliers, *(event.name for event in model.events)]}
    return TablePlan("--events", request.events_file, names, words, noun="events")


class RunTables:
    """Takes the rows and incidents of a run. Everything that ends it is called where interrupts are held back."""

    def __init__(self, run: SimulationRun, rows: SafeTable | None, happened: SafeTable | None) -> None:
        self._run, self._rows, self._events = run, rows, happened
        self._keeper: CheckpointWriter | None = None
        self._checkpoint = ""
        self.complete_files: list[str] = []  # that stand in their place
        self.t_end = -math.inf  # time of the last row

    @property
    def _tables(self) -> list[SafeTable]:
        return [each for each in (self._rows, self._events) if each is not None]

    def keep_checkpoints(self, path: str, first: RowsBefore | None, happened: RowsBefore | None) -> None:
        """Keep a checkpoint in a file; the rows of tables that are files too are safe at each of them."""
        from lagcli.running.checkpoint_file import CheckpointWriter

        self._checkpoint = path
        rows = None if self._rows is None else self._rows.keep_rows(first)
        incidents = None if self._events is None else self._events.keep_rows(happened)
        self._keeper = CheckpointWriter(path, rows, incidents)

    def begin(
        self, first: RowsBefore | None, happened: RowsBefore | None, drawn: DecimatedRows | None
    ) -> None:
        """Begin with the rows and incidents of the run before, which are `drawn` too."""
        if first is not None and self._rows is not None:
            self._rows.begin(first, _ignore if drawn is None else drawn.add)
            self.t_end = first.t_end
        if happened is not None and self._events is not None:
            self._events.begin(happened, _ignore if drawn is None else drawn.mark)

    def take(
        self,
        block: Floats,
        chosen: Floats,
        point: checkpoint.Checkpoint | None,
        incidents: Sequence[Incident] = NO_INCIDENTS,
    ) -> None:
        """A block of the run, its columns that are written, where to go on from after it, and its incidents."""
        if len(block):
            self.t_end = float(block[-1, 0])
        if self._rows is not None:
            self._rows.write(chosen)
        if self._events is not None and incidents:
            columns = self._run.incident_columns
            self._events.write(columns.numbers(incidents), columns.words(incidents))
        if self._keeper is not None and point is not None:
            with write_guard.writing(self._checkpoint):
                self._keeper.take(point)

    def complete(self, planned: int | None = None) -> None:
        """All rows are there, so many as were `planned`, where that is known.

        No file is replaced before all of them can be.
        """
        for each in self._tables:
            each.finish(planned if each is self._rows else None)
        for each in self._tables:
            each.complete()
            if each.file is not None:
                self.complete_files.append(each.file)
                interrupts.leave(f"lagcli: interrupted; {completed(self.complete_files)}")
        try:
            self._keep_checkpoint()
        finally:
            for each in self._tables:
                each.leave_rows(is_complete=True)

    def abandon(self) -> None:
        """The run has failed: leave no more than what a checkpoint needs."""
        for each in self._tables:
            each.abandon(self._keeper is not None and self._keeper.has_written)

    def keep(self) -> str:
        """The run has ended before its end: keep what there is, and return where that is, if it is in files."""
        saved = [each.keep() for each in self._tables]
        self._keep_checkpoint()
        for each in self._tables:
            each.leave_rows(is_complete=False)
        return ", ".join(filter(None, saved))

    def _keep_checkpoint(self) -> None:
        if self._keeper is not None:
            with write_guard.writing(self._checkpoint):
                self._keeper.write()


def completed(files: Sequence[str]) -> str:
    """The words on files that are complete."""
    return f"{' and '.join(files)} {'is' if len(files) == 1 else 'are'} complete"


def _ignore(block: Floats) -> None:
    """Not drawn."""


@contextlib.contextmanager
def opened(run: SimulationRun, rows: TablePlan | None, happened: TablePlan | None) -> Iterator[RunTables]:
    """The tables in files, on standard output, or nowhere; trouble with one is reported with its name.

    Interrupts are held back inside but in `interrupts.window`.
    """
    whence = provenance.of(run.model).as_json()
    with contextlib.ExitStack() as stack, interrupts.shielded():
        tables = [
            None if plan is None else stack.enter_context(safe_table.opened(plan, whence))
            for plan in (rows, happened)
        ]
        made = RunTables(run, tables[0], tables[1])
        with atomic_file.undone_by(made.abandon):
            yield made
