"""Tables as CSV: a header and one line per row, UTF-8, "\\n" everywhere, doubles that read back exactly.

What other programs write is read too: with any line ends, a mark at the beginning, blank lines at the end.
"""

from __future__ import annotations

import array
import csv
import functools
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from lagcli.output.tables import blocks, cell_text
from lagcli.output.tables.table_format import (
    SHOWN,
    CheckSize,
    Floats,
    Make,
    TableHead,
    as_text,
    bad,
    column_indices,
)

MOST_LINE = 1 << 22  # characters of a line of CSV: the names of 400 000 columns


def writer(path: Path) -> Make:
    """See `TableFormat`."""
    return CsvWriter


class CsvText:
    """The lines of a table; `delimiter`: between two values, a comma or a tab."""

    def __init__(self, head: TableHead, delimiter: str = ",") -> None:
        self._head, self._delimiter, self._at = head, delimiter, head.text_indices

    def header(self) -> bytes:
        """The header line; names with a delimiter, a quote or a line break are quoted."""
        line = io.StringIO()
        csv.writer(line, delimiter=self._delimiter, lineterminator="\n").writerow(self._head.columns)
        return line.getvalue().encode()

    def lines(self, rows: Floats, texts: cell_text.Texts = ()) -> Iterator[bytes | memoryview]:
        """The lines of ``rows``, shape (k, columns of numbers), in parts of bounded size; ValueError for infinity."""
        cell_text.require_no_infinity(rows, self._head.numbers)
        return self._lines(rows, texts)

    def _lines(self, rows: Floats, texts: cell_text.Texts) -> Iterator[bytes | memoryview]:
        tab = self._delimiter.encode()
        for numbers, cells in cell_text.parts(rows, texts):
            text: bytes | memoryview = cell_text.csv_lines(numbers)
            if tab != b",":
                text = bytes(text).replace(b",", tab)  # numbers hold no comma
            if self._at:
                found = bytes(text).splitlines()
                quoted = cell_text.quoted(cells, self._delimiter)
                text = b"".join(line + b"\n" for line in cell_text.spliced(found, self._at, quoted, tab))
            yield text


class CsvWriter:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(self, path: Path, head: TableHead, delimiter: str = ",") -> None:
        self._text = CsvText(head, delimiter)
        self._file = blocks.BlockFile(path, self._text.header())

    def write(self, rows: Floats, texts: cell_text.Texts = ()) -> None:
        """Append ``rows``, shape (k, columns of numbers), and the texts beside them; ValueError for infinity."""
        for part in self._text.lines(rows, texts):
            self._file.append(part)

    def finish(self) -> None:
        """Complete and close the file."""
        self._file.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        self._file.abandon()


class _Lines:
    """The lines of a CSV or TSV file, of bounded length; `length` counts the characters since the last row."""

    def __init__(self, path: Path, file: TextIO) -> None:
        self._path, self._file, self.length = path, file, 0

    def __iter__(self) -> Iterator[str]:
        while line := self._file.readline(MOST_LINE):
            self.length += len(line)
            if self.length >= MOST_LINE:
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
        from lagcli.output.tables import plain_csv

        at = column_indices(self.columns, names)
        plain = self.length
        if plain is not None:
            self._check_size(self._path, plain, len(names))
            found = plain_csv.numbers(self._path, self.separator, len(self.columns), at, plain)
            if found is not None:
                return found
        numbers, count = array.array("d"), 0
        for count, row in self._complete_rows(len(names)):
            numbers.extend([self._number(row[k], count, self.columns[k]) for k in at])
        return np.array(numbers, dtype=np.float64).reshape(count, len(names))

    @functools.cached_property
    def length(self) -> int | None:
        """See `table_format.ReadTable`."""
        from lagcli.output.tables import plain_csv

        return plain_csv.rows(self._path, self.separator, len(self.columns))

    def words(self, name: str) -> list[str]:
        """See `table_format.ReadTable`."""
        index = self.columns.index(name)
        return [as_text(self._path, row[index], count, name) for count, row in self._complete_rows(1)]

    def _complete_rows(self, wanted: int) -> Iterator[tuple[int, list[str]]]:
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
                lines.length = 0
                yield row


reader = CsvTable  # see `TableFormat`
