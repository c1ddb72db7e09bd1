"""A file that grows by whole blocks."""

from pathlib import Path


class BlockFile:
    """Bytes appended block by block; of a block whose writing was interrupted nothing stays in the file."""

    def __init__(self, path: Path) -> None:
        self._file = open(path, "wb")  # noqa: SIM115 (closed by close or abandon)
        self._end = 0
        self._torn = False

    def append(self, block: bytes) -> None:
        """Write one block after the last complete one."""
        self._mend()
        self._torn = True
        self._file.write(block)
        self._end += len(block)
        self._torn = False

    def close(self) -> None:
        """Cut off an incomplete block, and close."""
        try:
            self._mend()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close a file that will not be kept."""
        self._file.close()

    def _mend(self) -> None:
        if self._torn and self._file.seekable():
            self._file.seek(self._end)
            self._file.truncate()
        self._torn = False
