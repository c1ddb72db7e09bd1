"""The keys of the model format, declared once: reader, hints and reference page read this table."""

from __future__ import annotations

import dataclasses

from lagcli.model import settings


@dataclasses.dataclass(frozen=True, slots=True)
class Key:
    """One key: what stands under it, what it means, its default, and the keys of its entries.

    `entries` says that names of the user's stand below, each with `keys`.
    """

    name: str
    holds: str
    meaning: str
    default: str = ""
    entries: bool = False
    required: bool = False
    keys: tuple[Key, ...] = ()

    def key(self, name: str) -> Key:
        """The key `name` below this one."""
        return next(key for key in self.keys if key.name == name)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the keys below."""
        return tuple(key.name for key in self.keys)


_FAMILY = (
    Key("for", "range or list of ranges", "makes the entry a family over indices"),
    Key("if", "condition", "filters the members of a family"),
)

_EQUATION = (Key("equation", "equation", "the constraint, where the entry is written at length"), *_FAMILY)

FORMAT = Key(
    "model",
    "sections",
    "the whole document",
    keys=(
        Key("lagcli", "`1`", "the version of the format", required=True),
        Key("title", "text", "one line that names the model"),
        Key("description", "text", "what the model is about"),
        Key("source", "text", "where the model comes from"),
        Key(
            "units",
            "labels",
            "labels for axes and reports; nothing is converted",
            keys=(
                Key("length", "text", "label of the unit of length", "m"),
                Key("mass", "text", "label of the unit of mass", "kg"),
                Key("time", "text", "label of the unit of time", "s"),
            ),
        ),
        Key(
            "parameters",
            "number, expression or vector",
            "named constants, each of earlier ones",
            entries=True,
        ),
        Key(
            "coordinates",
            "mapping",
            "generalized coordinates with their initial values",
            entries=True,
            keys=(
                Key("value", "expression of parameters", "initial value", "0"),
                Key("rate", "expression of parameters", "initial rate", "0"),
                *_FAMILY,
            ),
        ),
        Key(
            "particles",
            "mapping",
            "point masses, Cartesian or dependent",
            entries=True,
            keys=(
                Key("mass", "expression of parameters", "mass, positive", required=True),
                Key(
                    "position",
                    "vector",
                    "initial position; or x(q, t), where it refers to coordinates or to `t`",
                    required=True,
                ),
                Key(
                    "velocity",
                    "vector of parameters",
                    "initial velocity of a Cartesian particle",
                    "[0, 0, 0]",
                ),
                *_FAMILY,
            ),
        ),
        Key("definitions", "expression", "shorthand usable anywhere below", entries=True),
        Key("lagrangian", "expression", "added to T - V of the particles and potentials"),
        Key(
            "forces",
            "mapping",
            "applied forces, potentials and generalized forces",
            entries=True,
            keys=(
                Key("to", "name, list of names or `all`", "the particles or coordinates a force acts on"),
                Key("force", "vector or expression", "the force; `m`, `r`, `v` are the particle's own"),
                Key("potential", "expression", "a potential of positions, coordinates and time"),
                *_FAMILY,
            ),
        ),
        Key(
            "holonomic", "equation", "constraints in whole coordinates and time", entries=True, keys=_EQUATION
        ),
        Key(
            "differential",
            "equation",
            "constraints linear in differentials or velocities",
            entries=True,
            keys=_EQUATION,
        ),
        Key(
            "inequality",
            "condition",
            "one-sided constraints in whole coordinates and time, with `>=` or `<=`",
            entries=True,
            keys=(
                Key(
                    "condition",
                    "condition",
                    "the constraint, where the entry is written at length",
                    required=True,
                ),
                Key(
                    "restitution",
                    "expression of parameters",
                    "coefficient of restitution e of its impacts, 0 <= e <= 1",
                    "0",
                ),
                *_FAMILY,
            ),
        ),
        Key("rigid", "list of particles", "particles that form one rigid body", entries=True),
        Key(
            "outputs",
            "expression",
            "extra recorded quantities",
            entries=True,
            keys=(
                Key("expression", "expression", "the quantity, where the entry is written at length"),
                *_FAMILY,
            ),
        ),
        Key(
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
                ),
                Key(
                    "direction",
                    "`up`, `down` or `both`",
                    "the crossings that count: to positive values, to negative ones",
                    "both",
                ),
                Key(
                    "action",
                    "`record` or `stop`",
                    "whether the crossing is recorded only, or also ends the run",
                    "record",
                ),
            ),
        ),
        Key(
            "simulation",
            "settings",
            "how to run",
            keys=(
                Key("start", "expression of parameters", "time of the initial values", "0"),
                Key("duration", "expression of parameters", "length of the run", "10"),
                Key("samples", "whole number", "rows of the table, both ends counted", "1001"),
                Key("output_step", "expression of parameters", "time between rows, instead of `samples`"),
                Key(
                    "method",
                    " or ".join(f"`{name}`" for name in settings.METHODS),
                    "the integration scheme",
                    "auto",
                ),
                Key("rtol", "expression of parameters", "relative tolerance of a step", "1e-11"),
                Key(
                    "atol",
                    "expression of parameters",
                    "absolute tolerance of a step",
                    "1e-13 of the sizes of the motion",
                ),
                Key(
                    "assemble", "`true` or `false`", "move the start to the nearest consistent state", "false"
                ),
                Key("keep", "list of coordinates", "coordinates that assembly must not move"),
            ),
        ),
    ),
)
