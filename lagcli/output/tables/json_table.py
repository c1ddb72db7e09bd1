"""Tables as JSON: ``{"columns": [...], "rows": [[...]]}``, one row a line, doubles that read back exactly.

Behind the rows ``"provenance"``, where it is known.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.output.tables import block_file, float_text


class Writer:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(
        self, path: Path, columns: Sequence[str], provenance: Mapping[str, object] | None = None
    ) -> None:
        self._end = b"\n]}\n"
        if provenance is not None:
            text = json.dumps(provenance, ensure_ascii=False, allow_nan=False)
            self._end = f'\n], "provenance": {text}}}\n'.encode()
        self._columns = tuple(columns)
        self._separator = b"\n"
        names = json.dumps(self._columns, ensure_ascii=False)
        self._file = block_file.BlockFile(path, f'{{"columns": {names}, "rows": ['.encode())

    def write(self, rows: NDArray[np.float64]) -> None:
        """Append ``rows``, shape (k, columns); ValueError for infinity, which JSON cannot hold."""
        float_text.require_no_infinity(rows, self._columns)
        for part in float_text.slices(rows):
            self._file.append(self._separator + float_text.json_lines(part))
            self._separator = b",\n"

    def finish(self) -> None:
        """Complete and close the file."""
        self._file.append(self._end)
        self._file.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        self._file.abandon()
