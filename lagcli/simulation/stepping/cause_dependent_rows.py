"""Rows become dependent, at a configuration through which a motion does not go on smoothly: a cause of a stop."""

from __future__ import annotations

from lagcli.simulation.run_state.run_stop import SINGULAR, Reason
from lagcli.simulation.singularity import singular_point
from lagcli.simulation.stepping.stop_diagnosis import PARAMETERS, Rejection, named


def cause(tried: Rejection) -> Reason | None:
    """See `causes_of_stops`."""
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
