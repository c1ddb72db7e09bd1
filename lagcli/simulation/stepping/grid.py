"""The times of the rows of the table."""

from __future__ import annotations

import dataclasses
import math

from lagcli.model.model import Simulation

# A last interval shorter than this part of the step is rounding, and no interval.
ROUNDING = 1e-9


@dataclasses.dataclass(frozen=True, slots=True)
class Grid:
    """Rows at start + i step for i < count - 1, and at the end exactly."""

    start: float
    end: float
    step: float
    count: int

    def time(self, i: int) -> float:
        """Time of row i; infinite after the last."""
        if i >= self.count - 1:
            return self.end if i == self.count - 1 else math.inf
        return self.start + i * self.step

    def after(self, t: float) -> int:
        """The first row that stands after t, by more than rounding."""
        return self.first(math.nextafter(t + ROUNDING * self.step, math.inf))

    def first(self, t: float) -> int:
        """The first row at t or after it; `count` where there is none."""
        if t > self.end:
            return self.count
        i = max(0, min(self.count, math.floor((t - self.start) / self.step) - 1)) if self.step else 0
        while self.time(i) < t:
            i += 1
        return i


def origin(settings: Simulation, has_time: bool) -> float:
    """The time from which a run counts: its start where no t occurs in what moves the model, else 0.

    Time counted from the start has the same roundings at every start.
    """
    return 0.0 if has_time else settings.start


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
    divides = abs(whole * step - duration) <= ROUNDING * step
    return Grid(start, end, step, whole + (1 if divides and whole else 2))
