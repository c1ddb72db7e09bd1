"""The table of a sweep: its columns, and its rows on their way into a file of any format."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from lagcli.api.sweeps.point_task import PointRow
from lagcli.output.files import formats
from lagcli.output.tables import sinks

Floats = npt.NDArray[np.float64]

NUMBER, STATUS, MESSAGE, END = "point", "status", "message", "t_end"
SHARD = "shard_of"  # of the table of a shard alone: which sweep it is a part of, and of how many points
ROWS_AT_ONCE = 4096  # rows that are turned into a block: some megabytes


def columns(names: Sequence[str], results: Sequence[str], is_shard: bool = False) -> tuple[str, ...]:
    """The columns of a table. Raises `ValueError` for two of one name."""
    found = (NUMBER, *names, *results, STATUS, MESSAGE, END, *([SHARD] if is_shard else []))
    twice = [name for name in found if found.count(name) > 1] if len(set(found)) < len(found) else []
    if twice:
        raise ValueError(
            f"two columns would be called `{twice[0]}`; name the reductions with --reduce NAME=EXPR"
        )
    return found


def texts(fmt: str, names: Sequence[str]) -> tuple[str, ...]:
    """The columns that are written as text; where a file holds plain text whole numbers are, to have no point."""
    whole = (NUMBER, STATUS) if fmt in formats.PLAIN else ()
    return tuple(name for name in (*whole, MESSAGE, SHARD) if name in names)


class SweepTable:
    """Takes the rows of a sweep into a file or a stream; `shard`: the text of the column `SHARD`."""

    def __init__(
        self,
        target: Path | BinaryIO,
        names: Sequence[str],
        provenance: Mapping[str, object] | None,
        shard: str = "",
    ) -> None:
        fmt = formats.of(target, formats.TABLES) if isinstance(target, Path) else "csv"
        self._names, self._shard = tuple(names), shard
        self._texts = texts(fmt, names)
        self._sink = sinks.open_sink(target, names, provenance=provenance, texts=self._texts)

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
        block = np.array(
            [
                [row.number, *row.point, *row.results, row.status, np.nan, row.t_end, np.nan][
                    : len(self._names)
                ]
                for row in rows
            ]
        )
        numbers = [i for i, name in enumerate(self._names) if name not in self._texts]
        written = [cells[name] for name in self._names if name in self._texts]
        self._sink.write(block[:, numbers], written)

    def write_all(self, rows: Iterable[PointRow]) -> None:
        """All of these rows, in blocks."""
        waiting = iter(rows)
        while block := list(itertools.islice(waiting, ROWS_AT_ONCE)):
            self.write(block)

    def commit(self) -> None:
        """The table is complete. Raises OSError."""
        self._sink.commit(durably=True)

    def keep_partial(self) -> Path | None:
        """Keep the rows so far in FILE.partial, and return that path; None for a stream."""
        return self._sink.keep_partial()

    def discard(self) -> None:
        """Leave nothing behind."""
        self._sink.discard()
