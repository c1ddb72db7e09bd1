"""Tables as Parquet, one row group per buffered block; the only file that imports pyarrow, an extra, in functions: the
format is known by its file where there is none."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lagcli.errors import requirements
from lagcli.output.tables import cell_text
from lagcli.output.tables.table_format import (
    CheckSize,
    Floats,
    Make,
    MissingExtra,
    TableHead,
    as_text,
    bad,
    parsed_provenance,
)

if TYPE_CHECKING:
    import pyarrow.parquet

_BATCH = 1 << 15  # rows read at a time


def writer(path: Path) -> Make:
    """See `TableFormat`."""
    with needing_pyarrow(path):
        import pyarrow.parquet  # noqa: F401 (it is there)
    return ParquetTableWriter


@contextlib.contextmanager
def needing_pyarrow(path: Path) -> Iterator[None]:
    """Surround what imports pyarrow, for this file. Raises `MissingExtra` if it is missing or too old."""
    refusal = requirements.too_old(requirements.OPTIONAL)
    if refusal:
        raise MissingExtra(f'"{path.name}": {refusal}')
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "pyarrow":
            raise
        raise MissingExtra(
            f'"{path.name}" needs pyarrow, which is not installed: pip install "lagcli[parquet]"'
        ) from error


class ParquetTableWriter:
    """Writes a table of float64 columns, and string ones, without nulls to ``path`` as its rows arrive; the metadata of
    its schema hold ``provenance`` as JSON."""

    def __init__(self, path: Path, head: TableHead) -> None:
        import pyarrow.parquet

        kinds = {name: pyarrow.string() if name in head.texts else pyarrow.float64() for name in head.columns}
        fields = [pyarrow.field(name, kind, nullable=False) for name, kind in kinds.items()]
        origin = head.provenance
        metadata = None if origin is None else {"provenance": json.dumps(origin, allow_nan=False)}
        self._schema = pyarrow.schema(fields, metadata=metadata)
        self._texts: dict[int, list[str]] = {index: [] for index in head.text_indices}
        self._buffer = cell_text.BufferedRows(len(head.numbers), self._store)
        # Dictionaries do not shrink columns in which hardly a number comes twice.
        words = list(head.texts) or False
        self._writer = pyarrow.parquet.ParquetWriter(str(path), self._schema, use_dictionary=words)

    def write(self, rows: Floats, texts: cell_text.Texts = ()) -> None:
        for column, cells in zip(self._texts.values(), texts, strict=True):
            column.extend(cells)
        self._buffer.add(rows)

    def finish(self) -> None:
        self._buffer.flush()
        self._writer.close()

    def abandon(self) -> None:
        import pyarrow

        # A writer that has failed may not be able to end its file.
        with contextlib.suppress(pyarrow.ArrowException):
            self._writer.close()

    def _store(self, block: Floats) -> None:
        import pyarrow

        arrays = [pyarrow.array(column) for column in block]
        for index, cells in self._texts.items():
            arrays.insert(index, pyarrow.array(cells[: block.shape[1]], pyarrow.string()))
            del cells[: block.shape[1]]
        self._writer.write_table(pyarrow.Table.from_arrays(arrays, schema=self._schema))


class ParquetTable:
    """A Parquet file; of its columns only floating and whole numbers. Of a column that is not asked for
    nothing is read."""

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        with needing_pyarrow(path):
            import pyarrow.parquet
        with path.open("rb"):  # what the file system says, pyarrow wraps
            pass
        self._path, self._check_size = path, check_size
        with self._opened() as file:
            fields = [(field.name, field.type) for field in file.schema_arrow]
            self.length: int = file.metadata.num_rows
            self.provenance = parsed_provenance((file.schema_arrow.metadata or {}).get(b"provenance"))
        self.columns = tuple(name for name, _ in fields)
        plain = (pyarrow.types.is_floating, pyarrow.types.is_integer)
        # The types of the columns that hold no plain numbers.
        self._odd = {name: str(kind) for name, kind in fields if not any(test(kind) for test in plain)}

    def take(self, names: Sequence[str]) -> Floats:
        self._check_size(self._path, self.length, len(names))
        for name in names:
            if name in self._odd:
                raise bad(self._path, f"`{name}` holds {self._odd[name]}, no plain numbers")
        found, row = np.empty((self.length, len(names))), 0
        if not names:
            return found
        with self._opened() as file:
            for batch in file.iter_batches(_BATCH, columns=list(names)):
                end = row + batch.num_rows
                if end > self.length:
                    raise bad(self._path, f"it has more rows than it says, which is {self.length}")
                for k, name in enumerate(names):
                    found[row:end, k] = batch.column(name).to_numpy(zero_copy_only=False)
                row = end
        if row < self.length:
            raise bad(self._path, f"it has {row} rows and says {self.length}")
        return found

    def words(self, name: str) -> list[str]:
        self._check_size(self._path, self.length, 1)
        if name not in self._odd:
            raise bad(self._path, f"`{name}` holds numbers and no text")
        found: list[object] = []
        with self._opened() as file:
            for batch in file.iter_batches(_BATCH, columns=[name]):
                found += batch.column(name).to_pylist()
        return [as_text(self._path, cell, row, name) for row, cell in enumerate(found, 1)]

    @contextlib.contextmanager
    def _opened(self) -> Iterator[pyarrow.parquet.ParquetFile]:
        """The file as pyarrow reads it. Raises `UnreadableTable` for what pyarrow cannot read as a table."""
        import pyarrow.parquet

        try:
            with pyarrow.parquet.ParquetFile(str(self._path)) as file:
                yield file
        except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:  # the last of a name
            raise bad(
                self._path, str(error).splitlines()[0] if str(error) else type(error).__name__
            ) from None


reader = ParquetTable  # see `TableFormat`
