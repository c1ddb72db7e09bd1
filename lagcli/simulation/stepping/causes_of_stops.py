"""Why a run finds no step any more: a cause is a function here, and its line in `CAUSES`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.run_state.run_stop import CONTACT, NO_SOLUTION, SINGULAR, Reason, StepFailure
from lagcli.simulation.scheme.controller import PARAMETERS as LENGTH
from lagcli.simulation.singularity import singular_point
from lagcli.simulation.stepping import sticking, stop_diagnosis
from lagcli.simulation.stepping.stop_diagnosis import BELOW_ROUNDING, PARAMETERS, Rejection, named
from lagcli.smoothness import named_functions
from lagcli.start.initial import State

if TYPE_CHECKING:
    from lagcli.simulation.stepping.stepper import Stepper

# A singular configuration, or a pole, is the reason of a stop where one is predicted within this part of the run.
SOON = 1e-4


def _dependent_rows(tried: Rejection) -> Reason | None:
    """Rows become dependent where no motion goes through smoothly."""
    run, last = tried.system.model.simulation, tried.last
    # So close behind an incident no instant may be predicted.
    is_behind = run.start < last and tried.here.t - last < PARAMETERS.behind * run.duration
    if not (tried.are_dependent and (tried.is_soon or is_behind) and tried.apart is None):
        return None
    rows = named(tried.system, singular_point.closest(tried.numeric, tried.here, tried.is_alone))
    what = f"the gradient of {rows} vanishes" if tried.is_alone else f"the rows {rows} become dependent"
    behind = f", or one too close behind the incident at t = {last:.9g}" if is_behind else ""
    return Reason(
        f"{what} there, a singular configuration through which this motion does not go on smoothly (a toggle"
        f" position, or a cusp{behind})",
        SINGULAR,
    )


def _contact_edge(tried: Rejection) -> Reason | None:
    """A closed contact slides over an edge."""
    kinked = named_functions.switching_contacts(tried.system.model)
    span = stop_diagnosis.time_scale(tried.system, tried.here)
    edges = contact_change.edges(tried.numeric, tried.here, kinked, span)
    if not edges:
        return None
    return Reason(
        f"the gradient of the closed contact {named(tried.system, edges)} jumps there, and so would the velocity: where"
        " a contact slides over an edge or into a corner, one condition has no single direction of the push (make"
        " the edge round, as `sqrt(x**2 + w**2)` in place of `abs(x)`)",
        CONTACT,
    )


def _inertias(tried: Rejection) -> Reason | None:
    """Inertias differ by so much that rounding is amplified beyond the tolerance."""
    if tried.apart is None or not tried.rank_margin < PARAMETERS.weighed:
        return None
    sentence, code = BELOW_ROUNDING
    return Reason(f"{sentence}: inertias that differ by a factor of {tried.apart:.0e} amplify rounding", code)


def _jumping_row(tried: Rejection) -> Reason | None:
    """A row jumps, ends or has a pole where the run stands."""
    sentence = stop_diagnosis.jump(tried.enforced, tried.here)
    return Reason(sentence, NO_SOLUTION) if sentence else None


# Each tells whether it is the cause for which a step was rejected; the first that is one is told, for it brings about
# what those after it would see.
CAUSES: tuple[Callable[[Rejection], Reason | None], ...] = (
    _dependent_rows,
    _jumping_row,
    _contact_edge,
    _inertias,
)


def _is_before_pole(run: Stepper, here: State) -> bool:
    """True if a function of t ahead is the reason: y' grows without bound towards its switch."""
    switch = run.timetable.ahead(run.t, run.t + _soon(run))
    if switch is None:
        return False
    # At the distance from it, three times and nine times as far.
    times = [switch - part * (switch - run.t) for part in (1.0, 3.0, 9.0)]
    return stop_diagnosis.is_pole(run, times, stop_diagnosis.of_forces(run.bound.numeric, here))


def _soon(run: Stepper) -> float:
    return SOON * (run.grid.end - run.grid.start)


def too_slow(run: Stepper, advanced: float) -> StepFailure:
    """The failure where the last steps advanced by so little of what is left of the run."""
    here, left = run.state_at(run.t, run.bound.y), run.grid.end - run.t
    if _is_before_pole(run, here):
        return StepFailure(*stop_diagnosis.POLE)
    return stop_diagnosis.hopeless(run.bound.enforced, here, LENGTH.pace, advanced, left)


def no_step(run: Stepper, error: float, residual: float) -> StepFailure:
    """The failure where no step can be taken, by what the last one that was tried had: its cause, or what these numbers
    say. Raises it where the motion sticks at a switch of a force."""
    bound = run.bound
    here, ahead = run.state_at(run.t, bound.y), run.state_at(run.t + bound.h[0], bound.new)
    switches = bound.enforced.plain.functions.numeric.force_switches
    if switches is not None:
        sticking.require_step(bound, switches, here.t)
    if _is_before_pole(run, here):
        return StepFailure(*stop_diagnosis.POLE)
    is_soon, last = run.watch.foreseen.instant - run.t < _soon(run), run.origin + run.contacts.last
    tried = Rejection(bound.enforced, error, residual, here, ahead, *run.rank_margin, is_soon, last)
    for cause in CAUSES:
        reason = cause(tried)
        if reason is not None:
            return StepFailure(*reason)
    return StepFailure(*tried.verdict)
