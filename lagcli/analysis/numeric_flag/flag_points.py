"""The points that the flag of a block is looked for at: the start, and others that motions from it reach.

What holds at a generic point of the orbit holds at nearly all of it; a start is often special.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from lagcli.analysis.numeric_flag import undecided
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.analysis.numeric_flag.reachable import ReachablePlaces
from lagcli.compiled.row_block import RowBlock
from lagcli.equations.system import System
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

FLOWS = 2  # one after the other, each from the place before; of many rows one, which takes long
# A switch (abs, min, max, sign) that is this part of the size of the coordinates from zero stands on neither side.
ON_KINK = 1e-9


class Points:
    """The start and other points of its orbit, as places of one block; `places` that were met, the start first.

    Raises `undecided.Undecided` where the rows are not finite at the start.
    """

    def __init__(self, block: RowBlock, system: System, begin: State, deadline: float) -> None:
        size = float(np.abs(begin.q).max(initial=0.0)) or 1.0
        self.has_switches, block = (
            block.has_kinks,
            block.on_branch(variables(block, begin), begin.p, ON_KINK * size),
        )
        self._block, self._begin = block, begin
        self.start = EvaluationPoint(block, variables(block, begin), begin.p)
        if not self.start.is_finite:
            raise undecided.Undecided("the rows are not finite at the start")
        self.places = [self.start]
        self._orbit = ReachablePlaces(block, system.model.simulation.duration or 1.0, deadline)

    def generic(self) -> EvaluationPoint:
        """The place with the highest ranks; among equals the last, which is no special choice of anyone."""
        count = len(self._block.holonomic) + len(self._block.differential)
        if self.start.all.low < count or self.start.first < len(self.start.kept):
            self.walk()
        return max(enumerate(self.places), key=lambda one: (*one[1].ranks, one[1].first, one[0]))[1]

    def both_sides_turn(self) -> bool:
        """True if the brackets of two fields are as many as rows on both sides of a switch that the start lies on."""
        if not self._block.has_kinks:
            return True
        sides = (self._block.on_branch(self.start.x, self.start.p, math.inf, side) for side in (1.0, -1.0))
        places = [EvaluationPoint(block, self.start.x, self.start.p) for block in sides]
        return all(one.is_finite and one.first == len(one.kept) for one in places)

    def walk(self) -> list[EvaluationPoint]:
        """The start, and places on its orbit as far as flows lead."""
        count = 1 if self.start.rows.is_large else FLOWS
        while len(self.places) <= count:
            there = self._orbit.from_place(self.places[-1])
            if there is None:
                break
            self.places.append(there)
        return self.places

    def state(self, place: EvaluationPoint) -> State:
        """The state at a place; coordinates that are none of the block stay where they are."""
        n = len(self._block.columns)
        q = self._begin.q.copy()
        q[self._block.columns] = place.x[:n]
        t = float(place.x[n]) if self._block.has_time else self._begin.t
        return dataclasses.replace(self._begin, t=t, q=q)


def variables(block: RowBlock, point: State) -> Floats:
    """x (N,) of a state."""
    return np.append(point.q[block.columns], [point.t] if block.has_time else [])
