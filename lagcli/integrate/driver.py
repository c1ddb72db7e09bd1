"""Takes the steps: accepts or rejects, fills the grid from the dense output, and stops with a reason.

Rows leave in blocks while the run goes on; the memory it needs does not grow with its length.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli.compile import NumericSystem
from lagcli.integrate import dop853, tableau
from lagcli.integrate.grid import Grid
from lagcli.model import Simulation

Floats = npt.NDArray[np.float64]

BLOCK_VALUES = 2**16  # numbers in a block of rows
SAFETY, SHRINK, GROW = 0.9, 0.2, 10.0
# A landed state off the constraints by more than this part of its size was not reached by Newton: a smaller step.
LANDING = 1e-9
# Errors of steps add up over a run, and what is promised is about the result: the scheme is held to a hundredth
# of the tolerance asked for, but not below where its error estimate is rounding.
TIGHTENING, FINEST = 100.0, 1e-14


@dataclasses.dataclass(slots=True)
class Account:
    """What a run reports, filled while it goes on.

    position_drift and velocity_drift: largest |f_i| / |B_i| and |B_i v + b_i| / |B_i| over the rows written.
    energy_imbalance: largest |H(t) - H(start) - W(t)| over the rows written, as a part of the energies that
    were exchanged (largest T plus largest change of V), with W the integrated power of everything that may
    change the Jacobi energy H.
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    position_drift: float = 0.0
    velocity_drift: float = 0.0
    energy_imbalance: float = 0.0
    solve_seconds: float = 0.0


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


class Call:
    """A CasADi function with fixed memory for its arguments and results: no allocation while stepping."""

    def __init__(self, function: Any, arguments: list[Floats]) -> None:
        self._function = function
        self._buffer, self._trigger = function.buffer()
        self.results = []
        for i, array in enumerate(arguments):
            self._buffer.set_arg(i, memoryview(array.data))
        for i in range(function.n_out()):
            shape = (function.size1_out(i), function.size2_out(i))
            array = np.zeros(shape, order="F") if shape[1] > 1 else np.zeros(shape[0])
            self._buffer.set_res(i, memoryview((array.T if array.ndim > 1 else array).data))
            self.results.append(array)

    def __call__(self) -> None:
        self._trigger()


def step_tolerance(settings: Simulation) -> Floats:
    """(rtol, atol) the error estimate of a step is compared with."""
    rtol = max(settings.rtol / TIGHTENING, min(settings.rtol, FINEST))
    return np.array([rtol, settings.atol * rtol / settings.rtol])


