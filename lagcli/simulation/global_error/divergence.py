"""The place where two runs of a model go apart at once, unlike by errors of steps: they have seen different forces."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# Of the kinds, positions and velocities: multipliers and forces jump where the model says so.
STATES = [0, 1]

# The distance of the runs grows by FACTOR within PART of the run, from NOISE of the scale or more to LEAST or more, and
# to so many TOLERANCES. In chaos that takes eleven times the time in which errors grow e-fold.
FACTOR, NOISE, LEAST, PART, TOLERANCES = 1e5, 1e-13, 1e-7, 0.01, 1e3


def window(count: int) -> int:
    """The rows within which runs go apart, of a table with so many."""
    return max(1, math.ceil(PART * count))


class Parting:
    """The last place where the distance of two tables grows too fast, if that is much of what they hold in the end.

    window: rows it has for that, 0 for never; rtol, atol: of the runs.
    """

    def __init__(self, window: int, rtol: float = 0.0, atol: float = 0.0) -> None:
        self._window, self._rtol, self._atol = window, rtol, atol
        self._t, self._gaps = np.zeros(0), np.zeros((0, len(STATES)))
        self._sizes = np.zeros(len(STATES))
        self._place: tuple[float, float] | None = None
        self._grown = np.zeros(len(STATES))

    @property
    def found(self) -> tuple[float, float] | None:
        """The times of the rows between which it grew."""
        least = np.maximum(LEAST * self._sizes, TOLERANCES * (self._atol + self._rtol * self._sizes))
        return self._place if (self._grown > least).any() else None

    def take(self, t: Floats, gaps: Floats, sizes: Floats) -> None:
        """The times of rows (k,), the largest distances so far and the scales of each kind (k, kinds)."""
        if not self._window or not t.size:
            return
        times, gaps = np.concatenate([self._t, t]), np.vstack([self._gaps, gaps[:, STATES]])
        now, before = gaps[self._window :], gaps[: -self._window]
        size = sizes[len(sizes) - len(now) :, STATES]
        jumps = (now > LEAST * size) & (now > FACTOR * np.maximum(before, NOISE * size))
        for i in np.flatnonzero(jumps.any(axis=1)).tolist():
            begin, end = float(times[i]), float(times[i + self._window])
            # Rows of one rise are one place; what grows again by so much leaves the place before far behind.
            if self._place is None or begin >= self._place[1]:
                self._place = begin, end
            self._grown = np.maximum(self._grown, np.where(jumps[i], now[i], 0.0))
        self._sizes = sizes[-1, STATES]
        self._t, self._gaps = times[-self._window :], gaps[-self._window :]
