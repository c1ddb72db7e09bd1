"""The tables of a run, its rows and its incidents, on their way out, and the checkpoints that agree with them."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import pathlib
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.frozen import frozen_value
from lagcli.output.files import atomic_file, interrupts, write_guard
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import cell_text, incident_table, provenance, sinks, table_format
from lagcli.running.run_request import RunRequest
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state import checkpoint
from lagcli.simulation.run_state.statistics import KINDS, Incident

if TYPE_CHECKING:
    from lagcli.output.figures.chart import DecimatedRows
    from lagcli.output.tables.row_file import RowFile, SafeRows

EVERY = 30.0  # seconds


@dataclasses.dataclass(frozen=True, slots=True)
class SyncedRows:
    """Rows of a table that are on the disk before a checkpoint is.

    target: the table; step: the distance of its rows; has_event_rows: with rows of the instants of incidents.
    """

    rows: RowFile
    target: Path
    step: float
    has_event_rows: bool = False

    def record(self, path: Path) -> checkpoint.CheckpointTable:
        """The words about it in a checkpoint in the file `path`."""
        written = self.rows.rows
        # The way from the folder of the checkpoint to the table: both may move together.
        folder, seen = os.path.dirname(os.path.realpath(path)), os.path.realpath(self.target)
        with contextlib.suppress(ValueError):  # on two drives
            seen = os.path.relpath(seen, folder)
        return checkpoint.CheckpointTable(
            seen, self.step, written.count, written.checksum, self.has_event_rows
        )


class CheckpointWriter:
    """Keeps the last checkpoint of a run in a file: the first at once, the others now and then, and on request.

    So a file that cannot be made is known when the run begins. Later a failure waits for `write`: a full disk may
    have room again, and the run goes on meanwhile. table, events: rows and incidents, where they go into files.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        table: SyncedRows | None = None,
        events: SyncedRows | None = None,
    ) -> None:
        self._path = Path(path)
        self._table, self._events = table, events
        self._last: checkpoint.Checkpoint | None = None
        self._due: float | None = None
        self.has_written = False

    def take(self, point: checkpoint.Checkpoint) -> None:
        """The run has come to a point. Raises OSError where the first one cannot be written."""
        if self._table is not None:
            point = dataclasses.replace(point, table=self._table.record(self._path))
        if self._events is not None:
            point = dataclasses.replace(point, events=self._events.record(self._path))
        is_first, self._last = self._due is None, point
        now = time.monotonic()
        if self._due is not None and now < self._due:
            return
        self._due = now + EVERY
        try:
            self.write()
        except OSError:
            self._last = point
            if is_first:
                raise

    def write(self) -> bool:
        """Write the last point taken; whether there was one that the file does not hold yet. Raises OSError."""
        if self._last is None:
            return False
        for rows in (self._table, self._events):
            if rows is not None:
                rows.rows.sync()
        atomic_file.write(self._path, checkpoint.encoded(self._last), durably=True)
        self._last, self.has_written = None, True
        return True


def table_of(path: Path, seen: str) -> Path:
    """The table that a checkpoint names so."""
    return Path(os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(path)), seen)))


