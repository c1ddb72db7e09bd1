"""A table of a run on its way into a file or onto standard output, and its rows that are safe beside checkpoints."""

from __future__ import annotations

import contextlib
import os
import pathlib
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.cli.files.table_plan import RowsBefore, TablePlan
from lagcli.cli.terminal import exits
from lagcli.output.files import atomic_file, interrupts, write_guard
from lagcli.output.tables import cell_text, sinks, table_format

if TYPE_CHECKING:
    # Rows are kept beside checkpoints, which most runs have none of.
    from lagcli.output.checkpoint_file import KeptRows
    from lagcli.output.tables.row_file import RowFile

Floats = npt.NDArray[np.float64]


class SafeTable:
    """Takes the rows of one table. Everything that ends it is called where interrupts are held back."""

    def __init__(self, sink: sinks.Sink, plan: TablePlan) -> None:
        self._sink, self._plan = sink, plan
        self._rows: RowFile | None = None

    @property
    def file(self) -> str | None:
        """The file, None for standard output."""
        return self._plan.file

    def keep_rows(self, first: RowsBefore | None) -> KeptRows | None:
        """Keep the rows beside the table, where it is a file, after those of the run before."""
        plan = self._plan
        if not self._sink.is_file or plan.file is None:
            return None
        from lagcli.output.checkpoint_file import KeptRows
        from lagcli.output.tables import row_file

        rows = row_file.path_of(plan.path)
        with write_guard.writing(os.fspath(rows)):
            if first is not None:
                self._rows = row_file.RowFile.going_on(first.path, plan.names, first.rows)
            else:
                row_file.require_ours(rows)
                self._rows = row_file.RowFile(rows, plan.names)
        return KeptRows(self._rows, plan.path, plan.step, plan.has_event_rows)

    def begin(self, first: RowsBefore, seen: Callable[[Floats], None]) -> None:
        """Begin with the rows of the run before, each block of which is also `seen`."""
        from lagcli.output.tables import row_file

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

    def complete(self) -> None:
        """All rows are there."""
        with write_guard.writing(self._plan.file or "standard output"), self._patient():
            self._sink.commit(durably=self._rows is not None)

    def leave_rows(self, is_complete: bool) -> None:
        """The last checkpoint is written: rows beside a complete table are needed no more."""
        if self._rows is not None:
            if is_complete:
                self._rows.remove()
            else:
                self._rows.close()

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
    """A table in a file or on standard output; trouble with it is told with its name.

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
                raise exits.UsageError(str(error)) from None
            yield SafeTable(stack.enter_context(sink), plan)
