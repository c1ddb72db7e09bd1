"""The point that `derive` linearizes about: the start, where it is an equilibrium or an instant of a steady motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.api import assemble_start
from lagcli.api.models import cache
from lagcli.api.models.cache import CompiledModel
from lagcli.api.runs import prepare_run, run_settings
from lagcli.errors import diagnostics
from lagcli.linearization import reference
from lagcli.linearization.linearized import Linear, LinearizedFunctions, Reference
from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.running import run_in_memory, table_columns
from lagcli.running.trajectory import SimulationStopped
from lagcli.start import initial

if TYPE_CHECKING:
    from lagcli.derivation.sections.linear_section import LinearPoint


def start(ready: CompiledModel, limit: float) -> tuple[Reference, tuple[int, ...], tuple[str, ...]]:
    """The state at the start with its multipliers, the contacts that press there, and how far it was moved.

    limit: seconds for the first integrals of differential rows, for which whoever asks `ready` again asks no second
    time. Raises `ModelError`, `SimulationStopped`.
    """

    built = ready.system
    model, known = built.model, ready.examined_start(limit=limit).known
    chosen = run_settings.chosen(model, {"duration": 0.0, "samples": 2})
    prepared = prepare_run.start(model, chosen, known)
    run = run_in_memory.in_memory(prepared, "*", None, 0.0)
    (t,), (q,), (v,) = table_columns.States(model, run.columns)(run.rows[:1])
    lam = np.array([run[f"lambda.{row.name}"][0] for row in built.multiplier_rows])
    p = initial.declared(built).p
    rows = len(built.rows.rows)
    closed = tuple(j for j in range(built.contacts.count) if lam[rows + j] > 0)
    return Reference(float(t), q, v, np.zeros_like(q), lam, p), closed, assemble_start.of_run(prepared)


def of_start(model: Model) -> LinearPoint:
    """The declared start as a point of linear equations, or why there are none about it."""
    # SymPy is not loaded by `modes`, which begins at the same point.
    from lagcli.derivation.sections.linear_section import MOST, LinearPoint

    ready = cache.compiled(model)
    count = len(model.coordinate_names)
    if count > MOST:
        return LinearPoint(reason=f"there are {count} coordinates, and they are written out for up to {MOST}")
    try:
        here, closed, _ = start(ready, settings.LIMIT)
    except (diagnostics.ModelError, SimulationStopped):
        return LinearPoint(reason="the declared start is not one that `simulate` begins at")
    functions = LinearizedFunctions(ready.system, closed)
    found = reference.classified(functions, ready.numeric, here, model.simulation.duration or 1.0)
    if found is None:
        return LinearPoint()
    if found.kind == "varying":
        return LinearPoint(reason="the linear equations about the declared start depend on t")
    there = found.here
    rows = len(ready.system.rows.rows)
    taken = [*range(rows), *(rows + j for j in closed)]
    numbers = (
        _without_rounding(there.q),
        _without_rounding(there.v),
        _without_rounding(there.a),
        _multipliers(found.linear, there.lam[taken], ready.system.holonomic_count),
    )
    return LinearPoint(found.kind, there.t, numbers, closed)


def _without_rounding(values: npt.NDArray[np.float64]) -> tuple[float, ...]:
    size = float(np.abs(values).max(initial=0.0))
    return tuple(float(x) if abs(x) > doubles.SUM * size else 0.0 for x in values)


def _multipliers(linear: Linear, lam: npt.NDArray[np.float64], s: int) -> tuple[float, ...]:
    """lambda, 0 where its force is rounding beside the largest force."""

    B, A = (np.array(part) for part in (linear.matrices.B, linear.matrices.A))
    rows = np.vstack([B[:s], A, B[s:]])
    forces = np.abs(rows * lam[:, None]).max(axis=1, initial=0.0)
    least = doubles.ZERO * float(linear.load.max(initial=0.0))
    return tuple(float(x) if force > least else 0.0 for x, force in zip(lam, forces, strict=True))
