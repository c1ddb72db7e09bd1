"""Columns of a CSV file read by NumPy, where the file is plain: numbers alone, as many in every row, no quotes.

Any other file is left to the reader that goes cell by cell and says what is wrong and where.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_BLOCK = 1 << 20  # bytes looked through at a time
_FIRST_LINE = 1 << 22  # bytes: a longer header is not looked for


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
    not plain.

    The last column is read too: a row that is too short has none, and with the count of separators then none is too
    long. Raises OSError.
    """
    if not count or not places:
        return None
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