@frozen_value
class TablePlan:
    """A table that a run shall write.

    option: the option that names its file; file: None for standard output; names: its columns; words: those of its
    columns that hold text, with all texts that may stand there; step: between its rows; has_event_rows: with rows of
    the instants of incidents; noun: of its rows.
    """

    option: str
    file: str | None
    names: tuple[str, ...]
    words: Mapping[str, Sequence[str]] = dataclasses.field(default_factory=dict)
    step: float = 0.0
    has_event_rows: bool = False
    noun: str = "rows"

    @classmethod
    def of_option(cls, output: str, names: Sequence[str]) -> TablePlan:
        """The table of `--output`, `-` for standard output."""
        return cls("--output", None if output == "-" else output, tuple(names))

    @property
    def texts(self) -> tuple[str, ...]:
        """The columns of text."""
        return tuple(self.words)

    @property
    def path(self) -> pathlib.Path:
        """The file, where there is one."""
        assert self.file is not None
        return pathlib.Path(os.path.realpath(self.file))

    def numbers(self, rows: Floats, texts: cell_text.Texts) -> Floats:
        """Rows as numbers alone, a text as its index among the words, (k, names)."""
        if not self.words:
            return rows
        known = ({word: float(i) for i, word in enumerate(words)} for words in self.words.values())
        coded = {
            name: [codes[text] for text in cells]
            for name, cells, codes in zip(self.texts, texts, known, strict=True)
        }
        numbers = iter(rows.T)
        columns = [coded[name] if name in coded else next(numbers) for name in self.names]
        return np.array(columns, dtype=float).reshape(len(self.names), len(rows)).T

    def decoded(self, block: Floats) -> tuple[Floats, list[list[str]]]:
        """The rows and the texts of rows as numbers alone."""
        texts = []
        for name, words in self.words.items():
            texts.append([words[int(i)] for i in block[:, self.names.index(name)]])
        numeric = [i for i, name in enumerate(self.names) if name not in self.words]
        return block if not self.words else np.ascontiguousarray(block[:, numeric]), texts


@frozen_value
class RowsBefore:
    """Rows of the run that is resumed, which the same table begins with: their file, and the time they go up to."""

    path: pathlib.Path
    rows: SafeRows
    t_end: float
    noun: str


