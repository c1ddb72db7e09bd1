"""Columns that a chart defines by expressions of others: `pull=abs(lambda.rod)`, as the reductions of a sweep."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lagcli.api.sweeps import reductions
from lagcli.expression.tree import ExpressionError
from lagcli.output.charts.compose import ChartChoice, UndrawableColumns

if TYPE_CHECKING:
    from lagcli.output.charts.chart_table import ChartTable

Floats = NDArray[np.float64]

_NAME = re.compile(r"[^\W\d]\w*")


def added(tables: Sequence[ChartTable], choice: ChartChoice) -> tuple[list[ChartTable], ChartChoice]:
    """The tables with the columns that a choice defines, `NAME=EXPR` in `y` and `x`, and the choice with their names.

    A table that has not all columns of an expression goes without. Raises `UndrawableColumns`.
    """
    found = list(tables)
    names = {}
    for option, text in (*(("--y", y) for y in choice.y), *((("--x", choice.x),) if choice.x else ())):
        if "=" in text:
            name, _, written = (part.strip() for part in text.partition("="))
            if not _NAME.fullmatch(name) or not written:
                raise UndrawableColumns(
                    f"{option} {text}: write NAME=EXPR, a name of letters and digits, such as 'pull=abs(lambda.rod)'"
                )
            names[text] = name
            found = _with(found, option, names[text], text.partition("=")[2])
    y = tuple(names.get(text, text) for text in choice.y)
    return found, dataclasses.replace(choice, y=y, x=names.get(choice.x or "", choice.x))


def _with(tables: Sequence[ChartTable], option: str, name: str, text: str) -> list[ChartTable]:
    """The tables with one more column where they can have it, which is at least one of them."""
    failed: list[ExpressionError] = []
    found = []
    for table in tables:
        if name in table.columns:
            raise UndrawableColumns(f"{option}: {table.name or 'the table'} has a column `{name}` of its own")
        try:
            found.append(_defined(table, name, text))
        except ExpressionError as error:
            failed.append(error)
            found.append(table)
    if len(failed) == len(tables) or any(error.code != "unknown-name" for error in failed):
        hint = f"; {failed[0].hint}" if failed[0].hint else ""
        raise UndrawableColumns(f"{option} {name}: {failed[0].message}{hint}")
    return found


def _defined(table: ChartTable, name: str, text: str) -> ChartTable:
    """A table with the values of an expression at its rows as a column. Raises `ExpressionError`."""
    parameters = _parameters(table.origin)
    used = reductions.columns_in(text, table.columns)
    # Names and functions are judged before any number is read.
    reductions.at_rows(text, {known: np.ones(2) for known in table.columns}, np.array([0.0, 1.0]), parameters)
    needed = list(dict.fromkeys([*used, *(["t"] if "t" in table.columns else [])])) or list(table.columns[:1])

    def take(names: Sequence[str]) -> Floats:
        if name not in names:
            return table.take(names)
        others = list(dict.fromkeys([*(other for other in names if other != name), *needed]))
        rows = dict(zip(others, table.take(others).T, strict=True))
        count = len(rows[others[0]])
        t = rows["t"] if "t" in rows else np.arange(float(count))
        values = (
            reductions.at_rows(text, {known: rows[known] for known in needed}, t, parameters) if count else t
        )
        return np.column_stack([values if one == name else rows[one] for one in names])

    return dataclasses.replace(table, columns=(*table.columns, name), take=take)


def _parameters(origin: Mapping[str, object] | None) -> dict[str, object]:
    """The parameters that the provenance of a table has: numbers, and vectors as the language has them."""
    given = origin.get("parameters") if origin is not None else None
    found: dict[str, object] = {}
    for name, value in given.items() if isinstance(given, Mapping) else ():
        parts = value if isinstance(value, (list, tuple)) else [value]
        if all(isinstance(part, (int, float)) and not isinstance(part, bool) for part in parts):
            numbers = tuple(map(float, parts))
            if len(numbers) == (3 if isinstance(value, (list, tuple)) else 1):
                found[name] = numbers if len(numbers) == 3 else numbers[0]
    return found
