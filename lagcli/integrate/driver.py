"""Takes the steps: accepts or rejects, fills the grid from the dense output, and stops with a reason.

Rows leave in blocks while the run goes on; the memory it needs does not grow with its length.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator
from typing import cast

import numpy as np
import numpy.typing as npt

from lagcli.compile import NumericSystem
from lagcli.integrate import dop853, tableau
from lagcli.integrate import grid as grids
from lagcli.integrate.account import Account
from lagcli.integrate.call import Call
from lagcli.model import Simulation

Floats = npt.NDArray[np.float64]

BLOCK_VALUES = 2**16  # numbers in a block of rows
PAUSE = 0.1  # seconds after which the rows so far, be there none, are handed out: for progress and interrupts
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
# A landed state off the constraints by more than this part of its size was not reached by Newton: a smaller step.
LANDING = 1e-9
# Errors of steps add up over a run, and what is promised is about the result: the scheme is held to a hundredth
# of the tolerance asked for, but not below where its error estimate is rounding.
TIGHTENING, FINEST = 100.0, 1e-14
EXPONENT = -1.0 / dop853.ORDER
# Every PACE steps a run is asked how many more it would take like this; HOPELESS many would take days.
PACE, HOPELESS = 5000, 1e10


@dataclasses.dataclass(frozen=True, slots=True)
class Stop:
    """Why a run ended before its end: the time reached and a sentence."""

    t: float
    reason: str


class Stopped(Exception):
    """The integration cannot go on; rows given so far are complete and right."""

    def __init__(self, stop: Stop) -> None:
        super().__init__(stop.reason)
        self.stop = stop


def step_tolerance(settings: Simulation) -> Floats:
    """(rtol, atol) the error estimate of a step is compared with."""
    rtol = max(settings.rtol / TIGHTENING, min(settings.rtol, FINEST))
    return np.array([rtol, settings.atol * rtol / settings.rtol])


class Run:
    """One integration from a consistent start; `columns` names the columns after t.

    Iterate `blocks` once; `account` is filled as they come.
    """

    def __init__(
        self,
        numeric: NumericSystem,
        scheme: dop853.Scheme,
        state: tuple[Floats, Floats],
        p: Floats,
        settings: Simulation,
        columns: tuple[str, ...],
    ) -> None:
        self.grid = grid = grids.grid(settings)
        self._columns = columns
        self.account = Account()
        self.t = grid.start
        self._next_row = 0
        n = numeric.n
        self._t, self._h = np.array([grid.start], dtype=float), np.zeros(1)
        self._y = np.concatenate([*state, [0.0]])
        self._k = np.zeros(2 * n + 1)
        self._p = np.ascontiguousarray(p, dtype=float)
        self._tolerance = step_tolerance(settings)
        self._step = Call(
            scheme.step, [self._t, self._h, self._y, self._k, self._tolerance, self._p]
        )  # fmt: skip
        new, k_new, _, stages = self._step.results
        self._dense = Call(scheme.dense, [self._t, self._h, self._y, new, k_new, stages.T, self._p])
        self._rhs = Call(numeric.rhs, [self._t, self._y, self._p])
        self._at, self._state = np.zeros(1), np.zeros(2 * n + 1)
        self._record = Call(numeric.record, [self._at, self._state, self._p])
        self._land = Call(numeric.land, [self._t, self._y, self._p])
        # Read at every step: plain floats, without numpy's conversion.
        self._outcome = cast("memoryview[float]", memoryview(self._step.results[2].data))
        self._h_cell = cast("memoryview[float]", memoryview(self._h.data))

    def blocks(self) -> Iterator[Floats]:
        """Blocks of complete rows, shape (k, 1 + columns), t first; one at least every `PAUSE`, maybe empty.

        Raises `Stopped` after the last good row.
        """
        width = 1 + self._record.results[1].size
        block = np.zeros((max(1, min(self.grid.count, BLOCK_VALUES // width)), width))
        rows = self._rows()
        stop: Stopped | None = None
        going = True
        while going:
            began = time.perf_counter()
            filled = 0
            try:
                for row in rows:
                    if row is not None:
                        block[filled] = row
                        filled += 1
                    if filled == len(block) or time.perf_counter() - began > PAUSE:
                        break
                else:
                    going = False
            except Stopped as stopped:
                stop, going = stopped, False
            self.account.solve_seconds += time.perf_counter() - began
            if filled or going:
                yield block[:filled].copy()
        if stop is not None:
            raise stop

    def _rows(self) -> Iterator[Floats | None]:
        """Rows of the table, and None after each step."""
        # The start may lie off the constraints by rounding; the first row and the first step begin on them.
        self._land()
        self._y[:], self._k[:] = self._land.results[0], self._land.results[1]
        self.account.evaluations += 1
        if not np.isfinite(self._k).all():
            raise self._stopped("the accelerations are not finite at the start")
        yield self._row(self.grid.start, self._y)
        self._next_row = 1
        if self.grid.count == 1:
            return
        h = self._first_step()
        pace_from = self.t
        while self._next_row < self.grid.count:
            h = self._advance(h)
            if self.account.steps % PACE == 0:
                self._check_pace(self._reached - pace_from)
                pace_from = self._reached
            yield from self._fill()
            self._accept()
            yield None

    def _advance(self, h: float) -> float:
        """Find an acceptable step from the current state; return the proposal for the one after it."""
        t, end = self.t, self.grid.end
        grow = GROW
        while True:
            last = t + h >= end or end - (t + h) < 1e-12 * h
            taken = end - t if last else h
            self._h_cell[0] = taken
            self._step.trigger()
            self.account.evaluations += tableau.STAGES
            error, residual, everything = self._outcome[0], self._outcome[1], self._outcome[2]
            landed = residual <= LANDING
            if error < 1.0 and landed and math.isfinite(everything):
                self.account.steps += 1
                self._reached = end if last else t + h
                proposal = taken * min(grow, max(SHRINK, SAFETY * max(error, 1e-10) ** EXPONENT))
                # A step cut short by the end of the grid says nothing against the step it was cut from.
                return float(max(h, proposal) if last else proposal)
            self.account.rejected += 1
            grow = 1.0
            # `not error < 1` also holds for nan: then nothing is known but that the step was too large.
            known = math.isfinite(error) and error >= 1.0 and landed
            h = taken * (min(0.9, max(SHRINK, SAFETY * error**EXPONENT)) if known else 0.25)
            if t + h / 64 == t:
                raise self._stopped(self._why(error, residual))

    def _check_pace(self, advanced: float) -> None:
        """Stop a run that would not end in any time one can wait."""
        if (self.grid.end - self.t) * PACE > HOPELESS * advanced:
            raise self._stopped(
                f"the last {PACE} steps advanced by {advanced:.2g}, so that the run would need"
                f" {(self.grid.end - self.t) / max(advanced, 1e-300) * PACE:.0e} more: the motion chatters across"
                " a jump of the forces, the forces are far too stiff for an explicit scheme, or the run is too long"
            )

    @staticmethod
    def _why(error: float, residual: float) -> str:
        if not math.isfinite(error) or not math.isfinite(residual):
            return (
                "the accelerations or multipliers are not finite there: the constraints become dependent,"
                " or a function of the model has a pole"
            )
        if residual > LANDING:
            return "the constraints cannot be satisfied beyond: their surface ends there"
        return "the step needed for the tolerance is below the rounding of the time"

    def _stopped(self, reason: str) -> Stopped:
        row = self._next_row
        where = f"stopped at t = {self.t:.9g} (after row {row} of {self.grid.count})"
        return Stopped(Stop(self.t, f"{where}: {reason}"))

    def _accept(self) -> None:
        self._t[0] = self.t = self._reached
        self._y[:], self._k[:] = self._step.results[0], self._step.results[1]

    def _fill(self) -> Iterator[Floats]:
        """Rows of the grid within the step just found, from its dense output."""
        grid, reached = self.grid, self._reached
        if grid.time(self._next_row) > reached:
            return
        self._dense.trigger()
        self.account.evaluations += len(tableau.A_DENSE)
        most = max(1, BLOCK_VALUES // self._y.size)
        while self._next_row < grid.count and grid.time(self._next_row) <= reached:
            times = grid.times(self._next_row, min(self._next_row + most, grid.count))
            times = times[times <= reached]
            x = (times - self.t) / self._h_cell[0]
            states = dop853.interpolate(self._y, self._dense.results[0], x)
            states[times == reached] = self._step.results[0]
            for at, state in zip(times, states, strict=True):
                row = self._row(at, state)
                self._next_row += 1
                yield row

    def _row(self, t: float, state: Floats) -> Floats:
        self._at[0], self._state[:] = t, state
        self._record.trigger()
        landed, row, figures = self._record.results
        if not (np.isfinite(row).all() and np.isfinite(figures).all()):
            bad = np.flatnonzero(~np.isfinite(row))
            what = f"the column `{self._columns[int(bad[0])]}`" if bad.size else "the energy balance"
            raise self._stopped(f"{what} is not finite at t = {t:.9g}")
        self.account.keep(figures, landed[-1])
        return np.concatenate([self._at, row]) + 0.0  # no table shows -0.0

    def _first_step(self) -> float:
        """Hairer's starting step (Solving ODEs I, sec. II.4), from the sizes of y, y' and y''."""
        t, span = float(self._t[0]), self.grid.end - self.grid.start
        y, k = self._y.copy(), self._k.copy()
        scale = self._tolerance[1] + np.abs(y) * self._tolerance[0]

        def norm(u: Floats) -> float:
            with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is asked for below
                return float(np.sqrt(np.mean((u[:-1] / scale[:-1]) ** 2))) if u.size > 1 else 0.0

        d0, d1 = norm(y), norm(k)
        h0 = 1e-6 * span if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        h0 = min(h0, span) or 1e-6 * span  # where y' is larger by so much that the quotient is zero
        self._t[0], self._y[:] = t + h0, y + h0 * k
        self._rhs()
        self.account.evaluations += 1
        d2 = norm(self._rhs.results[0] - k) / h0
        self._t[0], self._y[:] = t, y
        if not math.isfinite(d2):
            return 1e-6 * span
        steepest = max(d1, d2)
        h1 = max(1e-6 * span, h0 * 1e-3) if steepest <= 1e-15 else (0.01 / steepest) ** (1.0 / dop853.ORDER)
        return float(min(100 * h0, h1, span))
