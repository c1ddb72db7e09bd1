"""Tables as charts read them: names of columns, and the columns when they are asked for."""

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
from numpy.typing import NDArray

from lagcli.output.tables import provenance, read_table
from lagcli.output.tables.provenance import TableFacts
from lagcli.output.tables.table_format import UnreadableTable

Floats = NDArray[np.float64]

MOST_NUMBERS = 40_000_000  # that are read at a time, 320 MB; curves are thinned before the next are read
BATCH = 24_000_000  # numbers at a time where there are more columns
FIRST = 8  # columns of the first batch, where the number of rows is not known


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ChartTable:
    """A table with a name.

    take(names): rows (T, len(names)); length: how many there are, where that is known; incidents: times and kinds;
    origin: its provenance, where it is known.
    """

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
    places = {column: place for place, column in enumerate(columns)}
    return ChartTable(
        name,
        tuple(columns),
        lambda names: rows[:, [places[one] for one in names]],
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
    """A table in a file. Raises what `read_table.opened` raises; take raises `UnreadableTable` and OSError."""
    found = read_table.opened(path, MOST_NUMBERS)
    facts = provenance.facts_told_by(found.provenance)
    return ChartTable(
        os.fspath(path), found.columns, found.take, found.length, facts, origin=found.provenance
    )


@contextlib.contextmanager
def of_stream(stream: BinaryIO, name: str) -> Iterator[ChartTable]:
    """A table in CSV on a stream, which is kept in a file for as long as it is read. Raises as `of_file`."""
    with tempfile.TemporaryDirectory(prefix="lagcli-") as folder:
        path = pathlib.Path(folder, "table.csv")
        with path.open("wb") as file:
            shutil.copyfileobj(stream, file)

        def told(error: UnreadableTable) -> UnreadableTable:
            return UnreadableTable(str(error).replace(os.fspath(path), name))

        try:
            table = of_file(path)
        except UnreadableTable as error:
            raise told(error) from None

        def take(names: Sequence[str]) -> Floats:
            try:
                return table.take(names)
            except UnreadableTable as error:
                raise told(error) from None

        yield dataclasses.replace(table, name=name, take=take)
