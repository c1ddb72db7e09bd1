"""Inertias differ by so much that rounding is amplified beyond the tolerance: a cause of a stop."""

from __future__ import annotations

from lagcli.simulation.run_state.run_stop import Reason
from lagcli.simulation.stepping.stop_diagnosis import BELOW_ROUNDING, PARAMETERS, Rejection


def cause(tried: Rejection) -> Reason | None:
    """See `causes_of_stops`."""
    if tried.apart is None or not tried.rank_margin < PARAMETERS.weighed:
        return None
    sentence, code = BELOW_ROUNDING
    return Reason(f"{sentence}: inertias that differ by a factor of {tried.apart:.0e} amplify rounding", code)
