"""The times of the rows of the table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.frozen import frozen_value
from lagcli.model.settings import Simulation
from lagcli.smoothness.time_functions import TimeFunctions

if TYPE_CHECKING:
    from lagcli.simulation.scheme.bound_scheme import BoundStep
    from lagcli.simulation.stepping.narrow_places import NarrowPlaces

# Parts of a step (k,) -> its states (2n + 1, k).
Dense = Callable[[npt.NDArray[np.float64] | float], npt.NDArray[np.float64]]

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
        """True if an interval that ends at the time t, as the table shows it, is rounding, and no interval. That of the
        time is more than `doubles.ZERO` of a step for fine rows at a late time."""
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
    """The times at which steps are compared with the equations: rows of a grid, others between them at equal distances,
    as far as a model needs them, and where its narrow functions are passed; the grid is counted from `origin`.
    is_again: for a run that repeats another; is_any: there are any at all."""

    def __init__(
        self, grid: Grid, functions: TimeFunctions | None, origin: float = 0.0, is_again: bool = False
    ) -> None:
        self._grid, self._shift, self._is_again = grid, SHIFT if is_again else 0.0, is_again
        self.origin = origin
        self._places: NarrowPlaces | None = None
        self._has_time, self._of_time = functions is not None, 0
        if functions is not None:
            self._of_time = MORE if functions.is_mixed else 0 if functions.is_bounded else 1

    def bind(self, bound: BoundStep) -> None:
        """Take as many as are needed from now on, with the functions of a run."""
        parts = MORE if bound.numeric.has_narrow_functions else self._of_time
        is_asked = parts > 0 or self._has_time
        self._parts = max(LEAST, 2 * parts + 1) if self._is_again and is_asked else parts
        self._longest = 0.0 if self._of_time or self._is_again else MORE * self._grid.step
        self.is_any = self._parts > 0
        arguments, self._places = bound.enforced.plain.functions.numeric.narrow_arguments, None
        if arguments is not None:
            from lagcli.simulation.stepping.narrow_places import NarrowPlaces

            self._places = NarrowPlaces(arguments, bound)

    def within(
        self, t: float, reached: float, dense: Callable[[], Dense], is_growing: bool
    ) -> Iterator[float]:
        """The times within a step between two times; dense() gives its states (2n + 1, k) at parts (k,) of it;
        is_growing: the step is far shorter than its error lets it be, for no force has set its length."""
        yield from self._inside(t, reached, is_growing)
        if self._places is None or not self._places.are_passed(self.origin + t):
            return
        taken, states = reached - t, dense()
        for x in self._places.within(lambda x: states(x).ravel(), min(1.0, (self._grid.end - t) / taken)):
            at = t + x * taken
            if t + OFFSET * math.ulp(t) < at < reached:
                yield at

    def _inside(self, t: float, reached: float, is_growing: bool) -> Iterator[float]:
        """The times of rows strictly between two times, none where the stages of a step between them are witnesses."""
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
