"""Tables read back: what the writers of this room wrote, or a program that writes the same formats.

A table may come from anywhere. Its names are known before any of its numbers is read, only the columns that are asked
for are read, and how much that is is looked at first.
"""

from __future__ import annotations

import array
import csv
import os
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Protocol, TextIO

import numpy as np
from numpy.typing import NDArray

from lagcli.output import endings
from lagcli.output.tables import float_text
from lagcli.output.tables.sinks import needing_pyarrow

MOST_NUMBERS = 5_000_000  # of the columns that are read: an audit of as many holds 2 GB (400 bytes a number)
MOST_LINE = 1 << 22  # characters of a line of CSV: the names of 400 000 columns
MOST_JSON = 1 << 26  # bytes: a parsed file is up to 27 times as large (empty lists), 1.8 GB
MOST_HEADER = 4096  # bytes of the header of an array
SHOWN = 60  # characters of what is no number

Floats = NDArray[np.float64]


class UnreadableTable(ValueError):
    """The file is no table in the format that its ending names, or too large."""


class ReadTable(Protocol):
    """An open table: the names of its columns, and the columns themselves when they are asked for."""

    columns: tuple[str, ...]

    def take(self, names: Sequence[str]) -> Floats:
        """The rows (T, len(names)) of columns; what has no value is nan. Raises `UnreadableTable`, OSError."""


def opened(path: str | os.PathLike[str]) -> ReadTable:
    """A table of which the names are known; nothing else of it is in memory, but of a JSON file.

    Raises ``endings.UnknownFormat``, ``MissingExtra``, ``UnreadableTable``, OSError.
    """
    target = Path(path)
    fmt = endings.of(target, endings.TABLES)
    kinds: dict[str, Callable[[Path], ReadTable]] = {
        "csv": _Csv,
        "tsv": _Tsv,
        "json": _Json,
        "npz": _Npz,
        "parquet": _Parquet,
    }
    found = kinds[fmt](target)
    if len(set(found.columns)) < len(found.columns):
        raise UnreadableTable(f"{path} has two columns of one name")
    return found


def read(path: str | os.PathLike[str]) -> tuple[tuple[str, ...], Floats]:
    """All columns of a table and its rows (T, columns). Raises what `opened` raises."""
    table = opened(path)
    return table.columns, table.take(table.columns)


def _bad(path: Path, reason: object) -> UnreadableTable:
    return UnreadableTable(f"{path} is no table in the format .{path.suffix.lower()[1:]}: {reason}")


def _places(columns: Sequence[str], names: Sequence[str]) -> list[int]:
    at = {name: k for k, name in enumerate(columns)}
    return [at[name] for name in names]


def _check_size(path: Path, rows: int, columns: int) -> None:
    if rows * columns > MOST_NUMBERS:
        raise UnreadableTable(
            f"{path} is too large: {rows} rows or more of {columns} columns that are read; at most {MOST_NUMBERS}"
            f" numbers are, which is {MOST_NUMBERS // max(1, columns)} rows (a larger table needs more than 2 GB of"
            " memory): write fewer rows, or a shorter run"
        )


class _Lines:
    """The lines of a CSV or TSV file, of bounded length; `held` counts the characters since the last row."""

    def __init__(self, path: Path, file: TextIO) -> None:
        self._path, self._file, self.held = path, file, 0

    def __iter__(self) -> Iterator[str]:
        while line := self._file.readline(MOST_LINE):
            self.held += len(line)
            if self.held >= MOST_LINE:
                raise _bad(self._path, f"a row has {MOST_LINE} characters or more")
            yield line


