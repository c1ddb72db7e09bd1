"""The start of a run: the declared one, examined, or the nearest consistent one where the model asks for it."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.start import assembly, gaps, initial
from lagcli.start.assembly import Assembly
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
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
    initial.inertia(system, numeric, declared)
    residuals = initial.residuals(system, numeric, declared)
    if not system.model.simulation.assemble:
        assembly.require_consistent(system, numeric, declared, residuals)
        gaps.require_outside(system, numeric, declared)
        return ConsistentStart(assembly.settled(system, numeric, declared))
    moved = nearest(system, numeric)
    initial.inertia(system, numeric, moved.state)
    return ConsistentStart(moved.state, moved)


def nearest(system: System, numeric: NumericSystem) -> Assembly:
    """The consistent state nearest to the declared one, without the coordinates that the settings keep, also on the
    allowed side of the one-sided constraints. Raises `diagnostics.ModelError`.
    """
    declared, keep = initial.declared(system), system.model.simulation.keep
    return assembly.assemble(system, numeric, declared, keep, one_sided=True)
