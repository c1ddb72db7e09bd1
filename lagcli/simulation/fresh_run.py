"""A run from a consistent start, with all that it holds there."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from lagcli.equations.time_functions import TimeFunctions
from lagcli.simulation import loop
from lagcli.simulation.run_start import RunStart
from lagcli.simulation.scheme import invariants
from lagcli.start import initial

if TYPE_CHECKING:
    from lagcli.simulation.global_error.reference_run import RunWithReference


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FreshRun:
    """A run before its first step, and the same run repeated, for columns of errors."""

    run: loop.Run
    repeated: RunWithReference | None


def begin(
    found: invariants.Integrals,
    start: initial.State,
    is_singular: bool,
    timed: TimeFunctions | None = None,
    notes: tuple[str, ...] = (),
    digits: bool = False,
) -> FreshRun:
    """The run of a model from a consistent start, by the settings of the model.

    found: the integrals to hold, with the independent rows of the start; is_singular: the rows are dependent there and
    not nearby; timed: what the model says about t alone; notes: what was said about the integrals. Raises
    `diagnostics.ModelError` where an acceleration or a column is not finite at the start.
    """
    system = found.system
    held, not_held = invariants.begin(found, start)
    if not is_singular:
        initial.require_finite(system, held.functions.numeric, dataclasses.replace(start, p=held.parameters))
    first, chosen = RunStart(start.q, start.v, is_singular), system.model.simulation
    run = loop.start(held, first, chosen, system.columns, (*not_held, *notes), timed)
    if not digits:
        return FreshRun(run, None)
    # Loaded here: most runs are not repeated.
    from lagcli.simulation.global_error.reference_run import RunWithReference

    return FreshRun(run, RunWithReference(system, run, held, first, chosen))
