"""A file that grows by whole blocks."""

from pathlib import Path

from lagcli.output.files import atomic_file


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
