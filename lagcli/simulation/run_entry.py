"""Runs before their first step: from a consistent start, with all that they hold there, and on from a checkpoint."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING

from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.compiled.selection import Selection
from lagcli.equations import level_functions, size_limits
from lagcli.equations.system import System
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.memory import Memory
from lagcli.model.invariant import FirstIntegral
from lagcli.model.model import Model
from lagcli.model.settings import Simulation
from lagcli.simulation import loop
from lagcli.simulation.loop import Run, RunBlock, RunStart
from lagcli.simulation.row_writer import TableRows
from lagcli.simulation.run_state.between_steps import RunState
from lagcli.simulation.run_state.statistics import NO_ROWS, Extremes, RankDrop, RunStatistics
from lagcli.simulation.scheme import invariants
from lagcli.simulation.stepping import grid
from lagcli.smoothness import time_functions
from lagcli.start import initial

if TYPE_CHECKING:
    # Most runs go on from no checkpoint, and are not repeated.
    from lagcli.simulation.error_estimate import Accuracy
    from lagcli.simulation.reference_run import RunWithReference
    from lagcli.simulation.run_state.checkpoint import Checkpoint


@frozen
class RunReport:
    """The account of a run at the time t reached: q, v, a (n,) there, and the statistics as they stood then.

    selection: the independent rows it is stepped with; indeterminate: rows whose multipliers or impulses are, or were,
    not unique; solve_seconds, compile_seconds: wall time of steps and of native code, of a repeated run too;
    largest_penetration: the largest -g_j; complete: the rows of the grid up to t, made or not; accuracy: of a repeated
    run; rank_margin: how far rows are from dependent ones, as an angle.
    """

    t: float
    q: Floats
    v: Floats
    a: Floats
    selection: Selection
    indeterminate: frozenset[int]
    statistics: RunStatistics
    solve_seconds: float
    compile_seconds: float
    largest_penetration: float
    complete: int
    accuracy: Accuracy | None
    rank_margin: float

    @property
    def extremes(self) -> Extremes:
        """The extremes of the rows so far."""
        return self.statistics.extremes or NO_ROWS

    @property
    def rank(self) -> int:
        """The number of independent rows it is stepped with."""
        return len(self.selection.independent)

    @property
    def exchanged(self) -> float:
        """The largest T so far plus the largest change of V."""
        return self.extremes.moving + self.extremes.resting

    @property
    def crossings(self) -> tuple[RankDrop, ...]:
        """The singular configurations up to t: the last step may lead beyond it."""
        return tuple(one for one in self.statistics.crossings if one.t <= self.t)


class RunInBlocks:
    """A run that is ready to go: iterate `blocks` once. columns: of its rows, t first; grid: their times; skipped_rows:
    lost to another grid than that of the checkpoint; handed_out: rows up to there."""

    def __init__(
        self,
        run: Run,
        settings: Simulation,
        columns: tuple[str, ...],
        reference: RunWithReference | None = None,
        handed_out: int = 0,
    ) -> None:
        self._run, self.reference = run, reference
        self.columns = ("t", *columns, *(reference.COLUMNS if reference else ()))
        self.grid, self.skipped_rows, self.handed_out = grid.of_run(settings), run.skipped_rows, handed_out

    def blocks(self) -> Iterator[RunBlock]:
        """Blocks of complete rows, each with its incidents. Raises `run_stop.RunStop` after the last one."""
        return (self.reference or self._run).blocks()

    def run_state(self) -> RunState:
        """The state to go on from after all blocks so far; for the time between two of them, or after the last."""
        return (self.reference or self._run).run_state()

    def require_rows_left(self) -> None:
        """Raise `CheckpointError` where a resumed run has nothing left to do."""
        self._run.require_rows_left()

    def of_table(self, rows: Floats) -> Accuracy | None:
        """The estimate of the errors of a table, in place of `blocks`, of a run that is repeated."""
        assert self.reference is not None
        return self.reference.of_table(rows)

    @property
    def report(self) -> RunReport:
        """The report of the time reached: the end of the last block, or where the run stopped or was interrupted."""
        run, again = self._run.stepper, self.reference
        statistics, y, n = copy.copy(run.statistics), run.bound.y.copy(), run.bound.y.size // 2
        selection = run.bound.enforced.selection
        extremes = statistics.extremes or NO_ROWS
        accounts = [statistics, again.statistics] if again else [statistics]
        return RunReport(
            t=run.origin + run.t,
            q=y[:n],
            v=y[n:-1],
            a=run.bound.k[n:-1].copy(),
            selection=selection,
            indeterminate=selection.indeterminate.union(run.contacts.shared),
            statistics=statistics,
            solve_seconds=sum(each.solve_seconds for each in accounts),
            compile_seconds=sum(each.compile_seconds for each in accounts),
            largest_penetration=max(run.contacts.deepest, extremes.penetration),
            complete=self._run.writer.complete,
            accuracy=again.accuracy if again else None,
            rank_margin=run.rank_margin[0],
        )


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
        """A consistent state with all that a run from there goes with, by the settings of the model. selection: the
        independent rows there; is_singular: they are dependent there and not nearby; integrals: those to enforce;
        notes: on others. Raises `diagnostics.ModelError` where an acceleration or a column is not finite there."""
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
    """The run of a model from its start. cached: the functions of its text, which gave the start; is_repeated: with
    columns of errors; ends_only: with the first and the last row of the grid alone, where no other row can end the
    run."""
    rows = TableRows(system.columns, ends_only and cached.has_total_columns(system))
    run = loop.start(start, rows)
    if not is_repeated:
        return RunInBlocks(run, start.settings, system.columns)
    # Loaded here: most runs are not repeated.
    from lagcli.simulation.reference_run import RunWithReference

    return RunInBlocks(run, start.settings, system.columns, RunWithReference(run, start))


def resume(system: System, cached: CachedFunctions, point: Checkpoint) -> RunInBlocks:
    """The run of a model on from where another one of it stood, whose identity was compared. Raises
    `diagnostics.ModelError`, `CheckpointError` for a checkpoint of another system."""
    size_limits.require_run(system)
    from lagcli.simulation.run_state.checkpoint import CheckpointError

    declared, timed, run_state = initial.declared(system), cached.timed(system.model), point.run_state
    if len(run_state.turns) != (system.cuts.count if system.cuts else 0):
        raise CheckpointError("it is a damaged checkpoint: its number of angles is wrong")
    if run_state.selection.count != len(system.multiplier_rows):
        raise CheckpointError("it is a damaged checkpoint: its number of rows is wrong")
    try:
        integrals = cached.integrals(system, point.integrals).keeping(run_state.selection)
    except (ExpressionError, level_functions.UnknownName):
        raise CheckpointError("it is a damaged checkpoint: it holds integrals of other names") from None
    enforced = invariants.EnforcedInvariants(integrals, run_state.invariant_values, declared.p)
    chosen = system.model.simulation
    run = loop.resume(enforced, run_state, chosen, system.columns, timed)
    return RunInBlocks(run, chosen, system.columns, handed_out=run.grid.after(run_state.row))
