"""`lagcli.dof`: the degrees of freedom of a model."""

from __future__ import annotations

import dataclasses

from lagcli.analysis import dof as counting
from lagcli.analysis.classification import classify
from lagcli.analysis.dof import DofCount
from lagcli.api import cache, run_settings
from lagcli.api.cache import CompiledModel
from lagcli.api.load import Path, as_model
from lagcli.model.model import Model


def dof(model: Model | Path, *, limit: float | None = None) -> DofCount:
    """Count the degrees of freedom; `configuration_dof` is None where it is undecided, with the `reason`.

    `limit`: the seconds for proofs of integrability. Raises `ModelError`, `ValueError`.
    """
    seconds = run_settings.seconds(limit)
    model = as_model(model)
    if counting.are_free_particles(model):
        return counting.of_free_particles(model)
    return examined(cache.compiled(model), seconds)[1].count


def examined(ready: CompiledModel, limit: float) -> tuple[classify.Classified, counting.Examined]:
    """The classification and the count, with the hidden conditions among the rows."""
    whole = classify.classified(ready.system, ready.numeric, limit)
    case = whole.case
    found = counting.examine(case.system, case.numeric, case.begin, whole.found)
    own = {classify.equation(one) for one in whole.conditions}
    counted = dataclasses.replace(
        found.count,
        notes=(*cache.violation_notes(ready, "the count is that at"), *whole.notes, *found.count.notes),
        redundant_rows=tuple(name for name in found.count.redundant_rows if name not in own),
    )
    return dataclasses.replace(whole, found=found.found), dataclasses.replace(found, count=counted)
