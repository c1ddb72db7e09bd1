"""Tables as JSON: ``{"columns": [...], "rows": [[...]]}``, one row a line, doubles that read back exactly.

Behind the rows ``"provenance"``, where it is known.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import block_file, float_text, text_cells


class JsonWriter:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(
        self,
        path: Path,
        columns: Sequence[str],
        texts: Sequence[str] = (),
        provenance: Mapping[str, object] | None = None,
    ) -> None:
        self._end = b"\n]}\n"
        if provenance is not None:
            text = json.dumps(provenance, ensure_ascii=False, allow_nan=False)
            self._end = f'\n], "provenance": {text}}}\n'.encode()
        self._at = text_cells.places(columns, texts)
        self._numbers = [name for place, name in enumerate(columns) if place not in self._at]
        self._separator = b"\n"
        names = json.dumps(list(columns), ensure_ascii=False)
        self._file = block_file.BlockFile(path, f'{{"columns": {names}, "rows": ['.encode())

    def write(self, rows: NDArray[np.float64], texts: text_cells.Texts = ()) -> None:
        """Append ``rows``, shape (k, columns of numbers), and the texts beside them.

        ValueError for infinity, which JSON cannot hold.
        """
        float_text.require_no_infinity(rows, self._numbers)
        for numbers, cells in text_cells.parts(rows, texts):
            text = float_text.json_lines(numbers)
            if self._at:
                found = text[1:-1].split(b"],\n[")
                words = text_cells.spliced(found, self._at, text_cells.as_json(cells), b",")
                text = b"[" + b"],\n[".join(words) + b"]"
            self._file.append(self._separator + text)
            self._separator = b",\n"

    def finish(self) -> None:
        """Complete and close the file."""
        self._file.append(self._end)
        self._file.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        self._file.abandon()
