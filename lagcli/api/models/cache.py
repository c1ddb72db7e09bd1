"""Systems with their functions, ready to be integrated, and those that stay for another run.

The cache changes no answer, and may forget at any time.
"""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property
from typing import TYPE_CHECKING

from lagcli import progress
from lagcli.analysis.classification.known_integrals import KnownIntegrals
from lagcli.analysis.examined_start import ExaminedStart, KnownAnswers, examine
from lagcli.compiled import NumericSystem
from lagcli.equations import size_limits, system
from lagcli.model import settings
from lagcli.model.model import Model

if TYPE_CHECKING:
    # Counts and verdicts come without a run.
    from lagcli.simulation.run_entry import CachedFunctions

MOST_CACHED = 8  # compiled systems that stay for another run with other parameters


class CompiledModel:
    """A system with its functions, also with integrals enforced. What it keeps changes no answer."""

    def __init__(self, built: system.System, numeric: NumericSystem | None = None) -> None:
        self.system, self.numeric = built, numeric or NumericSystem(built)
        self._answers = KnownAnswers()

    @cached_property
    def cached(self) -> CachedFunctions:
        """The functions that runs of this text keep for one another."""
        from lagcli.simulation.run_entry import CachedFunctions

        return CachedFunctions(self.numeric)

    def with_values(self, model: Model) -> CompiledModel | None:
        """The functions for other values of parameters and start, or None where they do not fit."""
        moved = system.with_values(self.system, model)
        if moved is None:
            return None
        same = self.of(moved)
        same._answers = self._answers
        return same

    def of(self, moved: system.System) -> CompiledModel:
        """The functions for a system that differs in values alone."""
        same = CompiledModel(moved, self.numeric)
        same.cached = self.cached
        return same

    def examined_start(
        self, known: KnownIntegrals | None = None, limit: float = settings.LIMIT
    ) -> ExaminedStart:
        """The start of a run. Raises `diagnostics.ModelError` as `examined_start.examine`."""
        return examine(self.system, self.numeric, self._answers, known, limit)

    def first_integrals(self, limit: float = settings.LIMIT) -> KnownIntegrals:
        """The first integrals of the differential rows as far as they are found in `limit` seconds."""
        return self._answers.first_integrals(self.system, self.numeric, limit)


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
