"""The nouns of a model: what a file declares, checked and with every constant evaluated, but no dynamics yet.

An entry stands for one thing or, as a family, for K of them that share one expression over index vectors. Names keep
the order of the file; that of the constraints is the order of the multipliers lambda_i. No unit is converted.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator, Mapping
from typing import Literal, Protocol

import numpy as np

from lagcli import yaml_tree
from lagcli.arrays import Floats, Integers
from lagcli.errors import diagnostics
from lagcli.expression import tree
from lagcli.frozen import frozen, frozen_value
from lagcli.model.bodies import Body, Joint
from lagcli.model.family import Family
from lagcli.model.settings import Simulation

Vector3 = tuple[float, float, float]


@frozen_value
class Expression:
    """A tree with the text it was read from, for locating and showing."""

    tree: tree.Node
    origin: yaml_tree.Scalar

    def __repr__(self) -> str:
        return f"<Expression {self.text[:80]!r}>"

    @property
    def text(self) -> str:
        return self.origin.value.strip()

    @functools.cached_property
    def words(self) -> frozenset[str]:
        return tree.words(self.tree)

    @property
    def location(self) -> diagnostics.Location:
        return self.origin.location


@frozen_value
class VectorExpression:
    """One vector expression, or three scalar ones that were written as a list."""

    parts: tuple[Expression, ...]

    @property
    def location(self) -> diagnostics.Location:
        return self.parts[0].location


@frozen_value
class Units:
    """Labels for axes and reports."""

    length: str = "m"
    mass: str = "kg"
    time: str = "s"


@frozen_value
class Parameter:
    """A named constant, a number or a vector; `formula` is what it was computed from, where that is one expression."""

    name: str
    value: float | Vector3
    formula: Expression | None = dataclasses.field(default=None, compare=False)


@frozen
class Coordinate:
    """Generalized coordinates with initial values and rates, (K,) each; `written`: what they were computed from."""

    members: Family
    value: Floats
    rate: Floats
    location: diagnostics.Location
    written: Expression | None = dataclasses.field(default=None, compare=False)


@frozen
class Particle:
    """Point masses. Cartesian where `start` is given: their components are coordinates of the system, `start` and
    `start_velocity` (K, 3) their initial values. Otherwise dependent, x_n = x_n(q, t) (D.27), with `position`."""

    members: Family
    mass: Expression
    mass_values: Floats
    position: VectorExpression
    start: Floats | None
    start_velocity: Floats
    location: diagnostics.Location

    @property
    def is_dependent(self) -> bool:
        """True if the positions are functions of generalized coordinates and time."""
        return self.start is None


@frozen_value
class Definition:
    """Shorthand for an expression."""

    name: str
    expression: Expression


@frozen
class Action:
    """The targets of a force: P pairs of a target, by its number among all particles or among all generalized
    coordinates, and the member of the force that acts on it. Shapes (P,)."""

    targets: Integers
    acting: Integers

    def variables(self, members: Family) -> dict[str, Integers]:
        return {name: values[self.acting] for name, values in members.variables.items()}


@frozen
class ParticleForce:
    """An applied force on particles; `m`, `r`, `v` in it are the particle's own. A `constant` force (parameters,
    indices and `m` only) counts as the potential -F.r."""

    members: Family
    action: Action
    force: VectorExpression
    constant: bool


@frozen
class GeneralizedForce:
    """A force Q_j on generalized coordinates (D.30)."""

    members: Family
    action: Action
    force: Expression


@frozen
class Potential:
    """A potential V(r, q, t) (D.35); of a family the sum of all members."""

    members: Family
    expression: Expression


Force = ParticleForce | GeneralizedForce | Potential


def expressions_of(force: Force) -> tuple[Expression, ...]:
    """The expressions of a force."""
    if isinstance(force, Potential):
        return (force.expression,)
    return force.force.parts if isinstance(force, ParticleForce) else (force.force,)


@frozen
class _Equation:
    """A law with a row for each member, or three where it is a vector equation."""

    members: Family
    equation: Expression
    is_vector: bool

    @property
    def rows(self) -> tuple[str, ...]:
        return _with_axes(self.members, self.is_vector)


@frozen
class Holonomic(_Equation):
    """f(r, q, t) = left - right = 0 (D.2)."""


@frozen
class Differential(_Equation):
    """A law linear in differentials or in velocities (D.3, D.4)."""

    form: Literal["differentials", "velocities"]


@frozen
class Inequality:
    """g(r, q, t) = left - right >= 0: a one-sided constraint, a row for each member. The `equation`, a `tree.Relation`,
    was turned round where it had `<=`. restitution: the coefficients 0 <= e <= 1 of its impacts, (K,)."""

    members: Family
    equation: Expression
    restitution: Floats

    @property
    def rows(self) -> tuple[str, ...]:
        return self.members.names


Law = Holonomic | Differential | Inequality


def _with_axes(members: Family, is_vector: bool) -> tuple[str, ...]:
    if not is_vector:
        return members.names
    return tuple(f"{name}.{axis}" for name in members.names for axis in "xyz")


@frozen_value
class RigidBody:
    """Particles that form one rigid body, by their numbers; its rows are built in `rigid`."""

    name: str
    particles: tuple[int, ...]
    location: diagnostics.Location


@frozen
class Output:
    """An extra recorded quantity."""

    members: Family
    expression: Expression
    is_vector: bool

    @property
    def columns(self) -> tuple[str, ...]:
        return _with_axes(self.members, self.is_vector)


@frozen_value
class DeclaredEvent:
    """An event of the file: where `when` crosses zero in this direction it is recorded, or also ends the run."""

    name: str
    when: Expression
    direction: Literal["up", "down", "both"]
    action: Literal["record", "stop"]


class Made:
    """The nouns that the bodies and joints of a file stand for, in its order."""

    def __init__(self) -> None:
        self.bodies: list[Body] = []
        self.joints: list[Joint] = []
        self.parameters: list[Parameter] = []
        self.particles: list[Particle] = []
        self.rigid: list[RigidBody] = []
        self.holonomic: list[Holonomic] = []
        self.differential: list[Differential] = []


@frozen
class Batch:
    """Members (by their numbers) of the particle entry number `entry`, to be evaluated together."""

    entry: int
    member_numbers: Integers


# What expressions know without a declaration. A file that declares `deg` has its own instead; `pi` is reserved.
CONSTANTS = {"pi": math.pi, "deg": math.pi / 180.0}


class Origin(Protocol):
    """Something that a model was read from, and can be read from again with other values."""

    def changed(self, changes: Mapping[str, object]) -> Model: ...


@frozen
class Model:
    """A valid model. `fingerprint` tells models of different text apart; changed values do not enter it.

    `order` names definitions and batches of dependent particles, each after all it uses: evaluated so, a chain
    of any length needs no deep stack. `structure`: parameters that decide which members there are and which
    members an expression speaks of, with their values. `sha256`: of the bytes of the file, `text`: the file
    itself; `changes`: those of `--set`, as they were given; `origin`: the file to read it again from, None where the
    model is not as it was read.
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
    inequality: tuple[Inequality, ...]
    outputs: tuple[Output, ...]
    events: tuple[DeclaredEvent, ...]
    simulation: Simulation
    warnings: tuple[diagnostics.Diagnostic, ...]
    order: tuple[str | Batch, ...]
    structure: tuple[tuple[str, float], ...]
    bodies: tuple[Body, ...] = ()
    joints: tuple[Joint, ...] = ()
    sha256: str = ""
    text: str = dataclasses.field(default="", repr=False)
    changes: tuple[tuple[str, str], ...] = ()
    origin: Origin | None = dataclasses.field(default=None, repr=False)

    def with_parameters(self, changes: Mapping[str, object] | None = None, /, **parameters: object) -> Model:
        """Return the model with other values: `model.with_parameters(L=2)`, `({"theta.value": "pi/3"})`.

        What is given goes on top of earlier changes. The text is not parsed again, and a run of the new model uses
        the equations that were built for this one, and proofs that depend on no changed value.
        Raises `ModelError`, `OverrideError`, and `ValueError` where the model starts at a row of a table.
        """
        if self.origin is None:
            raise ValueError("the start of this model was changed after it was read: load the file anew")
        return self.origin.changed({**(changes or {}), **parameters})

    def __repr__(self) -> str:
        particles, coordinates = len(self.particle_names), len(self.generalized_names)
        laws = sum(1 for _ in self.constraints())
        title = f" {self.title[:60]!r}" if self.title else ""
        parts = [
            f"{count} {word}{'s' * (count != 1)}"
            for count, word in ((particles, "particle"), (coordinates, "coordinate"), (laws, "constraint"))
            if count
        ]
        return f"<Model{title} from {self.path}: {', '.join(parts)}>"

    def _repr_html_(self) -> str:
        # Models that are only computed with are shown nowhere.
        from lagcli.model import notebook_html

        laws = []
        for law in self.laws:
            count, name = law.members.count, law.members.base
            laws.append(
                (name if count == 1 else f"{name}: {count}", type(law).__name__.lower(), law.equation.text)
            )
        laws += [(body.name, "rigid", f"{len(body.particles)} particles") for body in self.rigid]
        values = [(one.name, f"{one.value}") for one in self.parameters]
        counts = ", ".join(
            f"{len(names)} {word}{'' if len(names) == 1 else 's'}"
            for names, word in ((self.particle_names, "particle"), (self.generalized_names, "coordinate"))
        )
        return notebook_html.page(
            self.title or self.path,
            notebook_html.sentences([f"{counts}, {self.path}"]),
            notebook_html.table(("constraint", "kind", "equation"), laws),
            notebook_html.table(("parameter", "value"), values),
        )

    def __eq__(self, other: object) -> bool:
        """True if both are read from the same text, with the same values of everything that may be set."""
        return isinstance(other, Model) and self._read_from() == other._read_from()

    def __hash__(self) -> int:
        # Models of one text stand in memories beside each other.
        return hash((self.fingerprint, *(one.value for one in self.parameters)))

    def _read_from(self) -> tuple[object, ...]:
        arrays = [part for p in self.particles if p.start is not None for part in (p.start, p.start_velocity)]
        arrays += [part for q in self.coordinates for part in (q.value, q.rate)]
        starts = tuple(array.tobytes() for array in arrays)
        return self.path, self.fingerprint, self.parameters, self.simulation, starts

    @property
    def constants(self) -> dict[str, float]:
        own = {one.name for one in self.parameters} | {one.name for one in self.definitions}
        own |= {one.members.base for one in self.coordinates} | {one.members.base for one in self.particles}
        own |= {one.members.base for one in self.outputs}
        return {name: value for name, value in CONSTANTS.items() if name not in own}

    @property
    def particle_names(self) -> tuple[str, ...]:
        return tuple(name for particle in self.particles for name in particle.members.names)

    @property
    def generalized_names(self) -> tuple[str, ...]:
        return tuple(name for coordinate in self.coordinates for name in coordinate.members.names)

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """The n coordinates of the system: components of Cartesian particles, then the generalized ones."""
        cartesian = (name for p in self.particles if not p.is_dependent for name in p.members.names)
        return (*(f"{name}.{axis}" for name in cartesian for axis in "xyz"), *self.generalized_names)

    @property
    def rate_names(self) -> tuple[str, ...]:
        """The columns of the velocities v, in the order of the coordinates."""
        generalized = set(self.generalized_names)
        return tuple(f"rate({n})" if n in generalized else f"{n[:-1]}v{n[-1]}" for n in self.coordinate_names)

    @property
    def state_columns(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The columns of tables that hold positions and coordinates, and those of velocities and rates."""
        particles, generalized = self.particle_names, self.generalized_names
        rates = (f"rate({name})" for name in generalized)
        return (
            (*(f"{name}.{axis}" for name in particles for axis in "xyz"), *generalized),
            (*(f"{name}.v{axis}" for name in particles for axis in "xyz"), *rates),
        )

    def location(self, coordinate: str) -> diagnostics.Location:
        for entry in self.coordinates:
            if coordinate in entry.members.names:
                return entry.location
        particle = coordinate.rpartition(".")[0]
        return next(p.location for p in self.particles if particle in p.members.names)

    def expressions(self) -> Iterator[Expression]:
        """All expressions of positions, definitions, forces, constraints, outputs and events."""
        for particle in self.particles:
            yield from particle.position.parts
        for definition in self.definitions:
            yield definition.expression
        if self.lagrangian is not None:
            yield self.lagrangian
        yield from self.force_expressions()
        yield from (law.equation for law in self.laws)
        yield from (output.expression for output in self.outputs)
        yield from (event.when for event in self.events)

    def force_expressions(self) -> Iterator[Expression]:
        return (expression for force in self.forces for expression in expressions_of(force))

    @property
    def laws(self) -> tuple[Law, ...]:
        """The constraints that are written as an equation or a condition, in the order of the multipliers."""
        return (*self.holonomic, *self.differential, *self.inequality)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """The K contacts: the rows of the inequalities."""
        return tuple(name for law in self.inequality for name in law.rows)

    @property
    def restitution(self) -> Floats:
        """The coefficients e of all contacts, (K,)."""
        return np.concatenate([np.zeros(0), *(law.restitution for law in self.inequality)])

    def constraints(self) -> Iterator[Holonomic | RigidBody | Differential | Inequality]:
        """All constraints in the order of the multipliers: holonomic, rigid, differential, inequality."""
        yield from self.holonomic
        yield from self.rigid
        yield from self.differential
        yield from self.inequality
