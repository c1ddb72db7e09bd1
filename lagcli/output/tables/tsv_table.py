"""Tables with tabs between the values; otherwise as CSV, for programs that expect tabs."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import block_file, csv_table


def header(columns: Sequence[str]) -> bytes:
    """The header line; names with a tab, a quote or a line break are quoted."""
    line = io.StringIO()
    csv.writer(line, delimiter="\t", lineterminator="\n").writerow(columns)
    return line.getvalue().encode()


class Writer:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self._columns = tuple(columns)
        self._file = block_file.BlockFile(path, header(columns))

    def write(self, rows: NDArray[np.float64]) -> None:
        """Append ``rows``, shape (k, columns); ValueError for infinity."""
        for part in csv_table.lines(rows, self._columns):
            self._file.append(memoryview(bytes(part).replace(b",", b"\t")))  # numbers hold no comma

    def finish(self) -> None:
        """Complete and close the file."""
        self._file.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        self._file.abandon()
