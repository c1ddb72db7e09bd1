"""The start of a run: onto the constraints, and with a first step."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.simulation.run_state.run_stop import NOT_FINITE, StepFailure
from lagcli.simulation.singularity.singularity_monitor import PARAMETERS as MONITOR
from lagcli.simulation.stepping import first_step, stop_diagnosis
from lagcli.simulation.stepping.stepper import LANDING, Stepper

Floats = npt.NDArray[np.float64]

# A step from a singular configuration moves by this part of its size, or less.
FIRST = 0.1


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunStart:
    """A consistent start, q and v (n,); is_singular: the rows are dependent there and not nearby; part: of the usual
    first step, with which the run begins; is_again: it repeats another run and must not miss what that one may."""

    q: Floats
    v: Floats
    is_singular: bool = False
    part: float = 1.0
    is_again: bool = False


def begin(run: Stepper, start: RunStart) -> None:
    """Put the start onto the constraints, and propose the first step."""
    bound, control = run.bound, run.control
    if start.is_singular:
        n = bound.y.size // 2
        speed, size = float(np.abs(bound.y[n:-1]).max()), float(np.abs(bound.y[:n]).max() or 1.0)
        control.step = start.part * FIRST * size / speed
        run.foreseen = run.watch.stand(run.t)
        run.settle()
        return
    # It may lie off the constraints by rounding; the first row and the first step begin on them.
    bound.land.trigger()
    bound.y[:], bound.k[:], outcome, sizes = bound.land.results
    clearance, least = outcome[1:3].tolist()
    run.account.evaluations += 1
    if not np.isfinite(bound.k).all():
        raise StepFailure(stop_diagnosis.START_NOT_FINITE, NOT_FINITE)
    run.account.evaluations += 1
    control.step = start.part * first_step.first_step(
        bound.rhs, bound.k, sizes, run.tolerance, run.method.order
    )
    if clearance < MONITOR.close_start**2:
        # No step is wasted towards a singular configuration so near: each amplifies rounding more.
        _look_back(run, MONITOR.back * control.step)
    run.foreseen = run.watch.foreseen(run.t, clearance, least)
    run.settle()


def _look_back(run: Stepper, tau: float) -> None:
    """Watch a time before the start, where Euler's step backward leads, so that the start itself foresees."""
    at = run.t - tau
    outcome = run.bound.landed_at(at, run.bound.y - tau * run.bound.k)[2]
    residual, clearance, least = outcome[:3].tolist()
    if residual <= LANDING:
        run.watch.foreseen(at, clearance, least)
