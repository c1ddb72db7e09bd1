"""A system with its functions, ready to be integrated."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from lagcli.analysis.classification.known_integrals import KnownIntegrals
from lagcli.analysis.examined_start import ExaminedStart, KnownAnswers, examine
from lagcli.compiled import NumericSystem
from lagcli.equations import system
from lagcli.model import settings
from lagcli.model.model import Model

if TYPE_CHECKING:
    # Counts and verdicts come without a run.
    from lagcli.simulation.run_entry import CachedFunctions


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
