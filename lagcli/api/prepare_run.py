"""Runs from their start and from a checkpoint, as far as before their first step."""

from __future__ import annotations

import dataclasses
import os
import time

from lagcli import progress
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.analysis.examined_start import ExaminedStart
from lagcli.api import cache, run_settings
from lagcli.api.cache import CompiledModel
from lagcli.api.load import Path
from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.model.settings import Simulation
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation import run_entry
from lagcli.simulation.run_state import checkpoint as checkpoints
from lagcli.start import initial


@progress.phase("preparing the run")
def prepare(
    model: Model,
    chosen: Simulation,
    resume_from: Path | None = None,
    limit: float | None = None,
    digits: bool = False,
    may_be_over: bool = False,
) -> SimulationRun:
    """A run from its start, or from the checkpoint in a file.

    limit: seconds to find first integrals; digits: with columns of errors; may_be_over: a run whose rows were all
    handed out before is no error. Raises as `start` and `resume`, `OSError`, and `ValueError` for a limit that is
    none and for digits of a run that is resumed; what is wrong with the checkpoint is reported with the name of the
    file.
    """
    seconds = run_settings.seconds(limit)
    if resume_from is None:
        return start(model, chosen, limit=seconds, digits=digits)
    if digits:
        from lagcli.simulation import error_estimate

        raise ValueError(f"digits: {error_estimate.NOT_RESUMED}")
    try:
        run = resume(model, chosen, checkpoints.read(resume_from))
        if not may_be_over:
            run.require_rows_left()
    except checkpoints.CheckpointError as error:
        raise checkpoints.CheckpointError(f"{os.fspath(resume_from)}: {error}") from None
    return run


def start(
    model: Model,
    chosen: Simulation,
    known: KnownIntegrals | None = None,
    *,
    limit: float = settings.LIMIT,
    digits: bool = False,
    ends_only: bool = False,
) -> SimulationRun:
    """A run from the start of the model.

    known: the first integrals of the differential rows, which are enforced at their values at the start as far as that
    can be; without them they are searched for `limit` seconds. digits: with columns of errors, from the same run
    repeated; ends_only: the first and the last row are enough. Raises `diagnostics.ModelError`.
    """
    began = time.perf_counter()
    ready = cache.compiled(dataclasses.replace(model, simulation=chosen))
    return start_compiled(ready, known, began=began, limit=limit, digits=digits, ends_only=ends_only)


def start_compiled(
    ready: CompiledModel,
    known: KnownIntegrals | None,
    *,
    began: float | None = None,
    limit: float = settings.LIMIT,
    digits: bool = False,
    ends_only: bool = False,
) -> SimulationRun:
    """A run from the start of a model that is compiled, with its own settings.

    began: of `time.perf_counter`, when the work for it did; otherwise as `start`.
    """
    began = time.perf_counter() if began is None else began
    start, first = ready.begin(known, limit)
    run = run_entry.begin(ready.system, ready.cached, first, digits, ends_only)
    return SimulationRun(ready.system, ready.numeric, start, run, time.perf_counter() - began)


def resume(model: Model, chosen: Simulation, point: checkpoints.Checkpoint) -> SimulationRun:
    """A run that goes on from where an earlier run of the same model stood.

    Its start was examined, and perhaps assembled, when it began. Raises `diagnostics.ModelError`,
    `checkpoints.CheckpointError` for a checkpoint of another run.
    """
    began = time.perf_counter()
    model = dataclasses.replace(model, simulation=chosen)
    checkpoints.require_same(point.identity, model)
    ready = cache.compiled(model)
    run = run_entry.resume(ready.system, ready.cached, point)
    known, selection = KnownIntegrals(point.integrals), point.run_state.selection
    start = ExaminedStart(initial.declared(ready.system), None, selection, False, known)
    return SimulationRun(ready.system, ready.numeric, start, run, time.perf_counter() - began, point)


def moves_of(run: SimulationRun) -> tuple[str, ...]:
    """Sentences on how far the start of a run was moved onto its rows; none where it was not."""
    if run.moves is None or not (run.moves.positions or run.moves.velocities):
        return ()
    return tuple(run.moves.lines(run.model.units))
