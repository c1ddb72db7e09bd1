"""The initial values that an assembly changed, from what to what."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.frozen import frozen_value
from lagcli.model import model as nouns

if TYPE_CHECKING:
    from lagcli.start.assembly import Assembly

Floats = npt.NDArray[np.float64]

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
    """The changes an assembly made: moved and moved_velocity as of `Assembly`; all coordinates and velocities it
    changed, in their order."""

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
    names, kinds = model.coordinate_names, set(model.generalized_names)
    rates = [f"rate({n})" if n in kinds else f"{n[:-1]}v{n[-1]}" for n in names]
    before, after = found.declared, found.state
    return Moves(
        found.moved,
        found.moved_velocity,
        tuple(_changed(names, before.q, after.q)),
        tuple(_changed(rates, before.v, after.v)),
    )


def _changed(names: Sequence[str], old: Floats, new: Floats) -> Iterator[Move]:
    size = max(np.abs(old).max(initial=0.0), np.abs(new).max(initial=0.0))
    for i in np.flatnonzero(np.abs(new - old) > doubles.VALUE * size).tolist():
        yield Move(names[i], float(old[i]), float(new[i]))
