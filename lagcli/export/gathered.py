"""Small blocks of rows gathered into large ones, for formats that are written by column."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

_BYTES = 1 << 24


class Gathered:
    """Copies of rows in arrival order, handed out again in blocks of some sixteen megabytes."""

    def __init__(self) -> None:
        self._parts: list[NDArray[np.float64]] = []
        self._bytes = 0

    def add(self, rows: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
        """Take in ``rows``, shape (k, columns), and yield the blocks that have become full."""
        step = max(1, _BYTES // (8 * max(1, rows.shape[1])))
        for start in range(0, len(rows), step):
            part = rows[start : start + step].copy()
            self._parts.append(part)
            self._bytes += part.nbytes
            if self._bytes >= _BYTES:
                yield from self.rest()

    def rest(self) -> Iterator[NDArray[np.float64]]:
        """Yield what is left as one block, if there is anything.

        The rows are forgotten first: where the receiver is interrupted, rows may miss at the end of a partial
        file, but none can stand there twice.
        """
        parts, self._parts, self._bytes = self._parts, [], 0
        if parts:
            yield np.concatenate(parts)
