"""A state within the step that was found, for those who ask for it once the run is elsewhere."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]


class FixedAhead(NamedTuple):
    """A state that is known: the time, and y (2n + 1,); before: the line of the table at the instant itself, where the
    rows give none."""

    t: float
    y: Floats
    before: Floats | None = None


class Ahead:
    """The state at a fraction of the step that was found, kept though the step is taken again."""

    before: Floats | None = None

    def __init__(self, run: Stepper, x: float) -> None:
        self._method, self._x, self.t = run.method, x, run.t + x * run.found.taken
        self._begin, self._coefficients = run.bound.y.copy(), run.rows.dense.results[0].copy()

    @property
    def y(self) -> Floats:
        """The state, (2n + 1,)."""
        begin, coefficients = self._begin[:, None], self._coefficients[:, :, None]
        return np.asarray(self._method.interpolated(begin, coefficients, np.array([self._x]))).ravel()


StateAhead = Ahead | FixedAhead
