"""The refusals of rows that no run can be stepped with, with advice: only what is true of these rows."""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.analysis.codimension.examine import Codimension, Rows
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import independent_rows, rank
from lagcli.linear.metric_rows import MetricRows
from lagcli.start import initial, sample_points
from lagcli.start.initial import State

POINTS = 3  # points beside the start at which rows are compared
# A fixed one: the advice must not change from run to run.
SEED = 20061


def multiplier_rule(system: System, found: Codimension) -> diagnostics.ModelError:
    """The error of a run of rows that are `deficient`: no finite multipliers give the true motion."""
    rows = list(found.rows)
    message = (
        f"the multiplier rule fails for the rows {initial.names_of(system, rows)}: the constraints take"
        f" {found.codimension} freedoms, and their gradients span only {found.rank} directions wherever they hold, so"
        " that no finite multipliers give the true motion"
    )
    particles = _particles(system, rows)
    hint = (
        f"declare {_listed(particles)} under `rigid` in place of these rows: the rows of a body are independent"
        if len(particles) > 1
        else "write the constraint so that its gradient does not vanish where it holds"
    )
    location = system.rows.rows[rows[-1]].location
    return diagnostics.ModelError([diagnostics.Diagnostic("multiplier-rule-fails", message, location, hint)])


def _particles(system: System, rows: Rows) -> list[str]:
    """The particles that rows hold, or none where they hold generalized coordinates."""
    names = system.model.coordinate_names
    columns = sorted(set(system.rows.B[rows, :].sparsity().get_col()))
    if any(names[i] in system.model.generalized_names for i in columns):
        return []
    return list(dict.fromkeys(names[i].rpartition(".")[0] for i in columns))


def _listed(names: list[str]) -> str:
    shown = ", ".join(f"`{name}`" for name in names[: initial.PARAMETERS.most_listed])
    return shown + (", ..." if len(names) > initial.PARAMETERS.most_listed else "")


def undecided(
    system: System, numeric: NumericSystem, state: State, surface: Codimension
) -> diagnostics.ModelError:
    """The error for a start at which the dimension of the surface is undecided."""
    rows = list(surface.rows)
    location = system.rows.rows[rows[-1]].location
    hint = _hint(system, numeric, state, rows)
    return diagnostics.ModelError(
        [diagnostics.Diagnostic("dependent-constraints", surface.reason, location, hint)]
    )


def _hint(system: System, numeric: NumericSystem, state: State, rows: list[int]) -> str:
    if len(rows) == 1:
        return "start where the gradient of this row does not vanish, or write the row so that it vanishes nowhere"
    follow = _dependent_beside(numeric, state, rows)
    if not follow:
        return (
            "beside the start these rows are independent, so none of them can be left out: this is a singular"
            " configuration, where branches of the motion may meet; start at a configuration aside of it"
        )
    verb = "depends" if len(follow) == 1 else "depend"
    return (
        f"{initial.names_of(system, follow)} {verb} on the others beside the start too: leave out what follows from"
        " the others"
    )


def _dependent_beside(numeric: NumericSystem, state: State, rows: list[int]) -> list[int]:
    """The rows that depend on the others of them at points beside the surface, where most are independent."""
    random = np.random.default_rng(SEED)
    best: list[int] = rows
    for _ in range(POINTS):
        direction = random.standard_normal(state.q.size)
        there = dataclasses.replace(
            state, q=state.q + sample_points.PARAMETERS.offset * initial.size(state.q) * direction
        )
        if not sample_points.is_finite(numeric, there):
            continue
        B = numeric.rows(there.t, there.q, there.v, there.p)[0][rows, :]
        beside = MetricRows(B, initial.metric_at(numeric, there))
        chosen = independent_rows.dependence(beside, rank.estimate(beside).high)
        if len(chosen.rest) < len(best):
            best = [rows[i] for i in chosen.rest]
    return best
