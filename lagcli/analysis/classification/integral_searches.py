"""Searches for the first integrals of differential rows, as far as they are found in a time."""

from __future__ import annotations

import dataclasses
from collections import OrderedDict

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.analysis.classification import classify, hidden_conditions, unenforced
from lagcli.analysis.classification.case import Case
from lagcli.analysis.classification.known_integrals import KnownIntegrals
from lagcli.analysis.codimension import redundancy
from lagcli.compiled import NumericSystem
from lagcli.equations import row_parameters, system
from lagcli.errors import diagnostics
from lagcli.start import sample_points

Floats = npt.NDArray[np.float64]


class KnownSearches:
    """Findings of searches for some values, kept for others that rows and consistent start do not tell apart.

    A search looks at the rows, at the consistent state nearest to the start, and at the duration of the run, and at
    nothing else: masses and forces that rows do not hold have no part in it.
    """

    MOST = 64  # that are kept: the inner one of two loops over values comes again for each value of the outer

    def __init__(self, built: system.System) -> None:
        self._places = row_parameters.of_rows(built)
        self._found: OrderedDict[tuple[object, ...], KnownIntegrals] = OrderedDict()

    def search(self, built: system.System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
        """The integrals found in `limit` seconds. Where numbers show that there are none, no algebra is asked."""
        try:
            case = _case(built, numeric)
        except diagnostics.ModelError as error:
            if not hidden_conditions.is_conflict(error):
                raise
            return _classified(built, numeric, limit)
        begin = case.begin
        parts = begin.q.tobytes(), begin.v.tobytes(), begin.p[self._places].tobytes()
        model = built.model
        key = (begin.t, *parts, row_parameters.formulas(model), model.simulation.duration, limit)
        known = self._found.get(key)
        if known is not None:
            return dataclasses.replace(known, orbits=_at(known.orbits, begin.p))
        found = _searched(case, built, numeric, limit)
        if not found.conditions:  # those are looked for at other states too
            self._found[key] = found
            while len(self._found) > self.MOST:
                self._found.popitem(last=False)
        return found


def _at(orbits: tuple[redundancy.Orbit, ...], p: Floats) -> tuple[redundancy.Orbit, ...]:
    """The orbits with other numbers, of which the rows hold none."""
    return tuple(
        dataclasses.replace(one, places=tuple(dataclasses.replace(place, p=p) for place in one.places))
        for one in orbits
    )


def _searched(case: Case, built: system.System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    try:
        if classify.certainly_nonholonomic(case):
            return KnownIntegrals(orbits=case.orbits)
    except diagnostics.ModelError as error:
        if not hidden_conditions.is_conflict(error):
            raise
    return _classified(built, numeric, limit)


def _classified(built: system.System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    whole = hidden_conditions.classified(built, numeric, limit)
    orbits = whole.case.orbits if not whole.conditions else ()
    return KnownIntegrals(whole.found.integrals, unenforced.notes(whole.found), whole.conditions, orbits)


@progress.phase("looking for a consistent start")
def _case(built: system.System, numeric: NumericSystem) -> Case:
    """The system at the consistent state nearest to its start. Raises `diagnostics.ModelError`."""
    return Case(built, numeric, sample_points.begin(built, numeric))
