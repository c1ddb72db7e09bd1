"""Tables as Parquet files; pyarrow is loaded when one is at hand."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

from lagcli.output.tables.sinks import needing_pyarrow
from lagcli.output.tables.table_format import CheckSize, Floats, Make, Provenance, ReadTable
from lagcli.output.tables.unreadable import as_text, bad


def writer(path: Path, provenance: Provenance) -> Make:
    """See `TableFormat`."""
    with needing_pyarrow(path):
        from lagcli.output.tables import parquet_table
    return functools.partial(parquet_table.ParquetTableWriter, provenance=provenance)


def reader(path: Path, check_size: CheckSize) -> ReadTable:
    """See `TableFormat`."""
    return ParquetTable(path, check_size)


class ParquetTable:
    """A Parquet file; of its columns only floating and whole numbers."""

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        self._check_size = check_size
        with needing_pyarrow(path):
            from lagcli.output.tables import parquet_table
        with path.open("rb"):  # what the file system says, pyarrow wraps
            pass
        self._path, self._table = path, parquet_table
        try:
            self.columns, self.length, self._odd, self.provenance = parquet_table.outline(path)
        except parquet_table.Damaged as error:
            raise bad(path, error) from None

    def take(self, names: Sequence[str]) -> Floats:
        """See `table_format.ReadTable`."""
        self._check_size(self._path, self.length, len(names))
        for name in names:
            if name in self._odd:
                raise bad(self._path, f"`{name}` holds {self._odd[name]}, no plain numbers")
        try:
            return self._table.numbers(self._path, names, self.length)
        except self._table.Damaged as error:
            raise bad(self._path, error) from None

    def words(self, name: str) -> list[str]:
        """See `table_format.ReadTable`."""
        self._check_size(self._path, self.length, 1)
        if name not in self._odd:
            raise bad(self._path, f"`{name}` holds numbers and no text")
        try:
            found = self._table.words(self._path, name)
        except self._table.Damaged as error:
            raise bad(self._path, error) from None
        return [as_text(self._path, cell, row, name) for row, cell in enumerate(found, 1)]
