"""Rows of sweeps read from their tables, and whether a file holds all rows of a sweep already."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from lagcli.api.sweeps import sweep_journal, sweep_table
from lagcli.api.sweeps.point_task import PointRow
from lagcli.api.sweeps.sweep_plan import SweepPlan
from lagcli.output.files import formats
from lagcli.output.tables import read_table, table_format
from lagcli.output.tables.read_table import ReadTable

MOST = 2.0**53  # whole numbers below it are numbers of their own


def rows(path: Path, table: ReadTable, names: int) -> list[PointRow]:
    """The rows of the table in a file, whose points have so many numbers. Raises `table_format.UnreadableTable`."""
    columns = [name for name in table.columns if name != sweep_table.SHARD]
    numbers = [name for name in columns if name != sweep_table.MESSAGE]
    messages = table.words(sweep_table.MESSAGE)
    cells = table.take(numbers)
    for name in (sweep_table.NUMBER, sweep_table.STATUS):
        column = cells[:, numbers.index(name)]
        if not (np.abs(column) < MOST).all() or (column % 1).any():  # nan neither
            raise table_format.bad(path, f"the column `{name}` holds a number that is not whole")
    return [
        PointRow(int(row[0]), tuple(row[1 : 1 + names]), tuple(row[1 + names : -2]), int(row[-2]), message, row[-1])
        for row, message in zip(cells.tolist(), messages, strict=True)
    ]  # fmt: skip


class OfUnknownSweep(ValueError):
    """A file holds all points of a sweep and does not say whether their rows are of this one."""


def is_silent(path: Path, plan: SweepPlan) -> bool:
    """True if a table of this sweep does not say of which it is: a shard does by its column, a whole sweep by the
    provenance that all formats but CSV and TSV have a place for."""
    return not plan.is_shard and formats.of(path, formats.TABLES) in formats.PLAIN


def found(path: Path, plan: SweepPlan, digest: str) -> list[PointRow] | None:
    """The rows of a file that this very sweep has written to its end, or None.

    digest: of the file that it has ended with, where that is known. Raises OSError, and `OfUnknownSweep`.
    """
    if not path.is_file():
        return None
    try:
        table = read_table.opened(path)
        if tuple(table.columns) != plan.columns or not (is_silent(path, plan) or _is_same(table, plan)):
            return None
        kept = rows(path, table, len(plan.task.names))
    except (formats.UnknownFormat, table_format.MissingExtra, table_format.UnreadableTable):
        return None  # whatever it is, it is replaced as any file is
    if [row.number for row in kept] != list(plan.numbers):
        return None
    if is_silent(path, plan) and digest != sweep_journal.digest(path):
        raise OfUnknownSweep(
            f"{path} holds a row of every point, and nothing says that these are of this model and its settings;"
            " without --resume all are computed anew"
        )
    return kept


def _is_same(table: ReadTable, plan: SweepPlan) -> bool:
    if plan.is_shard:
        return set(table.words(sweep_table.SHARD)) == {plan.shard_of}
    whence = table.provenance or {}
    wanted = json.loads(json.dumps(plan.identity))  # as it reads back from a file
    return all(whence.get(key) == value for key, value in wanted.items())
