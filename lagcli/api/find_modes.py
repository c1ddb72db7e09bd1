"""`lagcli.modes`: the linear equations about the declared start or the nearest equilibrium."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from lagcli import progress
from lagcli.api import cache, run_settings
from lagcli.api.load import Path, as_model
from lagcli.api.simulate import simulate
from lagcli.model.model import Model
from lagcli.output import table_columns
from lagcli.start import initial

if TYPE_CHECKING:
    from lagcli.api.compiled_model import CompiledModel
    from lagcli.linearization.linear_modes import Modes
    from lagcli.linearization.linearized import LinearizedFunctions, Reference
    from lagcli.linearization.reference import Steady


class ModesSettings(TypedDict):
    """The keywords of `modes`, None where the file's stays."""

    assemble: bool | None
    limit: float | None


class NoEquilibriumError(Exception):
    """The start is no equilibrium and no steady motion, and no equilibrium is found from it."""


@progress.phase("linearizing")
def modes(
    model: Model | Path,
    *,
    assemble: bool | None = None,
    limit: float | None = None,
) -> Modes:
    """Return frequencies, eigenvalues, shapes and stability of small deviations (`linear_modes.Modes`).

    About the declared start, if that is an equilibrium or a steady motion whose linear equations do not depend on t,
    else about the nearest equilibrium. assemble: move the start onto the constraints first; limit: seconds for the
    first integrals of differential rows. Angular frequencies in 1/time of the model's unit.

    Raises `ModelError`, `ValueError` for bad options, `NoEquilibriumError`, `SimulationStopped`.
    """
    # Other commands linearize nothing.
    from lagcli.linearization import assembled_modes, reference

    model = as_model(model)
    seconds = run_settings.seconds(limit)
    chosen = run_settings.chosen(model, {"assemble": assemble, "duration": 0.0, "samples": 2})
    duration = model.simulation.duration
    model = dataclasses.replace(model, simulation=chosen)
    here, closed = _start(model)
    ready = cache.compiled(model)
    functions = _functions(ready, closed, seconds)
    found = reference.classified(functions, ready.numeric, here, duration or 1.0)
    if found is None or found.kind == "varying":
        raise NoEquilibriumError("the start is no equilibrium and no steady motion")
    return assembled_modes.modes(functions, found, _notes(ready, found, closed))


def _start(model: Model) -> tuple[Reference, tuple[int, ...]]:
    """The state at the start with its multipliers, and the contacts that press there."""
    from lagcli.linearization.linearized import Reference

    run = simulate(model)
    built = cache.compiled(model).system
    (t,), (q,), (v,) = table_columns.States(model, run.columns)(run.rows[:1])
    lam = np.array([run[f"lambda.{row.name}"][0] for row in built.multiplier_rows])
    p = initial.declared(built).p
    rows = len(built.rows.rows)
    closed = tuple(j for j in range(built.contacts.count) if lam[rows + j] > 0)
    return Reference(float(t), q, v, np.zeros_like(q), lam, p), closed


def _functions(ready: CompiledModel, closed: tuple[int, ...], limit: float) -> LinearizedFunctions:
    """The linear equations, with the leaves of integrable differential rows as rows of whole coordinates."""
    from lagcli.linearization.linearized import LinearizedFunctions

    known = ready.first_integrals(limit)
    return LinearizedFunctions(ready.system, closed, known.integrals)


def _notes(ready: CompiledModel, found: Steady, closed: tuple[int, ...]) -> tuple[str, ...]:
    """What was linearized about, in sentences."""
    where = {
        "equilibrium": "about the declared start, an equilibrium",
        "steady": "about the declared start, an instant of a steady motion",
    }
    told = [where[found.kind]]
    if closed:
        names = ", ".join(f"`{ready.system.contacts.rows[j].name}`" for j in closed)
        told.append(f"contacts that press count as rows: {names}")
    return tuple(told)
