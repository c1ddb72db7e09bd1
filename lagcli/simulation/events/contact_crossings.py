"""Incidents of contacts close to singular configurations: looked for ahead, and refused where rounding decides."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.linear import rank
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.singularity import singular_point
from lagcli.simulation.singularity.singularity_monitor import PARAMETERS as MONITOR
from lagcli.simulation.singularity.singularity_monitor import SingularityMonitor
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]

# Rows that are closer to dependent ones than this amplify rounding.
NEAR = 1e-2
# So close the law of impact may take them for dependent, and they then change the velocities that it gives by more
# than this part.
DEPENDENT, SATISFIED = 10 * rank.PARAMETERS.large, 1e-5
# By this part of a step ahead it is seen whether rows come closer to dependent ones.
BESIDE = 1e-4


def is_near(run: Stepper) -> bool:
    """True where rows are close to dependent ones."""
    return run.rank_margin[0] < NEAR


def predict(run: Stepper) -> None:
    """Look at singular configurations ahead: what was seen before an incident belongs to another motion, and the first
    step from here may lead across one."""
    bound = run.bound
    run.watch = SingularityMonitor()
    if not bound.numeric.selection.independent:
        return
    status = bound.project.results[2]
    run.watch = run.watch.after(run.t, float(status[1]), float(status[2]))
    if not run.watch.rank_margin[0] < MONITOR.narrow:
        return
    offset = BESIDE * run.control.step
    _, _, status, *_ = bound.projected_at(run.t + offset, bound.y + offset * bound.k)
    run.count(1)
    watch = run.watch.after(run.t + offset, float(status[1]), float(status[2]))
    if watch.foreseen.is_any:
        watch = watch._replace(foreseen=watch.foreseen._replace(step=run.control.step))
    run.watch = watch


def require_projected(run: Stepper, wanted: Floats, before: Floats) -> None:
    """Raise `StepFailure` where the rows do not let the run go on with the velocities after an impact (n,)."""
    if not run.watch.rank_margin[0] < DEPENDENT:
        return
    n, y = wanted.size, run.bound.y
    sizes = run.bound.numeric.sizes(run.origin + run.t, y[:n], y[n : 2 * n], run.bound.enforced.p)
    units = np.array(sizes).ravel()[:n]
    off = float(np.abs((y[n : 2 * n] - wanted) / units).max(initial=0.0))
    size = float(np.abs(np.stack([wanted, before]) / units).max(initial=0.0))
    if off > SATISFIED * size:
        raise stop(run, "an impact of which the velocities are not determined")


def stop(run: Stepper, what: str) -> StepFailure:
    """The reason to stop where rows are so close to dependent ones that rounding is amplified."""
    rows = singular_point.closest(run.bound.numeric, run.state_at(run.t, run.bound.y), False)
    system = run.bound.enforced.system
    names = ", ".join(f"`{system.multiplier_rows[i].name}`" for i in rows)
    return StepFailure(
        f"{what}: the rows {names} are within {run.rank_margin[0]:.1g} of dependent ones there, a singular"
        " configuration, at which rounding is amplified",
        run_stop.SINGULAR,
    )
