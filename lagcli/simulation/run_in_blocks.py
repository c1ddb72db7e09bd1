"""A run in blocks of rows, each with a report of the run so far; with columns of errors where it is repeated."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.compiled.selection import Selection
from lagcli.frozen import frozen
from lagcli.model.settings import Simulation
from lagcli.simulation.run.loop import Run, RunBlock
from lagcli.simulation.run_state.between_steps import RunState
from lagcli.simulation.run_state.incident import RankDrop
from lagcli.simulation.run_state.statistics import NO_ROWS, Extremes, RunStatistics
from lagcli.simulation.stepping import grid

if TYPE_CHECKING:
    # Loaded where it is used: most runs are not repeated.
    from lagcli.simulation.global_error.accuracy import Accuracy
    from lagcli.simulation.global_error.reference_run import RunWithReference


Floats = npt.NDArray[np.float64]


@frozen
class RunReport:
    """The account of a run at the time t reached.

    q, v, a: the state there and its accelerations, (n,) each; selection: the independent rows it is stepped with;
    indeterminate: rows whose multipliers, or impulses, are not unique or were not at some time; statistics: as they
    stood then; solve_seconds: wall time, of a repeated run too; largest_penetration: the largest -g_j over all rows and
    ends of steps, in units of g_j; complete: the rows of the grid up to t, be they made or not; accuracy: of rows,
    where the run is repeated; rank_margin: how far the rows are from dependent ones after the last step, as an angle.
    """

    t: float
    q: Floats
    v: Floats
    a: Floats
    selection: Selection
    indeterminate: frozenset[int]
    statistics: RunStatistics
    solve_seconds: float
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
    """A run that is ready to go: iterate `blocks` once; all else is data.

    columns: of its rows, t first; grid: their times; skipped_rows: rows that are lost to a grid other than that of the
    checkpoint it goes on from; handed_out: the number of rows up to there; report: of the run so far, up to the last
    block.
    """

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
        self.report = self._report()

    def blocks(self) -> Iterator[RunBlock]:
        """Blocks of complete rows, each with its incidents. Raises `run_stop.RunStop` after the last one."""
        run = self.reference or self._run
        is_reported = False
        try:
            for block in run.blocks():
                self.report = self._report()
                is_reported = True
                yield block
                is_reported = False
        finally:
            # Of a run that stops or is interrupted the report is that of the time reached. A run that nobody goes on
            # with has reported; it may be given up where Python ends, and no module can be loaded any more.
            if not is_reported:
                self.report = self._report()

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

    def _report(self) -> RunReport:
        run, again = self._run.stepper, self.reference
        statistics, y, n = copy.copy(run.statistics), run.bound.y.copy(), run.bound.y.size // 2
        selection = run.bound.enforced.selection
        extremes = statistics.extremes or NO_ROWS
        return RunReport(
            t=run.origin + run.t,
            q=y[:n],
            v=y[n:-1],
            a=run.bound.k[n:-1].copy(),
            selection=selection,
            indeterminate=selection.indeterminate.union(run.contacts.shared),
            statistics=statistics,
            solve_seconds=statistics.solve_seconds + (again.solve_seconds if again else 0.0),
            largest_penetration=max(run.contacts.deepest, extremes.penetration),
            complete=self._run.complete,
            accuracy=again.accuracy if again else None,
            rank_margin=run.rank_margin[0],
        )
