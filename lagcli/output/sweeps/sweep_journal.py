"""The rows of a sweep as they come, safe on the disk: a file that only grows at its end, a line a row.

The first line says of which sweep it is. Every line begins with its checksum, so that one that a kill has torn is told
from a whole one; rows stand in the order of their points, so that those that are missing are all behind them.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

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
    """Takes the rows of a sweep, which has a `FileLock` on its table. `count` of them are there already.

    resume: go on after the rows of the same sweep; without it there must be none. Raises `UnfitJournal`,
    `UnfinishedSweep`, OSError.
    """

    def __init__(self, path: Path, identity: Mapping[str, object], resume: bool) -> None:
        self.path, self.count = path, 0
        if resume and path.is_file() and path.stat().st_size and not _ended_with(path):
            end = self._require_same(identity)
            self._file: BinaryIO = path.open("r+b", buffering=0)
            self._file.truncate(end)
            self._file.seek(end)
        else:
            _require_no_rows(path)
            pending = atomic_file.PendingFile(path)
            with atomic_file.undone_by(pending.discard):
                pending.path.write_bytes(_line({"kind": KIND, **identity}))
                pending.commit()
            self._file = path.open("ab", buffering=0)

    def _require_same(self, identity: Mapping[str, object]) -> int:
        """The end of the whole lines of the file."""
        with self.path.open("rb") as file:
            found = _parsed(file.readline())
            _require_kind(self.path, found)
            assert isinstance(found, dict)
            other = _differing(found, identity)
            if other:
                raise UnfitJournal(
                    f"{self.path} holds rows of a different sweep: {_part_name(other[0])} differs"
                )
            end = file.tell()
            for line in file:
                if _parsed(line) is None:
                    break
                end += len(line)
                self.count += 1
        return end

    def write(self, rows: Sequence[PointRow]) -> None:
        """Append rows, at once: a kill of this process loses none of them."""
        data = memoryview(
            b"".join(
                _line([row.number, row.point, row.results, row.status, row.message, row.t_end])
                for row in rows
            )
        )
        while data:
            data = data[self._file.write(data) :]
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
        """Leave in the place of the rows, which are in a complete table, what this table is. Raises OSError.

        For tables that have no place to say it: whoever resumes the sweep finds that nothing is left to do.
        """
        self._file.close()
        with self.path.open("rb") as file:
            header = file.readline()
        pending = atomic_file.PendingFile(self.path)
        with atomic_file.undone_by(pending.discard):
            pending.path.write_bytes(header + _line({ENDED: digest(table)}))
            pending.commit()


def digest(table: Path) -> str:
    """SHA-256 of a file. Raises OSError."""
    with table.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_under_way(path: Path) -> bool:
    """True if there is a journal that does not say that its sweep has ended. Raises OSError."""
    return path.exists() and not _ended_with(path)


def ended_with(path: Path, identity: Mapping[str, object]) -> str:
    """The digest of the table with which this very sweep has ended, as its journal says; else nothing. Raises
    OSError."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        found = _parsed(file.readline())
    if not isinstance(found, dict) or found.get("kind") != KIND or _differing(found, identity):
        return ""
    return _ended_with(path)


def _ended_with(path: Path) -> str:
    with path.open("rb") as file:
        file.readline()
        found = _parsed(file.readline())
    return str(found.get(ENDED, "")) if isinstance(found, dict) else ""


def _differing(found: Mapping[str, object], identity: Mapping[str, object]) -> list[str]:
    """The entries that another sweep has otherwise than one of this identity."""
    wanted = json.loads(json.dumps({"kind": KIND, **identity}))  # as it reads back from the file
    return [key for key in wanted if found.get(key) != wanted[key]]


def _part_name(key: str) -> str:
    return {"sha256": "the text of the model", "points": "what the points are"}.get(key, f"`{key}`")


def _require_no_rows(path: Path) -> None:
    if path.is_file() and path.stat().st_size:
        with path.open("rb") as file:
            _require_kind(path, _parsed(file.readline()))
            if isinstance(_parsed(file.readline()), list):
                raise UnfinishedSweep(
                    f"{path} holds the rows of a sweep that has not come to its end: --resume goes on after them;"
                    " to begin anew, remove the file"
                )


def _require_kind(path: Path, found: object) -> None:
    if not isinstance(found, dict) or found.get("kind") != KIND:
        raise UnfitJournal(f"{path} is there and holds no rows of a sweep")


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
