"""Checkpoints of a run that goes on, each written aside and moved into the place of the one before."""

import dataclasses
import os
import time
from pathlib import Path

from lagcli.output import atomic_file
from lagcli.output.tables import row_file
from lagcli.simulation import checkpoint

EVERY = 30.0  # seconds


class Keeper:
    """Keeps the last checkpoint of a run in a file: the first at once, the others now and then, and on request.

    So a file that cannot be made is known when the run begins. Later a failure waits for `write`: a full disk may
    have room again, and the run goes on meanwhile. Where the rows go into a file, `rows`, they are on the disk before
    the checkpoint is; `target` and `step` are the table and the distance of its rows.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        rows: row_file.RowFile | None = None,
        target: Path | None = None,
        step: float = 0.0,
    ) -> None:
        self._path = Path(path)
        self._rows, self._step = rows, step
        self._table = "" if target is None else seen_from(self._path, target)
        self._last: checkpoint.Checkpoint | None = None
        self._due: float | None = None

    def take(self, point: checkpoint.Checkpoint) -> None:
        """The run has come to a point. Raises OSError where the first one cannot be written."""
        if self._rows is not None:
            written = self._rows.rows
            table = checkpoint.CheckpointTable(self._table, self._step, written.count, written.checksum)
            point = dataclasses.replace(point, table=table)
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
        if self._rows is not None:
            self._rows.sync()
        file = atomic_file.Aside(self._path)
        with atomic_file.undone_by(file.discard):
            file.path.write_bytes(checkpoint.encoded(self._last))
            file.commit(durably=True)
        self._last = None
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
