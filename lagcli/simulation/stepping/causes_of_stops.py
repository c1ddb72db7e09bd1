"""Why a run finds no step any more: a cause is a file in this room, and its line in `CAUSES`."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lagcli.simulation.run_state.run_stop import Reason, StepFailure
from lagcli.simulation.run_state.statistics import RunStatistics
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.scheme.controller import PARAMETERS as LENGTH
from lagcli.simulation.stepping import (
    cause_contact_edge,
    cause_dependent_rows,
    cause_inertias,
    cause_jumping_row,
    sticking,
    stop_diagnosis,
)
from lagcli.simulation.stepping.stop_diagnosis import Rejection
from lagcli.simulation.stepping.timetable import Timetable
from lagcli.start.initial import State

# Each tells whether it is the cause for which a step was rejected; the first that is one is told, for it brings about
# what those after it would see.
CAUSES: tuple[Callable[[Rejection], Reason | None], ...] = (
    cause_dependent_rows.cause,
    cause_jumping_row.cause,
    cause_contact_edge.cause,
    cause_inertias.cause,
)


class Standing(NamedTuple):
    """Where a run stands that does not go on.

    bound: its functions at the state `here`; soon: a time that is a small part of the run; statistics: evaluations are
    counted in them.
    """

    bound: BoundStep
    here: State
    timetable: Timetable
    soon: float
    statistics: RunStatistics

    def is_before_pole(self) -> bool:
        """True if a function of t ahead is the reason: y' grows without bound towards its switch."""
        bound, t = self.bound, self.bound.t[0]
        switch = self.timetable.ahead(t, t + self.soon)
        if switch is None:
            return False
        # At the distance from it, three times and nine times as far.
        times = (switch - part * (switch - t) for part in (1.0, 3.0, 9.0))
        rates = [np.array(bound.numeric.rhs(at, bound.y, bound.p)).ravel() for at in times]
        self.statistics.evaluations += len(rates)
        return stop_diagnosis.is_pole(rates, stop_diagnosis.of_forces(bound.numeric, self.here))


def too_slow(where: Standing, advanced: float, left: float) -> StepFailure:
    """The failure where the last steps advanced by so little of what is left of the run."""
    if where.is_before_pole():
        return StepFailure(*stop_diagnosis.POLE)
    return stop_diagnosis.hopeless(where.bound.enforced, where.here, LENGTH.pace, advanced, left)


def no_step(where: Standing, tried: Rejection) -> StepFailure:
    """The failure where no step can be taken: its cause, or what the numbers of the last try say. Raises it where the
    motion sticks at a switch of a force."""
    switches = where.bound.enforced.plain.functions.numeric.force_switches
    if switches is not None:
        sticking.require_step(where.bound, switches, where.here.t)
    if where.is_before_pole():
        return StepFailure(*stop_diagnosis.POLE)
    for cause in CAUSES:
        reason = cause(tried)
        if reason is not None:
            return StepFailure(*reason)
    return StepFailure(*tried.verdict)
