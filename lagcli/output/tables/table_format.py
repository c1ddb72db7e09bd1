"""The protocol of a table format, and the refusals of files that are no tables.

A format is a file of this folder with the functions `writer` and `reader` and its line in `formats.FORMATS`; it is
loaded when a table of it is at hand.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from lagcli.frozen import frozen_value
from lagcli.output.files import formats
from lagcli.output.tables import cell_text

Floats = NDArray[np.float64]
CheckSize = Callable[[Path, int, int], None]  # of a file, rows and columns; raises `UnreadableTable`
Provenance = Mapping[str, object] | None

SHOWN = 60  # characters of what is no number
MOST_TEXT = 1000  # characters of a text: a kind or a name


class UnreadableTable(ValueError):
    """The file is no table in the format that its ending names, or too large."""


class MissingExtra(RuntimeError):
    """A format needs a package that is not installed; the message says how to install it."""


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

    def write(self, rows: Floats, texts: cell_text.Texts = ()) -> None:
        """Append rows (k, columns of numbers) and the cells of each column of text."""

    def finish(self) -> None:
        """Complete and close the file."""

    def abandon(self) -> None:
        """Close the file, which will not be kept."""


@frozen_value
class TableHead:
    """The head of a table that is written: the names of all columns and of those of text, and where it comes from."""

    columns: tuple[str, ...]
    texts: tuple[str, ...] = ()
    provenance: Provenance = None

    @property
    def text_indices(self) -> tuple[int, ...]:
        """The indices of the columns of text, in the order of the table."""
        return tuple(index for index, name in enumerate(self.columns) if name in self.texts)

    @property
    def numbers(self) -> tuple[str, ...]:
        """The columns of numbers, in the order of the table."""
        return tuple(name for name in self.columns if name not in self.texts)


# Begins the file of this path.
Make = Callable[[Path, TableHead], TableWriter]


class TableFormat(Protocol):
    """The functions that the file of a format has."""

    def writer(self, path: Path) -> Make:
        """The function that begins a file. path: of the table, for messages. Raises `MissingExtra`."""

    def reader(self, path: Path, check_size: CheckSize) -> ReadTable:
        """An open table. Raises `MissingExtra`, `UnreadableTable`, OSError."""


def of(ending: str) -> TableFormat:
    """The format of an ending of `formats.TABLES`."""
    return cast(
        TableFormat, importlib.import_module(f"lagcli.output.tables.{formats.FORMATS[ending].module}")
    )


def bad(path: Path, reason: object) -> UnreadableTable:
    """The refusal of a file, with its reason."""
    return UnreadableTable(f"{path} is no table in the format .{path.suffix.lower()[1:]}: {reason}")


def as_text(path: Path, cell: object, row: int, name: str) -> str:
    """A cell of a column of text. Raises `UnreadableTable`."""
    if not isinstance(cell, str) or len(cell) > MOST_TEXT:
        raise bad(path, f"row {row}: {name[:SHOWN]!r} holds {str(cell)[:SHOWN]!r}, which is no word")
    return cell


def parsed_provenance(text: bytes | None) -> dict[str, object] | None:
    """The provenance in the comment or the metadata of a file; None where there is none, or another text."""
    try:
        found = json.loads(text) if text else None
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def column_indices(columns: Sequence[str], names: Sequence[str]) -> list[int]:
    """The indices of the columns of these names."""
    at = {name: k for k, name in enumerate(columns)}
    return [at[name] for name in names]
