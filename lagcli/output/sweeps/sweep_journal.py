"""The rows of a sweep as they come, safe on the disk: a file that only grows at its end, a line a row.

The first line says of which sweep it is; each begins with its checksum, which tells one that a kill has torn. Rows
stand in the order of their points: those that are missing are all behind them.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from lagcli.output.files import atomic_file
from lagcli.output.sweeps.sweep_table import PointRow

KIND = "lagcli sweep 1"
ENDED = "table"  # in the second line of a sweep that has come to its end


class UnfitJournal(ValueError):
    """A file that holds no rows of this sweep; the message says why."""


def path_of(target: Path) -> Path:
    """The journal of a sweep that writes into `target`. Names that begin with a dot are passed over in datasets."""
    return target.with_name(f".{target.name}.points")


class UnfinishedSweep(UnfitJournal):
    """A file with rows of a sweep that has not come to its end, which would be lost."""


class SweepJournal:
    """Takes the rows of a sweep, which has a `FileLock` on its table; `count` of them are there already. resume: go on
    after the rows of the same sweep. Raises `UnfitJournal`, `UnfinishedSweep`, OSError."""

    def __init__(self, path: Path, identity: Mapping[str, object], resume: bool) -> None:
        self.path, self.count = path, 0
        is_there = path.is_file() and path.stat().st_size > 0
        first, second = _first_lines(path) if is_there else ({"kind": KIND}, None)
        if not isinstance(first, dict) or first.get("kind") != KIND:
            raise UnfitJournal(f"{path} is there and holds no rows of a sweep")
        if not (resume and is_there) or _table_of(second):
            if isinstance(second, list):
                raise UnfinishedSweep(
                    f"{path} holds the rows of a sweep that has not come to its end: --resume goes on after them;"
                    " to begin anew, remove the file"
                )
            atomic_file.write(path, _line({"kind": KIND, **identity}))
            self._file: io.FileIO = path.open("ab", buffering=0)
            return
        other = _differing(first, identity)
        if other is not None:
            words = {"sha256": "the text of the model", "points": "what the points are"}
            what = words.get(other, f"`{other}`")
            raise UnfitJournal(f"{path} holds rows of a different sweep: {what} differs")
        with path.open("rb") as file:
            file.readline()
            end = file.tell()
            for line in file:
                if _parsed(line) is None:
                    break
                end += len(line)
                self.count += 1
        self._file = path.open("r+b", buffering=0)
        self._file.truncate(end)
        self._file.seek(end)

    def write(self, rows: Sequence[PointRow]) -> None:
        """Append rows, at once: a kill of this process loses none of them."""
        lines = (_line([r.number, r.point, r.results, r.status, r.message, r.t_end]) for r in rows)
        atomic_file.put(self._file, b"".join(lines))
        self.count += len(rows)

    def sync(self) -> None:
        """Return when the rows are on the disk: for power cuts."""
        os.fsync(self._file.fileno())

    def rows(self) -> Iterator[PointRow]:
        """The rows there are. Raises OSError where the file has not all that were written."""
        with self.path.open("rb") as file:
            file.readline()
            for index in range(self.count):
                found = _parsed(file.readline())
                if not isinstance(found, list):
                    reason = f"row {index + 1} of the {self.count} that were written is not there"
                    raise OSError(errno.EIO, reason, str(self.path))
                number, point, results, status, message, t_end = found
                yield PointRow(number, tuple(point), tuple(results), status, message, t_end)

    def close(self) -> None:
        """Leave the file where it is."""
        self._file.close()

    def remove(self) -> None:
        """Remove the file: its rows are in a complete table."""
        self._file.close()
        self.path.unlink(missing_ok=True)

    def end_with(self, table: Path) -> None:
        """Leave in the place of the rows what the complete table is, where this has no place to say it: whoever resumes
        the sweep finds that nothing is left to do. Raises OSError."""
        self._file.close()
        with self.path.open("rb") as file:
            header = file.readline()
        atomic_file.write(self.path, header + _line({ENDED: digest(table)}))


def digest(table: Path) -> str:
    """SHA-256 of a file. Raises OSError."""
    with table.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_under_way(path: Path) -> bool:
    """True if there is a journal that does not say that its sweep has ended. Raises OSError."""
    return path.exists() and not _table_of(_first_lines(path)[1])


def ended_with(path: Path, identity: Mapping[str, object]) -> str:
    """The digest of the table with which this sweep has ended, as its journal says; else nothing. Raises OSError."""
    first, second = _first_lines(path) if path.is_file() else (None, None)
    return "" if not isinstance(first, dict) or _differing(first, identity) else _table_of(second)


def _first_lines(path: Path) -> tuple[object, object]:
    """The values of the first two lines: of which sweep the rows are, and a row, the end, or nothing."""
    with path.open("rb") as file:
        return _parsed(file.readline()), _parsed(file.readline())


def _table_of(second: object) -> str:
    """The digest of the table in the second line of a sweep that has ended."""
    return str(second.get(ENDED, "")) if isinstance(second, dict) else ""


def _differing(found: Mapping[str, object], identity: Mapping[str, object]) -> str | None:
    """The first entry that another sweep has otherwise than one of this identity."""
    wanted = json.loads(json.dumps({"kind": KIND, **identity}))  # as it reads back from the file
    return next((key for key in wanted if found.get(key) != wanted[key]), None)


def _line(value: object) -> bytes:
    text = json.dumps(value, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _parsed(line: bytes) -> object:
    """The value of a line, None where it is not whole."""
    if len(line) < 10 or not line.endswith(b"\n"):
        return None
    text = line[9:-1]
    if line[:9] != b"%08x " % zlib.crc32(text):
        return None
    return json.loads(text)
