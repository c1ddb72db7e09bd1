"""A model with its start moved to the nearest consistent state, and the note that an answer is of that state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lagcli.analysis.classification import classify
from lagcli.api.models import cache
from lagcli.api.models.cache import CompiledModel
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.model.model import Model
from lagcli.start import consistent_start, initial
from lagcli.start.assembly import Assembly

if TYPE_CHECKING:
    from lagcli.running.simulation_run import SimulationRun


def assembled(model: Model) -> tuple[Model, Assembly]:
    """The model with its start moved to the nearest consistent state, and how far. Raises `diagnostics.ModelError`."""
    ready = cache.compiled(model)
    built, numeric = ready.system, ready.numeric
    try:
        found = consistent_start.nearest(built, numeric)
    except diagnostics.ModelError as error:
        if not classify.is_conflict(error):
            raise
        case = classify.classified(built, numeric).case
        found = consistent_start.nearest(case.system, case.numeric)
    return system.started_at(model, found.state.q, found.state.v), found


def of_run(run: SimulationRun) -> tuple[str, ...]:
    """Sentences on how far the start of a run was moved onto its rows; none where it was not."""
    if run.assembly is None:
        return ()
    moved = consistent_start.moves(run.model, run.assembly)
    return tuple(moved.lines(run.model.units)) if moved.positions or moved.velocities else ()


def notes(ready: CompiledModel, done: str) -> tuple[str, ...]:
    """The note where the declared positions violate the rows, and what is `done` at the nearest ones that do not."""
    residuals = initial.residuals(ready.system, ready.numeric, initial.declared(ready.system))
    if not any(residuals.in_position(i) for i in residuals.violated):
        return ()
    off = residuals.of_positions
    return (
        f"the initial positions violate the rows by {off:.3g}: {done} the nearest consistent configuration",
    )
