"""Jumps of a potential, the Lagrangian or a place within a step: the force there is an impulse, and the run ends."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.equations import energy_jumps
from lagcli.simulation.stepper import Stepper

Floats = npt.NDArray[np.float64]

# So many parts of a step are looked at for switches of what must not jump; on the curve of the dense output.
WAY = np.linspace(0.0, 1.0, 17)


class ImpulseWatch:
    """The jumps of the system that a run steps, if any."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        self._jumps = stepper.bound.held.integrals.system.jumps

    def end_at_jump(self) -> None:
        """End the step just found where something jumps in it."""
        jumps, run, found = self._jumps, self._stepper, self._stepper.found
        if jumps is None:
            return
        p, is_ordinary = run.bound.held.p, found.passage is None
        if not jumps.is_crossed(self._place, WAY, p):
            return
        if is_ordinary and not found.has_dense:
            run.bound.staged.trigger()
            run.account.evaluations += run.method.evaluations
            run.make_dense()
        found.barrier = jumps.first(self._place, WAY, p)
        if found.barrier is not None:
            found.reached = run.t + found.barrier.part * found.taken

    def _place(self, x: float) -> energy_jumps.Place:
        """The time, q and v at a fraction of the step."""
        run, state = self._stepper, self._curve(x)
        n = state.size // 2
        return run.origin + run.t + x * run.found.taken, state[:n], state[n : 2 * n]

    def _curve(self, x: float) -> Floats:
        run, bound, found = self._stepper, self._stepper.bound, self._stepper.found
        y = bound.y
        if found.passage is not None:
            return found.passage.step.state(x)
        if found.has_dense:
            return np.asarray(run.method.interpolated(y, run.rows.dense.results[0], x))
        ahead, turns = bound.new - y, (1 - x) * bound.k - x * bound.k_new
        bends = found.taken * turns + (2 * x - 1) * ahead
        return np.asarray(y + x * ahead + x * (1 - x) * bends)
