"""The times within a step at which it is compared with the equations, for its stages may have missed a force: those of
rows, and where functions of place are narrow."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.stepping.grid import OFFSET, Grid, Witnesses

if TYPE_CHECKING:
    # Most models have no narrow functions.
    from lagcli.simulation.stepping.narrow_places import NarrowPlaces

Floats = npt.NDArray[np.float64]


class ComparedTimes:
    """Those of a run with the functions that it has now; times are counted from its `origin`; is_any: it has witnesses,
    without which no step is compared."""

    def __init__(self, bound: BoundStep, grid: Grid, origin: float, witnesses: Witnesses) -> None:
        self._grid, self.origin, self._witnesses = grid, origin, witnesses
        self.is_any = witnesses.is_any
        self._places = _narrow_places(bound)

    def within(
        self, t: float, reached: float, dense: Callable[[], Callable[[float], Floats]], is_growing: bool
    ) -> Iterator[float]:
        """The times within a step between two times; dense() gives its states (2n + 1,) at parts of it; is_growing: as
        `Witnesses.inside` takes it."""
        yield from self._witnesses.inside(t, reached, is_growing)
        if self._places is None or not self._places.are_passed(self.origin + t):
            return
        taken = reached - t
        for x in self._places.within(dense(), min(1.0, (self._grid.end - t) / taken)):
            at = t + x * taken
            if t + OFFSET * math.ulp(t) < at < reached:
                yield at


def _narrow_places(bound: BoundStep) -> NarrowPlaces | None:
    arguments = bound.enforced.plain.functions.numeric.narrow_arguments
    if arguments is None:
        return None
    from lagcli.simulation.stepping.narrow_places import NarrowPlaces

    return NarrowPlaces(arguments, bound)
