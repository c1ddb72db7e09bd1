"""`lagcli.displacements`: allowed and virtual displacements at a time."""

from __future__ import annotations

import dataclasses
from typing import Unpack

from lagcli import progress
from lagcli.analysis import displacement_set
from lagcli.analysis.displacement_set import Displacements
from lagcli.api import cache, run_settings
from lagcli.api.load import Path, as_model
from lagcli.api.simulate import simulate
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.running import table_columns
from lagcli.start import assembly, consistent_start, initial, projection


@progress.phase("looking for displacements")
@run_settings.keywords("duration", "samples", "output_step")
def displacements(
    model: Model | Path,
    at: float | None = None,
    **settings: Unpack[RunSettings],
) -> Displacements:
    """Return bases of the allowed (D.6) and virtual (D.9) displacements at a time, by default the start.

    Also the dependent and independent components (D.16), and whether forces between particles are central. Options
    as of `simulate`. Raises `ModelError`, `ValueError` for a time before the start, `SimulationStopped`.
    """
    model = as_model(model)
    chosen = run_settings.chosen(model, settings)
    model = dataclasses.replace(model, simulation=chosen)
    n = len(model.coordinate_names)
    most = displacement_set.MOST_COORDINATES
    if n > most:
        raise ValueError(f"the model has {n} coordinates, and bases are dense: up to {most} are looked at")
    if at is not None:
        if not 0 <= at - chosen.start < float("inf"):
            raise ValueError(f"at: a time from the start on, t = {chosen.start:g}, is needed")
        run = simulate(model, duration=at - chosen.start, samples=2)
        ready = cache.compiled(model)
        (t,), (q,), (v,) = table_columns.States(model, run.columns)(run.rows[-1:])
        state = initial.State(float(t), q, v, initial.declared(ready.system).p)
        return displacement_set.displacements(ready.system, ready.numeric, state)
    # The velocities at the start need not satisfy the rows: no row depends on them.
    moved = None
    if chosen.assemble:
        model, done = cache.assembled(model)
        moved = consistent_start.moves(model, done)
    ready = cache.compiled(model)
    start = initial.declared(ready.system)
    residuals = initial.residuals(ready.system, ready.numeric, start)
    if any(residuals.in_position(i) for i in residuals.violated):
        assembly.require_consistent(ready.system, ready.numeric, start, residuals)
    notes: tuple[str, ...] = ()
    if not residuals.consistent:
        notes = tuple(d.message for d in initial.inconsistencies(ready.system, residuals))
    if not projection.is_finite(ready.numeric, start):
        initial.inertia(ready.system, ready.numeric, start)  # says of which coordinate
    found = displacement_set.displacements(ready.system, ready.numeric, start)
    return dataclasses.replace(found, assembled=moved, notes=notes)
