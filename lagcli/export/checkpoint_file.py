"""Checkpoints of a run that goes on, each written aside and moved into the place of the one before."""

import os
import time
from pathlib import Path

from lagcli.export import aside
from lagcli.integrate import checkpoint

EVERY = 30.0  # seconds


class Keeper:
    """Keeps the last checkpoint of a run in a file: the first at once, the others now and then, and on request.

    So a file that cannot be made is known when the run begins. Later a failure waits for `write`: a full disk may
    have room again, and the run goes on meanwhile.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = Path(path)
        self._last: checkpoint.Checkpoint | None = None
        self._due: float | None = None

    def take(self, point: checkpoint.Checkpoint) -> None:
        """The run has come to a point. Raises OSError where the first one cannot be written."""
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
        file = aside.Aside(self._path)
        try:
            file.path.write_bytes(checkpoint.encoded(self._last))
            file.commit()
        except BaseException:
            file.discard()
            raise
        self._last = None
        return True
