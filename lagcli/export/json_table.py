"""Tables as JSON: ``{"columns": [...], "rows": [[...]]}``, one row a line, doubles that read back exactly."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lagcli.export import block_file, csv_table


class Writer:
    """Writes a table to ``path`` as its rows arrive."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self._columns = tuple(columns)
        self._separator = "\n"
        self._file = block_file.BlockFile(path)
        names = json.dumps(self._columns, ensure_ascii=False)
        self._file.append(f'{{"columns": {names}, "rows": ['.encode())

    def write(self, rows: NDArray[np.float64]) -> None:
        """Append ``rows``, shape (k, columns); ValueError for nan and infinity, which JSON cannot hold."""
        infinite = np.flatnonzero(~np.isfinite(rows).all(axis=0))
        if infinite.size:
            raise ValueError(
                f'JSON has no word for the value that is not finite in "{self._columns[infinite[0]]}"'
            )
        for part in csv_table.slices(rows):
            text = ",\n".join("[" + ", ".join(map(repr, row)) + "]" for row in part.tolist())
            self._file.append((self._separator + text).encode())
            self._separator = ",\n"

    def finish(self) -> None:
        """Complete and close the file."""
        self._file.append(b"\n]}\n")
        self._file.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        self._file.abandon()
