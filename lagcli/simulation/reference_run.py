"""Two runs side by side on one grid: the rows of the first with their errors, from the second."""

from __future__ import annotations

import collections
import dataclasses
import functools
import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.simulation import error_estimate, loop
from lagcli.simulation.error_estimate import LATE, Accuracy
from lagcli.simulation.loop import Run, RunBlock
from lagcli.simulation.row_writer import TableRows
from lagcli.simulation.run_state.between_steps import RunState
from lagcli.simulation.run_state.run_stop import RunStop, Stop
from lagcli.simulation.run_state.statistics import Incident, RunStatistics, Tally
from lagcli.simulation.scheme import step_tolerance


class RunWithReference:
    """A run from its start and the same run at another tolerance, which is kept no farther ahead than a block; the
    columns `COLUMNS` tell of the errors of `columns_of_kinds`."""

    COLUMNS = error_estimate.COLUMNS

    def __init__(self, run: Run, begin: loop.RunStart) -> None:
        settings, system = begin.settings, begin.enforced.system
        again = error_estimate.repeated(settings)
        self._tolerance = float(step_tolerance.of_steps(again)[0])
        self._run = run
        part = error_estimate.PARAMETERS.first_step
        smaller = dataclasses.replace(begin, settings=again, notes=(), part=part, is_again=True)
        self._again = loop.start(smaller, TableRows(system.columns))
        self._ahead = self._again.blocks()
        self._waiting = np.zeros((0, 1 + len(system.columns)))
        self._broken: Stop | None = None
        window = error_estimate.window(run.grid.count) if begin.enforced.has_time else 0
        relative = settings.rtol + step_tolerance.absolute(settings, 1.0) * (settings.atol is None)
        parted = error_estimate.Parting(window, relative, settings.atol or 0.0)
        self.columns_of_kinds = error_estimate.columns_of_kinds(system)
        factor = error_estimate.safety(settings)
        self._errors = error_estimate.Errors(self.columns_of_kinds, factor, parted)
        self._at_incidents = IncidentErrors(self.columns_of_kinds, factor)
        self._last: Floats | None = None  # t and errors of the row before the block
        # The run as it stood behind the last whole block, and where rows end within one, with the incidents up to
        # there: only where the repeated run has stopped there.
        self._mark: RunState | None = None
        self._cut: float | None = None
        self._incidents: list[Incident] = []
        self._taken = 0

    @property
    def statistics(self) -> RunStatistics:
        """The account of the repeated run."""
        return self._again.statistics

    @property
    def accuracy(self) -> Accuracy | None:
        """The estimate at the last row handed out, None before the first."""
        return self._errors.accuracy(self._again, self._tolerance)

    def of_table(self, rows: Floats) -> Accuracy | None:
        """The estimate for a table (T, columns) in place of the rows of the first run; None where its times are not
        those of the grid. Raises `RunStop` where the repeated run stops before the last of them."""
        known = 0
        for again in self._ahead:
            others = again.rows
            part = rows[known : known + len(others)]
            times = part[:, 0], others[: len(part), 0]
            if len(part) < len(others) or not np.allclose(*times, rtol=doubles.VALUE, atol=0):
                return None
            self._errors.sides.add(1, again.incidents)
            self._errors.take(part, others, None)
            known += len(others)
        return self.accuracy if known == len(rows) else None

    def blocks(self) -> Iterator[RunBlock]:
        """Blocks of rows (k, columns + 4), the errors last, and of incidents, their lines with errors too. Raises
        `RunStop` after the last good one, also where the repeated run stops and the first does not."""
        run = self._run
        for block in run.blocks():
            # The next rows of the repeated run; less where it has stopped.
            rows, parts, have = block.rows, [self._waiting], len(self._waiting)
            try:
                while have < len(rows):
                    again = next(self._ahead)
                    parts.append(again.rows)
                    self._errors.sides.add(1, again.incidents)
                    self._at_incidents.add(again.incidents)
                    have += len(parts[-1])
            except RunStop as stopped:
                stop = stopped.stop
                why = f"the run repeated at other tolerances {stop.reason}; the errors of rows after it are not known"
                self._broken = dataclasses.replace(stop, reason=why)
            others = np.concatenate(parts)
            self._waiting, others = others[len(rows) :].copy(), others[: len(rows)]
            known = len(others)
            self._errors.sides.add(0, block.incidents)
            errors = self._errors.take(rows[:known], others, block.incidents)
            # The incidents that come with rows, their lines with errors.
            lines, incidents = np.hstack([rows[:known, :1], errors]), block.incidents
            if self._last is not None:
                lines = np.vstack([self._last, lines])
            if len(lines):
                self._last = lines[-1]
                incidents = self._at_incidents.extended(incidents, run.origin + run.grid.time(0), lines)
            if known < len(rows):
                if known:
                    self._cut = run.grid.time(self._taken + known - 1)
                    last = run.origin + self._cut
                    self._incidents = [incident for incident in incidents if incident.t <= last]
                    yield RunBlock(np.hstack([rows[:known], errors]), self._incidents)
                assert self._broken is not None, "the rows of both runs stand on one grid"
                raise RunStop(self._broken)
            self._taken += known
            yield RunBlock(np.hstack([rows, errors]), incidents)
            self._mark = run.run_state()

    def run_state(self) -> RunState:
        """The state to go on from after the rows handed out so far."""
        if self._cut is None:
            return self._run.run_state()
        run_state = self._mark or self._run.run_state()
        reported = functools.reduce(Tally.plus, self._incidents, run_state.reported)
        return dataclasses.replace(run_state, row=self._cut, reported=reported)


