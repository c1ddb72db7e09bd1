"""The tables of a run, its rows and its incidents, on their way out, and the checkpoints that agree with them."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.api.runs.simulation_run import SimulationRun
from lagcli.cli.files import safe_table
from lagcli.cli.files.safe_table import SafeTable
from lagcli.cli.files.table_plan import TablePlan
from lagcli.cli.requests.asked_run import SimulateOptions
from lagcli.cli.terminal import exits
from lagcli.output.figures import decimate
from lagcli.output.files import interrupts, write_guard
from lagcli.output.tables import incident_table, provenance
from lagcli.output.tables.incident_table import IncidentColumns
from lagcli.simulation.run_state import checkpoint
from lagcli.simulation.run_state.incident import KINDS, Incident

if TYPE_CHECKING:
    # Most runs keep no checkpoints and go on from none.
    from lagcli.cli.files.table_plan import RowsBefore
    from lagcli.output.checkpoint_file import Keeper

Floats = npt.NDArray[np.float64]
NO_INCIDENTS: tuple[Incident, ...] = ()


def table(ready: SimulationRun, options: SimulateOptions, names: Sequence[str]) -> TablePlan | None:
    """The table of rows, if one is written."""
    if options.file is None and not options.to_stdout:
        return None
    return TablePlan("--output", options.file, tuple(names), {}, ready.grid.step, options.event_rows)


def events(ready: SimulationRun, options: SimulateOptions) -> TablePlan | None:
    """The table of incidents, if one is written. Raises `exits.UsageError` where two of its columns have one name."""
    if options.events is None:
        return None
    names = ready.incident_columns.names
    twice = [name for name in names if names.count(name) > 1] if len(set(names)) < len(names) else []
    if twice:
        raise exits.UsageError(
            f"--events {options.events}: two of its columns would be called `{twice[0]}`: rename the particle or the"
            " constraint"
        )
    model = ready.model
    multipliers = [name.removeprefix(incident_table.IMPULSE) for name in names if name.startswith("impulse.")]
    words = {"kind": KINDS, "name": [*multipliers, *(event.name for event in model.events)]}
    return TablePlan("--events", options.events_file, names, words, noun="events")


class TableOutput:
    """Takes the rows and incidents of a run. Everything that ends it is called where interrupts are held back."""

    def __init__(self, rows: SafeTable | None, happened: SafeTable | None, columns: IncidentColumns) -> None:
        self._rows, self._events, self._columns = rows, happened, columns
        self._keeper: Keeper | None = None
        self._checkpoint = ""
        self.t_end = -math.inf  # time of the last row

    @property
    def _tables(self) -> list[SafeTable]:
        return [each for each in (self._rows, self._events) if each is not None]

    def keep_checkpoints(self, path: str, first: RowsBefore | None, happened: RowsBefore | None) -> None:
        """Keep a checkpoint in a file; the rows of tables that are files too are safe at each of them."""
        from lagcli.output.checkpoint_file import Keeper

        self._checkpoint = path
        rows = None if self._rows is None else self._rows.keep_rows(first)
        incidents = None if self._events is None else self._events.keep_rows(happened)
        self._keeper = Keeper(path, rows, incidents)

    def begin(
        self, first: RowsBefore | None, happened: RowsBefore | None, drawn: decimate.DecimatedRows | None
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
            self._events.write(self._columns.numbers(incidents), self._columns.words(incidents))
        if self._keeper is not None and point is not None:
            with write_guard.writing(self._checkpoint):
                self._keeper.take(point)

    def complete(self) -> None:
        """All rows are there."""
        done: list[str] = []
        for each in self._tables:
            each.complete()
            if each.file is not None:
                done.append(each.file)
                are = "is" if len(done) == 1 else "are"
                interrupts.leave(f"lagcli: interrupted; {' and '.join(done)} {are} complete")
        self._keep_checkpoint()
        for each in self._tables:
            each.leave_rows(is_complete=True)

    def keep(self) -> str:
        """The run has ended before its end: keep what there is, and return where that is, if it is in files."""
        kept = [each.keep() for each in self._tables]
        self._keep_checkpoint()
        for each in self._tables:
            each.leave_rows(is_complete=False)
        return ", ".join(filter(None, kept))

    def _keep_checkpoint(self) -> None:
        if self._keeper is not None:
            with write_guard.writing(self._checkpoint):
                self._keeper.write()


def _ignore(block: Floats) -> None:
    """Not drawn."""


@contextlib.contextmanager
def opened(ready: SimulationRun, rows: TablePlan | None, happened: TablePlan | None) -> Iterator[TableOutput]:
    """The tables in files, on standard output, or nowhere; trouble with one is told with its name.

    Interrupts are held back inside but in `interrupts.window`.
    """
    whence = provenance.of(ready.model).as_json()
    with contextlib.ExitStack() as stack, interrupts.shielded():
        tables = [
            None if plan is None else stack.enter_context(safe_table.opened(plan, whence))
            for plan in (rows, happened)
        ]
        yield TableOutput(tables[0], tables[1], ready.incident_columns)
