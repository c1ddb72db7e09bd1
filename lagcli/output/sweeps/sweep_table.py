"""The table of a sweep: its rows, their way into a file of any format and back, and their account: how many points
ended how, and, of drawn points, how their results are distributed."""

from __future__ import annotations

import array
import dataclasses
import hashlib
import itertools
import json
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypedDict

import numpy as np

from lagcli import doubles
from lagcli.output.files import formats
from lagcli.output.tables import sinks, table_format
from lagcli.output.tables.table_format import ReadTable

# Codes of a point, as `simulate` would exit.
DONE, INVALID, STOPPED = 0, 1, 3

NUMBER, STATUS, MESSAGE, END = "point", "status", "message", "t_end"
# Of the table of a shard alone: which sweep it is a part of, and of how many points; and the checksum of a row, by
# which `--merge` sees a changed digit.
SHARD, CHECKSUM = "shard_of", "checksum"
ROWS_AT_ONCE = 4096  # rows that are turned into a block: some megabytes
# Of each result: its middle, its middle half, and nine tenths of it.
PERCENTILES = (5, 25, 50, 75, 95)


@dataclasses.dataclass(frozen=True, slots=True)
class PointRow:
    """The row of a point: its number and values, the reductions, nan where there are none, the code of `simulate`, a
    sentence where that is not 0, and the time reached, nan where no row was."""

    number: int
    point: tuple[float, ...]
    results: tuple[float, ...]
    status: int
    message: str
    t_end: float


