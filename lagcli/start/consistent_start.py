"""The start of a run: the declared one, examined, or the nearest consistent one where the model asks for it, and
the initial values that this changed, from what to what."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli import doubles, progress
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations import row_parameters, size_limits
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.frozen import frozen, frozen_value
from lagcli.model import model as nouns
from lagcli.start import initial
from lagcli.start.initial import State

if TYPE_CHECKING:
    # Most starts are consistent as they are declared.
    from lagcli.start.assembly import Assembly


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
    """The start of a model, assembled where its settings say so. Raises `diagnostics.ModelError` where no run can
    begin: without inertia, off the rows, or beyond walls."""
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

            report = gaps.penetrations(system, gaps.at_state(system, numeric, declared))
            if report:
                raise diagnostics.ModelError(report)
            declared = gaps.settled(system, numeric, declared)
        return ConsistentStart(declared)
    moved = nearest(system, numeric)
    metric = initial.inertia(system, numeric, moved.state)
    initial.require_squares(system, numeric, moved.state, metric)
    return ConsistentStart(moved.state, moved)


def nearest(system: System, numeric: NumericSystem) -> Assembly:
    """The nearest consistent state, as `assembly.assemble` finds it with the settings. Raises `ModelError`."""
    from lagcli.start import assembly

    declared, keep = initial.declared(system), system.model.simulation.keep
    return assembly.assemble(system, numeric, declared, keep, one_sided=True)


def known(built: System, numeric: NumericSystem) -> ConsistentStart:
    """What `find` gives, kept in memory by what it depends on: inertia, rows, contacts, duration and settings of
    assembly. With another weight or another spring the same start is found, to the bit."""
    size_limits.require_run(built)
    declared, chosen = initial.declared(built), built.model.simulation
    held = numeric.memory.answer("parameters of starts", lambda: row_parameters.of_start(built))
    parts = declared.q.tobytes(), declared.v.tobytes(), declared.p[held].tobytes()
    question = ("start", declared.t, *parts, chosen.duration, chosen.assemble, chosen.keep)
    return numeric.memory.answer(question, lambda: find(built, numeric)).with_numbers(declared.p)


MOST_LISTED = 6  # moves that are named one by one


@frozen_value
class Move:
    """A coordinate or velocity that was changed, in the units of the model."""

    name: str
    old: float
    new: float

    def __str__(self) -> str:
        return f"{self.name} from {self.old:.6g} to {self.new:.6g}"


@frozen_value
class Moves:
    """The changes that an assembly made; moved and moved_velocity are those of `Assembly`."""

    moved: float
    moved_velocity: float
    positions: tuple[Move, ...]
    velocities: tuple[Move, ...]

    def lines(self, units: nouns.Units) -> Iterator[str]:
        """Sentences: how far, and the largest changes."""
        yield (
            f"assembled: moved by {self.moved:.6g} sqrt({units.mass}) {units.length}, velocities by"
            f" {self.moved_velocity:.6g} sqrt({units.mass}) {units.length}/{units.time} (mass-weighted norm)"
        )
        for kind, found in (("positions", self.positions), ("velocities", self.velocities)):
            if found:
                largest = sorted(found, key=lambda move: -abs(move.new - move.old))[:MOST_LISTED]
                more = len(found) - len(largest)
                rest = f", and {more} more by less" if more else ""
                yield f"assembled {kind}: {', '.join(map(str, largest))}{rest}"

    def as_json(self) -> dict[str, Any]:
        """The object `assembled` of `--json` and `--stats`."""
        kinds = {"positions": self.positions, "velocities": self.velocities}
        lists = {
            kind: [{"name": move.name, "from": move.old, "to": move.new} for move in found]
            for kind, found in kinds.items()
        }
        return {"moved": self.moved, "moved_velocity": self.moved_velocity, **lists}


def moves(model: nouns.Model, found: Assembly) -> Moves:
    """The changes from the declared start to the assembled one."""
    before, after = found.declared, found.state
    return Moves(
        found.moved,
        found.moved_velocity,
        tuple(_changed(model.coordinate_names, before.q, after.q)),
        tuple(_changed(model.rate_names, before.v, after.v)),
    )


def _changed(names: Sequence[str], old: Floats, new: Floats) -> Iterator[Move]:
    size = max(np.abs(old).max(initial=0.0), np.abs(new).max(initial=0.0))
    for i in np.flatnonzero(np.abs(new - old) > doubles.VALUE * size).tolist():
        yield Move(names[i], float(old[i]), float(new[i]))
