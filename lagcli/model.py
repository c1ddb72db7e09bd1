"""The nouns of a model: what a file declares, checked and with every constant evaluated, but no dynamics yet.

Names keep the order of the file; the order of the constraints is the order of the multipliers lambda_i.
Lengths, masses and times carry whatever units the file labels (`Units`); nothing is converted.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Literal

from lagcli import diagnostics, source
from lagcli.expression import tree

Vector3 = tuple[float, float, float]


@dataclasses.dataclass(frozen=True, slots=True)
class Expression:
    """A tree with the text it was read from, for locating and showing."""

    tree: tree.Node
    origin: source.Scalar

    @property
    def text(self) -> str:
        """As the user wrote it."""
        return self.origin.value.strip()

    @property
    def location(self) -> diagnostics.Location:
        """Where the expression stands."""
        return self.origin.location


@dataclasses.dataclass(frozen=True, slots=True)
class VectorExpression:
    """One vector expression, or three scalar ones that were written as a list."""

    parts: tuple[Expression, ...]

    @property
    def location(self) -> diagnostics.Location:
        """Where it begins."""
        return self.parts[0].location


@dataclasses.dataclass(frozen=True, slots=True)
class Units:
    """Labels for axes and reports."""

    length: str = "m"
    mass: str = "kg"
    time: str = "s"


@dataclasses.dataclass(frozen=True, slots=True)
class Parameter:
    """A named constant, a number or a vector."""

    name: str
    value: float | Vector3


@dataclasses.dataclass(frozen=True, slots=True)
class Coordinate:
    """A generalized coordinate q with its initial value and initial rate."""

    name: str
    value: float
    rate: float
    location: diagnostics.Location


@dataclasses.dataclass(frozen=True, slots=True)
class Particle:
    """A point mass.

    Cartesian where `start` is given: its components are coordinates of the system, `start` and
    `start_velocity` their initial values. Otherwise dependent, x_n = x_n(q, t) (D.27), with `position`.
    """

    name: str
    mass: Expression
    mass_value: float
    position: VectorExpression
    start: Vector3 | None
    start_velocity: Vector3
    location: diagnostics.Location

    @property
    def is_dependent(self) -> bool:
        """Whether the position is a function of generalized coordinates and time."""
        return self.start is None


@dataclasses.dataclass(frozen=True, slots=True)
class Definition:
    """Shorthand for an expression."""

    name: str
    expression: Expression


@dataclasses.dataclass(frozen=True, slots=True)
class ParticleForce:
    """An applied force on particles; `m`, `r`, `v` in it are the particle's own.

    A `constant` force (parameters and `m` only) counts as the potential -F.r.
    """

    name: str
    targets: tuple[str, ...]
    force: VectorExpression
    constant: bool


@dataclasses.dataclass(frozen=True, slots=True)
class GeneralizedForce:
    """A force Q_j on generalized coordinates (D.30)."""

    name: str
    targets: tuple[str, ...]
    force: Expression


@dataclasses.dataclass(frozen=True, slots=True)
class Potential:
    """A potential V(r, q, t) (D.35)."""

    name: str
    expression: Expression


Force = ParticleForce | GeneralizedForce | Potential


@dataclasses.dataclass(frozen=True, slots=True)
class Holonomic:
    """f(r, q, t) = left - right = 0 (D.2); three rows where it is a vector equation."""

    name: str
    equation: Expression
    is_vector: bool

    @property
    def rows(self) -> tuple[str, ...]:
        """The names of its scalar rows."""
        return _row_names(self.name, self.is_vector)


@dataclasses.dataclass(frozen=True, slots=True)
class Differential:
    """A law linear in differentials or in velocities (D.3, D.4)."""

    name: str
    equation: Expression
    is_vector: bool
    form: Literal["differentials", "velocities"]

    @property
    def rows(self) -> tuple[str, ...]:
        """The names of its scalar rows."""
        return _row_names(self.name, self.is_vector)


def _row_names(name: str, is_vector: bool) -> tuple[str, ...]:
    return tuple(f"{name}.{axis}" for axis in "xyz") if is_vector else (name,)


@dataclasses.dataclass(frozen=True, slots=True)
class RigidBody:
    """Particles that form one rigid body; its rows are laid down in `rigid`."""

    name: str
    particles: tuple[str, ...]
    location: diagnostics.Location


@dataclasses.dataclass(frozen=True, slots=True)
class Output:
    """An extra recorded quantity."""

    name: str
    expression: Expression
    is_vector: bool

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its columns."""
        return _row_names(self.name, self.is_vector)


@dataclasses.dataclass(frozen=True, slots=True)
class Simulation:
    """How to run: times in the model's unit, `keep` in names of coordinates (`theta`, `a`, `a.x`)."""

    start: float = 0.0
    duration: float = 10.0
    samples: int = 1001
    output_step: float | None = None
    method: str = "auto"
    rtol: float = 1e-11
    atol: float = 1e-13
    assemble: bool = False
    keep: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True)
class Model:
    """A valid model. `fingerprint` tells models of different text apart; changed values do not enter it.

    `order` names particles and definitions, each after all it uses: evaluated so, a chain of any length needs
    no deep stack.
    """

    path: str
    fingerprint: str
    title: str
    description: str
    source: str
    units: Units
    parameters: tuple[Parameter, ...]
    coordinates: tuple[Coordinate, ...]
    particles: tuple[Particle, ...]
    definitions: tuple[Definition, ...]
    lagrangian: Expression | None
    forces: tuple[Force, ...]
    holonomic: tuple[Holonomic, ...]
    differential: tuple[Differential, ...]
    rigid: tuple[RigidBody, ...]
    outputs: tuple[Output, ...]
    simulation: Simulation
    warnings: tuple[diagnostics.Diagnostic, ...]
    order: tuple[str, ...]

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """The n coordinates of the system: components of Cartesian particles, then the generalized ones."""
        cartesian = (f"{p.name}.{axis}" for p in self.particles if not p.is_dependent for axis in "xyz")
        return (*cartesian, *(q.name for q in self.coordinates))

    def particle(self, name: str) -> Particle | None:
        """The particle of that name."""
        return next((p for p in self.particles if p.name == name), None)

    def constraints(self) -> Iterator[Holonomic | RigidBody | Differential]:
        """All constraints in the order of the multipliers: holonomic, rigid, differential."""
        yield from self.holonomic
        yield from self.rigid
        yield from self.differential
