"""Tables as Parquet, one row group per gathered block; the only file that imports pyarrow, an extra."""

import contextlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
from numpy.typing import NDArray

from lagcli.output.tables import row_buffer

_BATCH = 1 << 15  # rows read at a time


class Writer:
    """Writes a table of float64 columns without nulls to ``path`` as its rows arrive; the metadata of its schema hold
    ``provenance`` as JSON."""

    def __init__(
        self, path: Path, columns: Sequence[str], provenance: Mapping[str, object] | None = None
    ) -> None:
        fields = [pyarrow.field(name, pyarrow.float64(), nullable=False) for name in columns]
        metadata = None if provenance is None else {"provenance": json.dumps(provenance, allow_nan=False)}
        self._schema = pyarrow.schema(fields, metadata=metadata)
        self._gathered = row_buffer.Gathered(len(columns), self._store)
        # Dictionaries do not shrink columns in which hardly a number comes twice.
        self._writer = pyarrow.parquet.ParquetWriter(str(path), self._schema, use_dictionary=False)

    def write(self, rows: NDArray[np.float64]) -> None:
        """Append ``rows``, shape (k, columns)."""
        self._gathered.add(rows)

    def finish(self) -> None:
        """Complete and close the file."""
        self._gathered.flush()
        self._writer.close()

    def abandon(self) -> None:
        """Close the file, which will not be kept."""
        # A writer that has failed may not be able to end its file.
        with contextlib.suppress(pyarrow.ArrowException):
            self._writer.close()

    def _store(self, block: NDArray[np.float64]) -> None:
        arrays = [pyarrow.array(column) for column in block]
        self._writer.write_table(pyarrow.Table.from_arrays(arrays, schema=self._schema))


class Damaged(ValueError):
    """A file that pyarrow cannot read as a table of numbers."""


def outline(path: Path) -> tuple[tuple[str, ...], int, dict[str, str]]:
    """The names of the columns of a file, its number of rows, and the types of columns that hold no plain numbers.

    Nothing but the end of the file is read. Raises `Damaged`.
    """
    try:
        with pyarrow.parquet.ParquetFile(str(path)) as file:
            fields = [(field.name, field.type) for field in file.schema_arrow]
            length = file.metadata.num_rows
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:  # the last of a name
        raise Damaged(_reason(error)) from None
    plain = (pyarrow.types.is_floating, pyarrow.types.is_integer)
    odd = {name: str(kind) for name, kind in fields if not any(test(kind) for test in plain)}
    return tuple(name for name, _ in fields), length, odd


def numbers(path: Path, names: Sequence[str], length: int) -> NDArray[np.float64]:
    """The rows (length, len(names)) of columns of plain numbers; what has no value is nan. Raises `Damaged`."""
    found, row = np.empty((length, len(names))), 0
    if not names:
        return found
    try:
        with pyarrow.parquet.ParquetFile(str(path)) as file:
            for batch in file.iter_batches(_BATCH, columns=list(names)):
                end = row + batch.num_rows
                if end > length:
                    raise Damaged(f"it has more rows than it says, which is {length}")
                for k, name in enumerate(names):
                    found[row:end, k] = batch.column(name).to_numpy(zero_copy_only=False)
                row = end
    except (pyarrow.ArrowException, OSError) as error:
        raise Damaged(_reason(error)) from None
    if row < length:
        raise Damaged(f"it has {row} rows and says {length}")
    return found


def _reason(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
