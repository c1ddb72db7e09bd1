"""Tables as CSV: a header and one line per row, UTF-8, "\\n" everywhere, doubles that read back exactly; TSV has tabs.

What other programs write is read too. A file that is plain (numbers alone, as many in every row, no quotes) is read at
once; any other cell by cell, which tells what is wrong and where.
"""

from __future__ import annotations

import csv
import functools
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from lagcli.arrays import Floats
from lagcli.output.tables import cell_text, table_format
from lagcli.output.tables.table_format import SHOWN, CheckSize, TableFormat, TableHead, Texts, bad

MOST_LINE = 1 << 22  # characters of a line of CSV: the names of 400 000 columns
_BLOCK = 1 << 18  # bytes looked through at a time, and parsed: larger ones leave the cache
_OF_NUMBERS = b"0123456789.+-eE\r\n"
_WORDS = (b"nan", b"inf")  # that the writers have for what is no number
_END = ord("\n")


class CsvWriter(cell_text.TextWriter):
    """Writes a table to a path, or to a stream that is flushed after every block; `delimiter`: between two values."""

    def __init__(self, target: Path | BinaryIO, head: TableHead, delimiter: str = ",") -> None:
        # Names and texts with a delimiter, a quote or a line break are quoted.
        self._delimiter = delimiter
        begin = self._line(head.columns)
        if isinstance(target, Path):
            super().__init__(cell_text.BlockFile(target, begin), head)
        else:
            super().__init__(cell_text.BlockStream(target, begin), head)

    def _line(self, cells: Sequence[str]) -> bytes:
        line = io.StringIO()
        csv.writer(line, delimiter=self._delimiter, lineterminator="\n").writerow(cells)
        return line.getvalue().encode()

    def _block(self, numbers: Floats, texts: Texts) -> bytes | memoryview:
        text: bytes | memoryview = cell_text.csv_lines(numbers)
        tab = self._delimiter.encode()
        if tab != b",":
            text = bytes(text).replace(b",", tab)  # numbers hold no comma
        if not self._at:
            return text
        numbered = bytes(text).splitlines()
        lines = cell_text.spliced(numbered, self._at, texts, lambda text: self._line([text])[:-1], tab)
        return b"".join(line + b"\n" for line in lines)


class CsvTable(table_format.CellTable):
    """A file of lines with commas, UTF-8 with or without a mark at its beginning; any line ends."""

    separator, called, others = ",", "commas", r"[;\t]"

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        super().__init__(path, check_size)
        self.columns = next((tuple(row) for row in self._lines()), ())
        if len(self.columns) == 1 and re.search(self.others, self.columns[0]):
            raise bad(path, f"its columns are not separated by {self.called}")

    @functools.cached_property
    def length(self) -> int | None:
        return plain_count(self._path, self.separator, len(self.columns))

    def take(self, names: Sequence[str]) -> Floats:
        if self.length is not None:
            self._check_size(self._path, self.length, len(names))
            at = table_format.column_indices(self.columns, names)
            found = plain_numbers(self._path, self.separator, len(self.columns), at, self.length)
            if found is not None:
                return found
        return super().take(names)

    def _number(self, cell: object, row: int, name: str) -> float:
        text = str(cell)
        try:
            if text.isascii() and "_" not in text:  # which `float` would take
                return float(text) if text else np.nan
        except ValueError:
            pass
        raise bad(self._path, f"row {row}: {text[:SHOWN]!r} in the column {name[:SHOWN]!r} is no number")

    def _rows(self) -> Iterator[list[str]]:
        is_blank = False
        lines = self._lines()
        next(lines, None)
        for row in lines:
            if not row:  # blank lines may end a file
                is_blank = True
                continue
            yield [] if is_blank else row

    def _lines(self) -> Iterator[list[str]]:
        """The cells of all lines, the header among them."""
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


class TsvTable(CsvTable):
    """A file of lines with tabs."""

    separator, called, others = "\t", "tabs", "[;,]"


CSV = TableFormat(CsvWriter, CsvTable)
TSV = TableFormat(functools.partial(CsvWriter, delimiter="\t"), TsvTable)


def plain_count(path: Path, separator: str, width: int) -> int | None:
    """The number of rows below the header of a file with `width` columns, if it is plain as far as separators tell;
    None for other numbers of them, and where there is a quote. Raises OSError."""
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
        while block := file.read(_BLOCK) + file.readline():  # whole lines
            lines = block.removesuffix(b"\n")
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
            # Some of them are empty or words, or written as JSON does not
            text = b"".join(cells).translate(None, _OF_NUMBERS)
            for word in _WORDS:
                text = text.replace(word, b"")
            if text:
                return None
            try:
                values = np.array([float(cell) if cell.strip() else np.nan for cell in cells])
            except ValueError:
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
