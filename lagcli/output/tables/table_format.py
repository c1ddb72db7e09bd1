"""What all formats of tables share: writers and readers, tables read back, the choice of columns, refusals.

A format is a file of this folder with a `TableFormat`, and its line in `formats.FORMATS`; it is loaded when a table of
it is at hand. A table may come from anywhere: only the columns that are asked for are read, and how much that is is
looked at first.
"""

from __future__ import annotations

import array
import difflib
import fnmatch
import importlib
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol, cast

import numpy as np

from lagcli.arrays import Floats
from lagcli.errors import requirements
from lagcli.frozen import frozen_value
from lagcli.output.files import formats

Texts = Sequence[Sequence[str]]  # for each column of text, in the order of the table, its cells (k,)
CheckSize = Callable[[Path, int, int], None]  # of a file, rows and columns; raises `UnreadableTable`
Provenance = Mapping[str, object] | None

SHOWN = 60  # characters of what is no number
MOST_TEXT = 1000  # characters of a text: a kind or a name
MOST_NUMBERS = 5_000_000  # of the columns that are read: an audit of as many holds 2 GB (400 bytes a number)
ACCELERATION = re.compile(r"\w+(\[\d+\])*\.a[xyz]")


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

    def write(self, rows: Floats, texts: Texts = ()) -> None:
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


class TableFormat(NamedTuple):
    """Begins the file at a path, and opens one; the reader raises `UnreadableTable` and OSError."""

    writer: Callable[[Path, TableHead], TableWriter]
    reader: Callable[[Path, CheckSize], ReadTable]


def of(path: Path) -> TableFormat:
    """The format of a file, by its ending. Raises `formats.UnknownFormat`, `MissingExtra`."""
    ending = formats.of(path, formats.TABLES)
    module, needs = formats.FORMATS[ending].module, formats.FORMATS[ending].needs
    refusal = requirements.too_old(needs)
    if refusal:
        raise MissingExtra(f'"{path.name}": {refusal}')
    try:
        found = importlib.import_module(f"lagcli.output.tables.{module}")
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing not in needs:
            raise
        raise MissingExtra(
            f'"{path.name}" needs {missing}, which is not installed: pip install "lagcli[{ending}]"'
        ) from error
    return cast(TableFormat, getattr(found, ending.upper()))


def bad(path: Path, reason: object) -> UnreadableTable:
    """The refusal of a file, with its reason."""
    return UnreadableTable(f"{path} is no table in the format .{path.suffix.lower()[1:]}: {reason}")


def as_text(path: Path, cell: object, row: int, name: str) -> str:
    """A cell of a column of text. Raises `UnreadableTable`."""
    if not isinstance(cell, str) or len(cell) > MOST_TEXT:
        raise bad(path, f"row {row}: {name[:SHOWN]!r} holds {str(cell)[:SHOWN]!r}, which is no word")
    return cell


class CellTable:
    """A table that is read row by row and cell by cell; see `ReadTable`."""

    columns: tuple[str, ...]
    provenance: dict[str, object] | None = None

    def __init__(self, path: Path, check_size: CheckSize) -> None:
        self._path, self._check_size = path, check_size

    @property
    def length(self) -> int | None:
        raise NotImplementedError

    def _rows(self) -> Iterator[Sequence[object]]:
        """The cells of each row."""
        raise NotImplementedError

    def _number(self, cell: object, row: int, name: str) -> float:
        """The number in a cell. Raises `UnreadableTable`."""
        raise NotImplementedError

    def take(self, names: Sequence[str]) -> Floats:
        at = column_indices(self.columns, names)
        numbers, count = array.array("d"), 0
        for count, row in self._complete_rows(len(names)):
            numbers.extend([self._number(row[k], count, self.columns[k]) for k in at])
        return np.array(numbers, dtype=np.float64).reshape(count, len(names))

    def words(self, name: str) -> list[str]:
        index = self.columns.index(name)
        return [as_text(self._path, row[index], count, name) for count, row in self._complete_rows(1)]

    def _complete_rows(self, wanted: int) -> Iterator[tuple[int, Sequence[object]]]:
        """The rows, counted from 1, each with all its cells, of which so many are wanted."""
        self._check_size(self._path, self.length or 0, wanted)
        for count, row in enumerate(self._rows(), 1):
            if len(row) != len(self.columns):
                raise bad(self._path, f"row {count} has {len(row)} entries for {len(self.columns)} columns")
            self._check_size(self._path, count, wanted)
            yield count, row


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


