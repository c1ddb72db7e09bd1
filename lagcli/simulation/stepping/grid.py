"""The times of the rows of the table."""

from __future__ import annotations

import math
from collections.abc import Iterator

from lagcli import doubles
from lagcli.frozen import frozen_value
from lagcli.model.settings import Simulation
from lagcli.smoothness.time_functions import TimeFunctions

# Where t stands in a function together with coordinates, or a function of place may be narrow, nothing is known
# beforehand, and there are as many witnesses for each row. A step over as many rows has stages no farther apart than
# two rows are, about: without t it needs none.
MORE = 4
# The repeated run of an error estimate has at least LEAST for each row, and others between rows than the first one, at
# this part of their distance.
LEAST, SHIFT = 2, 0.37
# Closer to the begin of a step than so many roundings of the time there is no witness.
OFFSET = 2**14
# Roundings of time within which an incident is at a row, or at the end of the run.
AT_END = 8.0


@frozen_value
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
        return self.first(math.nextafter(t + doubles.ZERO * self.step, math.inf))

    def is_rounding(self, interval: float, t: float) -> bool:
        """True if an interval that ends at the time t, as the table shows it, is rounding, and no interval.

        That of the time is more than `doubles.ZERO` of a step for fine rows at a late time.
        """
        return interval <= max(doubles.ZERO * self.step, math.ulp(t))

    def first(self, t: float) -> int:
        """The first row at t or after it; `count` where there is none."""
        if t > self.end:
            return self.count
        i = max(0, min(self.count, math.floor((t - self.start) / self.step) - 1)) if self.step else 0
        while self.time(i) < t:
            i += 1
        return i


def of_run(settings: Simulation, origin: float = 0.0) -> Grid:
    """The grid of a run, counted from an origin; a duration of zero is the start alone."""
    start, duration = settings.start - origin, settings.duration
    end = start + duration
    if duration == 0.0:
        return Grid(start, start, 0.0, 1)
    if settings.output_step is None:
        return Grid(start, end, duration / (settings.samples - 1), settings.samples)
    step = settings.output_step
    whole = math.floor(duration / step * (1 + 1e-12))
    divides = abs(whole * step - duration) <= doubles.ZERO * step
    return Grid(start, end, step, whole + (1 if divides and whole else 2))


class Witnesses:
    """The times of the rows of a grid, and others between them at equal distances, as far as a model needs them.

    is_again: for a run that repeats another.
    """

    def __init__(self, grid: Grid, functions: TimeFunctions | None, is_again: bool = False) -> None:
        self._grid, self._shift, self._is_again = grid, SHIFT if is_again else 0.0, is_again
        self._has_time, self._of_time = functions is not None, 0
        if functions is not None:
            self._of_time = MORE if functions.is_mixed else 0 if functions.is_bounded else 1
        self.choose(False)

    def choose(self, has_narrow: bool) -> None:
        """Take as many as are needed from now on; has_narrow: where a function of place may be narrow."""
        parts = MORE if has_narrow else self._of_time
        is_asked = parts > 0 or self._has_time
        self._parts = max(LEAST, 2 * parts + 1) if self._is_again and is_asked else parts
        self._longest = 0.0 if self._of_time or self._is_again else MORE * self._grid.step

    @property
    def is_any(self) -> bool:
        """True if there are any at all."""
        return self._parts > 0

    def inside(self, t: float, reached: float, is_growing: bool = False) -> Iterator[float]:
        """The times of rows strictly between two times, none where the stages of a step between them are witnesses.

        is_growing: the step is far shorter than its error lets it be: no force has set its length.
        """
        grid, parts = self._grid, self._parts
        longest = min(self._longest, grid.step) if is_growing else self._longest
        if not parts or not grid.step or reached - t <= longest:
            return
        after = t + OFFSET * math.ulp(t)
        row = max(0, grid.first(after) - 1)
        while (begin := grid.time(row)) < reached:
            length = min(grid.time(row + 1), grid.end) - begin
            for part in range(parts):
                at = begin + length * (part + self._shift * bool(part)) / parts
                if after < at < reached:
                    yield at
            row += 1
