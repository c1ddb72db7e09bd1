"""Tables as CSV: a header and one line per row, UTF-8, "\\n" everywhere, doubles that read back exactly."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import block_file, float_text, text_cells


class CsvText:
    """The lines of a table; `texts`: names of columns of text, `delimiter`: between two values, a comma or a tab."""

    def __init__(self, columns: Sequence[str], texts: Sequence[str] = (), delimiter: str = ",") -> None:
        self._columns, self._delimiter = tuple(columns), delimiter
        self._at = text_cells.places(columns, texts)
        self._numbers = [name for place, name in enumerate(columns) if place not in self._at]

    def header(self) -> bytes:
        """The header line; names with a delimiter, a quote or a line break are quoted."""
        line = io.StringIO()
        csv.writer(line, delimiter=self._delimiter, lineterminator="\n").writerow(self._columns)
        return line.getvalue().encode()

    def lines(self, rows: NDArray[np.float64], texts: text_cells.Texts = ()) -> Iterator[bytes | memoryview]:
        """The lines of ``rows``, shape (k, columns of numbers), in parts of bounded size; ValueError for infinity."""
        float_text.require_no_infinity(rows, self._numbers)
        return self._lines(rows, texts)

    def _lines(self, rows: NDArray[np.float64], texts: text_cells.Texts) -> Iterator[bytes | memoryview]:
        tab = self._delimiter.encode()
        for numbers, cells in text_cells.parts(rows, texts):
            text: bytes | memoryview = float_text.csv_lines(numbers)
            if tab != b",":
                text = bytes(text).replace(b",", tab)  # numbers hold no comma
            if self._at:
                found = bytes(text).splitlines()
                quoted = text_cells.quoted(cells, self._delimiter)
                text = b"".join(line + b"\n" for line in text_cells.spliced(found, self._at, quoted, tab))
            yield text


class CsvWriter:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(
        self, path: Path, columns: Sequence[str], texts: Sequence[str] = (), delimiter: str = ","
    ) -> None:
        self._text = CsvText(columns, texts, delimiter)
        self._file = block_file.BlockFile(path, self._text.header())

    def write(self, rows: NDArray[np.float64], texts: text_cells.Texts = ()) -> None:
        """Append ``rows``, shape (k, columns of numbers), and the texts beside them; ValueError for infinity."""
        for part in self._text.lines(rows, texts):
            self._file.append(part)

    def finish(self) -> None:
        """Complete and close the file."""
        self._file.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        self._file.abandon()
