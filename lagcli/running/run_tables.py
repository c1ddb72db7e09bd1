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

from lagcli.arrays import Floats
from lagcli.frozen import frozen_value
from lagcli.output.files import atomic_file, interrupts, write_guard
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import sinks, table_format
from lagcli.output.tables.incident_table import IncidentColumns
from lagcli.simulation.run_state import checkpoint
from lagcli.simulation.run_state.statistics import Incident

if TYPE_CHECKING:
    from lagcli.output.figures.chart import DecimatedRows
    from lagcli.output.tables.row_file import RowFile, SafeRows


EVERY = 30.0  # seconds


class CheckpointWriter:
    """Keeps the last checkpoint of a run in a file: the first at once, the others now and then, and on request.

    So a file that cannot be made is known when the run begins. Later a failure waits for `write`: a full disk may
    have room again, and the run goes on meanwhile. table, events: of the rows and incidents.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        table: SafeTable | None = None,
        events: SafeTable | None = None,
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
                rows.sync()
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
    columns that hold text, with all texts that may stand there; step: between its rows, 0 where they have none;
    has_event_rows: with rows of the instants of incidents; noun: of its rows.
    """

    option: str
    file: str | None
    names: tuple[str, ...]
    words: Mapping[str, Sequence[str]] = dataclasses.field(default_factory=dict)
    step: float = 0.0
    has_event_rows: bool = False
    noun: str = "rows"

    @property
    def path(self) -> pathlib.Path:
        """The file, where there is one."""
        assert self.file is not None
        return pathlib.Path(os.path.realpath(self.file))

    def numbers(self, rows: Floats, texts: table_format.Texts) -> Floats:
        """Rows as numbers alone, a text as its index among the words, (k, names)."""
        if not self.words:
            return rows
        known = ({word: float(i) for i, word in enumerate(words)} for words in self.words.values())
        coded = {
            name: [codes[text] for text in cells]
            for name, cells, codes in zip(self.words, texts, known, strict=True)
        }
        numbers = iter(rows.T)
        columns = [coded[name] if name in coded else next(numbers) for name in self.names]
        return np.array(columns, dtype=float).reshape(len(self.names), len(rows)).T

    def decoded(self, block: Floats) -> tuple[Floats, list[list[str]]]:
        """The rows and the texts of rows as numbers alone."""
        texts = [
            [words[int(i)] for i in block[:, self.names.index(name)]] for name, words in self.words.items()
        ]
        numeric = [i for i, name in enumerate(self.names) if name not in self.words]
        return block if not self.words else np.ascontiguousarray(block[:, numeric]), texts


@frozen_value
class RowsBefore:
    """Rows of the run that is resumed, which the same table begins with: their file, and the time they go up to."""

    path: pathlib.Path
    rows: SafeRows
    t_end: float


