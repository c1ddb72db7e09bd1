"""A run that is ready to go, from its start or from a checkpoint."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli.analysis import redundancy
from lagcli.analysis.classification.verdict import Condition
from lagcli.api.compiled_model import CompiledModel, Integrals
from lagcli.compiled import NumericSystem
from lagcli.compiled.selection import Selection
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.output import event_rows, incident_table, table_columns
from lagcli.output.incident_table import IncidentColumns
from lagcli.output.trajectory import Outcome, Stats, provenance
from lagcli.simulation import loop
from lagcli.simulation.global_error.accuracy import KINDS, Accuracy
from lagcli.simulation.run_state import checkpoint as checkpoints
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.incident import Incident
from lagcli.simulation.singularity.singular_point import RankDrop
from lagcli.simulation.stepping import grid
from lagcli.start import assembly, assembly_moves, initial, lipschitz, singular_inertia

if TYPE_CHECKING:
    # Loaded where it is used: most runs are not repeated.
    from lagcli.simulation.global_error.reference_run import RunWithReference

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PreparedRun:
    """All that a run goes with.

    `start`: the state at its start, assembled where that was wanted; `integrals`: those that are held; `seconds`: the
    time this took; `conditions`: hidden conditions among the rows; `reference`: the same run repeated, for columns of
    errors; `resumed`: where an earlier run stood, if this one goes on from there.
    """

    ready: CompiledModel
    start: initial.State
    loop: loop.Run
    integrals: Integrals
    seconds: float
    conditions: tuple[Condition, ...] = ()
    assembly: assembly.Assembly | None = None
    reference: RunWithReference | None = None
    resumed: checkpoints.Checkpoint | None = None


class SimulationRun:
    """A run that is ready to go: columns, then `blocks` of rows once, then `stats`."""

    def __init__(self, prepared: PreparedRun) -> None:
        self._prepared = prepared
        self._system, self._numeric = prepared.ready.system, prepared.ready.numeric
        self._start, self._run, self._paired = prepared.start, prepared.loop, prepared.reference
        self.model = self._system.model
        self.columns = ("t", *self._system.columns, *(self._paired.COLUMNS if self._paired else ()))
        self.assembly = prepared.assembly
        self.resumed = prepared.resumed
        self.grid = grid.grid(self.model.simulation)
        # Those that have come with the last block, up to its last row or a little beyond.
        self.incidents: list[Incident] = []
        self._has_event_rows = False
        # The account covers the whole run: rows that were handed out before it was resumed too.
        self.outcome = Outcome()
        if self.resumed is not None:
            row = self.resumed.mark.row
            self.outcome = Outcome(self._run.grid.after(row), self.resumed.mark.origin + row)

    @functools.cached_property
    def warnings(self) -> tuple[diagnostics.Diagnostic, ...]:
        """Warnings of the model, of its equations and of its start; one of many runs looks for none."""
        read = (*self.model.warnings, *self._system.warnings)
        if self.resumed is not None:
            return read
        return (*read, *lipschitz.warnings(self._system, self._numeric, self._start))

    @property
    def t(self) -> float:
        """The time reached."""
        return self._run.origin + self._run.t

    def blocks(self) -> Iterator[Floats]:
        """Blocks of rows (k, len(columns)), each with its `incidents`. Raises `run_stop.RunStop` after the last one."""
        run = self._paired or self._run
        try:
            for block in run.blocks():
                self.incidents = run.take_incidents()
                if self._paired:
                    self._floors.take(block)
                if self._has_event_rows:
                    block = event_rows.merged(block, self.incidents)
                self.outcome.take(block)
                yield block
        except run_stop.RunStop as stopped:
            stop = stopped.stop
            if fallen := self._fallen_inertia():
                stop = dataclasses.replace(stop, reason=f"{stop.reason}; {fallen}")
            if why := self._led_off():
                where = stop.reason.partition(": ")[0]
                stop = dataclasses.replace(stop, reason=f"{where}: {why}", code=run_stop.NO_SOLUTION)
            self.outcome.stop(stop)
            raise run_stop.RunStop(stop) from None

    def add_event_rows(self) -> None:
        """Hand out two more rows at each instant of incidents, before and after it."""
        self._has_event_rows = True
        if self.resumed is not None:
            self.outcome.rows += 2 * self.resumed.mark.told.instants

    @functools.cached_property
    def incident_columns(self) -> IncidentColumns:
        """The columns of the table of incidents."""
        return incident_table.columns(self.model, self._system.columns)

    @property
    def end(self) -> float:
        """The time of the last row: the end of the grid, or that of the event that has ended the run."""
        return self.t if self._run.account.ended_by is not None else self.grid.end

    @functools.cached_property
    def _forces(self) -> table_columns.GeneralizedForces:
        return table_columns.GeneralizedForces(self._system, self._numeric, self._start.p, self.columns)

    @property
    def built(self) -> system.System:
        """The system that is integrated."""
        return self._system

    @property
    def numeric(self) -> NumericSystem:
        """Its functions, whatever integrals are held."""
        return self._numeric

    @property
    def parameters(self) -> Floats:
        """The numbers that go with them."""
        return self._start.p

    @property
    def exchanged(self) -> float:
        """The largest T so far plus the largest change of V."""
        figures = self._run.account.figures
        return figures.moving + figures.resting if figures else 0.0

    @property
    def rank(self) -> int:
        """The number of independent rows it is stepped with."""
        return len(self._run.selection.kept)

    @property
    def begin(self) -> initial.State:
        """The state that it starts from."""
        return self._start

    @property
    def selection(self) -> Selection:
        """The rows it is stepped with at the time reached."""
        return self._run.selection

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """The hidden conditions among its rows."""
        return self._prepared.conditions

    @property
    def integrals(self) -> Integrals:
        """The first integrals of the differential rows that it holds."""
        return self._prepared.integrals

    @property
    def by_name(self) -> tuple[str, ...]:
        """Columns that are given only where they are asked for by name: `Q.theta`."""
        return self._forces.names

    def taken(self, block: Floats, picked: list[int]) -> Floats:
        """Some columns of a block, by their numbers in `columns` and, after them, `by_name`."""
        if picked == list(range(len(self.columns))):
            return block
        if max(picked, default=0) >= len(self.columns):
            block = np.hstack([block, self._forces(block)])
        return block[:, picked]

    def _fallen_inertia(self) -> str:
        """The inertia that a run has lost where it stopped, as a sentence, or nothing."""
        start, inertia = self._start, self._numeric.inertia
        now = inertia(self.t, *np.split(self._run.y[:-1], 2), start.p)
        return singular_inertia.fallen(
            now, inertia(start.t, start.q, start.v, start.p), self.model.coordinate_names
        )

    def _led_off(self) -> str:
        """The hidden conditions that the forces do not keep where a run stopped, as a sentence, or nothing."""
        if not self._prepared.conditions:
            return ""
        # Loaded here: most models have no such rows.
        from lagcli.analysis.classification import led_off

        (q, v), a = np.split(self._run.y[:-1], 2), np.split(self._run.rate[:-1], 2)[1]
        state = initial.State(self.t, q, v, self._start.p)
        return led_off.reason(self._system, self._prepared.conditions, state, a)

    def of_table(self, rows: Floats) -> Accuracy | None:
        """The known error of a table of this run; of one with `digits`, in place of `blocks`."""
        assert self._paired is not None
        self._floors.take(rows)
        return self._known(self._paired.of_table(rows))

    @functools.cached_property
    def _floors(self) -> table_columns.Floors:
        return self.floors()

    def floors(self) -> table_columns.Floors:
        """Limits of what is zero to rounding in a table of this run, when it has taken its rows."""
        return table_columns.Floors(self._system, self._numeric, self._start.p, self.columns)

    def _known(self, found: Accuracy | None) -> Accuracy | None:
        """The accuracy with the kinds that are zero to rounding."""
        if found is None or self._paired is None:
            return None
        floors = self._floors
        kinds = zip(KINDS, self._paired.places, strict=True)
        return dataclasses.replace(found, zero=frozenset(k for k, at in kinds if floors.are_zero(at)))

    @property
    def passed_over(self) -> int:
        """Rows of the grid that a resumed run cannot give: those before the state it goes on from."""
        return self._run.passed_over

    def require_rows_left(self) -> None:
        """Raise `checkpoints.CheckpointError` where a resumed run has nothing left to do."""
        self._run.require_rows_left()

    def checkpoint(self) -> checkpoints.Checkpoint:
        """The state to go on from after all blocks so far; for the time between two of them, or after the last."""
        return checkpoints.Checkpoint(
            self._identity, (self._paired or self._run).mark(), self._prepared.integrals
        )

    @functools.cached_property
    def _identity(self) -> checkpoints.Identity:
        return checkpoints.identity(self.model)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks so far: multipliers that are not unique, singular configurations that were passed,
        integrals that are not held all the time."""
        account = self._run.account
        return (
            *redundancy.notes(self._system, self._run.selection),
            *redundancy.at_times(self._system, self._run.selection, self._run.indeterminate),
            *redundancy.passed(self._system, self._crossings),
            *account.notes,
        )

    @property
    def _crossings(self) -> tuple[RankDrop, ...]:
        """Singular configurations up to the time reached: the last step may lead farther."""
        return tuple(crossing for crossing in self._run.account.crossings if crossing.t <= self.t)

    @property
    def stats(self) -> Stats:
        """The account so far; of a resumed run it covers the whole, but for the seconds."""
        account = self._run.account
        figures = account.figures
        return Stats(
            account.steps,
            account.rejected,
            account.evaluations,
            self._prepared.seconds,
            account.solve_seconds + (self._paired.solve_seconds if self._paired else 0.0),
            settings.method_name(self.model.simulation),
            figures.position_drift if figures else 0.0,
            figures.velocity_drift if figures else 0.0,
            account.energy_imbalance,
            tuple(self._system.multiplier_rows[i].name for i in sorted(self._run.indeterminate)),
            tuple(crossing.t for crossing in self._crossings),
            self.outcome.stopped,
            account.ended_by,
            self.outcome.rows,
            self.outcome.t_end,
            provenance(self.model),
            self._known(self._paired.accuracy) if self._paired else None,
            assembly_moves.moves(self.model, self.assembly) if self.assembly else None,
            self.model.simulation.rtol,
            self.model.simulation.atol,
            account.told.impacts,
            account.told.releases,
            account.told.accumulations,
            account.largest_penetration,
        )
