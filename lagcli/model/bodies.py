"""Rigid bodies and joints in a model: names of the particles, rows and weights that stand for them."""

from __future__ import annotations

from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.frozen import frozen

AXES = "123"  # words of the directions of a body
CENTRE = "centre"
PLANE = "ab"  # words of the two directions in the plane of a flat body
OF_BODY = ("x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "wx", "wy", "wz")
OF_POINT = OF_BODY[:6]  # what a body without extent across its axis has


def weight(body: str, word: str, k: int | str) -> str:
    """The name of the hidden parameter that is weight k of a point or direction of a body; `n`: that of its normal."""
    return f"{body}.{word}.{k}"


@frozen
class Body:
    """A rigid body by the numbers of its particles."""

    name: str
    particles: tuple[int, ...]
    location: diagnostics.Location

    @property
    def base(self) -> str:
        """The name of it, or of the family that it is one of."""
        return self.name.partition("[")[0]

    @property
    def columns(self) -> tuple[str, ...]:
        """Its columns in the table."""
        return tuple(f"{self.name}.{part}" for part in (OF_BODY if len(self.particles) > 2 else OF_POINT))


@frozen
class Joint:
    """A joint, by its reaction on the particles of one body, the second of the two that is not the ground.

    rows: names of its rows; sign: -1 where that body is the first; word: of the weights of its place in that body, of a
    joint of a family built in, those of particles (P,) and of the normal.
    """

    name: str
    body: Body
    rows: tuple[str, ...]
    sign: float
    word: str
    built_in: tuple[Floats, float] | None

    @property
    def columns(self) -> tuple[str, ...]:
        """Its columns in the table: force and torque."""
        return tuple(f"{kind}.{self.name}.{axis}" for kind in ("force", "torque") for axis in "xyz")
