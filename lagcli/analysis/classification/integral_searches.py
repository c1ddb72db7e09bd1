"""Searches for the first integrals of differential rows, as far as they are found in a time, with notes on those that
are unknown and therefore not enforced."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.analysis.classification import classify
from lagcli.analysis.classification.case import Case
from lagcli.analysis.classification.known_integrals import KnownIntegrals, Orbit
from lagcli.analysis.classification.verdict import Classification
from lagcli.compiled import NumericSystem
from lagcli.equations import row_parameters, system
from lagcli.errors import diagnostics
from lagcli.start import sample_points

Floats = npt.NDArray[np.float64]

MOST_NAMES = 4  # more rows are counted and not named


def search(built: system.System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    """The first integrals of the differential rows as far as they are found in `limit` seconds. Where numbers show that
    there are none, no algebra is asked.

    A search looks at the rows, at the consistent state nearest to the start, and at the duration of the run, and at
    nothing else: other masses and forces that rows do not hold ask for no other search.
    """
    try:
        case = _case(built, numeric)
    except diagnostics.ModelError as error:
        if not classify.is_conflict(error):
            raise
        return _classified(built, numeric, limit)
    begin, model = case.begin, built.model
    held = numeric.memory.answer("parameters of rows", lambda: row_parameters.of_rows(built))
    parts = begin.q.tobytes(), begin.v.tobytes(), begin.p[held].tobytes()
    question = ("search", begin.t, *parts, row_parameters.formulas(model), model.simulation.duration, limit)
    found = numeric.memory.known(question)
    if not isinstance(found, KnownIntegrals):
        found = _searched(case, built, numeric, limit)
        if not found.conditions:  # those are looked for at other states too
            numeric.memory.keep(question, found)
    return dataclasses.replace(found, orbits=_at(found.orbits, begin.p))


def _at(orbits: tuple[Orbit, ...], p: Floats) -> tuple[Orbit, ...]:
    """The orbits with other numbers, of which the rows hold none."""
    return tuple(
        dataclasses.replace(one, states=tuple(dataclasses.replace(state, p=p) for state in one.states))
        for one in orbits
    )


def _searched(case: Case, built: system.System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    try:
        if classify.certainly_nonholonomic(case):
            return KnownIntegrals(orbits=case.orbits(progress.after(limit)))
    except diagnostics.ModelError as error:
        if not classify.is_conflict(error):
            raise
    return _classified(built, numeric, limit)


def _classified(built: system.System, numeric: NumericSystem, limit: float) -> KnownIntegrals:
    whole = classify.classified(built, numeric, limit)
    orbits = whole.case.orbits(progress.after(limit)) if not whole.conditions else ()
    return KnownIntegrals(whole.found.integrals, _notes(whole.found), whole.conditions, orbits)


@progress.phase("looking for a consistent start")
def _case(built: system.System, numeric: NumericSystem) -> Case:
    """The system at the consistent state nearest to its start. Raises `diagnostics.ModelError`."""
    return Case(built, numeric, sample_points.begin(built, numeric))


def _notes(found: Classification) -> tuple[str, ...]:
    """A note on all rows with integrals that were not found, and one on those of which nothing was decided."""
    unknown: list[str] = []
    undecided: list[str] = []
    for group in found.groups:
        if not group.is_decided:
            undecided += group.rows
        elif len(group.integrals) + len(group.passing) < group.flag[-1]:
            # Where no row alone lies in the integrable part a combination of them does.
            unknown += [row for row in group.rows if row in group.inside] or group.rows
    unknown_parts = []
    if unknown:
        unknown_parts.append(f"not all integrals of {_named(unknown)} were found")
    if undecided:
        unknown_parts.append(f"it is undecided whether {_named(undecided)} can be integrated")
    return tuple(
        f"{what}: integrals that are not known are enforced at velocity level only, to the integration tolerance"
        for what in unknown_parts
    )


def _named(rows: Iterable[str]) -> str:
    names = [f"`{row}`" for row in rows]
    more = len(names) - MOST_NAMES
    return ", ".join(names) if more <= 0 else f"{', '.join(names[:MOST_NAMES])} and {more} more"
