"""The start of a run: from a consistent state, or on from where another was marked; and its first step."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import numpy.typing as npt

from lagcli.frozen import frozen
from lagcli.model.settings import Simulation
from lagcli.simulation.run.loop import Run
from lagcli.simulation.run.row_writer import RowWriter, TableRows
from lagcli.simulation.run_state.between_steps import RunState, Turns
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme import controller
from lagcli.simulation.scheme.invariants import EnforcedInvariants
from lagcli.simulation.singularity.singularity_monitor import PARAMETERS as MONITOR
from lagcli.simulation.singularity.singularity_monitor import SingularityMonitor
from lagcli.simulation.stepping import grid as grids
from lagcli.simulation.stepping.step_trial import MOST_RESIDUAL
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness.time_functions import TimeFunctions

Floats = npt.NDArray[np.float64]

# A step from a singular configuration moves by this part of its size, or less.
FIRST = 0.1


@frozen
class RunStart:
    """A consistent start, q and v (n,), and all that a run from there goes with.

    enforced: the functions, with the integrals that are enforced there; timed: what the model says about t alone;
    is_singular: the rows are dependent there and not nearby; notes: what was said about integrals; part: of the usual
    first step, with which the run begins; is_again: it repeats another run and must not miss what that one may.
    """

    enforced: EnforcedInvariants
    q: Floats
    v: Floats
    settings: Simulation
    timed: TimeFunctions | None = None
    is_singular: bool = False
    notes: tuple[str, ...] = ()
    part: float = 1.0
    is_again: bool = False


def start(begin: RunStart, rows: TableRows) -> Run:
    """A run from a consistent start."""
    enforced, settings = begin.enforced, begin.settings
    origin = grids.origin(settings, enforced.has_time)
    grid = _grid(settings, origin)
    state = RunState(
        t=grid.start,
        y=np.concatenate([begin.q, begin.v, [0.0]]),
        k=np.zeros(2 * begin.q.size + 1),
        pace_from=grid.start,
        selection=enforced.selection,
        invariant_values=enforced.invariant_values,
        notes=begin.notes,
        origin=origin,
        turns=Turns(enforced.system).of(enforced.p),
    )
    timed = begin.timed if enforced.has_time else None
    stepper = Stepper(enforced, state, settings, grid, timed, begin.is_again)
    return Run(stepper, RowWriter(stepper, rows, 0), functools.partial(_begin, stepper, begin))


def resume(
    enforced: EnforcedInvariants,
    run_state: RunState,
    settings: Simulation,
    columns: tuple[str, ...],
    timed: TimeFunctions | None = None,
) -> Run:
    """A run that goes on from where another was marked; enforced: as it was there. Else as `start`."""
    grid = _grid(settings, run_state.origin)
    # The rows that another grid has between the last one handed out and the state are lost.
    after = grid.after(run_state.row)
    first = max(after, grid.first(run_state.t))
    stepper = Stepper(enforced, run_state, settings, grid, timed if enforced.has_time else None)
    writer = RowWriter(stepper, TableRows(columns), first, run_state.row)
    return Run(stepper, writer, None, run_state.row, first - after)


def _grid(settings: Simulation, origin: float) -> grids.Grid:
    return grids.of_run(dataclasses.replace(settings, start=settings.start - origin))


def _begin(run: Stepper, start: RunStart) -> bool:
    """Put the start onto the constraints, and propose the first step; True where it is an ordinary one."""
    bound, control = run.bound, run.control
    if start.is_singular:
        n = bound.y.size // 2
        speed, size = float(np.abs(bound.y[n:-1]).max()), float(np.abs(bound.y[:n]).max() or 1.0)
        control.step = start.part * FIRST * size / speed
        run.watch = SingularityMonitor.standing(run.t)
        run.settle()
        return False
    # It may lie off the constraints by rounding; the first row and the first step begin on them.
    status, sizes = bound.put_on_constraints()
    smallest_angle, least = status[1:3].tolist()
    run.count(1)
    if not np.isfinite(bound.k).all():
        from lagcli.simulation.stepping import stop_diagnosis

        raise StepFailure(*stop_diagnosis.START_NOT_FINITE)
    run.count(1)
    control.step = start.part * controller.first_step(
        bound.rhs, bound.k, sizes, run.tolerance, run.method.order
    )
    if smallest_angle < MONITOR.close_start**2:
        # No step is wasted towards a singular configuration so near: each amplifies rounding more.
        _look_back(run, MONITOR.back * control.step)
    run.watch = run.watch.after(run.t, smallest_angle, least)
    run.settle()
    return True


def _look_back(run: Stepper, tau: float) -> None:
    """Watch a time before the start, where Euler's step backward leads, so that a singularity is predicted from the
    start on."""
    at = run.t - tau
    status = run.bound.projected_at(at, run.bound.y - tau * run.bound.k)[2]
    residual, smallest_angle, least = status[:3].tolist()
    if residual <= MOST_RESIDUAL:
        run.watch = run.watch.after(at, smallest_angle, least)