# What is raised for a file that is no table to be read here, but for OSError.
UNREADABLE = (formats.UnknownFormat, MissingExtra, UnreadableTable)


def opened(path: str | os.PathLike[str], most: int | None = None) -> ReadTable:
    """A table of which the names are known; nothing else of it is in memory, but of a JSON file. most: numbers that may
    be read at a time. Raises ``formats.UnknownFormat``, ``MissingExtra``, ``UnreadableTable``, OSError."""
    target, allowed = Path(path), MOST_NUMBERS if most is None else most

    def check_size(path: Path, rows: int, columns: int) -> None:
        if rows * columns > allowed:
            raise UnreadableTable(
                f"{path} is too large: {rows} rows or more of {columns} columns that are read; at most {allowed}"
                f" numbers are, which is {allowed // max(1, columns)} rows (a larger table needs more than 2 GB of"
                " memory): write fewer rows, or a shorter run"
            )

    found = of(target).reader(target, check_size)
    if len(set(found.columns)) < len(found.columns):
        raise UnreadableTable(f"{path} has two columns of one name")
    return found


def read(path: str | os.PathLike[str]) -> tuple[tuple[str, ...], Floats]:
    """All columns of a table and its rows (T, columns). Raises what `opened` raises."""
    table = opened(path)
    return table.columns, table.take(table.columns)


class UnknownColumn(ValueError):
    """A pattern matches no column; ``nearest`` holds the known names most like it."""

    def __init__(self, pattern: str, nearest: Sequence[str]) -> None:
        super().__init__(pattern, nearest)
        self.pattern, self.nearest = pattern, tuple(nearest)

    def __str__(self) -> str:
        hint = f"; nearest: {', '.join(self.nearest)}" if self.nearest else ""
        if ACCELERATION.fullmatch(self.pattern):
            outputs = f"`outputs: {{acc: {self.pattern}}}`"
            hint = f"; accelerations are columns where they are outputs of the model: {outputs}"
        return f'no column matches "{self.pattern}"{hint}'


def select(columns: Sequence[str], patterns: str, by_name: Sequence[str] = ()) -> list[int]:
    """Indices into ``columns`` of the names that the comma-separated ``patterns`` choose, each once, in the order of
    the patterns.

    ``*`` stands for any text and ``?`` for one character, all else for itself. ``by_name``: columns after all others
    that ``*`` alone leaves out, such as ``Q.theta``: a pattern must begin with their first word and its dot. Raises
    ``UnknownColumn`` for the first pattern without a match.
    """
    if patterns == "*" and columns:
        return list(range(len(columns)))
    chosen: dict[int, None] = {}
    everything = (*columns, *by_name)
    for pattern in (part.strip() for part in patterns.split(",")):
        # fnmatch reads "[...]" as a character set; "[[]" is its way to write a literal bracket.
        is_open = re.search(r"[*?]", pattern)
        matches = (
            re.compile(fnmatch.translate(pattern.replace("[", "[[]"))).match if is_open else pattern.__eq__
        )
        found = [
            index
            for index, name in enumerate(everything)
            if matches(name) and (index < len(columns) or pattern.startswith(name.partition(".")[0] + "."))
        ]
        if not found:
            stem = re.sub(r"[*?]", "", pattern).casefold()
            names = {name.casefold(): name for name in reversed(everything)}
            close = difflib.get_close_matches(stem, list(names), n=3, cutoff=0.5)
            raise UnknownColumn(pattern, [names[key] for key in close])
        chosen.update(dict.fromkeys(found))
    return list(chosen)
