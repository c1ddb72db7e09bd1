"""Why a run could not go on, where the equations say more of it than the numbers of its last step."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

from lagcli.analysis.classification.verdict import Condition
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import Stop
from lagcli.start import singular_inertia
from lagcli.start.initial import State

if TYPE_CHECKING:
    from lagcli.simulation.run_in_blocks import RunReport


def explained(
    stop: Stop,
    system: System,
    numeric: NumericSystem,
    ends: tuple[State, RunReport],
    conditions: Sequence[Condition],
) -> Stop:
    """The stop with the inertia that the run has lost since its start, or with the hidden conditions that the forces
    do not keep. ends: the start and the report of the time reached."""
    start, report = ends
    now = numeric.inertia(report.t, report.q, report.v, start.p)
    first = numeric.inertia(start.t, start.q, start.v, start.p)
    if fallen := singular_inertia.fallen(now, first, system.model.coordinate_names):
        stop = dataclasses.replace(stop, reason=f"{stop.reason}; {fallen}")
    if not conditions:
        return stop
    # Loaded here: most models have no such rows.
    from lagcli.analysis.classification import led_off

    state = State(report.t, report.q, report.v, start.p)
    if why := led_off.reason(system, conditions, state, report.a):
        where = stop.reason.partition(": ")[0]
        stop = dataclasses.replace(stop, reason=f"{where}: {why}", code=run_stop.NO_SOLUTION)
    return stop