class IncidentErrors:
    """Incidents of the repeated run that wait for those of the run, in their order by kind and name. kinds: the columns
    of each kind in a row of the table; factor: on the distance of the two runs."""

    def __init__(self, kinds: tuple[list[int], ...], factor: float) -> None:
        self._kinds, self._factor = kinds, factor
        self._waiting: dict[tuple[str, str], collections.deque[Incident]] = {}

    def add(self, incidents: Sequence[Incident]) -> None:
        """Incidents of the repeated run, in the order of time."""
        for one in incidents:
            self._waiting.setdefault((one.kind, one.name), collections.deque()).append(one)

    def extended(self, incidents: Sequence[Incident], start: float, rows: Floats) -> list[Incident]:
        """Incidents of the run in the order of time, their lines with errors (4,) at the end. start: the time of the
        first row; rows (k, 5): times with the errors up to each. An error is the larger of that at the row before and
        that at the incident, nan where the repeated run has no such incident by then."""
        found = []
        for t, group in itertools.groupby(incidents, key=lambda incident: incident.t):
            reported, partners, late = list(group), list[Incident](), LATE * (t - start)
            for one in reported:
                waiting = self._waiting.get((one.kind, one.name), collections.deque())
                while waiting and waiting[0].t < t - late:
                    waiting.popleft()
                if waiting and waiting[0].t <= t + late:
                    partners.append(waiting.popleft())
            row = int(np.searchsorted(rows[:, 0], t, "left")) - 1
            least = rows[row, 1:] if row >= 0 else np.zeros(len(self._kinds))
            before = after = np.full(len(self._kinds), np.nan)
            if len(partners) == len(reported):
                partners.sort(key=lambda incident: incident.t)
                before = np.maximum(least, self._errors(reported[0].before, partners[0].before))
                after = np.maximum(before, self._errors(reported[-1].after, partners[-1].after))
            for one in reported:
                lines = np.append(one.before, before), np.append(one.after, after)
                found.append(dataclasses.replace(one, before=lines[0], after=lines[1]))
        return found

    def _errors(self, line: Floats, other: Floats) -> Floats:
        """The largest distance of two lines for each kind; they have no t, and what has no value does not count."""
        with np.errstate(invalid="ignore"):
            gaps = np.abs(line - other)
        gaps[~np.isfinite(gaps)] = 0.0
        largest = [gaps[np.array(at, dtype=int) - 1].max(initial=0.0) for at in self._kinds]
        return np.asarray(self._factor * np.array(largest))
