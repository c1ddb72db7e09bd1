"""A model with its start moved to the nearest consistent state."""

from __future__ import annotations

from lagcli.analysis.classification import hidden_conditions
from lagcli.api import cache
from lagcli.equations import restart
from lagcli.errors import diagnostics
from lagcli.model.model import Model
from lagcli.start import assembly, initial


def assembled(model: Model) -> tuple[Model, assembly.Assembly]:
    """The model with its start moved to the nearest consistent state, and how far. Raises `diagnostics.ModelError`."""
    ready = cache.compiled(model)
    built, numeric = ready.system, ready.numeric
    try:
        found = assembly.assemble(
            built, numeric, initial.declared(built), model.simulation.keep, one_sided=True
        )
    except diagnostics.ModelError as error:
        if not hidden_conditions.is_conflict(error):
            raise
        case = hidden_conditions.classified(built, numeric).case
        found = assembly.assemble(
            case.system, case.numeric, initial.declared(case.system), model.simulation.keep, one_sided=True
        )
    return restart.at(model, found.state.q, found.state.v), found
