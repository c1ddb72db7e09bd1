"""Where numbers are taken: the start, and points of the surface near it."""

from __future__ import annotations

from functools import cached_property

from lagcli import constraint_rows, walk
from lagcli.compile import NumericSystem, pattern
from lagcli.integrate.initial import State
from lagcli.mechanics.system import System

LATER = 0.01  # of the duration: how far points move on in time


class Places:
    """Points of the surface near the start, walked to when they are first asked for."""

    def __init__(self, system: System, numeric: NumericSystem, begin: State) -> None:
        self._system, self._numeric, self.begin = system, numeric, begin

    @cached_property
    def listed(self) -> list[State]:
        """The start first."""
        later = LATER * (self._system.model.simulation.duration or 1.0)
        moving = pattern.depends_on_time(self._system)
        rows = list(range(self._system.holonomic_count))
        if len(rows) > constraint_rows.DENSE:
            # A walk would take longer than all else; one point aside is found without it.
            return [self.begin]
        return walk.along(self._numeric, self.begin, rows, later if moving else 0.0)
