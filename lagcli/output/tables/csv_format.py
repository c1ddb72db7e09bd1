"""Tables as CSV: a header and one line per row, UTF-8, "\\n" everywhere, doubles that read back exactly.

What other programs write is read too: with any line ends, a mark at the beginning, blank lines at the end. A file that
is plain (numbers alone, as many in every row, no quotes) is read at once; any other cell by cell, which tells what is
wrong and where.
"""

from __future__ import annotations

import array
import csv
import functools
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from lagcli.output.tables import cell_text
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
_BLOCK = 1 << 18  # bytes looked through at a time, and parsed: larger ones leave the cache
_OF_NUMBERS = b"0123456789.+-eE\r\n"
_WORDS = (b"nan", b"inf")  # that the writers have for what is no number
_END = ord("\n")


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
        """The lines of ``rows``, shape (k, columns of numbers), in parts of bounded size."""
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
        self._text, self._numbers = CsvText(head, delimiter), head.numbers
        self._file = cell_text.BlockFile(path, self._text.header())

    def write(self, rows: Floats, texts: cell_text.Texts = ()) -> None:
        cell_text.require_no_infinity(rows, self._numbers)
        for part in self._text.lines(rows, texts):
            self._file.append(part)

    def finish(self) -> None:
        self._file.close()

    def abandon(self) -> None:
        self._file.abandon()


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
        at = column_indices(self.columns, names)
        plain = self.length
        if plain is not None:
            self._check_size(self._path, plain, len(names))
            found = plain_numbers(self._path, self.separator, len(self.columns), at, plain)
            if found is not None:
                return found
        numbers, count = array.array("d"), 0
        for count, row in self._complete_rows(len(names)):
            numbers.extend([self._number(row[k], count, self.columns[k]) for k in at])
        return np.array(numbers, dtype=np.float64).reshape(count, len(names))

    @functools.cached_property
    def length(self) -> int | None:
        return plain_count(self._path, self.separator, len(self.columns))

    def words(self, name: str) -> list[str]:
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
            length = 0  # characters since the last row

            def lines() -> Iterator[str]:
                nonlocal length
                while line := file.readline(MOST_LINE):
                    length += len(line)
                    if length >= MOST_LINE:
                        raise bad(self._path, f"a row has {MOST_LINE} characters or more")
                    yield line

            try:
                for row in csv.reader(lines(), strict=True, delimiter=self.separator):
                    length = 0
                    yield row
            except (csv.Error, UnicodeDecodeError) as error:
                raise bad(self._path, error) from None


def plain_count(path: Path, separator: str, width: int) -> int | None:
    """The number of rows below the header of a file with `width` columns, if it is plain as far as separators tell.

    None where the number of separators is not that of the rows, and where there is a quote. Raises OSError.
    """
    separators = ends = 0
    last = b"\n"
    with path.open("rb") as file:
        header = file.readline(MOST_LINE)
        if b'"' in header or not header.endswith(b"\n"):
            return None
        while block := file.read(_BLOCK):
            # A carriage return alone ends a line for one reader and not for the other.
            stray = b"\r" in block and b"\r" in block.replace(b"\r\n", b"\n").rstrip(b"\r")
            if stray or b'"' in block or not block.isascii():
                return None
            letters = np.frombuffer(block, dtype=np.uint8)  # five times as fast as counting in bytes
            separators += int(np.count_nonzero(letters == ord(separator)))
            ends += int(np.count_nonzero(letters == _END))
            last = block[-1:]
    count = ends + (last != b"\n")
    return count if separators == count * (width - 1) else None


def plain_numbers(
    path: Path, separator: str, width: int, columns: Sequence[int], count: int
) -> Floats | None:
    """The columns with these indices (T, len(columns)) of a file with `width` columns and so many rows; an empty cell
    is nan. None where it is not plain. Raises OSError."""
    if not count or not columns:
        return None
    found, row = np.empty((count, len(columns))), 0
    with path.open("rb") as file:
        file.readline(MOST_LINE)
        for lines in _lines(file):
            letters = np.frombuffer(lines + b"\n", dtype=np.uint8)
            found_ends = np.flatnonzero((letters == ord(separator)) | (letters == _END))
            if len(found_ends) % width:
                return None
            ends = found_ends.reshape(-1, width)  # where the cells end
            is_end = letters[ends] == _END
            if not is_end[:, -1].all() or is_end[:, :-1].any():
                return None
            part = _part(lines, separator, ends, columns)
            if part is None or row + len(part) > count:
                return None
            found[row : row + len(part)] = part
            row += len(part)
    return found if row == count else None


def _part(lines: bytes, separator: str, ends: npt.NDArray[np.intp], columns: Sequence[int]) -> Floats | None:
    """The columns with these indices of lines whose cells end there (rows, width); None where a cell is no number."""
    count, width = ends.shape
    # To cut a cell out costs three times as much as to parse one.
    if 4 * len(columns) > width:
        whole = _parsed(lines.replace(b"\n", b",").replace(separator.encode(), b","), ends.size)
        if whole is not None:
            return whole.reshape(count, width)[:, columns]
    begins = np.concatenate([[0], ends.ravel()[:-1] + 1]).reshape(count, width)
    found = np.empty((count, len(columns)))
    for k, column in enumerate(columns):
        bounds = zip(begins[:, column].tolist(), ends[:, column].tolist(), strict=True)
        cells = [lines[begin:end] for begin, end in bounds]
        values = _parsed(b",".join(cells), count)
        if values is None:
            values = _with_words(cells)
        if values is None:
            return None
        found[:, k] = values
    return found


def _parsed(cells: bytes, count: int) -> Floats | None:
    """So many numbers with commas between them, as a text in JSON, which knows no nan and no infinity."""
    if cells.translate(None, _OF_NUMBERS + b","):
        return None
    try:
        found = np.array(cell_text.parsed_json(b"[" + cells + b"]"), dtype=np.float64)
    except ValueError:
        return None
    return found if len(found) == count else None  # of one empty cell there is none


def _with_words(column: list[bytes]) -> Floats | None:
    """The numbers of cells, of which some are empty or words, or written as JSON does not."""
    text = b"".join(column).translate(None, _OF_NUMBERS)
    for word in _WORDS:
        text = text.replace(word, b"")
    if text:
        return None
    try:
        return np.array([float(cell) if cell.strip() else np.nan for cell in column])
    except ValueError:
        return None


def _lines(file: BinaryIO) -> Iterator[bytes]:
    """The rest of a file in blocks of whole lines, without the end of the last one."""
    rest = b""
    while block := file.read(_BLOCK):
        block = rest + block
        end = block.rfind(b"\n")
        if end < 0:
            rest = block
            continue
        rest = block[end + 1 :]
        yield block[:end]
    if rest:
        yield rest


reader = CsvTable  # see `TableFormat`
