"""The curves of columns, read in blocks and thinned at once, with what a chart has to know of all their rows."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lagcli.output.charts import path_thinning
from lagcli.output.charts.chart_table import ChartTable
from lagcli.output.figures import panels

Floats = NDArray[np.float64]

POINTS = 200_000  # of all curves of a chart
FEWEST, MOST = 400, 4000  # points of one curve over an axis that rises


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A curve, thinned: x and y (k,); of all rows the largest size, whether there are negative values, and how many
    zeros."""

    x: Floats
    y: Floats
    largest: float
    has_negatives: bool
    zeros: int
    rows: int

    def as_zero(self) -> Series:
        """The curve at zero, broken where it was."""
        return dataclasses.replace(self, y=np.where(np.isnan(self.y), np.nan, 0.0))


@dataclasses.dataclass(slots=True, eq=False)
class TableSeries:
    """The curves of one table by their columns; span: of the axis, None where there are no rows."""

    curves: dict[str, Series]
    span: tuple[float, float] | None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SeriesSet:
    """The curves of tables over one axis; is_time: the axis rises in all of them."""

    tables: list[TableSeries]
    is_time: bool

    def find(self, run: int, column: str) -> Series | None:
        """The curve of a column of a table, if it has one."""
        return self.tables[run].curves.get(column)

    def largest(self, column: str) -> float:
        """The largest size of a column in all tables."""
        return max(
            (table.curves[column].largest for table in self.tables if column in table.curves), default=0.0
        )


def over(tables: Sequence[ChartTable], axis: str | None, columns: Sequence[str], is_log: bool) -> SeriesSet:
    """Columns over an axis, over the number of the row where it is None; sizes with gaps at zeros where is_log."""
    count = sum(column in table.columns for table in tables for column in columns)
    most = int(np.clip(POINTS // max(1, count), FEWEST, MOST))
    found = [_table(table, axis, columns, is_log, most) for table in tables]
    return SeriesSet([series for series, _ in found], all(rises for _, rises in found))


def _table(
    table: ChartTable, axis: str | None, columns: Sequence[str], is_log: bool, most: int
) -> tuple[TableSeries, bool]:
    known = set(table.columns)
    names = [name for name in columns if name in known]
    found = TableSeries({}, None)
    rises = True
    for common, block_names, block in table.blocks([] if axis is None else [axis], names):
        x = common[:, 0] if axis is not None else np.arange(float(len(block)))
        finite = x[np.isfinite(x)]
        rises = axis in ("t", None) or bool((np.diff(x) >= 0).all())
        found.span = (float(finite.min()), float(finite.max())) if finite.size else None
        for place, name in enumerate(block_names):
            found.curves[name] = _series(x, block[:, place], is_log, most if rises else None)
    return found, rises


def _series(x: Floats, values: Floats, is_log: bool, most: int | None) -> Series:
    """A curve of at most so many points over a rising axis, of as many as it takes in a plane."""
    values = np.ascontiguousarray(values)  # one column of many is gone through several times
    finite = values[known] if not (known := np.isfinite(values)).all() else values
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    zeros = len(values) - int(np.count_nonzero(values))
    y = np.where(values != 0, np.abs(values), np.nan) if is_log else values
    if most is None:
        x, y = path_thinning.traced(x, y)
    else:
        kept = panels.thinned(y, most)
        x, y = x[kept], y[kept]
    return Series(x.copy(), y.copy(), max(-low, high, 0.0), bool((values < 0).any()), zeros, len(values))


def path(table: ChartTable, pair: tuple[str, str]) -> tuple[Floats, Floats]:
    """The curve of a column against another, thinned."""
    rows = table.take(list(dict.fromkeys(pair)))
    return path_thinning.traced(rows[:, 0], rows[:, -1])
