"""The line of the table within a step across a singular configuration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lagcli.simulation.scheme import line_functions
from lagcli.simulation.stepping import interpolate_rows
from lagcli.simulation.stepping.stepper import Stepper

if TYPE_CHECKING:
    # Most runs meet no singular configuration.
    from lagcli.simulation.scheme import collocation
    from lagcli.simulation.singularity.singularity_step import SingularStep

# Where the drifts of a row stand in a line: rounding, which is not interpolated.
DRIFTS = slice(-line_functions.BEYOND, -line_functions.BEYOND + 2)


def put(run: Stepper, across: SingularStep, at: float) -> None:
    """Write the line at a time within the step; close to the instant it is the limit from both sides."""
    rows, step, tau = run.rows, across.step, at - across.instant
    if abs(tau) > interpolate_rows.PARAMETERS.window * across.width:
        _put_aside(run, at, step)
        return
    taus = interpolate_rows.beside(across.width, across.is_start)
    lines = []
    for beside in taus:
        _put_aside(run, across.instant + beside, step)
        lines.append(rows.line.copy())
    found = np.array(lines)
    rows.line[:] = interpolate_rows.interpolated(taus, found, tau)
    rows.line[DRIFTS] = found[:, DRIFTS].max(axis=0)
    rows.line[0] = rows.at[0] = run.origin + at


def _put_aside(run: Stepper, at: float, step: collocation.Step) -> None:
    rows = run.rows
    rows.at[0] = run.origin + at
    rows.aside.arguments[1][:] = step.state((at - step.t) / step.h)
    rows.aside.trigger()
