"""What a run reports about itself, filled while it goes on."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


# Below this part of the energies themselves nothing is exchanged but rounding.
ROUNDING = 1e-10


@dataclasses.dataclass(slots=True)
class Account:
    """The account of a run.

    position_drift and velocity_drift: largest |f_i| / |B_i| and |B_i v + b_i| / |B_i| over the rows written.
    energy_imbalance: largest |H(t) - H(start) - W(t)| over the rows written, as a part of the energies that
    were exchanged (for particles: largest T plus largest change of V), with W the integrated power of
    everything that may change the Jacobi energy H.
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    position_drift: float = 0.0
    velocity_drift: float = 0.0
    solve_seconds: float = 0.0
    _start: tuple[float, float] | None = None
    _imbalance: float = 0.0
    _moving: float = 0.0
    _resting: float = 0.0
    _largest: float = 0.0

    @property
    def energy_imbalance(self) -> float:
        """Deviation from the energy balance, as a part of what was exchanged."""
        exchanged = self._moving + self._resting + ROUNDING * self._largest
        return self._imbalance / exchanged if exchanged else self._imbalance

    def keep(self, figures: Floats, work: float) -> None:
        """Take the figures of one row: position and velocity drift, H, its part without velocities; and W there."""
        position, velocity, jacobi, rest = figures.tolist()
        if self._start is None:
            self._start = (jacobi, rest)
        self.position_drift = max(self.position_drift, position)
        self.velocity_drift = max(self.velocity_drift, velocity)
        self._imbalance = max(self._imbalance, abs(jacobi - self._start[0] - work))
        self._moving = max(self._moving, abs(jacobi - rest))
        self._largest = max(self._largest, abs(jacobi), abs(rest))
        self._resting = max(self._resting, abs(rest - self._start[1]))
