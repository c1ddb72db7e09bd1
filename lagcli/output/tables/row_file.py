"""The rows of a run that a checkpoint has passed, safe on the disk whatever happens to the run.

A NumPy file of one array with a field for each column, ``numpy.load(path)["t"]``, grows at its end, where tables of
other formats cannot be read before they are complete. The cost of a checkpoint does not grow with the rows before it.
"""

import dataclasses
import os
import zlib
from collections.abc import Generator, Sequence
from pathlib import Path

import numpy as np

from lagcli.arrays import Floats
from lagcli.output.files import atomic_file

MAGIC = b"\x93NUMPY\x03\x00"  # version 3: names in UTF-8
DIGITS = 20  # room for the number of rows, which changes in its place
ROWS_AT_ONCE = 1 << 16  # numbers that are read back at a time


class UnfitRows(ValueError):
    """A file that does not hold the rows a checkpoint speaks of; the message says why."""


@dataclasses.dataclass(frozen=True, slots=True)
class SafeRows:
    """The first rows of a file: how many, and their checksum."""

    count: int
    checksum: int


def of_rows(columns: Sequence[str], rows: Floats) -> SafeRows:
    """The number and the checksum of rows (k, columns)."""
    return SafeRows(len(rows), zlib.crc32(_data(rows), _begin(columns)))


def path_of(target: Path) -> Path:
    """The path of the rows of a table while it is not complete."""
    return target.with_name(target.name + ".rows")


def require_ours(path: Path) -> None:
    """Raise `FileExistsError` where there is a file of this name that holds no rows."""
    if path.is_file() and path.stat().st_size:
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise FileExistsError(0, "the file exists and holds no rows of a run", str(path))


class RowFile:
    """Rows appended to a file; `sync` makes them safe. before: the first rows of the file of the run before, which goes
    on after them; without them there is a new file. Raises OSError."""

    def __init__(self, path: Path, columns: Sequence[str], before: SafeRows | None = None) -> None:
        header = _header(columns, 0)
        if before is None:
            atomic_file.write(path, header)
            before = SafeRows(0, _begin(columns))
        self.path, self._columns, self._head = path, tuple(columns), len(header)
        self._count, self._checksum = before.count, before.checksum
        self._file = path.open("r+b", buffering=0)
        self._file.truncate(self._end)

    @property
    def rows(self) -> SafeRows:
        """The rows that were written."""
        return SafeRows(self._count, self._checksum)

    @property
    def _end(self) -> int:
        return self._head + 8 * len(self._columns) * self._count

    def write(self, rows: Floats) -> None:
        """Append rows, shape (k, columns)."""
        data = _data(rows)
        self._put(self._end, data)
        self._count += len(rows)
        self._checksum = zlib.crc32(data, self._checksum)

    def sync(self) -> None:
        """Return when the rows are on the disk, and then their number."""
        os.fsync(self._file.fileno())
        self._put(0, _header(self._columns, self._count))
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Leave the file where it is."""
        self._file.close()

    def remove(self) -> None:
        """Remove the file: its rows are in a complete table."""
        self._file.close()
        self.path.unlink(missing_ok=True)

    def _put(self, offset: int, data: bytes) -> None:
        self._file.seek(offset)
        atomic_file.put(self._file, data)


def read(path: Path, columns: Sequence[str], rows: SafeRows) -> Generator[Floats, None, None]:
    """The first rows of a file, in blocks (k, columns). Raises `UnfitRows`, before the first block where the file has
    other columns or less rows and after the last for another checksum; OSError."""
    with path.open("rb") as file:
        # Read the header, which must be the one that would be written
        expected = _header(columns, 0)
        found = file.read(len(expected))
        if not found.startswith(MAGIC):
            raise UnfitRows(f"{path} holds no rows of a run")
        digits = expected.rindex(b"0,)") + 1  # where the number of rows ends
        if (found[: digits - DIGITS], found[digits:]) != (expected[: digits - DIGITS], expected[digits:]):
            raise UnfitRows(f"{path} has other columns")
        width = 8 * len(columns)
        if path.stat().st_size < file.tell() + width * rows.count:
            raise UnfitRows(f"{path} has less rows than the checkpoint speaks of")
        checksum, step = _begin(columns), max(1, ROWS_AT_ONCE // len(columns))
        for start in range(0, rows.count, step):
            data = file.read(width * min(step, rows.count - start))
            checksum = zlib.crc32(data, checksum)
            yield np.frombuffer(data, "<f8").reshape(-1, len(columns))
    if checksum != rows.checksum:
        raise UnfitRows(f"{path} holds the rows of a different run, or is damaged")


def _data(rows: Floats) -> bytes:
    return np.ascontiguousarray(rows, "<f8").tobytes()


def _begin(columns: Sequence[str]) -> int:
    return zlib.crc32(repr(list(columns)).encode())


def _header(columns: Sequence[str], count: int) -> bytes:
    """The head of a NumPy file, as long for any number of rows."""
    described = repr([(name, "<f8") for name in columns])
    text = f"{{'descr': {described}, 'fortran_order': False, 'shape': ({count:>{DIGITS}},), }}"
    size = len(text.encode()) + 1
    padding = -(len(MAGIC) + 4 + size) % 64
    body = (text + " " * padding + "\n").encode()
    return MAGIC + len(body).to_bytes(4, "little") + body
