"""Hints for sections and keys that are written otherwise than the format has them.

Most are words of other programs or of paper; some are slips of YAML: a colon without its space, a decimal comma, keys
that are not indented.
"""

from __future__ import annotations

from collections.abc import Iterable

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.input import keys

_POINTS = (
    "particles are points without inertia of their own: several form a body under `rigid`; the kinetic energy of a body"
    " in its angles can be written under `lagrangian`"
)
_NO_FRICTION = (
    "contacts are ideal, without friction, which does virtual work (D.11); friction of given size is a force"
)
_START = "initial values are part of `particles` (`position`, `velocity`) and `coordinates` (`value`, `rate`)"

# Words that newcomers use for sections, and where their content belongs.
_SECTIONS = {
    **dict.fromkeys(
        ("constraints", "constraint", "laws", "joints", "joint", "links", "rods", "hinges"),
        "constraints on positions go under `holonomic`, constraints on velocities under `differential`, one-sided ones"
        " under `inequality`",
    ),
    **dict.fromkeys(
        ("nonholonomic", "non_holonomic", "velocity_constraints", "pfaffian", "kinematic", "rolling"),
        "constraints on velocities or differentials go under `differential`",
    ),
    **dict.fromkeys(
        ("holonomics", "geometric", "equations", "position_constraints"), "did you mean `holonomic`?"
    ),
    **dict.fromkeys(
        ("bodies", "body", "rigid_bodies", "rigid_body", "frames"), f"did you mean `rigid`? {_POINTS}"
    ),
    **dict.fromkeys(("inertia", "inertias", "moments"), _POINTS),
    **dict.fromkeys(("points", "masses", "nodes", "mass_points", "objects"), "did you mean `particles`?"),
    **dict.fromkeys(
        ("variables", "states", "state", "generalized_coordinates", "dofs", "q", "angles"),
        "did you mean `coordinates`?",
    ),
    **dict.fromkeys(("constants", "params", "param", "values", "data"), "did you mean `parameters`?"),
    **dict.fromkeys(
        ("loads", "springs", "dampers", "drag", "actuators", "motors", "potentials", "torques", "friction"),
        "did you mean `forces`? a potential is declared there too: `NAME: {potential: ...}`",
    ),
    **dict.fromkeys(
        ("gravity", "g"), "gravity is a force: `weight: {to: all, force: [0, 0, -m*9.81]}` under `forces`"
    ),
    **dict.fromkeys(("initial", "initial_conditions", "initial_values", "start_values", "ic"), _START),
    **dict.fromkeys(("record", "results", "observables", "quantities", "measure"), "did you mean `outputs`?"),
    **dict.fromkeys(
        ("settings", "solver", "integration", "integrator", "run", "options", "time"),
        "did you mean `simulation`?",
    ),
    **dict.fromkeys(("functions", "aliases", "expressions", "defs"), "did you mean `definitions`?"),
    **dict.fromkeys(
        ("kinetic", "kinetic_energy", "energy"), "an energy T - V of coordinates goes under `lagrangian`"
    ),
    **dict.fromkeys(
        ("potential", "potential_energy"), "a potential goes under `forces`: `NAME: {potential: ...}`"
    ),
    **dict.fromkeys(
        (
            *(
                "contacts",
                "contact",
                "inequalities",
                "one_sided",
                "unilateral",
                "collisions",
                "impacts",
                "walls",
            ),
            *("bounds", "limits", "obstacles"),
        ),
        "did you mean `inequality`? `floor: a.z >= 0` there keeps a particle above the floor",
    ),
    **dict.fromkeys(
        ("event", "triggers", "zero_crossings", "stop", "terminate", "monitors", "guards"),
        "did you mean `events`?",
    ),
    **dict.fromkeys(("name", "model"), "did you mean `title`?"),
    **dict.fromkeys(("version", "format"), "a model begins with the line `lagcli: 1`"),
}

