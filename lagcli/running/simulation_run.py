"""A run that is ready to go, from its start or from a checkpoint."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.output.tables import incident_table, provenance
from lagcli.output.tables.incident_table import IncidentColumns
from lagcli.running import run_remarks, table_columns
from lagcli.running.run_account import Outcome, Stats, Stopped
from lagcli.running.table_columns import GeneralizedForces
from lagcli.simulation.run_entry import RunInBlocks, RunReport
from lagcli.simulation.run_state import checkpoint as checkpoints
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.statistics import Incident
from lagcli.start import consistent_start, lipschitz

if TYPE_CHECKING:
    from lagcli.analysis.examined_start import ExaminedStart
    from lagcli.simulation.error_estimate import Accuracy
    from lagcli.start.consistent_start import Moves


class SimulationRun:
    """A run that is ready to go: columns, then `blocks` of rows once, then `stats`.

    built: the system that is integrated; numeric: its functions, whatever integrals are enforced; begin: the state that
    it starts from, with the numbers `parameters`; assembly: what moved that state; integrals: the first integrals of
    differential rows that it holds; conditions: the hidden conditions among its rows; resumed: where an earlier run
    stood, if this one goes on from there.
    """

    def __init__(
        self,
        built: System,
        numeric: NumericSystem,
        start: ExaminedStart,
        run: RunInBlocks,
        seconds: float,
        resumed: checkpoints.Checkpoint | None = None,
    ) -> None:
        """start: as it was examined, seconds: the time that this and the functions took."""
        self.built, self.numeric, self._run, self._seconds = built, numeric, run, seconds
        self.begin, self.parameters, self.assembly = start.state, start.state.p, start.assembly
        self.integrals, self.conditions = start.known.integrals, start.known.conditions
        self.model, self.resumed = built.model, resumed
        self.columns = self._run.columns
        self.grid = self._run.grid
        # Those that have come with the last block, up to its last row or a little beyond.
        self.incidents: list[Incident] = []
        self._has_event_rows = False
        # The account covers the whole run: rows that were handed out before it was resumed too.
        self.outcome = Outcome() if resumed is None else Outcome(run.handed_out, resumed.t_end)

    @functools.cached_property
    def warnings(self) -> tuple[diagnostics.Diagnostic, ...]:
        """Warnings of the model, of its equations and of its start; one of many runs looks for none."""
        read = (*self.model.warnings, *self.built.warnings)
        if self.resumed is not None:
            return read
        return (*read, *lipschitz.warnings(self.built, self.numeric, self.begin))

    @property
    def moves(self) -> Moves | None:
        """What assembly changed in the start, where it was asked for."""
        return None if self.assembly is None else consistent_start.moves(self.model, self.assembly)

    @property
    def report(self) -> RunReport:
        """The report of the time reached."""
        return self._run.report

    @property
    def t(self) -> float:
        """The time reached."""
        return self.report.t

    def blocks(self) -> Iterator[Floats]:
        """Blocks of rows (k, len(columns)), each with its `incidents`. Raises `run_stop.RunStop` after the last one."""
        outcome = self.outcome
        try:
            for block in self._run.blocks():
                rows, self.incidents = block.rows, block.incidents
                if self._run.reference:
                    self._floors.take(rows)
                if self._has_event_rows:
                    rows = incident_table.with_event_rows(rows, self.incidents)
                if len(rows):
                    outcome.rows += len(rows)
                    outcome.t_end = float(rows[-1, 0])
                yield rows
        except run_stop.RunStop as stopped:
            ends = self.begin, self.report
            stop = run_remarks.explained(stopped.stop, self.built, self.numeric, ends, self.conditions)
            outcome.stopped = Stopped(stop.t, stop.reason, stop.code)
            raise run_stop.RunStop(stop) from None

    def add_event_rows(self) -> None:
        """Hand out two more rows at each instant of incidents, before and after it."""
        self._has_event_rows = True
        if self.resumed is not None:
            self.outcome.rows += 2 * self.resumed.run_state.reported.instants

    @functools.cached_property
    def _forces(self) -> GeneralizedForces:
        return GeneralizedForces(self.built, self.numeric, self.parameters, self.columns)

    @functools.cached_property
    def incident_columns(self) -> IncidentColumns:
        """The columns of the table of incidents."""
        return self.numeric.memory.answer(
            "columns of incidents", lambda: incident_table.columns(self.model, self.built.columns)
        )

    @property
    def end(self) -> float:
        """The time of the last row: the end of the grid, or that of the event that has ended the run."""
        return self.t if self.report.statistics.ended_by is not None else self.grid.end

    @functools.cached_property
    def left_out(self) -> tuple[str, ...]:
        """Columns of reactions that are not unique, and are given only where they are asked for."""
        if not self.model.joints:
            return ()
        from lagcli.analysis import joint_reactions

        return joint_reactions.not_unique(self.built, self.numeric, self.begin)

    @property
    def by_name(self) -> tuple[str, ...]:
        """Columns that are given only where they are asked for by name: `Q.theta`."""
        return self._forces.names if self.model.coordinates else ()

    def taken(self, block: Floats, picked: list[int]) -> Floats:
        """Some columns of a block, by their numbers in `columns` and, after them, `by_name`."""
        if picked == list(range(len(self.columns))):
            return block
        if max(picked, default=0) >= len(self.columns):
            block = np.hstack([block, self._forces(block)])
        return block[:, picked]

    def of_table(self, rows: Floats) -> Accuracy | None:
        """The known error of a table of this run; of one with `digits`, in place of `blocks`."""
        self._floors.take(rows)
        return self._known(self._run.of_table(rows))

    @functools.cached_property
    def _floors(self) -> table_columns.Floors:
        return self.floors()

    @property
    def floors(self) -> Callable[[], table_columns.Floors]:
        """What makes the limits of what is zero to rounding in a table of this run, when it has taken its rows."""
        return functools.partial(
            table_columns.Floors, self.built, self.numeric, self.parameters, self.columns
        )

    def _known(self, found: Accuracy | None) -> Accuracy | None:
        """The accuracy with the kinds that are zero to rounding, and what the energy says against it."""
        if found is None or self._run.reference is None:
            return None
        from lagcli.simulation.error_estimate import KINDS

        floors = self._floors
        kinds = zip(KINDS, self._run.reference.columns_of_kinds, strict=True)
        zero = frozenset(k for k, at in kinds if floors.are_zero(at))
        parted, report = found.parted, self.report
        # Beside dependent rows, which the notes name, runs go apart by their rounding.
        if parted is not None and parted[1] >= found.t and run_remarks.is_amplified(self.built, report):
            parted = None
        return dataclasses.replace(found, zero=zero, parted=parted, energy_error=self._energy_error(report))

    @property
    def skipped_rows(self) -> int:
        """Rows of the grid that a resumed run cannot give: those before the state it goes on from."""
        return self._run.skipped_rows

    def require_rows_left(self) -> None:
        """Raise `checkpoints.CheckpointError` where a resumed run has nothing left to do."""
        if self.resumed is not None:
            self._run.require_rows_left()

    def checkpoint(self) -> checkpoints.Checkpoint:
        """The state to go on from after all blocks so far; for the time between two of them, or after the last."""
        return checkpoints.Checkpoint(self._identity, self._run.run_state(), self.integrals)

    @functools.cached_property
    def _identity(self) -> checkpoints.Identity:
        return checkpoints.identity(self.model)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks so far; see `run_remarks.remarks`."""
        remarks = run_remarks.remarks(self.built, self.report)
        if self.left_out:
            from lagcli.analysis import joint_reactions

            return (*remarks, *(joint_reactions.sentences(self.left_out)))
        return remarks

    @property
    def stats(self) -> Stats:
        """The account so far; of a resumed run it covers the whole, but for the seconds."""
        report, system = self.report, self.built
        chosen, statistics = self.model.simulation, report.statistics
        extremes, tally = report.extremes, statistics.reported
        return Stats(
            statistics.steps,
            statistics.rejected,
            statistics.evaluations,
            self._seconds + report.compile_seconds,
            report.solve_seconds,
            settings.method_name(chosen),
            extremes.position_drift,
            extremes.velocity_drift,
            statistics.energy_imbalance,
            tuple(system.multiplier_rows[i].name for i in sorted(report.indeterminate)),
            tuple(crossing.t for crossing in report.crossings),
            self.outcome.stopped,
            statistics.ended_by,
            self.outcome.rows,
            self.outcome.t_end,
            provenance.of(self.model),
            self._known(report.accuracy),
            self.moves,
            chosen.rtol,
            chosen.atol,
            tally.impacts,
            tally.releases,
            tally.accumulations,
            report.largest_penetration,
            run_remarks.energy_warnings(self._energy_error(report)),
            statistics.native_steps,
        )

    def _energy_error(self, report: RunReport) -> float:
        return run_remarks.energy_error(self.numeric, self.model.simulation, self.begin, report)
