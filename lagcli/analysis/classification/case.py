"""The case to classify: a system at a consistent state, and what numbers say of it, each asked for once."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from lagcli.analysis.classification import coupling
from lagcli.analysis.classification.coupling import CoupledGroup
from lagcli.analysis.codimension.redundancy import Orbit
from lagcli.compiled import NumericSystem, pattern
from lagcli.equations.system import System
from lagcli.start.initial import State

if TYPE_CHECKING:
    from lagcli.analysis.numeric_flag import NumericFlag


class Case:
    """A system at its start `begin`: the groups of its rows, and the numeric flags."""

    def __init__(self, system: System, numeric: NumericSystem, begin: State) -> None:
        self.system, self.numeric, self.begin = system, numeric, begin
        self._flags: dict[CoupledGroup, NumericFlag] = {}

    @cached_property
    def groups(self) -> tuple[CoupledGroup, ...]:
        """The groups that hold differential rows."""
        return coupling.groups(self.system)

    @cached_property
    def depends_on_time(self) -> bool:
        """True if time is a coordinate of the forms."""
        return pattern.depends_on_time(self.system)

    @property
    def orbits(self) -> tuple[Orbit, ...]:
        """The groups whose motions from the start were followed."""
        return tuple(
            Orbit(group.rows, found.places)
            for group, found in self._flags.items()
            if found.is_certain and len(found.places) > 1
        )

    def flag(self, group: CoupledGroup, deadline: float) -> NumericFlag:
        """The flag of a group by numbers; `deadline`: a value of `time.monotonic`."""
        # Loaded here and not above: models without differential rows need none of it.
        from lagcli.analysis import numeric_flag

        known = self._flags.get(group)
        if known is None or not known.is_certain:
            known = self._flags[group] = numeric_flag.flag(self.system, self.begin, group.rows, deadline)
        return known
