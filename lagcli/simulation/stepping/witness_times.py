"""Times within a step at which the forces are held against what the step was made of.

A step is made of the forces at its stages. Where a model says more about t than a timetable can hold, the rows of the
table are witnesses: there y' of the dense output must be that of the equations, or the step has led over something that
no stage saw.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from lagcli.equations.time_functions import TimeFunctions
from lagcli.simulation.stepping.grid import Grid

# Where t stands in a function together with coordinates, nothing is known beforehand, and there are as many witnesses
# for each row.
MORE = 4
# The repeated run of an error estimate has at least LEAST for each row, and others between rows than the first one, at
# this part of their distance.
LEAST, SHIFT = 2, 0.37
# Closer to the begin of a step than so many roundings of the time there is no witness.
ASIDE = 2**14


class Witnesses:
    """The times of the rows of a grid, and others between them at equal distances, as far as a model needs them.

    is_again: for a run that repeats another.
    """

    def __init__(self, grid: Grid, functions: TimeFunctions | None, is_again: bool = False) -> None:
        self._grid, self._parts, self._shift = grid, 0, SHIFT if is_again else 0.0
        if functions is not None:
            self._parts = MORE if functions.is_mixed else 0 if functions.is_bounded else 1
            if is_again:
                self._parts = max(LEAST, 2 * self._parts + 1)

    @property
    def is_any(self) -> bool:
        """True if there are any at all."""
        return self._parts > 0

    def inside(self, t: float, reached: float) -> Iterator[float]:
        """Those strictly between two times."""
        grid, parts = self._grid, self._parts
        if not parts or not grid.step:
            return
        after = t + ASIDE * math.ulp(t)
        row = max(0, grid.first(after) - 1)
        while (begin := grid.time(row)) < reached:
            length = min(grid.time(row + 1), grid.end) - begin
            for part in range(parts):
                at = begin + length * (part + self._shift * bool(part)) / parts
                if after < at < reached:
                    yield at
            row += 1
