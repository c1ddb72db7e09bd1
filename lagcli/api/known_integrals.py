"""The first integrals of the differential rows, as far as they are found in a time."""

from __future__ import annotations

import dataclasses

from lagcli import progress
from lagcli.analysis import redundancy
from lagcli.analysis.classification import classify, hidden_conditions, unenforced
from lagcli.analysis.classification.case import Case
from lagcli.analysis.classification.verdict import Condition
from lagcli.compiled import NumericSystem
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.model import invariant
from lagcli.start import sample_points

Integrals = tuple[invariant.FirstIntegral, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class KnownIntegrals:
    """First integrals of the differential rows, notes on those that are not known, and the hidden conditions."""

    integrals: Integrals = ()
    notes: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    orbits: tuple[redundancy.Orbit, ...] = ()


def search(built: system.System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    """The integrals found in `limit` seconds. Where numbers show that there are none, no algebra is asked."""
    try:
        case = _case(built, numeric)
        if classify.certainly_nonholonomic(case):
            return KnownIntegrals(orbits=case.orbits)
    except diagnostics.ModelError as error:
        if not hidden_conditions.is_conflict(error):
            raise
    whole = hidden_conditions.classified(built, numeric, limit)
    orbits = whole.case.orbits if not whole.conditions else ()
    return KnownIntegrals(whole.found.integrals, unenforced.notes(whole.found), whole.conditions, orbits)


@progress.phase("looking for a consistent start")
def _case(built: system.System, numeric: NumericSystem) -> Case:
    """The system at the consistent state nearest to its start. Raises `diagnostics.ModelError`."""
    return Case(built, numeric, sample_points.begin(built, numeric))
