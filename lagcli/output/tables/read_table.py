"""Tables read back: what the writers of this room wrote, or a program that writes the same formats.

A table may come from anywhere. Its names are known before any of its numbers is read, only the columns that are asked
for are read, and how much that is is looked at first.
"""

from __future__ import annotations

import array
import csv
import functools
import os
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Protocol, TextIO

import numpy as np
from numpy.typing import NDArray

from lagcli.output.files import endings
from lagcli.output.tables import float_text, plain_csv
from lagcli.output.tables.read_npz import NpzTable
from lagcli.output.tables.sinks import needing_pyarrow
from lagcli.output.tables.unreadable import SHOWN, as_text, bad
from lagcli.output.tables.unreadable import UnreadableTable as UnreadableTable

MOST_NUMBERS = 5_000_000  # of the columns that are read: an audit of as many holds 2 GB (400 bytes a number)
MOST_LINE = 1 << 22  # characters of a line of CSV: the names of 400 000 columns
MOST_JSON = 1 << 26  # bytes: a parsed file is up to 27 times as large (empty lists), 1.8 GB

Floats = NDArray[np.float64]


class ReadTable(Protocol):
    """An open table: the names of its columns, and the columns themselves when they are asked for."""

    columns: tuple[str, ...]
    provenance: dict[str, object] | None  # where the file holds one

    @property
    def length(self) -> int | None:
        """The number of rows, where it is known before they are read. Raises OSError."""

    def take(self, names: Sequence[str]) -> Floats:
        """The rows (T, len(names)) of columns; what has no value is nan. Raises `UnreadableTable`, OSError."""

    def words(self, name: str) -> list[str]:
        """The cells of a column of text (T,). Raises `UnreadableTable`, OSError."""


CheckSize = Callable[[Path, int, int], None]  # of a file, rows and columns; raises `UnreadableTable`


def opened(path: str | os.PathLike[str], most: int | None = None) -> ReadTable:
    """A table of which the names are known; nothing else of it is in memory, but of a JSON file.

    most: numbers that may be read at a time, MOST_NUMBERS where nothing is said.
    Raises ``endings.UnknownFormat``, ``MissingExtra``, ``UnreadableTable``, OSError.
    """
    target = Path(path)
    fmt = endings.of(target, endings.TABLES)
    kinds: dict[str, Callable[[Path, CheckSize], ReadTable]] = {
        "csv": _Csv,
        "tsv": _Tsv,
        "json": _Json,
        "npz": NpzTable,
        "parquet": _Parquet,
    }
    found = kinds[fmt](target, _size_check(MOST_NUMBERS if most is None else most))
    if len(set(found.columns)) < len(found.columns):
        raise UnreadableTable(f"{path} has two columns of one name")
    return found


def read(path: str | os.PathLike[str]) -> tuple[tuple[str, ...], Floats]:
    """All columns of a table and its rows (T, columns). Raises what `opened` raises."""
    table = opened(path)
    return table.columns, table.take(table.columns)


def _places(columns: Sequence[str], names: Sequence[str]) -> list[int]:
    at = {name: k for k, name in enumerate(columns)}
    return [at[name] for name in names]


def _size_check(most: int) -> CheckSize:
    def check(path: Path, rows: int, columns: int) -> None:
        if rows * columns > most:
            raise UnreadableTable(
                f"{path} is too large: {rows} rows or more of {columns} columns that are read; at most {most}"
                f" numbers are, which is {most // max(1, columns)} rows (a larger table needs more than 2 GB of"
                " memory): write fewer rows, or a shorter run"
            )

    return check


class _Lines:
    """The lines of a CSV or TSV file, of bounded length; `held` counts the characters since the last row."""

    def __init__(self, path: Path, file: TextIO) -> None:
        self._path, self._file, self.held = path, file, 0

    def __iter__(self) -> Iterator[str]:
        while line := self._file.readline(MOST_LINE):
            self.held += len(line)
            if self.held >= MOST_LINE:
                raise bad(self._path, f"a row has {MOST_LINE} characters or more")
            yield line


