"""The rows of the grid from the steps of a run: at their ends, and from their dense output within them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Floats
from lagcli.simulation.run_state.run_stop import NOT_FINITE, StepFailure
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.grid import AT_END
from lagcli.simulation.stepping.step_trial import BESIDE
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.start.initial import State

# Where W stands in a line.
WORK = -2


class TableRows(NamedTuple):
    """The rows that are made: their columns after t; of the grid only the first and the last where `ends_only`."""

    columns: tuple[str, ...]
    ends_only: bool = False


class RowWriter:
    """Lines of a block; next_row: the number of the next row of the grid; last: the time of the last row."""

    def __init__(self, stepper: Stepper, made: TableRows, next_row: int, last: float = -math.inf) -> None:
        self._stepper, self._columns, self._ends_only = stepper, made.columns, made.ends_only
        self.grid, self.next_row = stepper.grid, next_row
        self.lines, self.filled, self.capacity = np.empty((0, 0)), 0, 0
        # Where the last step begins that was looked at for rows.
        self.last, self.begun = last, -math.inf
        stepper.row_time = self.grid.time(next_row)
        # What the rows say of contacts: columns of their multipliers, and of the positions.
        system = stepper.bound.enforced.system
        self._names = system.model.contact_names
        columns = {name: i for i, name in enumerate(system.columns, start=1)} if self._names else {}
        self.multipliers = [columns[f"lambda.{name}"] for name in self._names]
        self._positions = [columns[name] for name in system.model.coordinate_names] if self._names else []

    @property
    def width(self) -> int:
        """The numbers of a line."""
        return self._stepper.trial.rows.line.size

    @property
    def is_done(self) -> bool:
        """True if all rows of the grid have been written."""
        return self.next_row == self.grid.count

    @property
    def complete(self) -> int:
        """The rows of the grid that the run is beyond."""
        is_within = self._ends_only and 0 < self.next_row < self.grid.count
        return self.grid.first(math.nextafter(self._stepper.t, math.inf)) if is_within else self.next_row

    def open(self, capacity: int) -> None:
        """Begin a block, in memory of its own, with a line more than its capacity for the row of an event that ends the
        run."""
        self.lines, self.filled, self.capacity = np.empty((capacity + 1, self.width)), 0, capacity

    def close(self) -> Floats:
        """The lines of the block."""
        block = self.lines[: self.filled]
        return block.copy() if 2 * self.filled < len(self.lines) else block

    def put_begin(self) -> None:
        """Write the next row from the state where the run stands."""
        run, rows = self._stepper, self._stepper.trial.rows
        rows.put(run.origin + run.t, run.bound.y)
        rows.cells[0] = run.origin + run.row_time
        self._put_line()

    def put_state(self) -> bool:
        """Write the rows at the state where the run stands, if any; False where the block is full before. Behind a
        switch of functions of t they may lie a few roundings of the time before it."""
        while self._stepper.row_time <= self._stepper.t:
            if self.filled == self.capacity:
                return False
            self.put_begin()
        return True

    def put_last(self) -> None:
        """Write the row of the event that has ended the run, in place of one of the grid at the same instant. Only a
        row within the step that the event ends gives way: one where that step begins may have left already."""
        run = self._stepper
        if self.grid.is_rounding(run.t - self.last, run.origin + run.t):
            if self.last <= self.begun or not self.filled:
                return
            self.filled, self.next_row = self.filled - 1, self.next_row - 1
        run.row_time = run.t
        self.put_begin()

    def put_rows(self, step: FoundStep) -> bool:
        """Write the rows of the grid within the step that was found; False where the block is full before. The row at
        an incident is that of the state after it, and is left."""
        run, rows = self._stepper, self._stepper.trial.rows
        t, reached, taken = run.t, step.reached, step.taken
        self.begun, capacity = t, self.capacity
        before = reached
        if step.is_jump:
            # The time of an incident has its rounding; across a switch no row is before it.
            before = t if step.is_still else reached - AT_END * math.ulp(run.origin + reached)
        row_time = run.row_time
        if step.work is None and row_time < before and step.is_ordinary:
            # Nearly all rows of nearly all tables are such: what they do not need is not asked for.
            lines, time, origin = self.lines, self.grid.time, run.origin
            begun, first = self.filled, self.next_row
            trigger, at, x, line, cells = rows.inside.trigger, rows.at, rows.x, rows.line, rows.cells
            run.trial.make_dense()
            filled = begun
            while row_time < before and filled < capacity:
                at[0], x[0] = origin + row_time, (row_time - t) / taken
                trigger()
                if not math.isfinite(cells[-1]):
                    break
                lines[filled] = line
                filled += 1
                self.last = row_time
                row_time = time(first + filled - begun)
            self._require_pushes(lines[begun:filled])
            self.filled, self.next_row, run.row_time = filled, first + filled - begun, row_time
        while run.row_time <= reached:
            if step.is_jump and run.row_time >= before:
                break
            if self.filled == capacity:
                return False
            row_time = run.row_time
            rows.at[0] = run.origin + row_time
            if step.is_still:
                rows.put(rows.at[0], run.bound.y)
            elif step.singular_step is not None:
                from lagcli.simulation.stepping import interpolate_rows

                interpolate_rows.put_in_singular_step(run, step.singular_step, row_time)
            elif row_time < reached or step.barrier is not None:
                run.trial.make_dense()
                rows.x[0] = (row_time - t) / taken
                rows.inside.trigger()
            else:
                rows.put(rows.at[0], run.bound.new)
            self._put_line(step)
        return True

    def _put_line(self, step: FoundStep | None = None) -> None:
        """Write the line at hand as the next row, within a step or where the run stands."""
        run, line = self._stepper, self._stepper.trial.rows.line
        if not math.isfinite(run.trial.rows.cells[-1]) and (step is None or step.singular_step is None):
            if step is not None and run.row_time < step.reached:
                line[:] = self._limit(step)
            bad = np.flatnonzero(~np.isfinite(line[:-1]))
            if bad.size:  # else the sum overflowed, and nothing else
                # Beyond the columns are energies.
                names = [f"the column `{name}`" for name in self._columns] + ["the energy balance"]
                what = names[min(int(bad[0]) - 1, len(names) - 1)]
                raise StepFailure(f"{what} is not finite at t = {run.trial.rows.at[0]:.9g}", NOT_FINITE)
        if step is not None and step.work is not None:
            line[WORK] = step.work.at(run.row_time)
        self._require_pushes(line[None, :])
        self.lines[self.filled] = line
        self.filled, self.last = self.filled + 1, run.row_time
        self.next_row += 1
        if self._ends_only:
            self.next_row = max(self.next_row, self.grid.count - 1)
        run.row_time = self.grid.time(self.next_row)

    def _limit(self, step: FoundStep) -> Floats:
        """A row within a step at a point where the rows of B, or the levels of integrals, have no direction. Where the
        integrals are the reason, it is the row without them. Else it is the limit along the motion, from two points on
        either side: differences then shrink with the distance, and at a jump or a pole they do not."""
        from lagcli.simulation.stepping import interpolate_rows

        run, rows, enforced = self._stepper, self._stepper.trial.rows, self._stepper.bound.enforced
        at, x, lines = rows.at[0], rows.x[0], []
        if enforced.is_any:
            inside = enforced.plain.functions.scheme(run.method).line_inside
            plain = np.array(inside(at, x, run.bound.y, rows.dense.results[0], enforced.p)).ravel()
            if math.isfinite(plain[-1]):
                return plain
        for side in (-2, -1, 1, 2):
            rows.x[0], rows.at[0] = x + side * BESIDE, at + side * BESIDE * step.taken
            rows.inside.trigger()
            lines.append(rows.line.copy())
        rows.at[0] = at
        found = interpolate_rows.between(np.array(lines))
        found[0] = at
        return found

    def deepest(self, rows: Floats) -> float:
        """The largest -g_j over rows (k, columns), t first; 0 where none is below zero."""
        if not self._names or not len(rows):
            return 0.0
        plain = self._stepper.bound.enforced.plain
        gaps = plain.functions.numeric.gaps
        y = np.zeros((gaps.size1_in(1), len(rows)))
        y[: len(self._positions)] = rows[:, self._positions].T
        p = np.asarray(plain.p)[: gaps.size1_in(2)]
        g = np.array(gaps(rows[:, :1].T, y, np.repeat(p[:, None], len(rows), axis=1)))
        return max(0.0, float(np.nan_to_num(-g).max()))

    def _require_pushes(self, lines: Floats) -> None:
        """Raise `StepFailure` where a contact pulls in lines (k, columns), t first, by more than rounding and
        tolerance."""
        if not self._names or not (lines[:, self.multipliers] < 0.0).any():
            return
        from lagcli.simulation.closed_contacts import contact_instant
        from lagcli.simulation.events import step_watch

        run, n = self._stepper, len(self._positions)
        numeric, rtol = run.bound.enforced.plain.functions.numeric, float(run.tolerance[0])
        values = contact_instant.ContactRowValues(numeric, len(run.bound.enforced.system.rows.rows))
        parameters = contact_instant.PARAMETERS
        share = parameters.clearly * max(1.0, rtol / parameters.weightless)
        for line in lines[(lines[:, self.multipliers] < 0.0).any(axis=1)]:
            state = State(float(line[0]), line[self._positions], run.bound.y[n : 2 * n], run.bound.enforced.p)
            chosen = contact_instant.ContactParameters(rtol, size=run.contacts.size)
            here = contact_instant.ContactInstant(values, state, chosen)
            forces = line[self.multipliers]
            numbers = np.flatnonzero(forces < 0.0)
            least = share * here.least_forces(numbers, run.bound.k[n : 2 * n])
            pulling = [self._names[j] for j in numbers[-forces[numbers] > least].tolist()]
            if pulling:
                raise step_watch.pulls(pulling)
