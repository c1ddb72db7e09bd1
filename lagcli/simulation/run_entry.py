"""Runs before their first step: from a consistent start, with all that they hold there, and on from a checkpoint."""

from __future__ import annotations

import dataclasses

from lagcli.compiled.selection import Selection
from lagcli.equations import level_functions, size_limits
from lagcli.equations.system import System
from lagcli.expression.tree import ExpressionError
from lagcli.model.invariant import FirstIntegral
from lagcli.simulation.kept_functions import KeptFunctions
from lagcli.simulation.run import loop
from lagcli.simulation.run.row_writer import TableRows
from lagcli.simulation.run.run_start import RunStart
from lagcli.simulation.run_in_blocks import RunInBlocks
from lagcli.simulation.run_state.checkpoint import Checkpoint, CheckpointError
from lagcli.simulation.scheme import invariants
from lagcli.start import initial


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunPlan:
    """A run that is asked for, from a consistent start.

    selection: the independent rows there; is_singular: they are dependent there and not nearby; integrals: the first
    integrals to hold; notes: what was said about them; is_repeated: with columns of errors; ends_only: with the
    first row of the grid and the last one alone, where no other row can end the run.
    """

    start: initial.State
    selection: Selection
    is_singular: bool = False
    integrals: tuple[FirstIntegral, ...] = ()
    notes: tuple[str, ...] = ()
    is_repeated: bool = False
    ends_only: bool = False


def begin(system: System, kept: KeptFunctions, plan: RunPlan) -> RunInBlocks:
    """The run of a model from a consistent start, by the settings of the model.

    kept: the functions of its text. Raises `diagnostics.ModelError` where an acceleration or a column is not finite at
    the start.
    """
    start, timed = plan.start, kept.timed(system.model)
    open_ = dataclasses.replace(plan.selection, inactive=kept.numeric.selection.inactive)
    held, not_held = invariants.begin(kept.integrals(system, plan.integrals).keeping(open_), start)
    if not plan.is_singular:
        initial.require_finite(system, held.functions.numeric, dataclasses.replace(start, p=held.parameters))
    first, chosen = RunStart(start.q, start.v, plan.is_singular), system.model.simulation
    rows = TableRows(system.columns, plan.ends_only and kept.has_total_columns(system))
    run = loop.start(held, first, chosen, rows, (*not_held, *plan.notes), timed)
    if not plan.is_repeated:
        return RunInBlocks(run, chosen, system.columns)
    # Loaded here: most runs are not repeated.
    from lagcli.simulation.global_error.reference_run import RunWithReference

    return RunInBlocks(run, chosen, system.columns, RunWithReference(system, run, held, first, chosen))


def resume(system: System, kept: KeptFunctions, point: Checkpoint) -> RunInBlocks:
    """The run of a model on from where another one of it stood, whose identity was compared.

    Its start was examined, and perhaps assembled, when it began. Raises `diagnostics.ModelError`,
    `CheckpointError` for a checkpoint of another system.
    """
    size_limits.require_run(system)
    declared, timed = initial.declared(system), kept.timed(system.model)
    if len(point.mark.turns) != (system.cuts.count if system.cuts else 0):
        raise CheckpointError("it is a damaged checkpoint: its number of angles is wrong")
    held = invariants.EnforcedInvariants(_integrals(system, kept, point), point.mark.levels, declared.p)
    chosen = system.model.simulation
    run = loop.resume(held, point.mark, chosen, system.columns, timed)
    return RunInBlocks(run, chosen, system.columns, handed_out=run.grid.after(point.mark.row))


def _integrals(system: System, kept: KeptFunctions, point: Checkpoint) -> invariants.Integrals:
    """The integrals of a checkpoint. Raises `CheckpointError` where one is none of this system."""
    if point.mark.selection.count != len(system.multiplier_rows):
        raise CheckpointError("it is a damaged checkpoint: its number of rows is wrong")
    try:
        return kept.integrals(system, point.integrals).keeping(point.mark.selection)
    except (ExpressionError, level_functions.UnknownName):
        raise CheckpointError("it is a damaged checkpoint: it holds integrals of other names") from None
