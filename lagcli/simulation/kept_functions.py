"""The functions that runs of one text keep for one another: they change no answer, and save building them again."""

from __future__ import annotations

import dataclasses

from lagcli.compiled import NumericSystem
from lagcli.equations import time_functions, total_columns
from lagcli.equations.system import System
from lagcli.model.invariant import FirstIntegral
from lagcli.model.model import Model, Parameter
from lagcli.simulation.scheme import invariants

Found = tuple[FirstIntegral, ...]


@dataclasses.dataclass(slots=True, eq=False)
class KeptFunctions:
    """Steps by method, first integrals with their charts, and the functions of t, each built when a run asks for it."""

    numeric: NumericSystem
    _plain: invariants.RunFunctions | None = None
    _integrals: dict[Found, invariants.Integrals] = dataclasses.field(default_factory=dict)
    _totals: dict[tuple[tuple[str, float], ...], bool] = dataclasses.field(default_factory=dict)
    _timed: tuple[tuple[Parameter, ...], time_functions.TimeFunctions | None] | None = None

    @property
    def plain(self) -> invariants.RunFunctions:
        """The functions of the system by itself."""
        if self._plain is None:
            self._plain = invariants.RunFunctions(self.numeric)
        return self._plain

    def integrals(self, system: System, found: Found) -> invariants.Integrals:
        """These integrals with their functions, built anew where a value is built in that has changed."""
        known = self._integrals.get(found)
        if known is None or not known.hold_for(system):
            known = self._integrals[found] = invariants.Integrals(system, self.plain, found)
        elif known.system is not system:  # whose start, values and restitutions a run reads
            known = self._integrals[found] = known.of(system)
        return known

    def has_total_columns(self, system: System) -> bool:
        """See `total_columns.are_all`."""
        if system.built_in not in self._totals:
            self._totals[system.built_in] = total_columns.are_all(system)
        return self._totals[system.built_in]

    def timed(self, model: Model) -> time_functions.TimeFunctions | None:
        """The functions of t alone, None where the model has none, whatever its parameters are."""
        known = self._timed
        if known is None or (known[1] is not None and known[0] != model.parameters):
            known = self._timed = model.parameters, time_functions.functions(model)
        return known[1]
