"""A table of a run that is planned, and on its way into a file or onto standard output; its rows that are safe beside
checkpoints."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.frozen import frozen_value
from lagcli.output.files import atomic_file, interrupts, write_guard
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import cell_text, sinks, table_format

if TYPE_CHECKING:
    # Rows are kept beside checkpoints, which most runs have none of.
    from lagcli.output.tables.row_file import RowFile, SafeRows
    from lagcli.running.checkpoint_file import SyncedRows

Floats = npt.NDArray[np.float64]


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

    @property
    def sentence(self) -> str:
        """The sentence about them."""
        count = self.rows.count
        return f"with the {count} {self.noun} up to t = {self.t_end:.9g} of the run before, from {self.path}"


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
        from lagcli.running.checkpoint_file import SyncedRows

        self._before = first
        rows = row_file.path_of(plan.path)
        with write_guard.writing(os.fspath(rows)):
            if first is not None:
                self._rows = row_file.RowFile.going_on(first.path, plan.names, first.rows)
            else:
                row_file.require_ours(rows)
                self._rows = row_file.RowFile(rows, plan.names)
        return SyncedRows(self._rows, plan.path, plan.step, plan.has_event_rows)

    def begin(self, first: RowsBefore, seen: Callable[[Floats], None]) -> None:
        """Begin with the rows of the run before, each block of which is also `seen`."""
        from lagcli.output.tables import row_file

        self._before = first
        for block in row_file.read(first.path, self._plan.names, first.rows):
            with interrupts.window():
                seen(block)
            self._sink.write(*self._plan.decoded(block))

    def write(self, rows: Floats, texts: cell_text.Texts = ()) -> None:
        """More rows (k, columns of numbers), and their texts."""
        with write_guard.writing(self._plan.file or "standard output"), self._patient():
            self._sink.write(rows, texts)
        if self._rows is not None:
            with write_guard.writing(os.fspath(self._rows.path)):
                self._rows.write(self._plan.numbers(rows, texts))

    def finish(self, planned: int | None = None) -> None:
        """All rows are there, so many as were `planned`, where that is known; a file does not yet stand in its
        place."""
        with write_guard.writing(self._plan.file or "standard output"), self._patient():
            self._sink.finish(planned)

    def complete(self) -> None:
        """Move the table into its place."""
        with write_guard.writing(self._plan.file or "standard output"), self._patient():
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
        with write_guard.writing(self._plan.file or "standard output"), self._patient():
            partial = self._sink.keep_partial()
        return f"the complete {self._plan.noun} are in {partial}" if partial is not None else ""

    def _patient(self) -> contextlib.AbstractContextManager[None]:
        """A pipe may wait for its reader for ever; a file does not, and is finished whatever comes."""
        return contextlib.nullcontext() if self._sink.is_file else interrupts.shielded(interrupts.PATIENCE)


@contextlib.contextmanager
def opened(plan: TablePlan, provenance: Mapping[str, object]) -> Iterator[SafeTable]:
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

    Returns where that is, as a part of a sentence, or nothing. Raises as `opened`, and `WriteError`.
    """
    with opened(plan, provenance) as table:
        table.write(rows)
        if is_partial:
            return table.keep()
        table.finish(len(rows))
        table.complete()
    return ""