_TO_POSITION = dict.fromkeys(
    ("pos", "r", "place", "location", "start", "coordinates", "point", "xyz"), "position"
)
_TO_VELOCITY = dict.fromkeys(("vel", "v", "speed", "v0", "initial_velocity"), "velocity")
_ALIASES: dict[str, dict[str, str]] = {
    "particles": {**_TO_POSITION, **_TO_VELOCITY, **dict.fromkeys(("m", "weight", "M"), "mass")},
    "coordinates": {
        **dict.fromkeys(
            ("position", "initial", "start", "angle", "q", "x", "pos", "initial_value", "x0"), "value"
        ),
        **dict.fromkeys(("velocity", "speed", "v", "dot", "omega", "initial_rate", "vel", "v0"), "rate"),
    },
    "forces": {
        **dict.fromkeys(("on", "at", "target", "targets", "body", "particle", "particles", "acts_on"), "to"),
        **dict.fromkeys(
            ("value", "vector", "f", "F", "components", "torque", "moment", "magnitude"), "force"
        ),
        **dict.fromkeys(("V", "energy", "U", "potential_energy"), "potential"),
    },
    "inequality": {
        **dict.fromkeys(
            ("equation", "expression", "constraint", "g", "gap", "inequality", "when"), "condition"
        ),
        **dict.fromkeys(
            ("e", "cor", "COR", "epsilon", "bounce", "elasticity", "bounciness", "coefficient"), "restitution"
        ),
    },
    "events": {
        **dict.fromkeys(("condition", "expression", "trigger", "function", "event", "g", "guard"), "when"),
        **dict.fromkeys(("sign", "crossing", "slope", "dir"), "direction"),
        **dict.fromkeys(("do", "then", "effect"), "action"),
    },
    "simulation": {
        **dict.fromkeys(
            ("time", "t_end", "tend", "end", "tmax", "T", "t_final", "tf", "stop", "length"), "duration"
        ),
        **dict.fromkeys(("t0", "begin", "start_time", "tstart"), "start"),
        **dict.fromkeys(("steps", "n", "N", "points", "rows", "frames"), "samples"),
        **dict.fromkeys(("tolerance", "tol", "reltol", "precision", "eps", "rel_tol"), "rtol"),
        **dict.fromkeys(("abstol", "abs_tol"), "atol"),
        **dict.fromkeys(("solver", "integrator", "scheme"), "method"),
        **dict.fromkeys(("fixed", "frozen", "hold"), "keep"),
        **dict.fromkeys(("dt", "step", "h", "time_step", "timestep", "output", "interval"), "output_step"),
    },
}
_SENTENCES: dict[tuple[str, str], str] = {
    **{
        (
            "simulation",
            key,
        ): "the time between rows is `output_step`; the steps of the integration adapt themselves"
        for key, to in _ALIASES["simulation"].items()
        if to == "output_step"
    },
    **{("particles", axis): "a position is one list: `position: [x, y, z]`" for axis in "xyz"},
    **{
        ("particles", axis): "a velocity is one list: `velocity: [vx, vy, vz]`" for axis in ("vx", "vy", "vz")
    },
    **{("particles", key): _POINTS for key in ("inertia", "radius", "orientation", "I", "shape", "size")},
    **{
        ("particles", key): "hold a particle by a constraint: `pin: a = [0, 0, 0]` under `holonomic`"
        for key in ("fixed", "pinned", "anchored", "ground")
    },
    ("particles", "name"): "the name is written before the colon: `a: {mass: 1, position: [0, 0, 0]}`",
    ("particles", "force"): "forces go under `forces`: `push: {to: a, force: [1, 0, 0]}`",
    **{("inequality", key): _NO_FRICTION for key in ("friction", "mu", "friction_coefficient", "tangential")},
    **{
        (
            "inequality",
            key,
        ): "contacts are rigid: a soft one is a potential that rises at the wall, under `forces`"
        for key in ("stiffness", "damping", "k", "penalty", "compliance")
    },
    **{("events", key): "an end of the run is `action: stop`" for key in ("terminal", "stop", "terminate")},
    **{("events", key): "events are no families: each has an entry" for key in ("for", "if")},
    ("units", "angle"): "angles are in radians everywhere; degrees are written `30*deg`",
    ("units", "force"): "units of other quantities follow from length, mass and time",
}

EXAMPLES = {
    "parameters": "`g: 9.81`",
    "coordinates": "`theta: {value: 0.5, rate: 0}`",
    "particles": "`a: {mass: 1, position: [0, 0, 0]}`",
    "definitions": "`gap: distance(a, b)`",
    "forces": "`weight: {to: all, force: [0, 0, -m*g]}`, `spring: {potential: k/2*norm(a)**2}`",
    "holonomic": "`rod: norm(a) = 1`",
    "differential": "`skate: d(a.x) = 0`",
    "inequality": "`floor: a.z >= 0`, `wall: {condition: a.x <= 1, restitution: 0.5}`",
    "rigid": "`body: [a, b, c]`",
    "outputs": "`height: a.z`",
    "events": "`apex: {when: a.vz, direction: down}`",
    "units": "`length: mm`",
    "simulation": "`duration: 5`",
}


# Sections whose entries are written over several lines, and often without an indent.
_OFTEN_FLAT = ("particles", "coordinates", "forces", "inequality", "events")


def section(name: str, value: yaml_tree.AnyNode, before: str) -> str:
    """For an unknown section; `before`: an empty section just before it, or an empty text."""
    inside = keys.FORMAT.key(before) if before else None
    if inside is not None and inside.entries and isinstance(value, yaml_tree.Mapping):
        return f"if `{name}` belongs to `{before}`, indent it and what follows"
    if name in _SECTIONS:
        return _SECTIONS[name]
    if name in keys.FORMAT.key("simulation").names:
        return f"`{name}` belongs under `simulation`"
    for owner in ("particles", "coordinates", "forces"):
        if name in keys.FORMAT.key(owner).names:
            return f"`{name}` belongs to an entry of `{owner}`: indent it"
    near = diagnostics.nearest(name, keys.FORMAT.names)
    if not near and name in _ALIASES["simulation"]:
        return f"`{_ALIASES['simulation'][name]}` belongs under `simulation`"
    return near or "the sections are " + ", ".join(keys.FORMAT.names)


