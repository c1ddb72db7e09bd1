"""The account of a sweep: how many points ended how, and, of drawn points, how their results are distributed."""

from __future__ import annotations

import array
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lagcli.output.sweeps.sweep_table import DONE, INVALID, STOPPED, PointRow

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


class SweepEnding(NamedTuple):
    """The end of a sweep, whose rows are written: the exit code, sentences to tell, and the account as JSON, where that
    is asked for."""

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
            self.done += row.status == DONE
            self.stopped += row.status == STOPPED
            self.invalid += row.status == INVALID
            if row.status == DONE:
                for results, value in zip(self._values.values(), row.results, strict=False):
                    results.append(value)

    def spreads(self) -> dict[str, Spread]:
        """The distribution of each result that has a number at any point."""
        found = {}
        for name, results in self._values.items():
            values = np.array(results)
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

    def sentences(self) -> Iterator[str]:
        """The outcome, the workers that were lost, and how the results are distributed, in words."""
        yield self.sentence()
        if self.lost:
            times = "once" if self.lost == 1 else f"{self.lost} times"
            yield f"workers were ended by the system {times}; what they were computing has been computed again"
        for name, spread in self.spreads().items():
            quantiles = zip(QUANTILES, spread.quantiles, strict=True)
            quantile_text = ", ".join(f"{100 * q:g} %: {value:.6g}" for q, value in quantiles)
            yield f"{name}: mean {spread.mean:.6g}, standard deviation {spread.sd:.3g}; {quantile_text}"

    def as_json(self) -> dict[str, object]:
        """The object of `--json`."""
        counts: dict[str, object] = {
            "points": self.points, "done": self.done, "stopped": self.stopped, "invalid": self.invalid,
            "workers_lost": self.lost,
        }  # fmt: skip
        if self._values:
            counts["results"] = {name: spread.as_json() for name, spread in self.spreads().items()}
        return counts