class Run:
    """One integration from a consistent start. Iterate `blocks` once; `account` is filled as they come."""

    def __init__(
        self,
        numeric: NumericSystem,
        scheme: dop853.Scheme,
        state: tuple[Floats, Floats],
        p: Floats,
        settings: Simulation,
        grid: Grid,
    ) -> None:
        self.account = Account()
        self.t = grid.start
        self._grid = grid
        self._next_row = 0
        n = numeric.n
        self._t, self._h = np.array([grid.start]), np.zeros(1)
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
        self._jacobi: float | None = None
        self._potential = 0.0
        self._exchanged = [0.0, 0.0]
        self._imbalance = 0.0

    def blocks(self) -> Iterator[Floats]:
        """Blocks of complete rows, shape (k, 1 + columns), t first. Raises `Stopped` after the last good row."""
        width = 1 + self._record.results[1].size
        block = np.zeros((max(1, min(self._grid.count, BLOCK_VALUES // width)), width))
        filled = 0
        began = time.perf_counter()
        rows = self._rows()
        while True:
            try:
                row = next(rows, None)
            except Stopped:
                self.account.solve_seconds += time.perf_counter() - began
                if filled:
                    yield block[:filled].copy()
                raise
            if row is not None:
                block[filled] = row
                filled += 1
            if filled == len(block) or (row is None and filled):
                self.account.solve_seconds += time.perf_counter() - began
                yield block[:filled].copy()
                began = time.perf_counter()
                filled = 0
            if row is None:
                self.account.solve_seconds += time.perf_counter() - began
                return

    def _rows(self) -> Iterator[Floats]:
        # The start may lie off the constraints by rounding; the first row and the first step begin on them.
        self._land()
        self._y[:], self._k[:] = self._land.results[0], self._land.results[1]
        self.account.evaluations += 1
        if not np.isfinite(self._k).all():
            raise self._stopped("the accelerations are not finite at the start")
        yield self._row(self._grid.start, self._y)
        self._next_row = 1
        if self._grid.count == 1:
            return
        h = self._first_step()
        while self._next_row < self._grid.count:
            h = self._advance(h)
            yield from self._fill()
            self._accept()

    def _advance(self, h: float) -> float:
        """Find an acceptable step from the current state; return the proposal for the one after it."""
        t, end = float(self._t[0]), self._grid.end
        outcome = self._step.results[2]
        grow = GROW
        while True:
            last = t + h >= end or end - (t + h) < 1e-12 * h
            self._h[0] = end - t if last else h
            self._step()
            self.account.evaluations += tableau.STAGES
            error, residual = float(outcome[0]), float(outcome[1])
            landed = residual <= LANDING * self._size()
            if error < 1.0 and landed and np.isfinite(self._step.results[1]).all():
                self.account.steps += 1
                self._reached = end if last else t + h
                taken = float(self._h[0])
                proposal = taken * min(grow, max(SHRINK, SAFETY * max(error, 1e-10) ** (-1.0 / dop853.ORDER)))
                # A step cut short by the end of the grid says nothing against the step it was cut from.
                return float(max(h, proposal) if last else proposal)
            self.account.rejected += 1
            grow = 1.0
            # `not error < 1` also holds for nan: then nothing is known but that the step was too large.
            factor = (
                SAFETY * error ** (-1.0 / dop853.ORDER)
                if math.isfinite(error) and error >= 1.0 and landed
                else 0.25
            )
            h = float(self._h[0]) * float(min(0.9, max(SHRINK, factor)))
            if t + h / 64 == t:
                raise self._stopped(self._why(error, residual))

    def _size(self) -> float:
        """How large the coordinates are, or become in this step."""
        n = (self._y.size - 1) // 2
        q, v = np.abs(self._y[:n]).max(initial=0.0), np.abs(self._y[n : 2 * n]).max(initial=0.0)
        return float(q + self._h[0] * v) or 1.0

    def _why(self, error: float, residual: float) -> str:
        if not math.isfinite(error):
            return (
                "the accelerations or multipliers are not finite there: the constraints become dependent,"
                " or a function of the model has a pole"
            )
        if not residual <= LANDING * self._size():
            return "the constraints cannot be satisfied beyond: their surface ends there"
        return "the step needed for the tolerance is below the rounding of the time"

    def _stopped(self, reason: str) -> Stopped:
        t = float(self._t[0])
        row = self._next_row
        return Stopped(Stop(t, f"stopped at t = {t:.9g} (after row {row} of {self._grid.count}): {reason}"))

    def _accept(self) -> None:
        self._t[0] = self._reached
        self.t = self._reached
        self._y[:], self._k[:] = self._step.results[0], self._step.results[1]

    def _fill(self) -> Iterator[Floats]:
        """Rows of the grid within the step just found, from its dense output."""
        first, after = self._next_row, self._next_row
        while after < self._grid.count and self._grid.time(after) <= self._reached:
            after += 1
        if first == after:
            return
        times = self._grid.times(first, after)
        t, h = float(self._t[0]), float(self._h[0])
        inside = times < self._reached
        states = np.empty((times.size, self._y.size))
        states[~inside] = self._step.results[0]
        if inside.any():
            self._dense()
            self.account.evaluations += len(tableau.A_DENSE)
            x = (times[inside] - t) / h
            states[inside] = dop853.interpolate(self._y, self._dense.results[0], x)
        for at, state in zip(times, states, strict=True):
            row = self._row(float(at), state)
            self._next_row += 1
            yield row

    def _row(self, t: float, state: Floats) -> Floats:
        self._at[0], self._state[:] = t, state
        self._record()
        landed, row, account = self._record.results
        if not (np.isfinite(row).all() and np.isfinite(account).all()):
            raise self._stopped(f"a quantity of the table is not finite at t = {t:.9g}")
        self._keep_account(account, float(landed[-1]))
        return np.concatenate([[t], row])

    def _keep_account(self, figures: Floats, work: float) -> None:
        position, velocity, jacobi, kinetic, potential = map(float, figures)
        account = self.account
        account.position_drift = max(account.position_drift, position)
        account.velocity_drift = max(account.velocity_drift, velocity)
        if self._jacobi is None:
            self._jacobi, self._potential = jacobi, potential
        self._imbalance = max(self._imbalance, abs(jacobi - self._jacobi - work))
        self._exchanged[0] = max(self._exchanged[0], abs(kinetic))
        self._exchanged[1] = max(self._exchanged[1], abs(potential - self._potential))
        exchanged = sum(self._exchanged)
        account.energy_imbalance = self._imbalance / exchanged if exchanged else self._imbalance

    def _first_step(self) -> float:
        """Hairer's starting step (Solving ODEs I, sec. II.4), from the sizes of y, y' and y''."""
        t, span = float(self._t[0]), self._grid.end - self._grid.start
        y, k = self._y.copy(), self._k.copy()
        scale = self._tolerance[1] + np.abs(y) * self._tolerance[0]

        def norm(u: Floats) -> float:
            return float(np.sqrt(np.mean((u[:-1] / scale[:-1]) ** 2))) if u.size > 1 else 0.0

        d0, d1 = norm(y), norm(k)
        h0 = 1e-6 * span if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        h0 = min(h0, span)
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
