"""`lagcli.check`: everything that can be said before a run."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from lagcli import progress
from lagcli.analysis import check_report, codimension, dof, redundancy
from lagcli.analysis.check_report import Report
from lagcli.analysis.classification import verdict
from lagcli.api import cache, count_dof, run_settings
from lagcli.api.load import Path, as_model
from lagcli.equations import jump_warnings
from lagcli.errors import diagnostics
from lagcli.model.model import Model
from lagcli.start import consistent_start, gaps, initial, lipschitz

if TYPE_CHECKING:
    from lagcli.analysis.holonomy.witness import Witness


def check(model: Model | Path, *, assemble: bool = False, limit: float | None = None) -> Report:
    """Return verdicts, count, redundancy and consistency: the object behind `lagcli check --json`.

    `assemble` looks at the nearest consistent start; `limit`: the seconds for proofs of integrability. Raises
    `ModelError`, `ValueError`.
    """
    seconds = run_settings.seconds(limit)
    model = as_model(model)
    if dof.are_free_particles(model):
        return check_report.of_free_particles(model)
    ready = cache.compiled(model)
    residuals = initial.residuals(ready.system, ready.numeric, initial.declared(ready.system))
    moved = None
    apart = gaps.at_state(ready.system, ready.numeric, initial.declared(ready.system))
    if (assemble or model.simulation.assemble) and (apart.violated or not residuals.consistent):
        model, done = cache.assembled(model)
        moved, ready = consistent_start.moves(model, done), cache.compiled(model)
    sides = gaps.at_state(ready.system, ready.numeric, initial.declared(ready.system)).sides
    whole, examined = count_dof.examined(ready, seconds)
    built, numeric, case = ready.system, ready.numeric, whole.case
    found, counted = whole.found, examined.count
    # A hidden condition has no multiplier of its own.
    surface = codimension.examine(built, numeric, case.begin) if whole.conditions else examined.surface
    multipliers = redundancy.multipliers(built, numeric, examined.points, surface)
    verdicts = (*verdict.of_holonomic(model, tuple(row.name for row in built.rows.rows)), *found.verdicts)
    if whole.conditions and moved is None:
        residuals = initial.residuals(case.system, case.numeric, initial.declared(case.system))
    faults: list[diagnostics.Diagnostic] = []
    try:
        initial.inertia(built, numeric, initial.declared(built))
    except diagnostics.ModelError as error:  # such a model can be classified and counted all the same
        faults += error.diagnostics
    if moved is None:
        faults += [*initial.inconsistencies(case.system, residuals), *gaps.penetrations(built, apart)]
    return Report(
        title=model.title,
        path=model.path,
        dof=counted,
        constraints=(
            *(
                check_report.ConstraintReport(one, one.row in counted.redundant_rows, unique)
                for one, unique in zip(verdicts, multipliers.unique, strict=True)
            ),
            *(
                check_report.ConstraintReport(one, False, None, side)
                for one, side in zip(verdict.of_one_sided(model), sides, strict=True)
            ),
        ),
        null_vectors=multipliers.null_vectors,
        joint=check_report.joint(counted, found),
        initial=check_report.Initial(
            max(residuals.of_positions, apart.depth),
            residuals.of_velocities,
            residuals.consistent and not apart.violated,
            moved,
        ),
        warnings=(
            *model.warnings,
            *built.warnings,
            *jump_warnings.warnings(built),
            *lipschitz.warnings(built, numeric, case.begin),
            *(dataclasses.replace(d, severity="warning") for d in faults),
        ),
    )


def witness(model: Model, row: str, *, assemble: bool, limit: float) -> Witness | None:
    """A loop that shows a nonholonomic row to be so, or None where none is found in `limit` seconds."""
    # Most checks need no witness.
    from lagcli.analysis.holonomy import witness_search

    if assemble or model.simulation.assemble:
        model, _ = cache.assembled(model)
    ready = cache.compiled(model)
    return witness_search.find(ready.system, ready.numeric, row, progress.after(limit))
