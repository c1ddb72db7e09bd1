"""The protocol of a table format. One is a file of this folder with the functions `writer` and `reader` and its line in
`endings.FORMATS`; it is loaded when a table of it is at hand."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from lagcli.output.files import endings
from lagcli.output.tables import text_cells

Floats = NDArray[np.float64]
CheckSize = Callable[[Path, int, int], None]  # of a file, rows and columns; raises `UnreadableTable`
Provenance = Mapping[str, object] | None


class ReadTable(Protocol):
    """An open table: the names of its columns, and the columns themselves when they are asked for."""

    columns: tuple[str, ...]
    provenance: dict[str, object] | None  # where the file holds one

    @property
    def length(self) -> int | None:
        """The number of rows, where it is known before they are read. Raises OSError."""

    def take(self, names: Sequence[str]) -> Floats:
        """The rows (T, len(names)) of columns; what has no value is nan. Raises `UnreadableTable`, OSError."""

    def words(self, name: str) -> list[str]:
        """The cells of a column of text (T,). Raises `UnreadableTable`, OSError."""


class TableWriter(Protocol):
    """Writes one file, as its rows arrive. All methods let OSError pass."""

    def write(self, rows: Floats, texts: text_cells.Texts = ()) -> None:
        """Append rows (k, columns of numbers) and the cells of each column of text."""

    def finish(self) -> None:
        """Complete and close the file."""

    def abandon(self) -> None:
        """Close the file, which will not be kept."""


# Of the file to be written, all columns and those of text.
Make = Callable[[Path, Sequence[str], Sequence[str]], TableWriter]


class TableFormat(Protocol):
    """The functions that the file of a format has."""

    def writer(self, path: Path, provenance: Provenance) -> Make:
        """The function that begins a file. path: of the table, for messages. Raises `sinks.MissingExtra`."""

    def reader(self, path: Path, check_size: CheckSize) -> ReadTable:
        """An open table. Raises `sinks.MissingExtra`, `UnreadableTable`, OSError."""


def of(ending: str) -> TableFormat:
    """The format of an ending of `endings.TABLES`."""
    return cast(
        TableFormat, importlib.import_module(f"lagcli.output.tables.{endings.FORMATS[ending].module}")
    )


def places(columns: Sequence[str], names: Sequence[str]) -> list[int]:
    """The places of the columns of these names."""
    at = {name: k for k, name in enumerate(columns)}
    return [at[name] for name in names]