class _Csv:
    """A file of lines with commas, UTF-8 with or without a mark at its beginning; any line ends."""

    separator, called, others = ",", "commas", r"[;\t]"
    provenance: dict[str, object] | None = None

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        self._path, self._check_size = path, check_size
        self.columns = next((tuple(row) for row in self._rows()), ())
        if len(self.columns) == 1 and re.search(self.others, self.columns[0]):
            raise bad(path, f"its columns are not separated by {self.called}")

    def take(self, names: Sequence[str]) -> Floats:
        """See `ReadTable`."""
        places = _places(self.columns, names)
        plain = self.length
        if plain is not None:
            self._check_size(self._path, plain, len(names))
            found = plain_csv.numbers(self._path, self.separator, len(self.columns), places, plain)
            if found is not None:
                return found
        numbers, count = array.array("d"), 0
        for count, row in self._whole(len(names)):
            numbers.extend([self._number(row[k], count, self.columns[k]) for k in places])
        return np.array(numbers, dtype=np.float64).reshape(count, len(names))

    @functools.cached_property
    def length(self) -> int | None:
        """See `ReadTable`."""
        return plain_csv.rows(self._path, self.separator, len(self.columns))

    def words(self, name: str) -> list[str]:
        """See `ReadTable`."""
        place = self.columns.index(name)
        return [as_text(self._path, row[place], count, name) for count, row in self._whole(1)]

    def _whole(self, wanted: int) -> Iterator[tuple[int, list[str]]]:
        """The rows, counted from 1, each with all its cells, of which so many are wanted."""
        count, blank = 0, 0
        rows = self._rows()
        next(rows, None)
        for row in rows:
            if not row:  # blank lines may end a file
                blank += 1
                continue
            count += 1
            if blank or len(row) != len(self.columns):
                many = 0 if blank else len(row)
                raise bad(self._path, f"row {count} has {many} entries for {len(self.columns)} columns")
            self._check_size(self._path, count, wanted)
            yield count, row

    def _number(self, cell: str, row: int, name: str) -> float:
        try:
            if cell.isascii() and "_" not in cell:  # which `float` would take
                return float(cell) if cell else np.nan
        except ValueError:
            pass
        raise bad(self._path, f"row {row}: {cell[:SHOWN]!r} in the column {name[:SHOWN]!r} is no number")

    def _rows(self) -> Iterator[list[str]]:
        with self._path.open(encoding="utf-8-sig", newline="") as file:
            lines = _Lines(self._path, file)
            rows = csv.reader(lines, strict=True, delimiter=self.separator)
            while True:
                try:
                    row = next(rows, None)
                except (csv.Error, UnicodeDecodeError) as error:
                    raise bad(self._path, error) from None
                if row is None:
                    return
                lines.held = 0
                yield row


class _Tsv(_Csv):
    """CSV with tabs."""

    separator, called, others = "\t", "tabs", "[;,]"


class _Json:
    """An object with `columns` and `rows`. It is read as a whole, so its bytes are bounded."""

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        self._path, self._check_size = path, check_size
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
            raise bad(path, error) from None
        names = found.get("columns") if isinstance(found, dict) else None
        rows = found.get("rows") if isinstance(found, dict) else None
        if not isinstance(names, list) or not isinstance(rows, list):
            raise bad(path, "it is no object with the lists `columns` and `rows`")
        if not all(isinstance(name, str) for name in names):
            raise bad(path, "a name of a column is no text")
        self.columns, self._rows, self.length = tuple(names), rows, len(rows)
        origin = found.get("provenance")
        self.provenance = origin if isinstance(origin, dict) else None

    def take(self, names: Sequence[str]) -> Floats:
        """See `ReadTable`."""
        places = _places(self.columns, names)
        found = np.empty((len(self._rows), len(names)))
        for number, row in self._whole(len(names)):
            found[number - 1] = [self._number(row[k], number, self.columns[k]) for k in places]
        return found

    def words(self, name: str) -> list[str]:
        """See `ReadTable`."""
        place = self.columns.index(name)
        return [as_text(self._path, row[place], number, name) for number, row in self._whole(1)]

    def _whole(self, wanted: int) -> Iterator[tuple[int, list[object]]]:
        """As of CSV."""
        self._check_size(self._path, len(self._rows), wanted)
        for number, row in enumerate(self._rows, 1):
            if not isinstance(row, list) or len(row) != len(self.columns):
                many = len(row) if isinstance(row, list) else "no list of"
                raise bad(self._path, f"row {number} has {many} entries for {len(self.columns)} columns")
            yield number, row

    def _number(self, cell: object, row: int, name: str) -> float:
        if cell is None:
            return np.nan
        if isinstance(cell, bool) or not isinstance(cell, int | float):
            raise bad(
                self._path, f"row {row}: {name[:SHOWN]!r} holds {str(cell)[:SHOWN]!r}, which is no number"
            )
        return float(cell)


class _Parquet:
    """A Parquet file; of its columns only floating and whole numbers."""

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        self._check_size = check_size
        with needing_pyarrow(path):
            from lagcli.output.tables import parquet_table
        with path.open("rb"):  # what the file system says, pyarrow wraps
            pass
        self._path, self._table = path, parquet_table
        try:
            self.columns, self.length, self._odd, self.provenance = parquet_table.outline(path)
        except parquet_table.Damaged as error:
            raise bad(path, error) from None

    def take(self, names: Sequence[str]) -> Floats:
        """See `ReadTable`."""
        self._check_size(self._path, self.length, len(names))
        for name in names:
            if name in self._odd:
                raise bad(self._path, f"`{name}` holds {self._odd[name]}, no plain numbers")
        try:
            return self._table.numbers(self._path, names, self.length)
        except self._table.Damaged as error:
            raise bad(self._path, error) from None

    def words(self, name: str) -> list[str]:
        """See `ReadTable`."""
        self._check_size(self._path, self.length, 1)
        if name not in self._odd:
            raise bad(self._path, f"`{name}` holds numbers and no text")
        try:
            found = self._table.words(self._path, name)
        except self._table.Damaged as error:
            raise bad(self._path, error) from None
        return [as_text(self._path, cell, row, name) for row, cell in enumerate(found, 1)]
