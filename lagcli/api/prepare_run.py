"""Runs from their start and from a checkpoint, as far as before their first step."""

from __future__ import annotations

import dataclasses
import os
import time

from lagcli import progress
from lagcli.analysis import redundancy
from lagcli.analysis.classification import hidden_conditions
from lagcli.api import cache, run_settings
from lagcli.api.compiled_model import CompiledModel
from lagcli.api.known_integrals import KnownIntegrals
from lagcli.api.load import Path
from lagcli.api.simulation_run import PreparedRun, SimulationRun
from lagcli.compiled import NumericSystem
from lagcli.equations import level_functions, size_limits, system
from lagcli.errors import diagnostics
from lagcli.expression.tree import ExpressionError
from lagcli.model import settings
from lagcli.model.model import Model, Simulation
from lagcli.simulation import fresh_run, loop
from lagcli.simulation.run_state import checkpoint as checkpoints
from lagcli.simulation.scheme import invariants
from lagcli.start import consistent_start, initial
from lagcli.start.consistent_start import ConsistentStart


@dataclasses.dataclass(frozen=True, slots=True)
class ExaminedStart:
    """The start of a run and what is known there: `whole` is the system with the hidden conditions, where there are
    some."""

    start: ConsistentStart
    known: KnownIntegrals
    whole: tuple[system.System, NumericSystem] | None


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
    none and for digits of a run that is resumed; what is wrong with the checkpoint is told with the name of the file.
    """
    seconds = run_settings.seconds(limit)
    if resume_from is None:
        return start(model, chosen, limit=seconds, digits=digits)
    if digits:
        from lagcli.simulation.global_error import error_estimate

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
) -> SimulationRun:
    """A run from the start of the model.

    known: the first integrals of the differential rows, which are held at their values at the start as far as that
    can be; without them they are searched for `limit` seconds. digits: with columns of errors, from the same run
    repeated. Raises `diagnostics.ModelError`.
    """
    began = time.perf_counter()
    ready = cache.compiled(dataclasses.replace(model, simulation=chosen))
    return SimulationRun(_started(ready, known, limit, digits, began))


def start_compiled(ready: CompiledModel, known: KnownIntegrals) -> SimulationRun:
    """A run from the start of a model that is compiled, with its own settings. Raises `diagnostics.ModelError`."""
    return SimulationRun(_started(ready, known, settings.LIMIT, False, time.perf_counter()))


def resume(model: Model, chosen: Simulation, point: checkpoints.Checkpoint) -> SimulationRun:
    """A run that goes on from where an earlier run of the same model stood.

    Its start was examined, and perhaps assembled, when it began. Raises `diagnostics.ModelError`,
    `checkpoints.CheckpointError` for a checkpoint of another run.
    """
    began = time.perf_counter()
    model = dataclasses.replace(model, simulation=chosen)
    checkpoints.require_same(point.identity, model)
    ready = cache.compiled(model)
    size_limits.require_run(ready.system)
    state, times = initial.declared(ready.system), ready.timed()
    if len(point.mark.turns) != (ready.system.cuts.count if ready.system.cuts else 0):
        raise checkpoints.CheckpointError("it is a damaged checkpoint: its number of angles is wrong")
    held = invariants.EnforcedInvariants(_integrals(ready, point), point.mark.levels, state.p)
    run = loop.resume(held, point.mark, chosen, ready.system.columns, times)
    return SimulationRun(
        PreparedRun(
            ready,
            state,
            run,
            point.integrals,
            time.perf_counter() - began,
            resumed=point,
        )
    )


def _integrals(ready: CompiledModel, point: checkpoints.Checkpoint) -> invariants.Integrals:
    """The integrals of a checkpoint. Raises `checkpoints.CheckpointError` where one is none of this system."""
    if point.mark.selection.count != len(ready.system.multiplier_rows):
        raise checkpoints.CheckpointError("it is a damaged checkpoint: its number of rows is wrong")
    try:
        return ready.integrals(point.integrals).keeping(point.mark.selection)
    except (ExpressionError, level_functions.UnknownName):
        raise checkpoints.CheckpointError(
            "it is a damaged checkpoint: it holds integrals of other names"
        ) from None


def _started(
    ready: CompiledModel, known: KnownIntegrals | None, limit: float, digits: bool, began: float
) -> PreparedRun:
    """The parts of a run from its start; `began`: when the work for it did. Raises `diagnostics.ModelError`."""
    built = ready.system
    size_limits.require_run(built)
    examined = _examined_start(ready, known, limit)
    state, found = examined.start.state, examined.known
    begin = redundancy.begin(built, ready.numeric, state, examined.whole, found.orbits)
    open_ = dataclasses.replace(begin.selection, inactive=ready.numeric.selection.inactive)
    held = ready.integrals(found.integrals).keeping(open_)
    fresh = fresh_run.begin(held, state, begin.is_singular, ready.timed(), found.notes, digits)
    return PreparedRun(
        ready,
        state,
        fresh.run,
        found.integrals,
        time.perf_counter() - began,
        found.conditions,
        examined.start.assembly,
        fresh.repeated,
    )


def _examined_start(ready: CompiledModel, known: KnownIntegrals | None, limit: float) -> ExaminedStart:
    """The start, on hidden conditions too. Raises `diagnostics.ModelError`."""

    def integrals() -> KnownIntegrals:
        return ready.first_integrals(limit) if known is None else known

    try:
        begin = ready.starts.find(ready.system, ready.numeric)
        found = integrals()
    except diagnostics.ModelError as error:
        # Off a hidden condition no velocity satisfies the rows.
        found = integrals() if hidden_conditions.is_conflict(error) else KnownIntegrals()
        if not found.conditions:
            raise
    if not found.conditions:
        return ExaminedStart(begin, found, None)
    whole = hidden_conditions.extended(ready.system, found.conditions)
    numeric = NumericSystem(whole)
    # The conditions may have angles of their own, whose cuts the whole system counts among its values.
    begin = consistent_start.find(whole, numeric).with_numbers(system.values(ready.system))
    return ExaminedStart(begin, found, (whole, numeric))