class SafeTable:
    """Takes the rows of one table. Everything that ends it is called where interrupts are held back."""

    def __init__(self, sink: sinks.Sink, plan: TablePlan) -> None:
        self._sink, self._plan = sink, plan
        self._rows: RowFile | None = None
        self._before: RowsBefore | None = None

    @property
    def file(self) -> str | None:
        """The file, None for standard output."""
        return self._plan.file

    def keep_rows(self, first: RowsBefore | None) -> SyncedRows | None:
        """Keep the rows beside the table, where it is a file, after those of the run before."""
        plan = self._plan
        if not self._sink.is_file or plan.file is None:
            return None
        from lagcli.output.tables import row_file

        self._before = first
        rows = row_file.path_of(plan.path)
        with write_guard.writing(os.fspath(rows)):
            if first is not None:
                self._rows = row_file.RowFile(first.path, plan.names, first.rows)
            else:
                row_file.require_ours(rows)
                self._rows = row_file.RowFile(rows, plan.names)
        return SyncedRows(self._rows, plan.path, plan.step, plan.has_event_rows)

    def begin(self, first: RowsBefore, seen: Callable[[Floats], None] | None) -> None:
        """Begin with the rows of the run before, each block of which is also `seen`."""
        from lagcli.output.tables import row_file

        self._before = first
        for block in row_file.read(first.path, self._plan.names, first.rows):
            if seen is not None:
                with interrupts.window():
                    seen(block)
            self._sink.write(*self._plan.decoded(block))

    def write(self, rows: Floats, texts: cell_text.Texts = ()) -> None:
        """More rows (k, columns of numbers), and their texts."""
        with self._writing():
            self._sink.write(rows, texts)
        if self._rows is not None:
            with write_guard.writing(os.fspath(self._rows.path)):
                self._rows.write(self._plan.numbers(rows, texts))

    def finish(self, planned: int | None = None) -> None:
        """All rows are there, so many as were `planned`, where that is known; a file does not yet stand in its
        place."""
        with self._writing():
            self._sink.finish(planned)

    def complete(self) -> None:
        """Move the table into its place."""
        with self._writing():
            self._sink.commit(durably=self._rows is not None or self._before is not None)

    def leave_rows(self, is_complete: bool) -> None:
        """The last checkpoint is written: rows beside a complete table are needed no more, nor is what a run before
        left of it."""
        if self._rows is not None:
            if is_complete:
                self._rows.remove()
            else:
                self._rows.close()
        if is_complete and self._before is not None:
            for left in (self._before.path, atomic_file.partial_of(self._plan.path)):
                with write_guard.writing(os.fspath(left)):
                    left.unlink(missing_ok=True)

    def abandon(self, has_checkpoint: bool) -> None:
        """The run has failed: rows that no checkpoint speaks of are needed no more."""
        if self._rows is not None:
            if has_checkpoint or self._before is not None:
                self._rows.close()
            else:
                self._rows.remove()

    def keep(self) -> str:
        """The run has ended before its end: keep what there is; where it is, as a part of a sentence, or nothing."""
        with self._writing():
            partial = self._sink.keep_partial()
        return f"the complete {self._plan.noun} are in {partial}" if partial is not None else ""

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Trouble is reported with the name of the table. A pipe may wait for its reader for ever; a file does not, and
        is finished whatever comes."""
        is_file = self._sink.is_file
        patient = contextlib.nullcontext() if is_file else interrupts.shielded(interrupts.PATIENCE)
        with write_guard.writing(self._plan.file or "standard output"), patient:
            yield


@contextlib.contextmanager
def opened_table(plan: TablePlan, provenance: Mapping[str, object]) -> Iterator[SafeTable]:
    """A table in a file or on standard output; trouble with it is reported with its name. Raises `BadRequest` where a
    library for its format is missing.

    Interrupts are held back inside but in `interrupts.window`.
    """
    file = plan.file
    with contextlib.ExitStack() as stack:
        stack.enter_context(write_guard.writing(file or "standard output"))
        # An interrupt finds a sink that will be discarded, or none: no file stays behind.
        with interrupts.shielded():
            target = sys.stdout.buffer if file is None else pathlib.Path(file)
            # A pipe with a name is opened when somebody reads it.
            is_waiting = file is not None and not atomic_file.is_replaced(pathlib.Path(file))
            try:
                with interrupts.shielded(interrupts.PATIENCE) if is_waiting else contextlib.nullcontext():
                    sink = sinks.open_sink(target, plan.names, provenance=provenance, texts=plan.texts)
            except table_format.MissingExtra as error:
                raise BadRequest(str(error)) from None
            yield SafeTable(stack.enter_context(sink), plan)


def write(plan: TablePlan, provenance: Mapping[str, object], rows: Floats, is_partial: bool) -> str:
    """Write the rows of a table, of which there are no others; one of a run that stopped is saved beside the file.

    Returns where that is, as a part of a sentence, or nothing. Raises as `opened_table`, and `WriteError`.
    """
    with opened_table(plan, provenance) as table:
        table.write(rows)
        if is_partial:
            return table.keep()
        table.finish(len(rows))
        table.complete()
    return ""


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

        self._checkpoint = path
        rows = None if self._rows is None else self._rows.keep_rows(first)
        incidents = None if self._events is None else self._events.keep_rows(happened)
        self._keeper = CheckpointWriter(path, rows, incidents)

    def begin(
        self, first: RowsBefore | None, happened: RowsBefore | None, drawn: DecimatedRows | None
    ) -> None:
        """Begin with the rows and incidents of the run before, which are `drawn` too."""
        if first is not None and self._rows is not None:
            self._rows.begin(first, None if drawn is None else drawn.add)
            self.t_end = first.t_end
        if happened is not None and self._events is not None:
            self._events.begin(happened, None if drawn is None else drawn.mark)

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


@contextlib.contextmanager
def opened(run: SimulationRun, rows: TablePlan | None, happened: TablePlan | None) -> Iterator[RunTables]:
    """The tables in files, on standard output, or nowhere; trouble with one is reported with its name.

    Interrupts are held back inside but in `interrupts.window`.
    """
    whence = provenance.of(run.model).as_json()
    with contextlib.ExitStack() as stack, interrupts.shielded():
        tables = [
            None if plan is None else stack.enter_context(opened_table(plan, whence))
            for plan in (rows, happened)
        ]
        made = RunTables(run, tables[0], tables[1])
        with atomic_file.undone_by(made.abandon):
            yield made
