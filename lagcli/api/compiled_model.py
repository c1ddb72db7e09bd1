"""A system with its functions, ready to be integrated."""

from __future__ import annotations

from lagcli.analysis.classification.known_integrals import KnownIntegrals
from lagcli.analysis.examined_start import ExaminedStart, KnownAnswers, examine
from lagcli.compiled import NumericSystem
from lagcli.equations import system
from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.simulation.kept_functions import KeptFunctions


class CompiledModel:
    """A system with its functions, also with integrals held. What it keeps changes no answer."""

    def __init__(self, built: system.System, kept: KeptFunctions | None = None) -> None:
        self.system = built
        self.kept = kept or KeptFunctions(NumericSystem(built))
        self.numeric = self.kept.numeric
        self._answers = KnownAnswers()

    def with_values(self, model: Model) -> CompiledModel | None:
        """These functions for other values of parameters and start, or None where they do not fit."""
        moved = system.with_values(self.system, model)
        if moved is None:
            return None
        same = CompiledModel(moved, self.kept)
        same._answers = self._answers
        return same

    def examined_start(
        self, known: KnownIntegrals | None = None, limit: float = settings.LIMIT
    ) -> ExaminedStart:
        """The start of a run. Raises `diagnostics.ModelError` as `examined_start.examine`."""
        return examine(self.system, self.numeric, self._answers, known, limit)

    def first_integrals(self, limit: float = settings.LIMIT) -> KnownIntegrals:
        """The first integrals of the differential rows as far as they are found in `limit` seconds."""
        return self._answers.first_integrals(self.system, self.numeric, limit)
