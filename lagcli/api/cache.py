"""Compiled systems, those that stay for another run, and models with their start moved."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import TYPE_CHECKING

from lagcli import memory, progress
from lagcli.analysis import examined_start
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.analysis.examined_start import ExaminedStart
from lagcli.compiled import NumericSystem
from lagcli.equations import size_limits, system
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.model.model import Model
from lagcli.model.settings import Simulation
from lagcli.start import consistent_start, initial

if TYPE_CHECKING:
    # Counts and verdicts come without a run.
    from lagcli.simulation.loop import RunStart
    from lagcli.simulation.run_entry import CachedFunctions
    from lagcli.start.assembly import Assembly

MOST_CACHED = 8  # compiled systems that stay for another run with other parameters


class CompiledModel:
    """A system with its functions, also with integrals enforced. What it keeps changes no answer."""

    def __init__(self, built: system.System, numeric: NumericSystem | None = None) -> None:
        self.system, self.numeric = built, numeric or NumericSystem(built)
        self._starts, self._begin = memory.Memory(MOST_CACHED), memory.Memory(1)

    @cached_property
    def cached(self) -> CachedFunctions:
        """The functions that runs of this text keep for one another."""
        from lagcli.simulation.run_entry import CachedFunctions

        return CachedFunctions(self.numeric)

    def with_values(self, model: Model) -> CompiledModel | None:
        """The functions for other values of parameters and start, or None where they do not fit."""
        moved = system.with_values(self.system, model)
        return None if moved is None else self.of(moved)

    def of(self, moved: system.System) -> CompiledModel:
        """The functions for a system that differs in values alone."""
        same = CompiledModel(moved, self.numeric)
        same.cached, same._starts = self.cached, self._starts
        return same

    def begin(self, known: KnownIntegrals | None, limit: float) -> tuple[ExaminedStart, RunStart]:
        """The start of a run with the settings of the model, and what it goes with; see `prepare_run.start`."""

        def found() -> tuple[ExaminedStart, RunStart]:
            start = self.examined_start(known, limit)
            integrals, notes = start.known.integrals, start.known.notes
            chosen = start.selection, start.is_singular
            return start, self.cached.run_start(self.system, start.state, *chosen, integrals, notes)

        return found() if known is not None else self._begin.answer(limit, found)

    def examined_start(self, known: KnownIntegrals | None, limit: float) -> ExaminedStart:
        """See `examined_start.examine`; runs that differ in their rows and tolerances share it."""
        if known is not None:
            return examined_start.examine(self.system, self.numeric, known, limit)
        model = self.system.model
        chosen = model.simulation
        same = Simulation(chosen.start, chosen.duration, assemble=chosen.assemble, keep=chosen.keep)
        question = dataclasses.replace(model, simulation=same), limit
        return self._starts.answer(
            question, lambda: examined_start.examine(self.system, self.numeric, None, limit)
        )

    def first_integrals(self, limit: float = settings.LIMIT) -> KnownIntegrals:
        """The first integrals of the differential rows as far as they are found in `limit` seconds."""
        return examined_start.first_integrals(self.system, self.numeric, limit)


_compiled = memory.Memory(MOST_CACHED)


@progress.phase("building the equations")
def compiled(model: Model) -> CompiledModel:
    """The compiled system of a model. Other values of parameters or of the start need no new build."""
    key = model.path, model.fingerprint  # a reported location contains the path
    known = _compiled.known(key)
    if isinstance(known, CompiledModel):
        before = known.system.model
        # Equal models were perhaps changed in another way, which tables tell.
        if before == model and (before.changes, before.sha256) == (model.changes, model.sha256):
            return known
    size_limits.require_built(model)
    same = known.with_values(model) if isinstance(known, CompiledModel) else None
    result = same or CompiledModel(system.build(model))
    _compiled.keep(key, result)
    return result


def assembled(model: Model) -> tuple[Model, Assembly]:
    """The model with its start moved to the nearest consistent state, and how far. Raises `diagnostics.ModelError`."""
    from lagcli.analysis.classification import classify  # most models are never moved

    ready = compiled(model)
    built, numeric = ready.system, ready.numeric
    try:
        found = consistent_start.nearest(built, numeric)
    except diagnostics.ModelError as error:
        if not classify.is_conflict(error):
            raise
        case = classify.classified(built, numeric).case
        found = consistent_start.nearest(case.system, case.numeric)
    return system.started_at(model, found.state.q, found.state.v), found


def violation_notes(ready: CompiledModel, done: str) -> tuple[str, ...]:
    """The note where the declared positions violate the rows, and what is `done` at the nearest ones that do not."""
    residuals = initial.residuals(ready.system, ready.numeric, initial.declared(ready.system))
    if not any(residuals.in_position(i) for i in residuals.violated):
        return ()
    off = residuals.of_positions
    return (
        f"the initial positions violate the rows by {off:.3g}: {done} the nearest consistent configuration",
    )
