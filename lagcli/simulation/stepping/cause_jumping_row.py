"""A row jumps, ends or has a pole where the run stands: a cause of a stop."""

from __future__ import annotations

from lagcli.simulation.run_state.run_stop import NO_SOLUTION, Reason
from lagcli.simulation.stepping import stop_diagnosis
from lagcli.simulation.stepping.stop_diagnosis import Rejection


def cause(tried: Rejection) -> Reason | None:
    """See `causes_of_stops`."""
    sentence = stop_diagnosis.jump(tried.enforced, tried.here)
    return Reason(sentence, NO_SOLUTION) if sentence else None
