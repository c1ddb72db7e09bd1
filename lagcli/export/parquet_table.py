"""Tables as Parquet, one row group per gathered block; the only file that imports pyarrow, an extra."""

import contextlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
from numpy.typing import NDArray

from lagcli.export import gathered


class Writer:
    """Writes a table of float64 columns without nulls to ``path`` as its rows arrive."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        fields = [pyarrow.field(name, pyarrow.float64(), nullable=False) for name in columns]
        self._schema = pyarrow.schema(fields)
        self._gathered = gathered.Gathered(len(columns))
        # Dictionaries do not shrink columns in which hardly a number comes twice.
        self._writer = pyarrow.parquet.ParquetWriter(str(path), self._schema, use_dictionary=False)

    def write(self, rows: NDArray[np.float64]) -> None:
        """Append ``rows``, shape (k, columns)."""
        for block in self._gathered.add(rows):
            self._store(block)

    def finish(self) -> None:
        """Complete and close the file."""
        for block in self._gathered.rest():
            self._store(block)
        self._writer.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        # A writer that has failed may not be able to end its file.
        with contextlib.suppress(pyarrow.ArrowException):
            self._writer.close()

    def _store(self, block: NDArray[np.float64]) -> None:
        arrays = [pyarrow.array(column) for column in block]
        self._writer.write_table(pyarrow.Table.from_arrays(arrays, schema=self._schema))
