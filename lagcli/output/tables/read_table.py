"""Tables read back: what the writers of this room wrote, or a program that writes the same formats.

A table may come from anywhere. Its names are known before any of its numbers is read, only the columns that are asked
for are read, and how much that is is looked at first.
"""

from __future__ import annotations

import os
from pathlib import Path

from lagcli.output.files import formats
from lagcli.output.tables import table_format
from lagcli.output.tables.table_format import CheckSize, Floats, MissingExtra
from lagcli.output.tables.table_format import ReadTable as ReadTable
from lagcli.output.tables.table_format import UnreadableTable as UnreadableTable

MOST_NUMBERS = 5_000_000  # of the columns that are read: an audit of as many holds 2 GB (400 bytes a number)

# What is raised for a file that is no table to be read here, but for OSError.
UNREADABLE = (formats.UnknownFormat, MissingExtra, UnreadableTable)


def opened(path: str | os.PathLike[str], most: int | None = None) -> ReadTable:
    """A table of which the names are known; nothing else of it is in memory, but of a JSON file.

    most: numbers that may be read at a time, MOST_NUMBERS where nothing is said.
    Raises ``formats.UnknownFormat``, ``MissingExtra``, ``UnreadableTable``, OSError.
    """
    target = Path(path)
    fmt = table_format.of(formats.of(target, formats.TABLES))
    found = fmt.reader(target, _size_check(MOST_NUMBERS if most is None else most))
    if len(set(found.columns)) < len(found.columns):
        raise UnreadableTable(f"{path} has two columns of one name")
    return found


def read(path: str | os.PathLike[str]) -> tuple[tuple[str, ...], Floats]:
    """All columns of a table and its rows (T, columns). Raises what `opened` raises."""
    table = opened(path)
    return table.columns, table.take(table.columns)


def _size_check(most: int) -> CheckSize:
    def check(path: Path, rows: int, columns: int) -> None:
        if rows * columns > most:
            raise UnreadableTable(
                f"{path} is too large: {rows} rows or more of {columns} columns that are read; at most {most}"
                f" numbers are, which is {most // max(1, columns)} rows (a larger table needs more than 2 GB of"
                " memory): write fewer rows, or a shorter run"
            )

    return check
