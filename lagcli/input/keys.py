"""The keys of the model format, declared once: reader, hints and reference page read this table."""

from __future__ import annotations

from lagcli.frozen import frozen_value
from lagcli.model import settings


@frozen_value
class Key:
    """One key: what stands under it, what it means, its default, and the keys of its entries.

    `entries` says that names of the user's stand below, each with `keys`; `short` is what an entry may also be in place
    of a mapping. `example` is a value as it is written in a file. `instead_of` are keys beside which this one may not
    stand; of the sets of keys in `one_of` at least one is complete.
    """

    name: str
    holds: str
    meaning: str
    default: str = ""
    entries: bool = False
    required: bool = False
    keys: tuple[Key, ...] = ()
    short: str = ""
    example: str = ""
    instead_of: tuple[str, ...] = ()
    one_of: tuple[tuple[str, ...], ...] = ()

    def key(self, name: str) -> Key:
        return next(key for key in self.keys if key.name == name)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(key.name for key in self.keys)


_FAMILY = (
    Key("for", "range or list of ranges", "makes the entry a family over indices", example="i = 1..N"),
    Key("if", "condition", "filters the members of a family", example="i != 2"),
)


def _equation(example: str) -> tuple[Key, ...]:
    meaning = "the constraint, where the entry is written at length"
    return (Key("equation", "equation", meaning, example=example), *_FAMILY)


_UNITS = Key(
    "units",
    "labels",
    "labels for axes and reports; nothing is converted",
    keys=(
        Key("length", "text", "label of the unit of length", "m", example="mm"),
        Key("mass", "text", "label of the unit of mass", "kg", example="g"),
        Key("time", "text", "label of the unit of time", "s", example="ms"),
    ),
    example="{length: mm, mass: g, time: ms}",
)

_COORDINATES = Key(
    "coordinates",
    "mapping",
    "generalized coordinates with their initial values",
    entries=True,
    short="expression of parameters",
    keys=(
        Key("value", "expression of parameters", "initial value", "0", example="30*deg"),
        Key("rate", "expression of parameters", "initial rate", "0", example="sqrt(g/L)"),
        *_FAMILY,
    ),
    example="{theta: {value: 0.5, rate: 0}}",
)

_PARTICLES = Key(
    "particles",
    "mapping",
    "point masses, Cartesian or dependent",
    entries=True,
    keys=(
        Key("mass", "expression of parameters", "mass, positive", required=True, example="2*m"),
        Key(
            "position",
            "vector",
            "initial position; or x(q, t), where it refers to coordinates or to `t`",
            required=True,
            example="[L*sin(theta), 0, -L*cos(theta)]",
        ),
        Key(
            "velocity",
            "vector of parameters",
            "initial velocity of a Cartesian particle",
            "[0, 0, 0]",
            example="[0, 1.5, 0]",
        ),
        *_FAMILY,
    ),
    example="{a: {mass: m, position: [L, 0, 0]}}",
)

_FORCES = Key(
    "forces",
    "mapping",
    "applied forces, potentials and generalized forces",
    entries=True,
    keys=(
        Key(
            "to",
            "name, list of names or `all`",
            "the particles or coordinates a force acts on",
            example="[a, b]",
        ),
        Key(
            "force",
            "vector or expression",
            "the force; `m`, `r`, `v` are the particle's own",
            example="[0, 0, -m*g]",
        ),
        Key(
            "potential",
            "expression",
            "a potential of positions, coordinates and time",
            example="k/2*(distance(a, b) - L)**2",
            instead_of=("to", "force"),
        ),
        *_FAMILY,
    ),
    example="{weight: {to: all, force: [0, 0, -m*g]}}",
    one_of=(("to", "force"), ("potential",)),
)

_INEQUALITY = Key(
    "inequality",
    "condition",
    "one-sided constraints in positions and time, with `>=` or `<=`",
    entries=True,
    keys=(
        Key(
            "condition",
            "condition",
            "the constraint, where the entry is written at length",
            required=True,
            example="a.z >= -2*L",
        ),
        Key(
            "restitution",
            "expression of parameters",
            "coefficient of restitution e of its impacts, 0 <= e <= 1",
            "0",
            example="0.8",
        ),
        *_FAMILY,
    ),
    example="{floor: a.z >= -2*L}",
)

_EVENTS = Key(
    "events",
    "mapping",
    "what is recorded, or stops the run, where an expression crosses zero",
    entries=True,
    keys=(
        Key(
            "when",
            "expression",
            "the quantity that crosses zero, of all an output may use",
            required=True,
            example="multiplier(rod) - 20",
        ),
        Key(
            "direction",
            "`up`, `down` or `both`",
            "the crossings that count: to positive values, to negative ones",
            "both",
            example="down",
        ),
        Key(
            "action",
            "`record` or `stop`",
            "whether the crossing is recorded only, or also ends the run",
            "record",
            example="stop",
        ),
    ),
    example="{lowest: {when: a.vz, direction: up}}",
)

_SIMULATION = Key(
    "simulation",
    "settings",
    "how to run",
    keys=tuple(
        Key(name, row.holds, row.meaning, row.default, example=row.example, instead_of=row.instead_of)
        for name, (_, row) in settings.table().items()
    ),
    example="{duration: 5, samples: 501}",
)

_OUTPUTS = Key(
    "outputs",
    "expression",
    "extra recorded quantities",
    entries=True,
    keys=(
        Key(
            "expression",
            "expression",
            "the quantity, where the entry is written at length",
            example="norm(a.v)",
        ),
        *_FAMILY,
    ),
    example="{pull: norm(reaction(a))}",
    one_of=(("expression",),),
)

FORMAT = Key(
    "model",
    "sections",
    "the whole document",
    keys=(
        Key("lagcli", "`1`", "the version of the format", required=True, example="1"),
        Key("title", "text", "one line that names the model", example="Pendulum"),
        Key("description", "text", "what the model is about", example="Let go from the horizontal."),
        Key("source", "text", "where the model comes from", example="Goldstein, ch. 1"),
        _UNITS,
        Key(
            "parameters",
            "number, expression or vector",
            "named constants, each of earlier ones",
            entries=True,
            example="{m: 2, L: 1, g: 9.81}",
        ),
        _COORDINATES,
        _PARTICLES,
        Key(
            "definitions",
            "expression",
            "shorthand usable anywhere below",
            entries=True,
            example='{gap: "distance(a, b) - L"}',
        ),
        Key(
            "lagrangian",
            "expression",
            "added to T - V of the particles and potentials",
            example="J/2*rate(theta)**2",
        ),
        _FORCES,
        Key(
            "holonomic",
            "equation",
            "constraints in positions and time",
            entries=True,
            keys=_equation("distance(p[i], p[i+1]) = L"),
            example="{rod: L = norm(a)}",
            one_of=(("equation",),),
        ),
        Key(
            "differential",
            "equation",
            "constraints linear in differentials or velocities",
            entries=True,
            keys=_equation("cos(theta)*d(a.y) - sin(theta)*d(a.x) = 0"),
            example="{skate: cos(theta)*d(a.y) - sin(theta)*d(a.x) = 0}",
            one_of=(("equation",),),
        ),
        _INEQUALITY,
        Key(
            "rigid",
            "list of particles",
            "particles that form one rigid body",
            entries=True,
            example="{body: [a, b, c]}",
        ),
        _OUTPUTS,
        _EVENTS,
        _SIMULATION,
    ),
)
