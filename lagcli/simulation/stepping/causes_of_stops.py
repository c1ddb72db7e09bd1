"""Why a run finds no step any more: a cause is a file in this room, and its line in `CAUSES`."""

from __future__ import annotations

from collections.abc import Callable

from lagcli.simulation.run_state.run_stop import Reason, StepFailure
from lagcli.simulation.stepping import (
    cause_contact_edge,
    cause_dependent_rows,
    cause_inertias,
    cause_jumping_row,
)
from lagcli.simulation.stepping.stop_diagnosis import Rejection

# Each tells whether it is the cause for which a step was rejected; the first that is one is told, for it brings about
# what those after it would see.
CAUSES: tuple[Callable[[Rejection], Reason | None], ...] = (
    cause_dependent_rows.cause,
    cause_jumping_row.cause,
    cause_contact_edge.cause,
    cause_inertias.cause,
)


def no_step(tried: Rejection) -> StepFailure:
    """The failure where no step can be taken: its cause, or what the numbers of the last try say."""
    for cause in CAUSES:
        reason = cause(tried)
        if reason is not None:
            return StepFailure(*reason)
    return StepFailure(*tried.verdict)
