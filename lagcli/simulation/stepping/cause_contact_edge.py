"""A closed contact slides over an edge: a cause of a stop."""

from __future__ import annotations

from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.run_state.run_stop import CONTACT, Reason
from lagcli.simulation.stepping import stop_diagnosis
from lagcli.simulation.stepping.stop_diagnosis import Rejection, named
from lagcli.smoothness import named_functions


def cause(tried: Rejection) -> Reason | None:
    """See `causes_of_stops`."""
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