class _Csv:
    """A file of lines with commas, UTF-8 with or without a mark at its beginning; any line ends."""

    separator, called, others = ",", "commas", r"[;\t]"

    def __init__(self, path: Path) -> None:
        self._path = path
        self.columns = next((tuple(row) for row in self._rows()), ())
        if len(self.columns) == 1 and re.search(self.others, self.columns[0]):
            raise _bad(path, f"its columns are not separated by {self.called}")

    def take(self, names: Sequence[str]) -> Floats:
        """See `Table`."""
        places = _places(self.columns, names)
        numbers, count, blank = array.array("d"), 0, 0
        rows = self._rows()
        next(rows, None)
        for row in rows:
            if not row:  # blank lines may end a file
                blank += 1
                continue
            count += 1
            if blank or len(row) != len(self.columns):
                many = 0 if blank else len(row)
                raise _bad(self._path, f"row {count} has {many} entries for {len(self.columns)} columns")
            _check_size(self._path, count, len(names))
            numbers.extend([self._number(row[k], count, self.columns[k]) for k in places])
        return np.array(numbers, dtype=np.float64).reshape(count, len(names))

    def _number(self, cell: str, row: int, name: str) -> float:
        try:
            if cell.isascii() and "_" not in cell:  # which `float` would take
                return float(cell) if cell else np.nan
        except ValueError:
            pass
        raise _bad(self._path, f"row {row}: {cell[:SHOWN]!r} in the column {name[:SHOWN]!r} is no number")

    def _rows(self) -> Iterator[list[str]]:
        with self._path.open(encoding="utf-8-sig", newline="") as file:
            lines = _Lines(self._path, file)
            rows = csv.reader(lines, strict=True, delimiter=self.separator)
            while True:
                try:
                    row = next(rows, None)
                except (csv.Error, UnicodeDecodeError) as error:
                    raise _bad(self._path, error) from None
                if row is None:
                    return
                lines.held = 0
                yield row


class _Tsv(_Csv):
    """CSV with tabs."""

    separator, called, others = "\t", "tabs", "[;,]"


