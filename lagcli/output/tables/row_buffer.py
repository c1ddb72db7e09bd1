"""Small blocks of rows gathered into large ones, for formats that are written by column."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_BYTES = 1 << 24  # of a block: large writes, and small beside what a run takes


class Gathered:
    """Copies of the rows of a table of ``width`` columns, stored as blocks of some sixteen megabytes.

    A block has the shape (width, k), one contiguous line a column, and is good until ``store`` returns.
    """

    def __init__(self, width: int, store: Callable[[NDArray[np.float64]], None]) -> None:
        self._block = np.empty((width, max(1, _BYTES // (8 * max(1, width)))))
        self._filled = 0
        self._store = store

    def add(self, rows: NDArray[np.float64]) -> None:
        """Take in ``rows``, shape (k, width), and store the blocks that have become full."""
        taken = 0
        while taken < len(rows):
            part = rows[taken : taken + self._block.shape[1] - self._filled]
            self._block[:, self._filled : self._filled + len(part)] = part.T
            taken += len(part)
            self._filled += len(part)
            if self._filled == self._block.shape[1]:
                self.flush()

    def flush(self) -> None:
        """Store what is left as one block, if there is anything.

        The rows are forgotten first: where the receiver is interrupted, rows may miss at the end of a partial
        file, but none can stand there twice.
        """
        filled, self._filled = self._filled, 0
        if filled:
            self._store(self._block[:, :filled])
