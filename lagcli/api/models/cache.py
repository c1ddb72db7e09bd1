"""Compiled systems that stay for another run: a cache and nothing else, that may forget at any time."""

from __future__ import annotations

from collections import OrderedDict

from lagcli import progress
from lagcli.api.models.compiled_model import CompiledModel
from lagcli.equations import size_limits, system
from lagcli.model.model import Model

MOST_CACHED = 8  # compiled systems that stay for another run with other parameters

_cached: OrderedDict[tuple[str, str], CompiledModel] = OrderedDict()


@progress.phase("building the equations")
def compiled(model: Model) -> CompiledModel:
    """The compiled system of a model. Other values of parameters or of the start need no new build."""
    size_limits.require_built(model)
    key = model.path, model.fingerprint  # a reported location contains the path
    cached = _cached.pop(key, None)
    result = (cached.with_values(model) if cached is not None else None) or CompiledModel(system.build(model))
    _cached[key] = result
    while len(_cached) > MOST_CACHED:
        _cached.popitem(last=False)
    return result


def forget() -> None:
    """Keep nothing of what was compiled before."""
    _cached.clear()
