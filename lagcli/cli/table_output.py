"""The table of a run on its way into a file or onto standard output, and the checkpoints that agree with it."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import pathlib
import sys
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lagcli.api.simulation_run import SimulationRun
from lagcli.cli import exits, signals
from lagcli.output import atomic_file, checkpoint_file
from lagcli.output.tables import row_file, sinks
from lagcli.output.trajectory import provenance
from lagcli.simulation import checkpoint

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class Before:
    """Rows of the run that is resumed, which the same table begins with: their file, and the time of the last one."""

    path: pathlib.Path
    rows: row_file.SafeRows
    t_end: float

    @property
    def sentence(self) -> str:
        """The sentence about them."""
        count = self.rows.count
        return f"with the {count} rows up to t = {self.t_end:.9g} of the run before, from {self.path}"


def before(ready: SimulationRun, resume: str | None, file: str | None, names: Sequence[str]) -> Before | None:
    """The rows before a resumed run, where it writes the same table and that table was never completed.

    Raises `exits.UsageError` where they do not fit together, for they would be lost.
    """
    point = ready.resumed
    if point is None or point.table is None or file is None or resume is None:
        return None
    record = point.table
    table = pathlib.Path(os.path.realpath(file))
    path = row_file.path_of(table)
    if checkpoint_file.table_of(pathlib.Path(resume), record.file) != table or not path.is_file():
        return None
    instead = "give another file for the rows after it alone"
    own = ready.grid.step
    if record.step != own:
        raise exits.UsageError(
            f"--output {file}: the run before wrote rows {record.step:.9g} apart into it, and this one {own:.9g};"
            f" {instead}"
        )
    rows = row_file.SafeRows(record.count, record.checksum)
    try:
        with contextlib.closing(row_file.read(path, names, rows)) as blocks:
            for _ in blocks:
                pass
    except row_file.UnfitRows as error:
        raise exits.UsageError(f"--output {file}: {error}; {instead}") from None
    except OSError as error:
        raise exits.UsageError(f"--output {file}: cannot read {path}: {error.strerror}") from None
    return Before(path, rows, point.mark.origin + point.mark.row)


def require_kept(ready: SimulationRun, resume: str | None, file: str | None) -> None:
    """Refuse to replace the table of the run before by the rows after it alone. Raises `exits.UsageError`."""
    point = ready.resumed
    if point is None or point.table is None or file is None or resume is None:
        return
    path = pathlib.Path(os.path.realpath(file))
    if path.is_file() and checkpoint_file.table_of(pathlib.Path(resume), point.table.file) == path:
        t = point.mark.origin + point.mark.row
        raise exits.UsageError(
            f"--output {file}: that is the table of the run before, and a resumed run has only the rows after"
            f" t = {t:.9g}: give another file, or move that one away"
        )


def elsewhere(ready: SimulationRun, resume: str | None) -> str:
    """The place of the rows before a resumed run if their table was never completed, as a sentence, or nothing."""
    point = ready.resumed
    if point is None or point.table is None or resume is None:
        return ""
    table = checkpoint_file.table_of(pathlib.Path(resume), point.table.file)
    path = row_file.path_of(table)
    if not path.is_file():
        return ""
    count, t = point.table.count, point.mark.origin + point.mark.row
    return f"the {count} rows up to t = {t:.9g} of the run before are in {path}; `-o {table}` writes one table of all"


class TableOutput:
    """Takes the rows of a run. Everything that ends it is called where interrupts are held back."""

    def __init__(self, sink: sinks.Sink | None, file: str | None) -> None:
        self._sink, self._file = sink, file
        self._rows: row_file.RowFile | None = None
        self._keeper: checkpoint_file.Keeper | None = None
        self._checkpoint = ""
        self.t_end = -math.inf  # time of the last row

    def keep_checkpoints(self, path: str, names: Sequence[str], step: float, first: Before | None) -> None:
        """Keep a checkpoint in a file; where the table is a file too, its rows are safe at each of them."""
        self._checkpoint, target = path, None
        if self._sink is not None and self._sink.is_file and self._file is not None:
            target = pathlib.Path(os.path.realpath(self._file))
            rows = row_file.path_of(target)
            with exits.writing(os.fspath(rows)):
                if first is not None:
                    self._rows = row_file.RowFile.going_on(first.path, names, first.rows)
                else:
                    row_file.require_ours(rows)
                    self._rows = row_file.RowFile(rows, names)
        self._keeper = checkpoint_file.Keeper(path, self._rows, target, step)

    def begin(self, first: Before, names: Sequence[str], seen: Callable[[Floats], None]) -> None:
        """Begin with the rows of the run before, each block of which is also `seen`."""
        assert self._sink is not None
        for block in row_file.read(first.path, names, first.rows):
            with signals.window():
                seen(block)
            self._sink.write(block)
        self.t_end = first.t_end

    def take(self, block: Floats, chosen: Floats, point: checkpoint.Checkpoint | None) -> None:
        """A block of the run, its columns that are written, and where to go on from after it."""
        if len(block):
            self.t_end = float(block[-1, 0])
        if self._sink is not None:
            with self._patient():
                self._sink.write(chosen)
        if self._rows is not None:
            with exits.writing(os.fspath(self._rows.path)):
                self._rows.write(chosen)
        if self._keeper is not None and point is not None:
            with exits.writing(self._checkpoint):
                self._keeper.take(point)

    def complete(self) -> None:
        """All rows are there."""
        self._end(is_complete=True)
        if self._file is not None:
            signals.leave(f"lagcli: interrupted; {self._file} is complete")
        self._keep_checkpoint()
        if self._rows is not None:
            self._rows.remove()

    def keep(self) -> pathlib.Path | None:
        """The run has ended before its end: keep what there is, and return the name of the file, if there is one."""
        partial = self._end(is_complete=False)
        self._keep_checkpoint()
        if self._rows is not None:
            self._rows.close()
        return partial

    def _end(self, is_complete: bool) -> pathlib.Path | None:
        if self._sink is None:
            return None
        with self._patient():
            if not is_complete:
                return self._sink.keep_partial()
            self._sink.commit(durably=self._rows is not None)
        return None

    def _keep_checkpoint(self) -> None:
        if self._keeper is not None:
            with exits.writing(self._checkpoint):
                self._keeper.write()

    def _patient(self) -> contextlib.AbstractContextManager[None]:
        """A pipe may wait for its reader for ever; a file does not, and is finished whatever comes."""
        is_waiting = self._sink is not None and not self._sink.is_file
        return signals.shielded(signals.PATIENCE) if is_waiting else contextlib.nullcontext()


@contextlib.contextmanager
def opened(
    ready: SimulationRun, file: str | None, to_stdout: bool, names: Sequence[str]
) -> Iterator[TableOutput]:
    """The table in a file, on standard output, or nowhere; trouble with it is told with its name.

    Interrupts are held back inside but in `signals.window`.
    """
    with contextlib.ExitStack() as stack:
        stack.enter_context(exits.writing(file or "standard output"))
        # An interrupt finds a sink that will be discarded, or none: no file stays behind.
        with signals.shielded():
            sink = None
            if file is not None or to_stdout:
                target = sys.stdout.buffer if file is None else pathlib.Path(file)
                try:
                    whence = provenance(ready.model).as_json()
                    # A pipe with a name is opened when somebody reads it.
                    is_waiting = file is not None and not atomic_file.is_replaced(pathlib.Path(file))
                    with signals.shielded(signals.PATIENCE) if is_waiting else contextlib.nullcontext():
                        sink = stack.enter_context(sinks.open_sink(target, names, provenance=whence))
                except sinks.MissingExtra as error:
                    raise exits.UsageError(str(error)) from None
            yield TableOutput(sink, file)
