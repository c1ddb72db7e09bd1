"""Where the rows of the table stand in time."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from lagcli.model import Simulation


@dataclasses.dataclass(frozen=True, slots=True)
class Grid:
    """Rows at start + i step for i < count - 1, and at the end exactly."""

    start: float
    end: float
    step: float
    count: int

    def time(self, i: int) -> float:
        """Time of row i."""
        return self.end if i == self.count - 1 else self.start + i * self.step

    def times(self, first: int, after: int) -> npt.NDArray[np.float64]:
        """Times of rows first <= i < after."""
        t: npt.NDArray[np.float64] = self.start + np.arange(first, after, dtype=np.float64) * self.step
        if after == self.count and t.size:
            t[-1] = self.end
        return t


def grid(settings: Simulation) -> Grid:
    """The grid of a run; a duration of zero is the start alone."""
    start, duration = settings.start, settings.duration
    end = start + duration
    if duration == 0.0:
        return Grid(start, start, 0.0, 1)
    if settings.output_step is None:
        return Grid(start, end, duration / (settings.samples - 1), settings.samples)
    step = settings.output_step
    whole = math.floor(duration / step * (1 + 1e-12))
    # A last interval that is rounding only is no interval: the last row stands at the end.
    divides = abs(whole * step - duration) <= 1e-9 * step
    return Grid(start, end, step, whole + (1 if divides and whole else 2))