class SafeTable:
    """Takes the rows of one table. Everything that ends it is called where interrupts are held back."""

    def __init__(self, sink: sinks.Sink, plan: TablePlan, first: RowsBefore | None = None) -> None:
        """first: the rows that it begins with, where the run before has some."""
        self._sink, self._plan, self.first = sink, plan, first
        self._rows: RowFile | None = None
        self.file = plan.file

    def keep_rows(self) -> None:
        """Keep the rows beside the table, where it is a file, after those of the run before."""
        plan = self._plan
        if not self._sink.is_file:
            return
        from lagcli.output.tables import row_file

        rows = row_file.path_of(plan.path)
        with write_guard.writing(os.fspath(rows)):
            if self.first is not None:
                self._rows = row_file.RowFile(self.first.path, plan.names, self.first.rows)
            else:
                row_file.require_ours(rows)
                self._rows = row_file.RowFile(rows, plan.names)

    def sync(self) -> None:
        """The rows beside the table are on the disk, as they have to be before a checkpoint is."""
        if self._rows is not None:
            self._rows.sync()

    def record(self, path: Path) -> checkpoint.CheckpointTable | None:
        """The words about it in a checkpoint in the file `path`, where rows are kept."""
        if self._rows is None:
            return None
        plan, written = self._plan, self._rows.rows
        # The way from the folder of the checkpoint to the table: both may move together.
        folder, seen = os.path.dirname(os.path.realpath(path)), os.fspath(plan.path)
        with contextlib.suppress(ValueError):  # on two drives
            seen = os.path.relpath(seen, folder)
        return checkpoint.CheckpointTable(
            seen, plan.step, written.count, written.checksum, plan.has_event_rows
        )

    def begin(self, seen: Callable[[Floats], None] | None) -> None:
        """Begin with the rows of the run before, each block of which is also `seen`."""
        if self.first is None:
            return
        from lagcli.output.tables import row_file

        for block in row_file.read(self.first.path, self._plan.names, self.first.rows):
            if seen is not None:
                with interrupts.window():
                    seen(block)
            self._sink.write(*self._plan.decoded(block))

    def write(self, rows: Floats, texts: table_format.Texts = ()) -> None:
        """More rows (k, columns of numbers), and their texts."""
        with self._writing():
            self._sink.write(rows, texts)
        if self._rows is not None:
            with write_guard.writing(os.fspath(self._rows.path)):
                self._rows.write(self._plan.numbers(rows, texts))

    def finish(self, planned: int | None = None) -> None:
        """All rows are there, so many as were `planned`, if known; a file does not yet stand in its place."""
        with self._writing():
            self._sink.finish(planned)

    def complete(self) -> None:
        """Move the table into its place."""
        with self._writing():
            self._sink.commit(durably=self._rows is not None or self.first is not None)

    def leave_rows(self, is_complete: bool) -> None:
        """The last checkpoint is written: what is beside a complete table is needed no more."""
        if self._rows is not None:
            if is_complete:
                self._rows.remove()
            else:
                self._rows.close()
        if is_complete and self.first is not None:
            for left in (self.first.path, atomic_file.partial_of(self._plan.path)):
                with write_guard.writing(os.fspath(left)):
                    left.unlink(missing_ok=True)

    def abandon(self, has_checkpoint: bool) -> None:
        """The run has failed: rows that no checkpoint speaks of are needed no more."""
        if self._rows is None:
            return
        if has_checkpoint or self.first is not None:
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
def opened_table(
    plan: TablePlan, provenance: Mapping[str, object], first: RowsBefore | None = None
) -> Iterator[SafeTable]:
    """A table in a file or on standard output. Raises `BadRequest` where a library for its format is missing.

    Trouble inside is reported with its name, and interrupts are held back but in `interrupts.window`.
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
                    sink = sinks.open_sink(target, plan.names, provenance=provenance, texts=tuple(plan.words))
            except table_format.MissingExtra as error:
                raise BadRequest(str(error)) from None
            yield SafeTable(stack.enter_context(sink), plan, first)


def write(
    output: str, names: Sequence[str], rows: Floats, provenance: Mapping[str, object], is_partial: bool
) -> str:
    """Write the table of `--output`, `-` for standard output; one of a run that stopped is saved beside the file.

    Returns where that is, as a part of a sentence, or nothing. Raises as `opened_table`, and `WriteError`.
    """
    plan = TablePlan("--output", None if output == "-" else output, tuple(names))
    with opened_table(plan, provenance) as table:
        table.write(rows)
        if is_partial:
            return table.keep()
        table.finish(len(rows))
        table.complete()
    return ""


class RunTables:
    """Takes the rows and incidents of a run. Everything that ends it is called where interrupts are held back."""

    def __init__(
        self,
        columns: IncidentColumns,
        rows: SafeTable | None,
        events: SafeTable | None,
        checkpoint_file: str | None,
    ) -> None:
        """columns: of incidents; checkpoint_file: where a checkpoint is kept."""
        self._columns, self._rows, self._events = columns, rows, events
        self._tables = [each for each in (rows, events) if each is not None]
        self._keeper: CheckpointWriter | None = None
        self._checkpoint = checkpoint_file
        self.complete_files: list[str] = []  # that stand in their place
        self.t_end = -math.inf  # time of the last row

    def begin(self, drawn: DecimatedRows | None) -> None:
        """Begin with the rows and incidents of the run before, which are `drawn` too.

        With a checkpoint the rows of tables that are files are safe at each one.
        """
        if self._checkpoint is not None:
            for each in self._tables:
                each.keep_rows()
            self._keeper = CheckpointWriter(self._checkpoint, self._rows, self._events)
        if self._rows is not None:
            self._rows.begin(None if drawn is None else drawn.add)
            if self._rows.first is not None:
                self.t_end = self._rows.first.t_end
        if self._events is not None:
            self._events.begin(None if drawn is None else drawn.mark)

    def take(
        self,
        block: Floats,
        chosen: Floats,
        point: checkpoint.Checkpoint | None,
        incidents: Sequence[Incident],
    ) -> None:
        """A block of the run, its columns that are written, where to go on from after it, and its incidents."""
        if len(block):
            self.t_end = float(block[-1, 0])
        if self._rows is not None:
            self._rows.write(chosen)
        if self._events is not None and incidents:
            self._events.write(self._columns.numbers(incidents), self._columns.words(incidents))
        if self._keeper is not None and self._checkpoint is not None and point is not None:
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
        if self._keeper is not None and self._checkpoint is not None:
            with write_guard.writing(self._checkpoint):
                self._keeper.write()


def completed(files: Sequence[str]) -> str:
    """The words on files that are complete."""
    return f"{' and '.join(files)} {'is' if len(files) == 1 else 'are'} complete"
