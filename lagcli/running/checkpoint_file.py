"""Checkpoints of a run that goes on, each written aside and moved into the place of the one before."""

import dataclasses
import os
import time
from pathlib import Path

from lagcli.output.files import atomic_file
from lagcli.output.tables import row_file
from lagcli.simulation.run_state import checkpoint

EVERY = 30.0  # seconds


@dataclasses.dataclass(frozen=True, slots=True)
class SyncedRows:
    """Rows of a table that are on the disk before a checkpoint is.

    target: the table; step: the distance of its rows; has_event_rows: with rows of the instants of incidents.
    """

    rows: row_file.RowFile
    target: Path
    step: float = 0.0
    has_event_rows: bool = False

    def record(self, path: Path) -> checkpoint.CheckpointTable:
        """The words about it in a checkpoint in the file `path`."""
        written = self.rows.rows
        seen = seen_from(path, self.target)
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


def seen_from(path: Path, target: Path) -> str:
    """The way from the folder of a checkpoint to a table: both may move together."""
    folder, end = os.path.dirname(os.path.realpath(path)), os.path.realpath(target)
    try:
        return os.path.relpath(end, folder)
    except ValueError:  # on two drives
        return end


def table_of(path: Path, seen: str) -> Path:
    """The table that a checkpoint names so."""
    return Path(os.path.realpath(os.path.join(os.path.dirname(os.path.realpath(path)), seen)))
