"""The case to classify: a system at a consistent state, its coupled rows, and what numbers say of it, each asked for
once.

Rows that share coordinates belong together; uncoupled groups are classified apart. A differential row takes part with
every coordinate it moves or depends on, a holonomic row with those of f. Time does not couple: whatever dt is, the
others can follow.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from lagcli.analysis.classification.verdict import Orbit
from lagcli.analysis.codimension.examine import connected
from lagcli.compiled import NumericSystem, row_block
from lagcli.equations.system import System
from lagcli.frozen import frozen_value
from lagcli.start.initial import State

if TYPE_CHECKING:
    from lagcli.analysis.numeric_flag import NumericFlag


@frozen_value
class CoupledGroup:
    """Numbers of coupled rows: the differential ones, and the holonomic ones that share coordinates with them."""

    differential: tuple[int, ...]
    holonomic: tuple[int, ...]

    @property
    def rows(self) -> tuple[int, ...]:
        """All of them, in their order."""
        return (*self.holonomic, *self.differential)


class Case:
    """A system at its start `begin`: the groups of its rows, and the numeric flags."""

    def __init__(self, system: System, numeric: NumericSystem, begin: State) -> None:
        self.system, self.numeric, self.begin = system, numeric, begin
        self._flags: dict[CoupledGroup, NumericFlag] = {}

    @cached_property
    def groups(self) -> tuple[CoupledGroup, ...]:
        """The groups that hold differential rows, in the order of their first ones."""
        count, s = len(self.system.rows.rows), self.system.holonomic_count
        if s == count:
            return ()
        # Rows and coordinates are the nodes of a graph; a pair joins its row to its coordinate.
        pairs = zip(*(found.tolist() for found in row_block.coordinates(self.system)), strict=True)
        joined = ((row, count + k) for row, k in pairs)
        found = []
        for part in connected([*((row,) for row in range(count)), *joined]):
            rows = [row for row in part if row < count]
            differential = tuple(row for row in rows if row >= s)
            if differential:
                found.append(CoupledGroup(differential, tuple(row for row in rows if row < s)))
        return tuple(sorted(found, key=lambda group: group.differential))

    def orbits(self, deadline: float) -> tuple[Orbit, ...]:
        """The groups whose motions from the start can be followed before a deadline of `progress.after`."""
        flags = [(group, self.flag(group, deadline)) for group in self.groups]
        return tuple(
            Orbit(group.rows, found.states)
            for group, found in flags
            if found.is_certain and len(found.states) > 1
        )

    def flag(self, group: CoupledGroup, deadline: float) -> NumericFlag:
        """The flag of a group by numbers; `deadline`: of `progress.after`."""
        # Loaded here and not above: models without differential rows need none of it.
        from lagcli.analysis import numeric_flag

        known = self._flags.get(group)
        if known is None or not known.is_certain:
            known = self._flags[group] = numeric_flag.flag(self.system, self.begin, group.rows, deadline)
        return known