@dataclasses.dataclass(frozen=True, slots=True)
class PlannedRows:
    """The rows of a sweep, or of a shard of it, that are to be computed.

    identity: the data that make two sweeps one; names: of the numbers of a point; results: the columns that are kept of
    a run; count: points of the whole sweep; part, parts: the shard, every `parts`-th point from the `part`-th on,
    counted from 1.
    """

    identity: Mapping[str, object]
    names: tuple[str, ...]
    results: tuple[str, ...]
    count: int
    part: int = 1
    parts: int = 1

    @property
    def numbers(self) -> range:
        """The points of the shard."""
        return range(self.part - 1, self.count, self.parts)

    @property
    def is_shard(self) -> bool:
        """True if there are other parts."""
        return self.parts > 1

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of the table. Raises `ValueError` for two of one name."""
        shard = [SHARD, CHECKSUM] if self.is_shard else []
        found = (NUMBER, *self.names, *self.results, STATUS, MESSAGE, END, *shard)
        twice = [name for name in found if found.count(name) > 1] if len(set(found)) < len(found) else []
        if twice:
            raise ValueError(
                f"two columns would be called `{twice[0]}`; name the reductions with --reduce NAME=EXPR"
            )
        return found

    @property
    def provenance(self) -> dict[str, object]:
        """The data that make two files of rows one."""
        return {**self.identity, "shard": [self.part, self.parts]}

    @property
    def shard_of(self) -> str:
        """The same cell in all parts of a sweep, whose last word is the number of points; nothing for a whole sweep."""
        if not self.is_shard:
            return ""
        text = json.dumps(self.identity, sort_keys=True)
        return f"{hashlib.sha256(text.encode()).hexdigest()[:16]} {self.count}"


class SweepTable:
    """Takes the rows of a sweep into the sink of a file or a stream; `shard`: the text of the column `SHARD`."""

    def __init__(
        self,
        target: Path | BinaryIO,
        names: Sequence[str],
        provenance: Mapping[str, object] | None,
        shard: str = "",
    ) -> None:
        fmt = formats.of(target, formats.TABLES) if isinstance(target, Path) else "csv"
        self._names, self._shard = tuple(names), shard
        # Whole numbers are texts in a file of plain text, to have no point.
        whole = (NUMBER, STATUS) if fmt in formats.PLAIN else ()
        self._texts = tuple(name for name in (*whole, MESSAGE, SHARD, CHECKSUM) if name in names)
        self.sink = sinks.open_sink(target, names, provenance=provenance, texts=self._texts)

    def write(self, rows: Sequence[PointRow]) -> None:
        """More rows. Raises OSError."""
        if not rows:
            return
        cells = {
            NUMBER: [str(row.number) for row in rows],
            STATUS: [str(row.status) for row in rows],
            MESSAGE: [row.message for row in rows],
            SHARD: [self._shard] * len(rows),
        }
        if CHECKSUM in self._names:
            cells[CHECKSUM] = [checksum(self._shard, row) for row in rows]
        # A number for every column, nan for those of text
        ends = [np.nan] * (len(self._names) - len(rows[0].point) - len(rows[0].results) - 4)
        block = np.array([[r.number, *r.point, *r.results, r.status, np.nan, r.t_end, *ends] for r in rows])
        numbers = [i for i, name in enumerate(self._names) if name not in self._texts]
        written = [cells[name] for name in self._names if name in self._texts]
        self.sink.write(block[:, numbers], written)


def blocks(rows: Iterable[PointRow]) -> Iterable[list[PointRow]]:
    """The rows in blocks that are written at once."""
    waiting = iter(rows)
    return iter(lambda: list(itertools.islice(waiting, ROWS_AT_ONCE)), [])


def checksum(shard: str, row: PointRow) -> str:
    """The checksum of a row of a shard, of all its numbers and words, whatever the format of its table is."""
    numbers = [float(number) + 0.0 for number in (*row.point, *row.results, row.t_end)]  # no -0.0
    text = json.dumps([shard, row.number, numbers, row.status, row.message])
    return f"crc32 {zlib.crc32(text.encode()):08x}"


def rows(path: Path, table: ReadTable, names: int) -> list[PointRow]:
    """The rows of the table in a file, whose points have so many numbers. Raises `table_format.UnreadableTable`, for
    the row of a shard too that is another than was written."""
    columns = [name for name in table.columns if SHARD not in table.columns or name not in (SHARD, CHECKSUM)]
    numbers = [name for name in columns if name != MESSAGE]
    messages = table.words(MESSAGE)
    cells = table.take(numbers)
    for name in (NUMBER, STATUS):
        column = cells[:, numbers.index(name)]
        if not (np.abs(column) < doubles.WHOLE).all() or (column % 1).any():  # nan neither
            raise table_format.bad(path, f"the column `{name}` holds a number that is not whole")
    found = [
        PointRow(int(row[0]), tuple(row[1 : 1 + names]), tuple(row[1 + names : -2]), int(row[-2]), message, row[-1])
        for row, message in zip(cells.tolist(), messages, strict=True)
    ]  # fmt: skip
    if SHARD in table.columns and CHECKSUM in table.columns:
        for row, shard, expected in zip(found, table.words(SHARD), table.words(CHECKSUM), strict=True):
            if checksum(shard, row) != expected:
                raise table_format.bad(
                    path, f"the row of the point {row.number} was changed after it was written"
                )
    return found


class Spread(TypedDict):
    """The distribution of a result: the number of values, mean, standard deviation (of a sample), least and largest,
    and `PERCENTILES` by the parts that are below them."""

    count: int
    mean: float
    sd: float
    min: float
    max: float
    quantiles: dict[str, float]


class SweepEnding(NamedTuple):
    """The end of a sweep: the exit code, sentences to tell, and the account as JSON, where that is asked for."""

    code: int
    messages: tuple[str, ...]
    account: Mapping[str, object] | None


class SweepAccount:
    """Counts the rows that it takes. names: of the results; spreads: with their distributions, 8 bytes a number."""

    def __init__(self, names: Sequence[str], spreads: bool) -> None:
        self.done = self.stopped = self.invalid = 0
        self.lost = 0  # times that workers were ended by the system
        self._values = {name: array.array("d") for name in names} if spreads else {}

    @property
    def points(self) -> int:
        """The rows so far."""
        return self.done + self.stopped + self.invalid

    @property
    def code(self) -> int:
        """The exit code: the worst of the points, of which an invalid one is worse than one that stopped."""
        if self.invalid:
            return INVALID
        return STOPPED if self.stopped else DONE

    def take(self, rows: Sequence[PointRow]) -> None:
        """Count these rows."""
        for row in rows:
            self.stopped += row.status == STOPPED
            self.invalid += row.status == INVALID
            if row.status == DONE:
                self.done += 1
                for results, value in zip(self._values.values(), row.results, strict=False):
                    results.append(value)

    def spreads(self) -> dict[str, Spread]:
        """The distribution of each result that has a number at any of the points that are done."""
        found: dict[str, Spread] = {}
        for name, results in self._values.items():
            values = np.array(results)
            values = values[~np.isnan(values)]
            if values.size:
                quantiles = np.percentile(values, PERCENTILES).tolist()
                found[name] = {
                    "count": int(values.size),
                    "mean": float(values.mean()),
                    "sd": float(values.std(ddof=1)) if values.size > 1 else 0.0,
                    "min": float(values.min()),
                    "max": float(values.max()),
                    "quantiles": {f"{p / 100:g}": x for p, x in zip(PERCENTILES, quantiles, strict=True)},
                }
        return found

    def sentence(self) -> str:
        """The outcome in words."""
        parts = [f"{self.done} done", f"{self.stopped} stopped", f"{self.invalid} invalid"]
        return f"{self.points} point{'s' * (self.points != 1)}: {', '.join(parts)}"

    def sentences(self) -> Iterator[str]:
        """The outcome, the workers that were lost, and how the results are distributed, in words."""
        yield self.sentence()
        if self.lost:
            times = "once" if self.lost == 1 else f"{self.lost} times"
            yield f"workers were ended by the system {times}; what they were computing has been computed again"
        for name, spread in self.spreads().items():
            quantiles = ", ".join(f"{100 * float(q):g} %: {x:.6g}" for q, x in spread["quantiles"].items())
            yield f"{name}: mean {spread['mean']:.6g}, standard deviation {spread['sd']:.3g}; {quantiles}"

    def as_json(self) -> dict[str, object]:
        """The object of `--json`."""
        counts: dict[str, object] = {
            "points": self.points, "done": self.done, "stopped": self.stopped, "invalid": self.invalid,
            "workers_lost": self.lost,
        }  # fmt: skip
        if self._values:
            counts["results"] = self.spreads()
        return counts
