"""Tables read from lines of text."""

from __future__ import annotations

import array
import csv
import functools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from lagcli.output.tables import plain_csv
from lagcli.output.tables.table_format import CheckSize, Floats, places
from lagcli.output.tables.unreadable import SHOWN, as_text, bad

MOST_LINE = 1 << 22  # characters of a line of CSV: the names of 400 000 columns


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


class CsvTable:
    """A file of lines with commas, UTF-8 with or without a mark at its beginning; any line ends."""

    separator, called, others = ",", "commas", r"[;\t]"
    provenance: dict[str, object] | None = None

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        self._path, self._check_size = path, check_size
        self.columns = next((tuple(row) for row in self._rows()), ())
        if len(self.columns) == 1 and re.search(self.others, self.columns[0]):
            raise bad(path, f"its columns are not separated by {self.called}")

    def take(self, names: Sequence[str]) -> Floats:
        """See `table_format.ReadTable`."""
        at = places(self.columns, names)
        plain = self.length
        if plain is not None:
            self._check_size(self._path, plain, len(names))
            found = plain_csv.numbers(self._path, self.separator, len(self.columns), at, plain)
            if found is not None:
                return found
        numbers, count = array.array("d"), 0
        for count, row in self._whole(len(names)):
            numbers.extend([self._number(row[k], count, self.columns[k]) for k in at])
        return np.array(numbers, dtype=np.float64).reshape(count, len(names))

    @functools.cached_property
    def length(self) -> int | None:
        """See `table_format.ReadTable`."""
        return plain_csv.rows(self._path, self.separator, len(self.columns))

    def words(self, name: str) -> list[str]:
        """See `table_format.ReadTable`."""
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


class TsvTable(CsvTable):
    """CSV with tabs."""

    separator, called, others = "\t", "tabs", "[;,]"
