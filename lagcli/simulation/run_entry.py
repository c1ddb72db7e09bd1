"""Runs before their first step: from a consistent start, with all that they hold there, and on from a checkpoint."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from lagcli.compiled import NumericSystem
from lagcli.compiled.selection import Selection
from lagcli.equations import level_functions, size_limits
from lagcli.equations.system import System
from lagcli.expression.tree import ExpressionError
from lagcli.memory import Memory
from lagcli.model.invariant import FirstIntegral
from lagcli.model.model import Model
from lagcli.simulation.run import run_start
from lagcli.simulation.run.row_writer import TableRows
from lagcli.simulation.run.run_start import RunStart
from lagcli.simulation.run_in_blocks import RunInBlocks
from lagcli.simulation.scheme import invariants
from lagcli.smoothness import time_functions
from lagcli.start import initial

if TYPE_CHECKING:
    # Most runs go on from no checkpoint.
    from lagcli.simulation.run_state.checkpoint import Checkpoint


Found = tuple[FirstIntegral, ...]


@dataclasses.dataclass(slots=True, eq=False)
class CachedFunctions:
    """Steps by method, first integrals with their charts, and the functions of t, each built when a run asks for it."""

    numeric: NumericSystem
    _memory: Memory = dataclasses.field(default_factory=Memory)

    @property
    def plain(self) -> invariants.RunFunctions:
        """The functions of the system by itself."""
        return self._memory.answer("plain", lambda: invariants.RunFunctions(self.numeric))

    def integrals(self, system: System, found: Found) -> invariants.Integrals:
        """The integrals with their functions, built anew where a value is built in that has changed."""
        question = ("integrals", found)
        known = self._memory.known(question)
        if not isinstance(known, invariants.Integrals) or not known.hold_for(system):
            known = invariants.Integrals(system, self.plain, found)
        known = known.of(system)  # whose start, values and restitutions a run reads
        self._memory.keep(question, known)
        return known

    def has_total_columns(self, system: System) -> bool:
        """See `operation_rules.has_total_columns`."""
        from lagcli.equations import operation_rules

        question = ("total columns", system.built_in)
        return self._memory.answer(question, lambda: operation_rules.has_total_columns(system))

    def timed(self, model: Model) -> time_functions.TimeFunctions | None:
        """The functions of t alone, None where the model has none, whatever its parameters are."""
        if self._memory.known("no functions of t"):
            return None
        timed = self._memory.answer(("timed", model.parameters), lambda: time_functions.functions(model))
        if timed is None:
            self._memory.keep("no functions of t", True)
        return timed

    def run_start(
        self,
        system: System,
        state: initial.State,
        selection: Selection,
        is_singular: bool,
        integrals: Found,
        notes: tuple[str, ...],
    ) -> RunStart:
        """A consistent state with all that a run from there goes with, by the settings of the model.

        selection: the independent rows there; is_singular: they are dependent there and not nearby; integrals: those to
        enforce; notes: what is to be said of others. Raises `diagnostics.ModelError` where an acceleration or a column
        is not finite there.
        """
        open_rows = dataclasses.replace(selection, inactive=self.numeric.selection.inactive)
        enforced, not_enforced = invariants.begin(self.integrals(system, integrals).keeping(open_rows), state)
        if not is_singular:
            values = dataclasses.replace(state, p=enforced.parameters)
            initial.require_finite(system, enforced.functions.numeric, values)
        settings, timed = system.model.simulation, self.timed(system.model)
        return RunStart(enforced, state.q, state.v, settings, timed, is_singular, (*not_enforced, *notes))


def begin(
    system: System,
    cached: CachedFunctions,
    start: RunStart,
    is_repeated: bool = False,
    ends_only: bool = False,
) -> RunInBlocks:
    """The run of a model from its start, by the settings of the model.

    cached: the functions of its text, which gave the start; is_repeated: with columns of errors; ends_only: with the
    first row of the grid and the last one alone, where no other row can end the run.
    """
    rows = TableRows(system.columns, ends_only and cached.has_total_columns(system))
    run = run_start.start(start, rows)
    if not is_repeated:
        return RunInBlocks(run, start.settings, system.columns)
    # Loaded here: most runs are not repeated.
    from lagcli.simulation.global_error.reference_run import RunWithReference

    return RunInBlocks(run, start.settings, system.columns, RunWithReference(run, start))


def resume(system: System, cached: CachedFunctions, point: Checkpoint) -> RunInBlocks:
    """The run of a model on from where another one of it stood, whose identity was compared.

    Its start was examined, and perhaps assembled, when it began. Raises `diagnostics.ModelError`,
    `CheckpointError` for a checkpoint of another system.
    """
    size_limits.require_run(system)
    from lagcli.simulation.run_state.checkpoint import CheckpointError

    declared, timed = initial.declared(system), cached.timed(system.model)
    if len(point.run_state.turns) != (system.cuts.count if system.cuts else 0):
        raise CheckpointError("it is a damaged checkpoint: its number of angles is wrong")
    enforced = invariants.EnforcedInvariants(
        _integrals(system, cached, point), point.run_state.invariant_values, declared.p
    )
    chosen = system.model.simulation
    run = run_start.resume(enforced, point.run_state, chosen, system.columns, timed)
    return RunInBlocks(run, chosen, system.columns, handed_out=run.grid.after(point.run_state.row))


def _integrals(system: System, cached: CachedFunctions, point: Checkpoint) -> invariants.Integrals:
    """The integrals of a checkpoint. Raises `CheckpointError` where one is none of this system."""
    from lagcli.simulation.run_state.checkpoint import CheckpointError

    if point.run_state.selection.count != len(system.multiplier_rows):
        raise CheckpointError("it is a damaged checkpoint: its number of rows is wrong")
    try:
        return cached.integrals(system, point.integrals).keeping(point.run_state.selection)
    except (ExpressionError, level_functions.UnknownName):
        raise CheckpointError("it is a damaged checkpoint: it holds integrals of other names") from None
