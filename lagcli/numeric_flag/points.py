"""The points that the flag of a block is looked for at: the start, others of the surface, one of its own.

What holds at a generic point holds at nearly all; a start is often special.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.compile.block import Block
from lagcli.constraint_rows import MetricRows
from lagcli.integrate.initial import State
from lagcli.mechanics.system import System
from lagcli.metric import Metric
from lagcli.numeric_flag import doubt
from lagcli.numeric_flag.place import Place

Floats = npt.NDArray[np.float64]

# How far the own point lies from the best of the others, in parts of its size and of the duration.
STEP, LATER, STEPS, SHORTER, FACTOR = 0.1, 0.01, 10, 8, 4
# Newton's steps must become shorter by this.
CONTRACTS = 0.9
# Where Newton's steps have reached rounding, in parts of the size.
MET, STALLED = 1e-13, 1e-9
SEED = 20062


class Points:
    """The start and other points of the surface, as places of one block.

    Raises `doubt.Undecided` where the rows are not finite at the start.
    """

    def __init__(self, block: Block, system: System, points: Sequence[State], deadline: float) -> None:
        self._block, self._deadline = block, deadline
        self._duration = system.model.simulation.duration or 1.0
        places = [Place(block, _variables(block, point), point.p) for point in points]
        if not places[0].is_finite:
            raise doubt.Undecided("the rows are not finite at the start")
        self.start, self._places = places[0], [place for place in places if place.is_finite]

    def generic(self) -> Place:
        """The place with the highest ranks; among equals the last, which is no special choice of anyone."""
        count = len(self._block.holonomic) + len(self._block.differential)
        best = self._best()
        is_open = best.all.low < count or best.first < len(best.kept)
        # A start is often special, and so may be its time.
        if is_open and (best is self.start or self._block.has_time):
            aside = self._aside(best)
            if aside is not None:
                self._places.append(aside)
                best = self._best()
        return best

    def _best(self) -> Place:
        keys = [(*place.ranks, place.first, k) for k, place in enumerate(self._places)]
        return self._places[max(keys)[-1]]

    def _aside(self, place: Place) -> Place | None:
        """A random point of the surface near a place, later in time where that is a variable, or None."""
        block, n, s = self._block, len(self._block.columns), len(self._block.holonomic)
        random = np.random.default_rng(SEED)
        size = float(np.abs(place.x[:n]).max(initial=0.0)) or 1.0
        rows = place.plain[:s, :n]
        u = random.standard_normal(n)
        u = u + MetricRows(rows, Metric.unit(n)).correction(np.array(rows @ u).ravel())
        step = np.zeros(block.size)
        step[:n] = STEP * size * u / (np.abs(u).max(initial=0.0) or 1.0)
        step[n:] = LATER * self._duration * random.random()
        for k in range(SHORTER):
            doubt.require_time(self._deadline)
            there = _met(block, place.x + step / FACTOR**k, place.p, size)
            if there is not None:
                return there
        return None


def _variables(block: Block, point: State) -> Floats:
    """x (N,) of a state."""
    return np.append(point.q[block.columns], [point.t] if block.has_time else [])


def _met(block: Block, x: Floats, p: Floats, size: float) -> Place | None:
    """The place on f = 0 that a few Newton steps in the coordinates reach from x, or None; size: that of x."""
    n, s = len(block.columns), len(block.holonomic)
    before = math.inf
    for _ in range(STEPS):
        A, f = block.rows(x, p)
        if not (np.isfinite(A.nonzeros()).all() and np.isfinite(f.nonzeros()).all()):
            return None
        step = MetricRows(A[:s, :n], Metric.unit(n)).correction(np.array(f).ravel())
        length = float(np.abs(step).max(initial=0.0))
        # Of many rows the last steps end at a rounding of their own.
        if length <= MET * size or before <= length <= STALLED * size:
            return Place(block, x, p)
        if not length < before * CONTRACTS:
            return None
        x, before = np.append(x[:n] + step, x[n:]), length
    return None
