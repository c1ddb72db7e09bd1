"""Tables as Parquet, one row group per gathered block; the only file that imports pyarrow, an extra."""

import contextlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
from numpy.typing import NDArray

from lagcli.output.tables import row_buffer, text_cells
from lagcli.output.tables.unreadable import provenance

_BATCH = 1 << 15  # rows read at a time


class ParquetTableWriter:
    """Writes a table of float64 columns, and string ones, without nulls to ``path`` as its rows arrive; the metadata of
    its schema hold ``provenance`` as JSON."""

    def __init__(
        self,
        path: Path,
        columns: Sequence[str],
        texts: Sequence[str] = (),
        provenance: Mapping[str, object] | None = None,
    ) -> None:
        kinds = {name: pyarrow.string() if name in texts else pyarrow.float64() for name in columns}
        fields = [pyarrow.field(name, kind, nullable=False) for name, kind in kinds.items()]
        metadata = None if provenance is None else {"provenance": json.dumps(provenance, allow_nan=False)}
        self._schema = pyarrow.schema(fields, metadata=metadata)
        self._texts: dict[int, list[str]] = {place: [] for place in text_cells.places(columns, texts)}
        self._gathered = row_buffer.Gathered(len(columns) - len(texts), self._store)
        # Dictionaries do not shrink columns in which hardly a number comes twice.
        words = list(texts) or False
        self._writer = pyarrow.parquet.ParquetWriter(str(path), self._schema, use_dictionary=words)

    def write(self, rows: NDArray[np.float64], texts: text_cells.Texts = ()) -> None:
        """Append ``rows``, shape (k, columns of numbers), and the texts beside them."""
        for kept, cells in zip(self._texts.values(), texts, strict=True):
            kept.extend(cells)
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
        for place, cells in self._texts.items():
            arrays.insert(place, pyarrow.array(cells[: block.shape[1]], pyarrow.string()))
            del cells[: block.shape[1]]
        self._writer.write_table(pyarrow.Table.from_arrays(arrays, schema=self._schema))


class Damaged(ValueError):
    """A file that pyarrow cannot read as a table of numbers."""


Outline = tuple[tuple[str, ...], int, dict[str, str], dict[str, object] | None]


def outline(path: Path) -> Outline:
    """The names of the columns of a file, its number of rows, the types of columns that hold no plain numbers, and the
    provenance, where there is one.

    Nothing but the end of the file is read. Raises `Damaged`.
    """
    try:
        with pyarrow.parquet.ParquetFile(str(path)) as file:
            fields = [(field.name, field.type) for field in file.schema_arrow]
            length = file.metadata.num_rows
            origin = provenance((file.schema_arrow.metadata or {}).get(b"provenance"))
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:  # the last of a name
        raise Damaged(_reason(error)) from None
    plain = (pyarrow.types.is_floating, pyarrow.types.is_integer)
    odd = {name: str(kind) for name, kind in fields if not any(test(kind) for test in plain)}
    return tuple(name for name, _ in fields), length, odd, origin


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


def words(path: Path, name: str) -> list[object]:
    """The cells of a column that holds no plain numbers. Raises `Damaged`."""
    found: list[object] = []
    try:
        with pyarrow.parquet.ParquetFile(str(path)) as file:
            for batch in file.iter_batches(_BATCH, columns=[name]):
                found += batch.column(name).to_pylist()
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
        raise Damaged(_reason(error)) from None
    return found


def _reason(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