class _Json:
    """An object with `columns` and `rows`. It is read as a whole, so its bytes are bounded."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with path.open("rb") as file:
            text = file.read(MOST_JSON + 1)
        if len(text) > MOST_JSON:
            raise UnreadableTable(
                f"{path} is too large: a table in JSON may have {MOST_JSON >> 20} MiB (parsed, it is many times larger"
                " in memory); write .npz, .parquet or .csv"
            )
        try:
            found = float_text.parsed_json(text.removeprefix(b"\xef\xbb\xbf"))
        except ValueError as error:
            raise _bad(path, error) from None
        names = found.get("columns") if isinstance(found, dict) else None
        rows = found.get("rows") if isinstance(found, dict) else None
        if not isinstance(names, list) or not isinstance(rows, list):
            raise _bad(path, "it is no object with the lists `columns` and `rows`")
        if not all(isinstance(name, str) for name in names):
            raise _bad(path, "a name of a column is no text")
        self.columns, self._rows = tuple(names), rows

    def take(self, names: Sequence[str]) -> Floats:
        """See `Table`."""
        _check_size(self._path, len(self._rows), len(names))
        places = _places(self.columns, names)
        found = np.empty((len(self._rows), len(names)))
        for number, row in enumerate(self._rows, 1):
            if not isinstance(row, list) or len(row) != len(self.columns):
                many = len(row) if isinstance(row, list) else "no list of"
                raise _bad(self._path, f"row {number} has {many} entries for {len(self.columns)} columns")
            found[number - 1] = [self._number(row[k], number, self.columns[k]) for k in places]
        return found

    def _number(self, cell: object, row: int, name: str) -> float:
        if cell is None:
            return np.nan
        if isinstance(cell, bool) or not isinstance(cell, int | float):
            raise _bad(
                self._path, f"row {row}: {name[:SHOWN]!r} holds {str(cell)[:SHOWN]!r}, which is no number"
            )
        return float(cell)


class _Npz:
    """A zip archive of arrays, stored or deflated; of their headers only the plainest are taken."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with path.open("rb") as file, self._archive(file) as archive:
            self._members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
            self.columns = tuple(info.filename.removesuffix(".npy") for info in archive.infolist())

    def take(self, names: Sequence[str]) -> Floats:
        """See `Table`."""
        with self._path.open("rb") as file, self._archive(file) as archive:
            headers = [self._header(archive, name) for name in names]
            lengths = {length for _, length, _ in headers}
            if len(lengths) > 1:
                raise _bad(self._path, f"its arrays have different lengths: {min(lengths)}, {max(lengths)}")
            length = lengths.pop() if lengths else 0
            _check_size(self._path, length, len(names))
            found = np.empty((length, len(names)))
            for k, (kind, _, start) in enumerate(headers):
                data = self._bytes(archive, names[k], start, length * kind.itemsize)
                found[:, k] = np.frombuffer(data, kind)
        return found

    def _archive(self, file: BinaryIO) -> zipfile.ZipFile:
        try:
            return zipfile.ZipFile(file)
        except (zipfile.BadZipFile, NotImplementedError, ValueError, OSError) as error:
            # The file is open: an OSError is a place that the archive names and that is not there.
            raise _bad(self._path, error) from None

    def _header(self, archive: zipfile.ZipFile, name: str) -> tuple[np.dtype[np.generic], int, int]:
        """Type and length of an array, and where its numbers begin; without running what its header says."""
        info = self._members[name]
        if info.flag_bits & 1:
            raise _bad(self._path, f"`{name}` is encrypted")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise _bad(self._path, f"`{name}` is compressed by a method that NumPy does not write")
        head = self._bytes(archive, name, 0, min(MOST_HEADER, info.file_size))
        if head[:6] != b"\x93NUMPY" or len(head) < 12:
            raise _bad(self._path, f"`{name}` is no array")
        first = 10 if head[6] == 1 else 12
        start = first + int.from_bytes(head[8:first], "little")
        text = head[first:start].decode("latin-1")
        kind = re.search(r"'descr': *'([<>|=]?[fiu][1248])'", text)
        shape = re.search(r"'shape': *\((\d{1,15}),?\)", text)
        if kind is None or shape is None or start > MOST_HEADER:
            raise _bad(self._path, f"`{name}` is no column of real numbers: {text[:SHOWN].strip()}")
        if kind[1].endswith("f1"):  # a number of one byte has no fractions
            raise _bad(self._path, f"`{name}` is no column of real numbers: {kind[1]}")
        plain = np.dtype(kind[1])
        if start + int(shape[1]) * plain.itemsize != info.file_size:
            raise _bad(self._path, f"`{name}` is said to have {shape[1]} numbers, which its size denies")
        return plain, int(shape[1]), start

    def _bytes(self, archive: zipfile.ZipFile, name: str, start: int, count: int) -> bytes:
        try:
            with archive.open(self._members[name]) as member:
                member.read(start)
                data = member.read(count)
        except (
            zipfile.BadZipFile,
            zlib.error,
            EOFError,
            NotImplementedError,
            RuntimeError,
            OSError,
        ) as error:
            raise _bad(self._path, f"`{name}`: {error or 'it ends too early'}") from None
        if len(data) != count:
            raise _bad(self._path, f"`{name}` ends too early")
        return data


class _Parquet:
    """A Parquet file; of its columns only floating and whole numbers."""

    def __init__(self, path: Path) -> None:
        with needing_pyarrow(path):
            from lagcli.output.tables import parquet_table
        with path.open("rb"):  # what the file system says, pyarrow wraps
            pass
        self._path, self._table = path, parquet_table
        try:
            self.columns, self._length, self._odd = parquet_table.outline(path)
        except parquet_table.Damaged as error:
            raise _bad(path, error) from None

    def take(self, names: Sequence[str]) -> Floats:
        """See `Table`."""
        _check_size(self._path, self._length, len(names))
        for name in names:
            if name in self._odd:
                raise _bad(self._path, f"`{name}` holds {self._odd[name]}, no plain numbers")
        try:
            return self._table.numbers(self._path, names, self._length)
        except self._table.Damaged as error:
            raise _bad(self._path, error) from None
