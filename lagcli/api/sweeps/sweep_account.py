"""The account of a sweep: how many points ended how, and, of drawn points, how their results are distributed."""

from __future__ import annotations

import array
import dataclasses
from collections.abc import Sequence

import numpy as np

from lagcli.api.sweeps import point_task
from lagcli.api.sweeps.point_task import PointRow

# Of each result: its middle, its middle half, and nine tenths of it.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclasses.dataclass(frozen=True, slots=True)
class Spread:
    """The distribution of a result over the points that are done: their number, mean, standard deviation (of a sample),
    quantiles in the order of `QUANTILES`, least and largest."""

    count: int
    mean: float
    sd: float
    quantiles: tuple[float, ...]
    least: float
    largest: float

    def as_json(self) -> dict[str, object]:
        """The object of `--json`."""
        quantiles = {f"{q:g}": value for q, value in zip(QUANTILES, self.quantiles, strict=True)}
        ends = {"min": self.least, "max": self.largest}
        return {"count": self.count, "mean": self.mean, "sd": self.sd, **ends, "quantiles": quantiles}


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
            return point_task.INVALID
        return point_task.STOPPED if self.stopped else point_task.DONE

    def take(self, rows: Sequence[PointRow]) -> None:
        """Count these rows."""
        for row in rows:
            self.done += row.status == point_task.DONE
            self.stopped += row.status == point_task.STOPPED
            self.invalid += row.status == point_task.INVALID
            if row.status == point_task.DONE:
                for kept, value in zip(self._values.values(), row.results, strict=False):
                    kept.append(value)

    def spreads(self) -> dict[str, Spread]:
        """The distribution of each result that has a number at any point."""
        found = {}
        for name, kept in self._values.items():
            values = np.array(kept)
            values = values[~np.isnan(values)]
            if values.size:
                sd = float(values.std(ddof=1)) if values.size > 1 else 0.0
                quantiles = tuple(np.quantile(values, QUANTILES).tolist())
                ends = float(values.min()), float(values.max())
                found[name] = Spread(int(values.size), float(values.mean()), sd, quantiles, *ends)
        return found

    def sentence(self) -> str:
        """The outcome in words."""
        parts = [f"{self.done} done", f"{self.stopped} stopped", f"{self.invalid} invalid"]
        return f"{self.points} point{'s' * (self.points != 1)}: {', '.join(parts)}"

    def of_workers(self) -> str:
        """The workers that were lost, in words."""
        times = "once" if self.lost == 1 else f"{self.lost} times"
        return f"workers were ended by the system {times}; what they were computing has been computed again"

    def as_json(self) -> dict[str, object]:
        """The object of `--json`."""
        counts: dict[str, object] = {
            "points": self.points, "done": self.done, "stopped": self.stopped, "invalid": self.invalid,
            "workers_lost": self.lost,
        }  # fmt: skip
        if self._values:
            counts["results"] = {name: spread.as_json() for name, spread in self.spreads().items()}
        return counts
