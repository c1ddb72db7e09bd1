"""A system with its functions, and what was found out about it."""

from __future__ import annotations

from typing import Literal

from lagcli import compiled
from lagcli.api import known_integrals
from lagcli.equations import system, time_functions
from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.simulation.scheme import invariants
from lagcli.start import known_starts

Integrals = known_integrals.Integrals


class CompiledModel:
    """A system with its functions, also with integrals held. What it keeps changes no answer."""

    def __init__(self, built: system.System, functions: invariants.RunFunctions | None = None) -> None:
        self.system = built
        self.functions = functions or invariants.RunFunctions(compiled.NumericSystem(built))
        self._integrals: dict[Integrals, invariants.Integrals] = {}
        self._searches: known_integrals.KnownSearches | None = None
        self._starts: known_starts.KnownStarts | None = None
        self._timed: time_functions.TimeFunctions | Literal[False] | None = False  # where nobody has asked

    @property
    def numeric(self) -> compiled.NumericSystem:
        """The functions of the system by itself."""
        return self.functions.numeric

    def integrals(self, found: Integrals) -> invariants.Integrals:
        """These integrals with their functions, built anew where a value is built in that has changed."""
        known = self._integrals.get(found)
        if known is None or not known.hold_for(self.system):
            known = self._integrals[found] = invariants.Integrals(self.system, self.functions, found)
        elif known.system is not self.system:  # whose start, values and restitutions a run reads
            known = self._integrals[found] = known.of(self.system)
        return known

    def with_values(self, model: Model) -> CompiledModel | None:
        """These functions for other values of parameters and start, or None where they do not fit."""
        moved = system.with_values(self.system, model)
        if moved is None:
            return None
        same = CompiledModel(moved, self.functions)
        same._integrals, same._searches, same._starts = self._integrals, self._searches, self._starts
        if self._timed is None or model.parameters == self.system.model.parameters:
            same._timed = self._timed
        return same

    @property
    def starts(self) -> known_starts.KnownStarts:
        """The consistent starts that are known."""
        if self._starts is None:
            self._starts = known_starts.KnownStarts(self.system)
        return self._starts

    def timed(self) -> time_functions.TimeFunctions | None:
        """The functions of t; another run of the same model asks for no others."""
        if self._timed is False:
            self._timed = time_functions.functions(self.system.model)
        return self._timed

    def first_integrals(self, limit: float = settings.LIMIT) -> known_integrals.KnownIntegrals:
        """The first integrals of the differential rows as far as they are found in `limit` seconds.

        Another run with the same values, or with others that the rows do not hold, asks for no other search.
        """
        if not self.system.model.differential:
            return known_integrals.KnownIntegrals()
        if self._searches is None:
            self._searches = known_integrals.KnownSearches(self.system)
        return self._searches.search(self.system, self.numeric, limit)
