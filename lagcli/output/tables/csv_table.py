"""Tables as CSV: a header and one line per row, UTF-8, "\\n" everywhere, doubles that read back exactly."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import block_file, float_text


def header(columns: Sequence[str]) -> bytes:
    """The header line; names with a comma, a quote or a line break are quoted."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(columns)
    return line.getvalue().encode()


def lines(rows: NDArray[np.float64], columns: Sequence[str]) -> Iterator[memoryview]:
    """The lines of ``rows``, shape (k, columns), in parts of bounded size; ValueError for infinity."""
    float_text.require_no_infinity(rows, columns)
    return map(float_text.csv_lines, float_text.slices(rows))


class Writer:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self._columns = tuple(columns)
        self._file = block_file.BlockFile(path, header(columns))

    def write(self, rows: NDArray[np.float64]) -> None:
        """Append ``rows``, shape (k, columns); ValueError for infinity."""
        for part in lines(rows, self._columns):
            self._file.append(part)

    def finish(self) -> None:
        """Complete and close the file."""
        self._file.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        self._file.abandon()
