"""Blocks of rows: a file that grows by complete ones, and a buffer that makes large ones of small ones."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.output.files import atomic_file

_BYTES = 1 << 24  # of a buffered block: large writes, and small beside what a run takes


class BlockFile:
    """``head``, then bytes appended block by block; of an interrupted block nothing stays in the file.

    There is no buffer above the system's: a block is in the file when `append` returns, and to close it writes
    nothing, so that it cannot wait for the reader of a pipe.
    """

    def __init__(self, path: Path, head: bytes) -> None:
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115 (closed by close or abandon)
        self._end = 0
        self._torn = False
        with atomic_file.undone_by(self._file.close):
            self.append(head)

    def append(self, block: bytes | memoryview) -> None:
        """Write one block after the last complete one."""
        self._restore()
        self._torn = True
        rest = memoryview(block)
        while rest:
            # A nearly full disk may take a part; only the next call then tells why.
            rest = rest[self._file.write(rest) :]
        self._end += len(block)
        self._torn = False

    def close(self) -> None:
        """Cut off an incomplete block, and close."""
        try:
            self._restore()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close a file that will not be kept."""
        self._file.close()

    def _restore(self) -> None:
        if self._torn and self._file.seekable():
            self._file.seek(self._end)
            self._file.truncate()
        self._torn = False


class BufferedRows:
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
