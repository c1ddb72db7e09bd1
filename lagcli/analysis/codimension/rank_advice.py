"""Advice about rows of which it is not known how many freedoms they take: only what is true of these rows."""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.analysis.codimension import Codimension
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import independent_rows, rank
from lagcli.linear.metric_rows import MetricRows
from lagcli.start import initial, sample_points
from lagcli.start.initial import State

PLACES = 3  # places beside the start at which rows are compared
# A fixed one: the advice must not change from run to run.
SEED = 20061


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
    """The rows that depend on the others of them at places beside the surface, where most are independent."""
    random = np.random.default_rng(SEED)
    best: list[int] = rows
    for _ in range(PLACES):
        direction = random.standard_normal(state.q.size)
        there = dataclasses.replace(
            state, q=state.q + sample_points.ASIDE * sample_points.size(state.q) * direction
        )
        if not sample_points.is_finite(numeric, there):
            continue
        B = numeric.rows(there.t, there.q, there.v, there.p)[0][rows, :]
        beside = MetricRows(B, initial.metric_at(numeric, there))
        chosen = independent_rows.dependence(beside, rank.rank(beside).high)
        if len(chosen.rest) < len(best):
            best = [rows[i] for i in chosen.rest]
    return best