def key(owner: keys.Key, name: yaml_tree.Scalar, value: yaml_tree.AnyNode) -> str:
    """For an unknown key of an entry of a section."""
    word, colon, rest = name.value.partition(":")
    if colon and word in owner.names:
        return f"a colon needs a space after it: `{word}: {rest}`"
    if is_decimal_part(name, value):
        return "a decimal point is written `.`, not `,`"
    sentence = _SENTENCES.get((owner.name, name.value))
    if sentence:
        return sentence
    alias = _ALIASES.get(owner.name, {}).get(name.value)
    if alias:
        return f"did you mean `{alias}`?"
    known = ", ".join(f"`{k.name}`" for k in owner.keys)
    return diagnostics.nearest(name.value, owner.names) or f"the keys here are {known}"


def meant_keys(owner: keys.Key, names: Iterable[yaml_tree.Scalar]) -> set[str]:
    """The keys that unknown ones stand for: these are not missing as well."""
    found = set()
    for name in names:
        word = name.value.partition(":")[0]
        found.add(word if word in owner.names else _ALIASES.get(owner.name, {}).get(name.value, ""))
        if owner.name == "particles" and name.value in ("x", "y", "z"):
            found.add("position")
    return found


def is_decimal_part(name: yaml_tree.Scalar, value: yaml_tree.AnyNode) -> bool:
    """True if an entry is what a decimal comma cut off in `{ }`: `{g: 9,81}` is `g: 9` and `81:`."""
    touching = name.text.content[max(0, name.start - 1) : name.start] == ","
    return name.value.isdigit() and touching and yaml_tree.is_empty(value)


def shape(owner: keys.Key, node: yaml_tree.AnyNode) -> str:
    """For what should be a mapping with the keys of `owner`, and is none."""
    if owner.name == "forces":
        written = node.value if isinstance(node, yaml_tree.Scalar) else "[...]"
        vector = written if written.startswith("[") and len(written) < 60 else "[fx, fy, fz]"
        return (
            f"a force says what it acts on: `{{to: all, force: {vector}}}`; a potential is `{{potential: V}}`"
        )
    if owner.name == "particles":
        return "write `{mass: 1, position: [x, y, z]}`"
    if owner.name == "events" and isinstance(node, yaml_tree.Scalar) and 0 < len(node.value) < 60:
        return f"write `{{when: {node.value.strip()}}}`"
    if owner.name == "coordinates":
        return "write `{value: 0.5, rate: 0}`"
    return f"for example {EXAMPLES[owner.name]}" if owner.name in EXAMPLES else ""


def indented(
    root: yaml_tree.Mapping,
) -> tuple[yaml_tree.Mapping, list[tuple[yaml_tree.Scalar, yaml_tree.Scalar]]]:
    """The document with keys moved under the empty entry they follow, and each such entry with its first key.

    `a:` with `mass:` and `position:` at its own level declares three empty particles; it is read as one.
    """
    found: list[tuple[yaml_tree.Scalar, yaml_tree.Scalar]] = []
    sections = []
    for name, node in root:
        if name.value in _OFTEN_FLAT and isinstance(node, yaml_tree.Mapping):
            node = _indented(keys.FORMAT.key(name.value), node, found)
        sections.append((name, node))
    if not found:
        return root, found
    return yaml_tree.Mapping(root.text, root.start, root.end, tuple(sections)), found


def _indented(
    owner: keys.Key, node: yaml_tree.Mapping, found: list[tuple[yaml_tree.Scalar, yaml_tree.Scalar]]
) -> yaml_tree.Mapping:
    entries: list[tuple[yaml_tree.Scalar, yaml_tree.AnyNode]] = []
    inner: list[tuple[yaml_tree.Scalar, yaml_tree.AnyNode]] = []
    for name, value in node:
        written = not isinstance(value, yaml_tree.Mapping) and not yaml_tree.is_empty(value)
        if name.value in owner.names and written and entries and yaml_tree.is_empty(entries[-1][1]):
            if not inner:
                found.append((entries[-1][0], name))
            inner.append((name, value))
            continue
        _close(entries, inner)
        inner = []
        entries.append((name, value))
    _close(entries, inner)
    return yaml_tree.Mapping(node.text, node.start, node.end, tuple(entries))


def _close(
    entries: list[tuple[yaml_tree.Scalar, yaml_tree.AnyNode]],
    inner: list[tuple[yaml_tree.Scalar, yaml_tree.AnyNode]],
) -> None:
    """Give the last entry the keys that follow it."""
    if inner:
        first, last = inner[0][0], inner[-1][1]
        entries[-1] = (entries[-1][0], yaml_tree.Mapping(first.text, first.start, last.end, tuple(inner)))
