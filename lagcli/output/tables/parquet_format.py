"""Tables as Parquet, one row group per buffered block; the only file that imports pyarrow, an extra."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow.parquet

from lagcli.arrays import Floats
from lagcli.output.tables import cell_text, table_format
from lagcli.output.tables.table_format import CheckSize, TableFormat, TableHead, Texts, as_text, bad

_BATCH = 1 << 15  # rows read at a time


class ParquetWriter:
    """Writes a table of float64 columns, and string ones, without nulls to ``path`` as its rows arrive; the metadata of
    its schema hold ``provenance`` as JSON."""

    def __init__(self, path: Path, head: TableHead) -> None:
        kinds = {name: pyarrow.string() if name in head.texts else pyarrow.float64() for name in head.columns}
        fields = [pyarrow.field(name, kind, nullable=False) for name, kind in kinds.items()]
        origin = head.provenance
        metadata = None if origin is None else {"provenance": json.dumps(origin, allow_nan=False)}
        self._schema = pyarrow.schema(fields, metadata=metadata)
        self._at = head.text_indices
        self._buffer = cell_text.BufferedRows(len(head.numbers), len(self._at), self._store)
        # Dictionaries do not shrink columns in which hardly a number comes twice.
        words = list(head.texts) or False
        self._writer = pyarrow.parquet.ParquetWriter(str(path), self._schema, use_dictionary=words)

    def write(self, rows: Floats, texts: Texts = ()) -> None:
        self._buffer.add(rows, texts)

    def finish(self) -> None:
        self._buffer.flush()
        self._writer.close()

    def abandon(self) -> None:
        # A writer that has failed may not be able to end its file.
        with contextlib.suppress(pyarrow.ArrowException):
            self._writer.close()

    def _store(self, block: Floats, texts: list[list[str]]) -> None:
        arrays = [pyarrow.array(column) for column in block]
        for index, cells in zip(self._at, texts, strict=True):
            arrays.insert(index, pyarrow.array(cells, pyarrow.string()))
        self._writer.write_table(pyarrow.Table.from_arrays(arrays, schema=self._schema))


class ParquetTable:
    """A Parquet file, of whose columns floating and whole numbers are read, those that are asked for alone."""

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        with path.open("rb"):  # what the file system says, pyarrow wraps
            pass
        self._path, self._check_size = path, check_size
        with self._opened() as file:
            fields = [(field.name, field.type) for field in file.schema_arrow]
            self.length: int = file.metadata.num_rows
            metadata = file.schema_arrow.metadata or {}
            self.provenance = table_format.parsed_provenance(metadata.get(b"provenance"))
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
        try:
            with pyarrow.parquet.ParquetFile(str(self._path)) as file:
                yield file
        except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:  # the last of a name
            raise bad(
                self._path, str(error).splitlines()[0] if str(error) else type(error).__name__
            ) from None


PARQUET = TableFormat(ParquetWriter, ParquetTable)
