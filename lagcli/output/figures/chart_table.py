"""Tables as charts read them, in blocks of columns: curves are decimated at once, and know what to tell of all rows."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import BinaryIO, Protocol

import numpy as np

from lagcli.arrays import Floats
from lagcli.output.figures import chart
from lagcli.output.figures.chart import Span
from lagcli.output.tables import provenance, table_format
from lagcli.output.tables.provenance import TableFacts
from lagcli.output.tables.table_format import UnreadableTable

MOST_NUMBERS = 40_000_000  # that are read at a time, 320 MB; curves are decimated before the next are read
BATCH = 24_000_000  # numbers at a time where there are more columns
POINTS = 200_000  # of all curves of a chart
FEWEST, MOST = 400, 4000  # points of one curve over an axis that rises
FIRST = 8  # columns of the first batch, where the number of rows is not known


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ChartTable:
    """A table with a name. take(names): rows (T, len(names)); length: how many, where that is known; incidents: times
    and kinds; origin: its provenance, where it is known."""

    name: str
    columns: tuple[str, ...]
    take: Callable[[Sequence[str]], Floats]
    length: int | None = None
    facts: TableFacts = provenance.NO_FACTS
    incidents: Sequence[tuple[float, str]] = ()
    origin: Mapping[str, object] | None = None

    def blocks(
        self, common: Sequence[str], names: Sequence[str]
    ) -> Iterator[tuple[Floats, Sequence[str], Floats]]:
        """Columns in blocks of bounded size: (T, len(common)), some of the names, and theirs (T, k)."""
        left = list(names)
        most = FIRST if self.length is None else max(1, BATCH // max(1, self.length) - len(common))
        while left:
            now, left = left[:most], left[most:]
            rows = self.take([*common, *now])
            yield rows[:, : len(common)], now, rows[:, len(common) :]
            most = max(1, BATCH // max(1, len(rows)) - len(common))


def of_rows(
    name: str,
    columns: Sequence[str],
    rows: Floats,
    facts: TableFacts,
    incidents: Sequence[tuple[float, str]] = (),
) -> ChartTable:
    """A table in memory, rows (T, columns)."""
    indices = {column: index for index, column in enumerate(columns)}
    return ChartTable(
        name,
        tuple(columns),
        lambda names: rows[:, [indices[one] for one in names]],
        len(rows),
        facts,
        incidents,
    )


class RunTable(Protocol):
    """The part of a run that a chart is made of."""

    @property
    def columns(self) -> tuple[str, ...]: ...
    @property
    def rows(self) -> Floats: ...
    @property
    def facts(self) -> TableFacts: ...
    @property
    def incident_times(self) -> Sequence[tuple[float, str]]: ...
    @property
    def origin(self) -> Mapping[str, object] | None: ...


def of_run(run: RunTable, name: str = "") -> ChartTable:
    """The table of a run."""
    table = of_rows(name, run.columns, run.rows, run.facts, run.incident_times)
    return dataclasses.replace(table, origin=run.origin)


def of_file(path: str | os.PathLike[str]) -> ChartTable:
    """A table in a file. Raises what `table_format.opened` raises; take raises `UnreadableTable` and OSError."""
    found = table_format.opened(path, MOST_NUMBERS)
    facts = provenance.facts_from(found.provenance)
    return ChartTable(
        os.fspath(path), found.columns, found.take, found.length, facts, origin=found.provenance
    )


@contextlib.contextmanager
def of_stream(stream: BinaryIO, name: str) -> Iterator[ChartTable]:
    """A table in CSV on a stream, which is stored in a file for as long as it is read. Raises as `of_file`."""
    with tempfile.TemporaryDirectory(prefix="lagcli-") as folder:
        path = pathlib.Path(folder, "table.csv")
        with path.open("wb") as file:
            shutil.copyfileobj(stream, file)

        @contextlib.contextmanager
        def named() -> Iterator[None]:
            try:
                yield
            except UnreadableTable as error:
                raise UnreadableTable(str(error).replace(os.fspath(path), name)) from None

        def take(names: Sequence[str]) -> Floats:
            with named():
                return table.take(names)

        with named():
            table = of_file(path)
        yield dataclasses.replace(table, name=name, take=take)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A decimated curve (k,), and of all its rows the largest size, whether there are negative values, and how many
    zeros."""

    x: Floats
    y: Floats
    largest: float
    has_negatives: bool
    zeros: int
    rows: int


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SeriesSet:
    """The curves of each table by their columns; ends: of the axes that have rows; is_time: the axis rises in all."""

    curves: list[dict[str, Series]]
    ends: list[Span]
    is_time: bool

    def of(self, column: str) -> list[Series]:
        """The curves of a column in the tables that have it."""
        return [curves[column] for curves in self.curves if column in curves]

    def largest(self, column: str) -> float:
        """The largest size of a column in all tables."""
        return max((one.largest for one in self.of(column)), default=0.0)


def over(tables: Sequence[ChartTable], axis: str | None, columns: Sequence[str], is_log: bool) -> SeriesSet:
    """Columns over an axis, over the number of the row where it is None; sizes with gaps at zeros where is_log."""
    count = sum(column in table.columns for table in tables for column in columns)
    most = int(np.clip(POINTS // max(1, count), FEWEST, MOST))
    found: list[dict[str, Series]] = []
    ends, is_time = [], True
    for table in tables:
        known = set(table.columns)
        own: dict[str, Series] = {}
        x, rises = np.zeros(0), True
        for common, names, block in table.blocks(
            [] if axis is None else [axis], [name for name in columns if name in known]
        ):
            x = common[:, 0] if axis is not None else np.arange(float(len(block)))
            rises = axis in ("t", None) or bool((x[1:] >= x[:-1]).all())
            for index, name in enumerate(names):
                own[name] = _series(x, block[:, index], is_log, most if rises else None)
        found.append(own)
        ends += [chart.ends([x])] if np.isfinite(x).any() else []
        is_time = is_time and rises
    return SeriesSet(found, ends, is_time)


def _series(x: Floats, values: Floats, is_log: bool, most: int | None) -> Series:
    """A curve of at most so many points over a rising axis, of as many as it takes in a plane."""
    values = np.ascontiguousarray(values)  # one column of many is gone through several times
    low, high = chart.ends([values])
    zeros = len(values) - int(np.count_nonzero(values))
    y = np.where(values != 0, np.abs(values), np.nan) if is_log else values
    if most is None:
        x, y = chart.path(x, y)
    else:
        chosen = chart.extrema(y, most)
        x, y = x[chosen], y[chosen]
    return Series(x.copy(), y.copy(), max(-low, high, 0.0), bool((values < 0).any()), zeros, len(values))


def path(table: ChartTable, pair: tuple[str, str]) -> tuple[Floats, Floats]:
    """The curve of a column against another, decimated."""
    rows = table.take(list(dict.fromkeys(pair)))
    return chart.path(rows[:, 0], rows[:, -1])
