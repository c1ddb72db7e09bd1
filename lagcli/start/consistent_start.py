"""The start of a run: the declared one, examined, or the nearest consistent one where the model asks for it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.compiled import NumericSystem
from lagcli.equations import row_parameters, size_limits
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.start import initial
from lagcli.start.initial import State

if TYPE_CHECKING:
    # Most starts are consistent as they are declared.
    from lagcli.start.assembly import Assembly

Floats = npt.NDArray[np.float64]


@frozen
class ConsistentStart:
    """A state where a run can begin, and how it was moved there, if it was."""

    state: State
    assembly: Assembly | None = None

    def with_numbers(self, p: Floats) -> ConsistentStart:
        """The start with other values of what it does not depend on."""
        state, moved = dataclasses.replace(self.state, p=p), self.assembly
        if moved is None:
            return ConsistentStart(state)
        return ConsistentStart(
            state, dataclasses.replace(moved, state=state, declared=dataclasses.replace(moved.declared, p=p))
        )


@progress.phase("looking at the start")
def find(system: System, numeric: NumericSystem) -> ConsistentStart:
    """The start of a model with inertia, on its rows and outside its walls; assembled where its settings say so.

    Raises `diagnostics.ModelError` where no run can begin.
    """
    declared = initial.declared(system)
    metric = initial.inertia(system, numeric, declared)
    initial.require_squares(system, numeric, declared, metric)
    residuals = initial.residuals(system, numeric, declared)
    if not system.model.simulation.assemble:
        if not residuals.consistent:
            from lagcli.start import assembly

            assembly.require_consistent(system, numeric, declared, residuals)
        if system.contacts.count:
            from lagcli.start import gaps  # here, as most models have no one-sided constraints

            gaps.require_outside(system, numeric, declared)
            declared = gaps.settled(system, numeric, declared)
        return ConsistentStart(declared)
    moved = nearest(system, numeric)
    metric = initial.inertia(system, numeric, moved.state)
    initial.require_squares(system, numeric, moved.state, metric)
    return ConsistentStart(moved.state, moved)


def nearest(system: System, numeric: NumericSystem) -> Assembly:
    """The consistent state nearest to the declared one, without the coordinates that the settings keep, also on the
    allowed side of the one-sided constraints. Raises `diagnostics.ModelError`.
    """
    from lagcli.start import assembly

    declared, keep = initial.declared(system), system.model.simulation.keep
    return assembly.assemble(system, numeric, declared, keep, one_sided=True)


def known(built: System, numeric: NumericSystem) -> ConsistentStart:
    """The consistent start of a model, found for whatever it depends on.

    Assembly and the look at the residuals ask inertia, rows and contacts, the duration of the run and the settings of
    assembly, and nothing else: with another weight or another spring the same start is found, to the bit.
    Raises `diagnostics.ModelError` where no run can begin.
    """
    size_limits.require_run(built)
    declared, chosen = initial.declared(built), built.model.simulation
    held = numeric.memory.answer("parameters of starts", lambda: row_parameters.of_start(built))
    parts = declared.q.tobytes(), declared.v.tobytes(), declared.p[held].tobytes()
    question = ("start", declared.t, *parts, chosen.duration, chosen.assemble, chosen.keep)
    return numeric.memory.answer(question, lambda: find(built, numeric)).with_numbers(declared.p)
