"""Takes the steps: accepts or rejects, fills the grid from the dense output, and stops with a reason.

Rows leave in blocks while the run goes on; the memory it needs does not grow with its length.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from lagcli.compiled.bound_function import BoundFunction, cells
from lagcli.compiled.selection import Selection
from lagcli.equations import energy_jumps
from lagcli.equations.time_functions import TimeFunctions
from lagcli.model.model import Simulation
from lagcli.simulation import (
    collocation,
    first_step,
    interpolate_rows,
    invariants,
    line_functions,
    method,
    rank_dip,
    singular_point,
    singularity_step,
    step_tolerance,
    stop_reasons,
    switch_states,
)
from lagcli.simulation import grid as grids
from lagcli.simulation.angle_turns import Turns
from lagcli.simulation.checkpoint import CheckpointError, RunState
from lagcli.simulation.invariants import EnforcedInvariants
from lagcli.simulation.singularity_monitor import BACK, CLOSE_START, NEVER, SingularityMonitor
from lagcli.simulation.statistics import Figures, RunStatistics
from lagcli.simulation.timetable import Timetable
from lagcli.simulation.witness_times import Witnesses
from lagcli.simulation.work_integral import COARSE, Work, within
from lagcli.start import initial

Floats = npt.NDArray[np.float64]

BLOCK_VALUES = 2**16  # numbers in a block of rows
PAUSE = 0.1  # seconds after which the rows so far, be there none, are handed out: for progress and interrupts
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
# A landed state off the constraints by more than this part of its size was not reached by Newton: a smaller step.
LANDING = 1e-9
# A step of this error is right, and so are rows that are independent: where it does not land, integrals may be the
# reason.
CERTAIN = 1e-6
# A row where nothing has a value is a limit from points at this part of a step, and at twice that.
NEAR = 1e-4
# Where the drifts of a row stand in a line: rounding, which is not interpolated.
DRIFTS = slice(-line_functions.BEYOND, -line_functions.BEYOND + 2)
# Where W stands in a line.
WORK = -2
# A step from a singular configuration moves by this part of its size, or less.
FIRST = 0.1
# A step in which rows have been dependent unseen counts as one of this error, which halves it; down to this part of
# the step proposed, for rounding may look the same.
HIDDEN, HIDING = 100.0, 1e-3
# A step is wrong where the dense output is off the equations by so many tolerances at a row, and counts as one of
# this error then.
FORGIVEN, UNSEEN = 3e3, -1.0
# Rows that are this close to dependent ones where a run stops are the reason.
DEPENDENT, SOON = 1e-2, 1e-4
# Rows that are independent in themselves, but this close to dependent ones in the mass metric, amplify rounding so much
# that a step may not reach its tolerance: masses differ by 1e8.
WEIGHED = 1e-4
# Every PACE steps a run is asked how many more it would take like this; HOPELESS many would take days.
PACE, HOPELESS = 5000, 1e10
# So many parts of a step are looked at for switches of what must not jump; on the curve of the dense output.
WAY = np.linspace(0.0, 1.0, 17)
NONE_TRIED: invariants.Tried = frozenset()
BELOW_ROUNDING = "the step needed for the tolerance is below the rounding of the time"


# Why a run stops, as codes for `lagcli explain`.
SINGULAR, NO_SOLUTION = "singular-constraints", "no-solution-beyond"
NOT_FINITE, TOO_SMALL = "not-finite", "step-too-small"


@dataclasses.dataclass(frozen=True, slots=True)
class Stop:
    """Why a run ended before its end: the time reached, a sentence, and one of the codes of `catalogue.stops`."""

    t: float
    reason: str
    code: str


class RunStop(Exception):
    """The integration cannot go on; rows given so far are complete and right."""

    def __init__(self, stop: Stop) -> None:
        super().__init__(stop.reason)
        self.stop = stop


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunStart:
    """A consistent start, q and v (n,); is_singular: the rows are dependent there and not nearby; part: of the usual
    first step, with which the run begins; is_again: it repeats another run and must not miss what that one may."""

    q: Floats
    v: Floats
    is_singular: bool = False
    part: float = 1.0
    is_again: bool = False


class Run:
    """One integration, from a consistent start or from where another run was marked; `columns` after t.

    held: the functions, with the integrals that are held at the start or at the mark; notes: what was said about
    them at the start; timed: what the model says about t alone. Times in here, `t` and the grid too, are counted from
    `origin`. Iterate `blocks` once; `account` is filled as they come.
    """

    def __init__(
        self,
        held: EnforcedInvariants,
        begin: RunStart | RunState,
        settings: Simulation,
        columns: tuple[str, ...],
        notes: tuple[str, ...] = (),
        timed: TimeFunctions | None = None,
    ) -> None:
        self.origin = begin.origin if isinstance(begin, RunState) else grids.origin(settings, held.has_time)
        self.grid = grid = grids.grid(dataclasses.replace(settings, start=settings.start - self.origin))
        spoken = timed if held.has_time else None
        is_again = isinstance(begin, RunStart) and begin.is_again
        longest = settings.max_step or math.inf
        self._timetable = Timetable(spoken, grid.start, grid.step, longest, 0 if is_again else 1)
        self._witnesses = Witnesses(grid, spoken, is_again)
        # What steps need not be asked about at all.
        self._is_timed, self._is_witnessed = self._timetable.is_any, self._witnesses.is_any
        self._columns = columns
        self.account = RunStatistics(notes=notes)
        self._resumed = begin if isinstance(begin, RunState) else None
        state = begin.y if isinstance(begin, RunState) else np.concatenate([begin.q, begin.v, [0.0]])
        self._is_singular = isinstance(begin, RunStart) and begin.is_singular
        self._part = begin.part if isinstance(begin, RunStart) else 1.0
        self._tolerance = step_tolerance.of_steps(settings)
        self._method = method.of(settings)
        self._exponent = -1.0 / self._method.order
        # A run counts its turns in numbers of its own.
        held = dataclasses.replace(held, p=held.p.copy())
        self._turns = Turns(held.integrals.system)
        if isinstance(begin, RunState):
            self._turns.resume(held.p, begin.turns)
        self._bind(held, np.array(state, dtype=float))
        self.t = self._reached = self._pace_from = self._t_cell[0] = grid.start
        self._step_size = self._taken = self._proposed = 0.0
        self._watch = SingularityMonitor()
        self._foreseen = NEVER
        self._passage: singularity_step.SingularStep | None = None
        # W in the step just found, where its stages were too few for it.
        self._work: Work | None = None
        self._in_step = self._has_dense = self._is_still = False
        # The state before the last step that is what a longer run would have taken; None where that is the last.
        self._undisturbed: RunState | None = None
        self._next_row = self.passed_over = 0
        if self._resumed is not None:
            self._resume(self._resumed)
        self._barrier: energy_jumps.Jump | None = None
        self._row_time = grid.time(self._next_row)
        self._row = -math.inf if self._resumed is None else self._resumed.row
        self._settle()

    def _bind(self, held: EnforcedInvariants, y: Floats) -> None:
        """The compiled functions on their arrays: y and k at the begin of a step, new and k_new at its end."""
        self._held = held
        scheme = held.functions.scheme(self._method)
        numeric, p = held.functions.numeric, held.parameters
        self._p = p
        t, h, at, x = (np.zeros(1) for _ in range(4))
        k = np.zeros(y.size)
        self._y, self._k = y, k
        self._rhs = BoundFunction(numeric.rhs, [t, y, p])
        self._land = BoundFunction(numeric.land, [t, y, p])
        aside = np.zeros(1)
        self._land_aside = BoundFunction(numeric.land, [aside, np.zeros(y.size), p])
        arguments = [t, h, y, k, self._tolerance, p]
        self._step = BoundFunction(scheme.step, arguments, wanted=3)
        new, k_new, outcome = self._step.results
        # The same step with its stages, for the dense output of one that holds rows.
        self._staged_step = BoundFunction(scheme.step, arguments, given=self._step.results)
        stages = self._staged_step.results[3:]
        self._dense = BoundFunction(scheme.dense, [t, h, y, new, k_new, p, k, *stages])
        coefficients = self._dense.results[0]
        if self._is_witnessed:
            inputs = [at, x, h, y, coefficients.T, self._tolerance, p]
            self._defect = BoundFunction(scheme.defect, inputs)
        self._line_inside = BoundFunction(scheme.line_inside, [at, x, y, coefficients.T, p])
        line = self._line_inside.results
        self._line_begin = BoundFunction(scheme.line_at, [at, y, p], given=line)
        self._line_aside = BoundFunction(scheme.line_at, [at, np.zeros(y.size), p], given=line)
        self._line_end = BoundFunction(scheme.line_at, [at, new, p], given=line)
        self._line = line[0]
        self._new, self._k_new = new, k_new
        # What every step and every row reads and writes.
        self._t_cell, self._h_cell, self._at_cell, self._x_cell = map(cells, (t, h, at, x))
        self._land_cells = cells(aside)
        self._outcome, self._line_cells = cells(outcome), cells(self._line)

    def _resume(self, mark: RunState) -> None:
        grid = self.grid
        self.t = self._reached = self._t_cell[0] = mark.t
        self._k[:] = mark.k
        self._step_size, self._pace_from = mark.step, mark.pace_from
        counted = mark.steps, mark.rejected, mark.evaluations
        self.account = RunStatistics(*counted, 0.0, mark.figures, mark.notes, mark.crossings)
        self._watch = SingularityMonitor(mark.watch)
        self._foreseen = self._watch.again()
        # The rows that another grid has between the last one handed out and the mark are lost.
        after = grid.after(mark.row)
        self._next_row = max(after, grid.first(mark.t))
        self.passed_over = self._next_row - after

    def require_rows_left(self) -> None:
        """Raise `CheckpointError` where all rows of a resumed run were handed out before."""
        mark = self._resumed
        if mark is not None and self._next_row >= self.grid.count:
            raise CheckpointError(
                f"nothing is left to do: it is at t = {self.origin + mark.t:.9g} with its last row at"
                f" {self.origin + mark.row:.9g}, and the run ends at {self.origin + self.grid.end:.9g}; a longer"
                " duration goes on"
            )

    @property
    def y(self) -> Floats:
        """The state reached, (2n + 1,)."""
        return self._y.copy()

    def mark(self) -> RunState:
        """Where to go on from, with all rows handed out so far; for the time between two blocks."""
        figures = self.account.figures
        assert figures is not None, "the first block holds the first row"
        base = self._undisturbed or self._here(figures)
        return dataclasses.replace(base, row=self._row, figures=figures)

    @property
    def rate(self) -> Floats:
        """y' there, (2n + 1,)."""
        return self._k.copy()

    @property
    def selection(self) -> Selection:
        """The independent rows it is stepped with."""
        return self._held.integrals.selection

    def _here(self, figures: Figures) -> RunState:
        state = self._t_cell[0], self._y.copy(), self._k.copy(), self._step_size, self._pace_from
        held = self._settled
        chosen = held.integrals.selection, held.levels
        base = RunState(*state, *self._counted, self._row, figures, *chosen, self._notes)
        watched = dataclasses.replace(base, watch=self._watched, crossings=self._crossings)
        return dataclasses.replace(watched, origin=self.origin, turns=self._turns.of(self._held.p))

    def _settle(self) -> None:
        """Keep what belongs to the state from which the next step is tried."""
        account = self.account
        self._counted = account.steps, account.rejected, account.evaluations
        self._settled, self._notes = self._held, account.notes
        self._watched, self._crossings = self._watch.state, account.crossings
        self._tried: invariants.Tried = NONE_TRIED

    def blocks(self) -> Iterator[Floats]:
        """Blocks of complete rows, shape (k, 1 + columns), t first; one at least every `PAUSE`, maybe empty.

        Raises `Stopped` after the last good row.
        """
        width = self._line.size
        capacity = max(1, min(self.grid.count, BLOCK_VALUES // width))
        stop: RunStop | None = None
        going = True
        while going:
            began = time.perf_counter()
            # Handed out without a copy, so that each needs memory of its own.
            self._lines, self._filled = np.empty((capacity, width)), 0
            try:
                going = not self._fill(began + PAUSE)
            except RunStop as stopped:
                stop, going = stopped, False
            block = self._lines[: self._filled]
            if 2 * self._filled < capacity:
                block = block.copy()
            if self._filled:
                self.account.keep(block[:, -line_functions.BEYOND : -1])
                self._row = self.grid.time(self._next_row - 1)
            rows = block[:, : -line_functions.BEYOND]
            rows += 0.0  # no table shows -0.0
            self.account.solve_seconds += time.perf_counter() - began
            if self._filled or going:
                yield rows
        if stop is not None:
            raise stop

    def _fill(self, until: float) -> bool:
        """Take steps and put their rows into the block until it is full or the time is over; True at the end."""
        if self._step_size == 0.0:
            self._begin()
        count = self.grid.count
        while True:
            if self._in_step:
                if not self._put_rows():
                    return False
                if self._next_row == count:
                    self.t = self.grid.end
                    return True
                self._accept()
                if time.perf_counter() > until:
                    return False
            elif self._next_row == count:
                return True
            if self._is_timed and self._stand():
                continue
            if self._foreseen is NEVER or not (self._foreseen.is_any and self._pass()):
                self._advance()
            self._end_at_jump()

    def _end_at_jump(self) -> None:
        """End the step just found where a potential, the Lagrangian or a place jumps in it."""
        jumps = self._held.integrals.system.jumps
        if jumps is None:
            return
        t, taken, n, p = self.t, self._taken, self._y.size // 2, self._held.p
        y, new, k, k_new = self._y, self._new, self._k, self._k_new

        def curve(x: float) -> Floats:
            if self._passage is not None:
                return self._passage.step.state(x)
            if self._has_dense:
                return np.asarray(self._method.interpolated(y, self._dense.results[0], x))
            ahead, bends = new - y, taken * ((1 - x) * k - x * k_new) + (2 * x - 1) * (new - y)
            return np.asarray(y + x * ahead + x * (1 - x) * bends)

        def way(x: float) -> energy_jumps.Place:
            state = curve(x)
            return self.origin + t + x * taken, state[:n], state[n : 2 * n]

        if not jumps.is_crossed(way, WAY, p):
            return
        if self._passage is None and not self._has_dense:
            self._staged_step.trigger()
            self.account.evaluations += self._method.evaluations
            self._make_dense()
        self._barrier = jumps.first(way, WAY, p)
        if self._barrier is not None:
            self._reached = t + self._barrier.part * taken

    def _stop_before(self, barrier: energy_jumps.Jump) -> NoReturn:
        self.t = self._reached
        self._stop(
            f"{barrier.told}: the force is an impulse, which the equations of motion do not describe",
            NO_SOLUTION,
        )

    def _begin(self) -> None:
        """The start: its row, and the first step."""
        if self._is_singular:
            speed = float(np.abs(self._y[self._y.size // 2 : -1]).max())
            self._step_size = (
                self._part * FIRST * float(np.abs(self._y[: self._y.size // 2]).max() or 1.0) / speed
            )
            self._foreseen = self._watch.stand(self.t)
            self._settle()
            return
        # It may lie off the constraints by rounding; the first row and the first step begin on them.
        self._land.trigger()
        self._y[:], self._k[:] = self._land.results[0], self._land.results[1]
        clearance, least = self._land.results[2][1:3].tolist()
        self.account.evaluations += 1
        if not np.isfinite(self._k).all():
            self._stop("the accelerations are not finite at the start", NOT_FINITE)
        self.account.evaluations += 1
        self._step_size = self._part * first_step.first_step(
            self._rhs, self._k, self._land.results[3], float(self._tolerance[0]), self._method.order
        )
        if clearance < CLOSE_START**2:
            # No step is wasted towards a singular configuration so near: each amplifies rounding more.
            self._look_back(BACK * self._step_size)
        self._foreseen = self._watch.foreseen(self.t, clearance, least)
        self._settle()
        self._at_cell[0] = self.origin + self.t
        self._line_begin.trigger()
        self._put_line()

    def _look_back(self, tau: float) -> None:
        """Watch a time before the start, where Euler's step backward leads, so that the start itself foresees."""
        self._land_cells[0], self._land_aside.arguments[1][:] = self.t - tau, self._y - tau * self._k
        self._land_aside.trigger()
        self._count_aside()
        residual, clearance, least = self._land_aside.results[2][:3].tolist()
        if residual <= LANDING:
            self._watch.foreseen(self.t - tau, clearance, least)

    def _advance(self) -> None:
        """Find an acceptable step from the current state.

        The last step is cut to end where the run does. Where it is rejected the whole step is tried, as a
        longer run would have tried it, so that the steps up to the last do not depend on the end.
        """
        t, end = self.t, self.grid.end
        h, wished = self._lengths(t)
        grow, shorter = GROW, 0.0
        while True:
            # The step ends at a time that is a double, so that t and the state go on together.
            reached = t + h
            taken = reached - t
            if not taken > 0.0:
                self._stop(BELOW_ROUNDING, TOO_SMALL)
            last = reached >= end or end - reached < 1e-12 * h
            is_cut = last and not shorter
            if is_cut:
                reached, taken = end, end - t
            error, smaller = self._try(reached, taken)
            if not smaller:
                if is_cut or not last:
                    break
                # Beyond the end there is a good step, and none up to it: from here on the end matters.
                self._undisturbed = self._undisturbed or self._here(self._figures())
                h = shorter
                continue
            self.account.rejected += 1
            if self._held.is_any and error != UNSEEN and self._outcome[0] < CERTAIN and self._let_go(last):
                continue
            grow = 1.0
            if t + smaller / 64 == t:
                self._stop(*self._why(error, self._outcome[3]))
            if is_cut:
                shorter = smaller
            else:
                h = smaller
        self._foreseen = self._watch.foreseen(reached, self._outcome[4], self._outcome[5])
        self.account.steps += 1
        if self._outcome[7] > COARSE and self.account.is_balanced:
            self._find_work(taken)
        self._in_step = True
        self._reached, self._taken = reached, taken
        grown = taken * min(grow, max(SHRINK, SAFETY * max(error, 1e-10) ** self._exponent))
        # Where the timetable has cut a step, and not its error, the next one has the length that was wished.
        self._proposed = max(grown, wished if h < wished and grow > 1.0 else 0.0)

    def _lengths(self, t: float) -> tuple[float, float]:
        """The length of a step to be tried from t, and what it would be without the timetable."""
        wished = self._step_size
        if self._foreseen is not NEVER:
            wished = self._foreseen.shortened(t, wished)
        return self._timetable.shortened(t, wished) if self._is_timed else wished, wished

    def _try(self, reached: float, taken: float) -> tuple[float, float]:
        """The error of a step, and the length of a smaller one that should be tried; 0 where it may be taken.

        The error is `UNSEEN` where only a witness speaks against it.
        """
        self._h_cell[0], self._has_dense = taken, False
        is_watched = self._row_time < reached or self._is_witnessed
        (self._staged_step if is_watched else self._step).trigger()
        self.account.evaluations += self._method.evaluations
        scheme_error, moved, hidden, residual, _, _, everything, _ = self._outcome
        landed, error = residual <= LANDING, max(scheme_error, moved)
        if hidden < 0.0 and taken > HIDING * self._step_size:
            error = max(error, HIDDEN)
        if error < 1.0 and landed and math.isfinite(everything):
            if not self._is_witnessed:
                return error, 0.0
            unseen = self._unseen(reached, taken)
            return (error, 0.0) if unseen == math.inf else (UNSEEN, unseen - self.t)
        # `not error < 1` also holds for nan: then nothing is known but that the step was too large.
        known = math.isfinite(error) and error >= 1.0 and landed
        return error, taken * (min(0.9, max(SHRINK, SAFETY * error**self._exponent)) if known else 0.25)

    def _unseen(self, reached: float, taken: float) -> float:
        """The first time within a step at which the forces are not those it was made of; infinite where they are."""
        for at in self._witnesses.inside(self.t, reached):
            self._make_dense()
            self._at_cell[0], self._x_cell[0] = self.origin + at, (at - self.t) / taken
            self._defect.trigger()
            self.account.evaluations += 1
            if self._defect.results[0][0] > FORGIVEN:
                return at
        return math.inf

    def _find_work(self, taken: float) -> None:
        """Integrate W over a step on its dense output: the scheme's own W is not right to the tolerance of the run."""
        self._staged_step.trigger()
        self._make_dense()
        span = self.t, taken, self._tolerance[0]
        begin, coefficients = self._y[:, None], self._dense.results[0][:, :, None]
        self._work = within(
            self._land_aside, span, self._y, lambda x: self._method.interpolated(begin, coefficients, x).T
        )
        self._count_aside()
        if self._work is None:
            self.account.doubt()
        else:
            self._new[-1] = self._work.end

    def _make_dense(self) -> None:
        if not self._has_dense:
            self._dense.trigger()
            self.account.evaluations += self._method.dense_evaluations
            self._has_dense = True

    def _stand(self) -> bool:
        """Go to the other side of a time at which functions of t switch, where the state is the same; False where there
        is none here."""
        found = None if self._foreseen.is_here else self._timetable.switch(self.t)
        if found is None:
            return False
        middle, after = (min(t, self.grid.end) for t in found)
        y, k, dt = self._y, self._k, after - self.t
        self._land_cells[0], self._land_aside.arguments[1][:] = after, y
        self._land_aside.trigger()
        landed, rate, *_ = self._land_aside.results
        if self._is_pole(self.t, -dt) or self._is_pole(after, dt):
            self._stop(
                "the accelerations grow beyond all bounds there: a function of t has a pole", NOT_FINITE
            )
        if not switch_states.is_same((y, k), (landed, rate), dt):
            rows = switch_states.violated(self._held.functions.numeric, self._state(after, y))
            self._stop(
                self._jump()
                or f"the rows {self._named(rows)} make velocities jump there: an impact, which the equations of motion"
                " do not describe",
                NO_SOLUTION,
            )
        self._land_aside.arguments[1][:] = y + (middle - self.t) * k + (after - middle) * rate
        self._land_aside.trigger()
        self._count_aside()
        self._new[:], self._k_new[:] = landed, rate
        self._in_step = self._is_still = True
        self._reached, self._taken, self._proposed = after, dt, self._step_size
        return True

    def _is_pole(self, t: float, away: float) -> bool:
        """True if y' at the state grows without bound towards a switch, half of `away` behind a time."""
        rates = [
            np.array(self._held.functions.numeric.rhs(t + part * away, self._y, self._held.p)).ravel()
            for part in (0.0, 1.0, 4.0)
        ]
        self.account.evaluations += len(rates)
        return switch_states.is_pole(rates)

    def _pass(self) -> bool:
        """Take one step across the singular configuration that is foreseen, or away from it; False where there is none
        so near."""
        if self._foreseen.is_here:
            self._leave()
            return True
        if not self._foreseen.is_near(self.t, self._step_size, self._tolerance[0]):
            return False
        if self._foreseen.angle > rank_dip.CERTAIN and self._is_dip():
            return False
        found = singularity_step.across(
            self._held.functions.numeric, self._land_aside, self._point, self._foreseen
        )
        self._count_aside()
        if isinstance(found, Selection):
            self._rebind(self._held.keeping(found))
            self._watch, self._foreseen = SingularityMonitor(), NEVER
        elif found is not None:
            self._cross(found)
        elif self._held.is_any:
            return self._pass_without_integrals()
        return isinstance(found, singularity_step.Crossing)

    def _is_dip(self) -> bool:
        """Whether ordinary steps show that rows only come closer to dependent ones, and part again."""
        place = self._foreseen.place

        def square(h: float) -> float:
            self._h_cell[0] = h
            self._step.trigger()
            self.account.evaluations += self._method.evaluations
            _, _, _, residual, *there, _, _ = self._outcome
            return there[place - 1] if residual <= LANDING else math.nan

        return rank_dip.is_dip(square, self._watch.state[place], self._foreseen.instant - self.t)

    def _rebind(self, held: EnforcedInvariants) -> None:
        y, k = self._y.copy(), self._k.copy()
        self._bind(held, y)
        self._t_cell[0], self._k[:] = self.t, k

    def _pass_without_integrals(self) -> bool:
        """The same where integrals are the reason why there is no step: they may have no direction at the instant.

        Those that hold beyond it are kept, else they are let go.
        """
        plain = self._held.plain.functions.numeric
        land = BoundFunction(plain.land, [np.zeros(1), np.zeros(self._y.size), self._held.p])
        found = singularity_step.across(plain, land, self._point, self._foreseen)
        self.account.evaluations += land.used
        if not isinstance(found, singularity_step.Crossing):
            return False
        step = found.passage.step
        reached, new = step.t + step.h, step.state(1.0)
        if collocation.landed(self._land_aside, reached, new) is not None:
            self._cross(found)
            return True
        ahead = self._state(reached, new)
        held, notes, self._tried = invariants.let_go(
            self._held, self._state(self.t, self._y), ahead, self._tried
        )
        self.account.notes += notes
        self._rebind(held)
        return self._pass()

    def _leave(self) -> None:
        """Take the first step from a singular configuration."""
        numeric, land = self._held.functions.numeric, self._land_aside
        found = singularity_step.away(numeric, land, self._point, self._step_size)
        self._count_aside()
        if found is None:
            self._stop(
                "the start is a singular configuration, and no smooth motion along one of the branches that meet"
                " there has the initial velocities",
                SINGULAR,
            )
        self._cross(found)

    def _count_aside(self) -> None:
        self.account.evaluations += self._land_aside.used
        self._land_aside.used = 0

    @property
    def _point(self) -> singularity_step.Point:
        return singularity_step.Point(self.t, self._y, self._k, self._held.p, self._tolerance)

    def _cross(self, found: singularity_step.Crossing) -> None:
        """Make a step across the step just found."""
        step = found.passage.step
        reached = step.t + step.h
        at_end = step.state((reached - step.t) / step.h)
        self._land_cells[0], self._land_aside.arguments[1][:] = reached, at_end
        self._land_aside.trigger()
        landed, rate, outcome, _ = self._land_aside.results
        self._new[:], self._k_new[:] = landed, rate
        self._foreseen = self._watch.foreseen(reached, outcome[1], outcome[2])
        self.account.steps += 1
        self.account.crossings += (dataclasses.replace(found.loss, t=self.origin + found.loss.t),)
        self._in_step, self._passage = True, found.passage
        self._reached, self._taken = reached, step.h
        self._proposed = self._step_size

    def _let_go(self, is_last: bool) -> bool:
        """After a step that did not land though it is right: leave the integrals that are the reason, if any."""
        t, y, k, h = self.t, self._y, self._k, self._h_cell[0]
        arguments = [np.array([t]), np.array([h]), y, k, self._tolerance, self._held.p]
        step = BoundFunction(self._held.plain.functions.scheme(self._method).step, arguments, wanted=3)
        step.trigger()
        self.account.evaluations += self._method.evaluations
        new, _, (error, moved, _, residual, _, _, everything, _) = step.results
        if not (max(error, moved) < 1.0 and residual <= LANDING and math.isfinite(everything)):
            return False
        if is_last:
            # A longer run may be in another place when it comes to this.
            self._undisturbed = self._undisturbed or self._here(self._figures())
        here, ahead = (self._state(at, state) for at, state in ((t, y), (t + h, new)))
        held, notes, self._tried = invariants.let_go(self._held, here, ahead, self._tried)
        self.account.notes += notes
        self._bind(held, y)
        self._t_cell[0], self._h_cell[0], self._k[:] = t, h, k
        return True

    def _state(self, t: float, y: Floats) -> initial.State:
        n = y.size // 2
        return initial.State(self.origin + t, y[:n], y[n : 2 * n], self._held.p)

    def _accept(self) -> None:
        if self._barrier is not None:
            self._stop_before(self._barrier)
        was_still, self._is_still = self._is_still, False
        self._in_step, self._passage, self._work = False, None, None
        self._t_cell[0] = self.t = self._reached
        self._y[:], self._k[:] = self._new, self._k_new
        self._step_size = self._proposed
        if self._turns.is_any:
            self._count_turns()
        self._settle()
        if self.account.steps % PACE == 0 and not was_still:
            pace_from, self._pace_from = self._pace_from, self.t
            self._check_pace(self.t - pace_from)

    def _count_turns(self) -> None:
        p, n = self._held.p, self._y.size // 2
        self.account.notes += self._turns.settle(self.origin + self.t, self._y[:n], p)
        self._p[: p.size] = p

    def _put_rows(self) -> bool:
        """Put the rows of the grid within the step just found into the block; False where it is full before."""
        t, reached, taken = self.t, self._reached, self._taken
        capacity = len(self._lines)
        while self._row_time <= reached:
            if self._filled == capacity:
                return False
            at = self._row_time
            self._at_cell[0] = self.origin + at
            if self._is_still:
                self._line_aside.arguments[1][:] = self._y
                self._line_aside.trigger()
            elif self._passage is not None:
                self._across(self._passage, at)
            elif at < reached or self._barrier is not None:
                self._make_dense()
                self._x_cell[0] = (at - t) / taken
                self._line_inside.trigger()
            else:
                self._line_end.trigger()
            self._put_line()
        return True

    def _across(self, across: singularity_step.SingularStep, at: float) -> None:
        """The line of a row within a step across a singular configuration."""
        step, tau = across.step, at - across.instant
        if abs(tau) > interpolate_rows.WINDOW * across.width:
            self._put_aside(at, step)
            return
        taus = interpolate_rows.beside(across.width, across.is_start)
        lines = []
        for beside in taus:
            self._put_aside(across.instant + beside, step)
            lines.append(self._line.copy())
        found = np.array(lines)
        self._line[:] = interpolate_rows.interpolated(taus, found, tau)
        self._line[DRIFTS] = found[:, DRIFTS].max(axis=0)
        self._line[0] = self._at_cell[0] = self.origin + at

    def _put_aside(self, at: float, step: collocation.Step) -> None:
        self._at_cell[0] = self.origin + at
        self._line_aside.arguments[1][:] = step.state((at - step.t) / step.h)
        self._line_aside.trigger()

    def _mend(self) -> None:
        """A row within a step at a point where the rows of B, or the levels of integrals, have no direction.

        Where the integrals are the reason, it is the row without them. Else it is the limit along the motion, from
        two points on either side, where all columns have one: their differences then shrink with the distance,
        and where one has a jump or a pole they do not.
        """
        at, x, taken = self._at_cell[0], self._x_cell[0], self._taken
        if self._held.is_any:
            arguments = [at, x, self._y, self._dense.results[0], self._held.p]
            plain = np.array(self._held.plain.functions.scheme(self._method).line_inside(*arguments)).ravel()
            if math.isfinite(plain[-1]):
                self._line[:] = plain
                return
        lines = []
        for side in (-2, -1, 1, 2):
            self._x_cell[0], self._at_cell[0] = x + side * NEAR, at + side * NEAR * taken
            self._line_inside.trigger()
            lines.append(self._line.copy())
        self._at_cell[0] = at
        self._line[:] = interpolate_rows.between(np.array(lines))
        self._line[0] = at

    def _put_line(self) -> None:
        if not math.isfinite(self._line_cells[-1]) and self._passage is None:
            if self._in_step and self._row_time < self._reached:
                self._mend()
            self._require_finite()
        if self._work is not None:
            self._line[WORK] = self._work.at(self._row_time)
        self._lines[self._filled] = self._line
        self._filled += 1
        self._next_row += 1
        self._row_time = self.grid.time(self._next_row)

    def _require_finite(self) -> None:
        bad = np.flatnonzero(~np.isfinite(self._line[:-1]))
        if not bad.size:
            return  # the sum overflowed, and nothing else
        column = int(bad[0]) - 1
        known = column < len(self._columns)
        what = f"the column `{self._columns[column]}`" if known else "the energy balance"
        self._stop(f"{what} is not finite at t = {self._at_cell[0]:.9g}", NOT_FINITE)

    def _figures(self) -> Figures:
        """Those of the rows handed out; a block that is being filled is not yet among them."""
        return self.account.figures or Figures(0.0, 0.0)

    def _check_pace(self, advanced: float) -> None:
        """Stop a run that would not end in any time one can wait."""
        if (self.grid.end - self.t) * PACE > HOPELESS * advanced:
            self._stop(
                self._jump()
                or f"the last {PACE} steps advanced by {advanced:.2g}, so that the run would need"
                f" {(self.grid.end - self.t) / max(advanced, 1e-300) * PACE:.0e} more: the motion chatters across"
                " a jump of the forces, the forces are far too stiff for an explicit scheme, or the run is too long",
                TOO_SMALL,
            )

    def _why(self, error: float, residual: float) -> tuple[str, str]:
        """The reason why no step can be taken, and its code."""
        nearness, is_alone = self._watch.nearness
        is_near, numeric = nearness < DEPENDENT, self._held.functions.numeric
        is_soon = self._foreseen.instant - self.t < SOON * (self.grid.end - self.grid.start)
        here = self._state(self.t, self._y)
        apart = singular_point.apart(numeric, here) if is_near and not is_alone else None
        if is_near and is_soon and apart is None:
            told = self._named(singular_point.closest(numeric, here, is_alone))
            what = f"the gradient of {told} vanishes" if is_alone else f"the rows {told} become dependent"
            return (
                f"{what} there, a singular configuration through which this motion does not go on smoothly (a toggle"
                " position, or a cusp)",
                SINGULAR,
            )
        jump = self._jump()
        if jump:
            return jump, NO_SOLUTION
        if apart is not None and nearness < WEIGHED:
            told = f"inertias that differ by a factor of {apart:.0e} amplify rounding"
            return f"{BELOW_ROUNDING}: {told}", TOO_SMALL
        if not math.isfinite(error) or not math.isfinite(residual):
            return (
                "the accelerations or multipliers are not finite there: the constraints become dependent,"
                " or a function of the model has a pole",
                NOT_FINITE,
            )
        if residual > LANDING:
            ahead = self._state(self.t + self._h_cell[0], self._new)
            parting = singular_point.departed(numeric, ahead, LANDING)
            if parting:
                told = f"the rows {self._named(parting)} contradict each other beyond: they agree up to here"
                return told, NO_SOLUTION
            return "the constraints have no solution after this time", NO_SOLUTION
        return BELOW_ROUNDING, TOO_SMALL

    def _jump(self) -> str:
        state = self._state(self.t, self._y)
        return stop_reasons.reason(self._held.integrals.system, self._held.plain.functions.numeric, state)

    def _named(self, rows: tuple[int, ...]) -> str:
        names = [name.removeprefix("lambda.") for name in self._columns if name.startswith("lambda.")]
        return ", ".join(f"`{names[i]}`" for i in rows[: initial.MOST_TOLD])

    def _stop(self, reason: str, code: str) -> NoReturn:
        row = self._next_row
        t = self.origin + self.t
        where = f"stopped at t = {t:.9g} (after row {row} of {self.grid.count})"
        raise RunStop(Stop(t, f"{where}: {reason}", code))
