"""Why a run finds no step any more: a cause is a function here, and its line in `CAUSES`."""

from __future__ import annotations

from collections.abc import Callable

from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.run_state.run_stop import CONTACT, NO_SOLUTION, SINGULAR, Reason
from lagcli.simulation.singularity import singularity_step
from lagcli.simulation.stepping import stop_diagnosis
from lagcli.simulation.stepping.stop_diagnosis import BELOW_ROUNDING, PARAMETERS, Rejection, named
from lagcli.smoothness import named_functions


def _dependent_rows(tried: Rejection) -> Reason | None:
    """Rows become dependent where no motion goes through smoothly."""
    run, last = tried.system.model.simulation, tried.last
    # So close behind an incident no instant may be predicted.
    is_behind = run.start < last and tried.here.t - last < PARAMETERS.behind * run.duration
    if not (tried.are_dependent and (tried.is_soon or is_behind) and tried.apart is None):
        return None
    rows = named(tried.system, singularity_step.closest(tried.numeric, tried.here, tried.is_alone))
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


def reason(tried: Rejection) -> Reason:
    """The cause for which a step was rejected, or what its numbers say."""
    return next(filter(None, (cause(tried) for cause in CAUSES)), tried.verdict)
