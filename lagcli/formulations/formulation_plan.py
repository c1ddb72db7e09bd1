"""The formulations that fit a model, and where their tables can be compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lagcli.arrays import Flags, Floats
from lagcli.compiled import NumericSystem
from lagcli.formulations import comparison
from lagcli.formulations.comparison import Formulation
from lagcli.linear import decompositions
from lagcli.model.model import Model
from lagcli.start import projection
from lagcli.start.initial import State

# The reduction is dense, and each step takes operations by the cube of this.
MOST_COORDINATES = 600
# Rows of length one with a smaller singular value than this leave multipliers few digits: they are quotients by it.
NEAR = 1e-2


def declared(model: Model, rows: int) -> str:
    """The formulation of the model as it stands, a key of `comparison.TITLES`; `rows`: C."""
    if not model.coordinates:
        return "newton"
    return "lagrange-multipliers" if rows else "lagrange"


def is_reducible(model: Model, rows: int, n: int) -> bool:
    """True if the null space of C rows is to be taken: of few columns, that no contact changes and no event ends."""
    return rows > 0 and n <= MOST_COORDINATES and not is_changed(model)


def is_changed(model: Model) -> bool:
    """True if contacts, impacts or events change a motion of the model, or end it."""
    return bool(model.inequality) or any(event.action == "stop" for event in model.events)


def comparable(model: Model, other: Formulation, of: Mapping[str, str]) -> dict[str, str]:
    """The columns whose meaning another formulation shares: freed particles take rows from coordinates and their R."""
    if other.name != "freed":
        return dict(of)
    apart = {f"R.{name}" for name in model.generalized_names}
    return {name: kind for name, kind in of.items() if name not in apart}


def singular(numeric: NumericSystem, states: tuple[Floats, Floats, Floats], p: Floats, rank: int) -> Flags:
    """True for each of the states t (k,), q and v (k, n) near a singular configuration, with rows of this rank."""
    found = np.zeros(len(states[0]), dtype=bool)
    for i, (t, q, v) in enumerate(zip(*states, strict=True)):
        rows = projection.rows(numeric, State(float(t), q, v, p))
        sigma = decompositions.singular_values(rows.dense)
        found[i] = rank > 0 and sigma[rank - 1] < NEAR
    return found


def compared(
    model: Model,
    first: Formulation,
    others: Sequence[tuple[Formulation, Mapping[str, str]]],
    tolerance: float,
    near: Flags,
) -> comparison.Comparison:
    """The comparison of others, each with the columns it shares, with the first."""
    agreements = tuple(comparison.compare(shared, first, other, near) for other, shared in others)
    notes = []
    if near.any():
        notes.append(
            f"multipliers are not compared in {int(near.sum())} of {near.size} rows, which are near a singular"
            " configuration: they have a pole there"
        )
    runs = (first, *(other for other, _ in others))
    notes += [f"{one.path} as {comparison.TITLES[one.name]} {one.stopped}" for one in runs if one.stopped]
    if first.rows and is_changed(model):
        notes.append(
            "the reduction by the null space is left out: it is that of the equations, and contacts that close,"
            " impacts and events that end a run would change it"
        )
    elif first.rows and first.coordinates > MOST_COORDINATES:
        notes.append(
            f"the reduction by the null space is left out: it is dense, and meant for {MOST_COORDINATES} coordinates"
            " or fewer"
        )
    elif not others:
        notes.append(
            "only one formulation fits: there are no rows to eliminate and no dependent particles to free"
        )
    return comparison.Comparison(runs, agreements, tolerance, tuple(notes))
