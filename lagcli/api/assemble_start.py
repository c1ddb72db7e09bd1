"""A model with its start moved to the nearest consistent state."""

from __future__ import annotations

from lagcli.analysis.classification import classify
from lagcli.api.models import cache
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.model.model import Model
from lagcli.start import consistent_start
from lagcli.start.assembly import Assembly


def assembled(model: Model) -> tuple[Model, Assembly]:
    """The model with its start moved to the nearest consistent state, and how far. Raises `diagnostics.ModelError`."""
    ready = cache.compiled(model)
    built, numeric = ready.system, ready.numeric
    try:
        found = consistent_start.nearest(built, numeric)
    except diagnostics.ModelError as error:
        if not classify.is_conflict(error):
            raise
        case = classify.classified(built, numeric).case
        found = consistent_start.nearest(case.system, case.numeric)
    return system.started_at(model, found.state.q, found.state.v), found
