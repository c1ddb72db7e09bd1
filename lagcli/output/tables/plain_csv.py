"""Columns of a CSV file read at once, where the file is plain: numbers alone, as many in every row, no quotes.

Any other file is left to the reader that goes cell by cell and says what is wrong and where.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import cell_text

_BLOCK = 1 << 18  # bytes looked through at a time, and parsed: larger ones leave the cache
_FIRST_LINE = 1 << 22  # bytes: a longer header is not looked for
_OF_NUMBERS = b"0123456789.+-eE\r\n"
_WORDS = (b"nan", b"inf")  # that the writers have for what is no number
_END = ord("\n")


def rows(path: Path, separator: str, width: int) -> int | None:
    """The number of rows below the header of a file with `width` columns, if it is plain as far as separators tell.

    None where the number of separators is not that of the rows, and where there is a quote. Raises OSError.
    """
    separators = ends = 0
    last = b"\n"
    with path.open("rb") as file:
        header = file.readline(_FIRST_LINE)
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


def numbers(
    path: Path, separator: str, width: int, columns: Sequence[int], count: int
) -> NDArray[np.float64] | None:
    """The columns with these indices (T, len(columns)) of a file with `width` columns and so many rows; an empty cell
    is nan. None where it is not plain. Raises OSError."""
    if not count or not columns:
        return None
    found, row = np.empty((count, len(columns))), 0
    with path.open("rb") as file:
        file.readline(_FIRST_LINE)
        for lines in _lines(file):
            ends = _ends(lines, separator, width)
            part = _part(lines, separator, ends, columns) if ends is not None else None
            if part is None or row + len(part) > count:
                return None
            found[row : row + len(part)] = part
            row += len(part)
    return found if row == count else None


def _ends(lines: bytes, separator: str, width: int) -> NDArray[np.intp] | None:
    """The positions at which the cells of lines end (rows, width); None where a line has more or fewer."""
    letters = np.frombuffer(lines + b"\n", dtype=np.uint8)
    at = np.flatnonzero((letters == ord(separator)) | (letters == _END))
    if len(at) % width:
        return None
    ends = at.reshape(-1, width)
    is_end = letters[ends] == _END
    return ends if is_end[:, -1].all() and not is_end[:, :-1].any() else None


def _part(
    lines: bytes, separator: str, ends: NDArray[np.intp], columns: Sequence[int]
) -> NDArray[np.float64] | None:
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


def _parsed(cells: bytes, count: int) -> NDArray[np.float64] | None:
    """So many numbers with commas between them, as a text in JSON, which knows no nan and no infinity."""
    if cells.translate(None, _OF_NUMBERS + b","):
        return None
    try:
        found = np.array(cell_text.parsed_json(b"[" + cells + b"]"), dtype=np.float64)
    except ValueError:
        return None
    return found if len(found) == count else None  # of one empty cell there is none


def _with_words(column: list[bytes]) -> NDArray[np.float64] | None:
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
