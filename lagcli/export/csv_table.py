"""Tables as CSV: a header and one line per row, UTF-8, "\\n" everywhere, doubles that read back exactly."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.export import block_file

# Python floats and their texts take some 100 bytes a number, so a block of rows is turned into text in parts.
_NUMBERS_AT_ONCE = 1 << 16


def header(columns: Sequence[str]) -> bytes:
    """The header line; names with a comma, a quote or a line break are quoted."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(columns)
    return line.getvalue().encode()


def lines(rows: NDArray[np.float64]) -> Iterator[bytes]:
    """The lines of ``rows``, shape (k, columns), in parts of bounded size."""
    for part in slices(rows):
        yield "".join(",".join(map(repr, row)) + "\n" for row in part.tolist()).encode()


def slices(rows: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Consecutive slices of ``rows``, shape (k, columns), small enough to be turned into Python floats."""
    step = max(1, _NUMBERS_AT_ONCE // max(1, rows.shape[1]))
    for start in range(0, len(rows), step):
        yield rows[start : start + step]


class Writer:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self._file = block_file.BlockFile(path)
        self._file.append(header(columns))

    def write(self, rows: NDArray[np.float64]) -> None:
        """Append ``rows``, shape (k, columns)."""
        for part in lines(rows):
            self._file.append(part)

    def finish(self) -> None:
        """Complete and close the file."""
        self._file.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        self._file.abandon()
