"""Columns of a CSV file read at once, where the file is plain: numbers alone, as many in every row, no quotes.

Any other file is left to the reader that goes cell by cell and says what is wrong and where.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import float_text

_BLOCK = 1 << 18  # bytes looked through at a time, and parsed: larger ones leave the cache
_FIRST_LINE = 1 << 22  # bytes: a longer header is not looked for
# NumPy parses wanted columns alone, 0.2 s a column of a million rows; parsing all as JSON takes 1.5 s for 17 columns.
_FEW = 6
_OF_NUMBERS = b"0123456789.+-eE\r\n"


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
            separators += block.count(separator.encode())
            ends += block.count(b"\n")
            last = block[-1:]
    count = ends + (last != b"\n")
    return count if separators == count * (width - 1) else None


def numbers(
    path: Path, separator: str, width: int, places: Sequence[int], count: int
) -> NDArray[np.float64] | None:
    """The columns at some places (T, len(places)) of a file with `width` columns and so many rows; None where it is
    not plain. Raises OSError."""
    if not count or not places:
        return None
    found = None
    if len(places) > _FEW:
        found = _as_json(path, separator, width, places, count)
    return found if found is not None else _columns(path, separator, width, places, count)


def _columns(
    path: Path, separator: str, width: int, places: Sequence[int], count: int
) -> NDArray[np.float64] | None:
    """The last column is read too: a row that is too short has none, and with the count of separators then none is too
    long."""
    wanted = sorted({*places, width - 1})
    try:
        found = np.loadtxt(
            path.absolute(),  # which no reader takes for an address
            delimiter=separator,
            skiprows=1,
            usecols=wanted,
            comments=None,
            encoding="utf-8",
            ndmin=2,
        )
    except ValueError:  # an empty cell, a word: the other reader says where
        return None
    if len(found) != count:  # an empty line was skipped
        return None
    at = [wanted.index(place) for place in places]
    return found if at == list(range(len(wanted))) else found[:, at]


def _as_json(
    path: Path, separator: str, width: int, places: Sequence[int], count: int
) -> NDArray[np.float64] | None:
    """The lines as rows of a text in JSON, which knows no nan and no infinity."""
    found, row = np.empty((count, len(places))), 0
    with path.open("rb") as file:
        file.readline(_FIRST_LINE)
        for lines in _lines(file):
            if lines.translate(None, _OF_NUMBERS + separator.encode()):
                return None
            body = lines.replace(b"\r", b"").replace(separator.encode(), b",").replace(b"\n", b"],[")
            try:
                part = np.array(float_text.parsed_json(b"[[" + body + b"]]"), dtype=np.float64)
            except ValueError:
                return None
            if part.ndim != 2 or part.shape[1] != width or row + len(part) > count:
                return None
            found[row : row + len(part)] = part[:, places]
            row += len(part)
    return found if row == count else None


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
