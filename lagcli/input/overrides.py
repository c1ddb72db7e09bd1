"""Changes to parameters and initial values that come from the command line (`--set`) or from Python.

Those of entries are written into the document; those of single members of families, `p[3].x`, are made in the model.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import SupportsFloat

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.expression import parser, tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen_value
from lagcli.input import namespace
from lagcli.input.scalars import Formulas
from lagcli.model import model

_INITIAL = {"value": "coordinates", "rate": "coordinates", "position": "particles", "velocity": "particles"}
_COMPONENTS: dict[str, tuple[str, int]] = {
    "x": ("position", 0),
    "y": ("position", 1),
    "z": ("position", 2),
    "vx": ("velocity", 0),
    "vy": ("velocity", 1),
    "vz": ("velocity", 2),
}


class OverrideError(Exception):
    """A change names nothing that can be changed, or is no expression."""


@frozen_value
class OfMember:
    """A change to one member of a family, `p[3].x`: it cannot be written into the document, where the family is
    one entry. `axis`: of the component of `field` that changes, or None for all of it."""

    name: str
    section: str
    owner: str
    field: str
    axis: int | None
    value: yaml_tree.AnyNode


def apply(
    root: yaml_tree.Mapping, changes: Mapping[str, object]
) -> tuple[yaml_tree.Mapping, tuple[OfMember, ...]]:
    """The document with the changes written into it, and those to single members. Raises `OverrideError`."""
    of_members = []
    for name, value in changes.items():
        node = _node(f"--set {name}", value)
        one = _of_member(root, name, node)
        if one is not None:
            of_members.append(one)
        else:
            root = _apply(root, name, node)
    return root, tuple(of_members)


def _of_member(root: yaml_tree.Mapping, name: str, value: yaml_tree.AnyNode) -> OfMember | None:
    """The change, where it is of a member of a family and not of an entry."""
    owner, field = _parts(name)
    section = "particles" if field in _COMPONENTS else _INITIAL.get(field)
    base, bracket, _ = owner.partition("[")
    entries = root.get(section) if section else None
    if not bracket or section is None or not isinstance(entries, yaml_tree.Mapping):
        return None
    if entries.get(owner) is not None or all(key.value.partition("[")[0] != base for key, _ in entries):
        return None
    if field not in _COMPONENTS:
        return OfMember(name, section, owner, field, None, value)
    if not isinstance(value, yaml_tree.Scalar):
        raise OverrideError(f"--set {name}: a number or an expression is needed")
    return OfMember(name, section, owner, *_COMPONENTS[field], value)


def _parts(name: str) -> tuple[str, str]:
    """The texts before and after the dot of `p[1].x`."""
    head, bracket, rest = name.rpartition("]")
    word, _, field = rest.partition(".")
    return head + bracket + word, field


def _node(label: str, value: object) -> yaml_tree.AnyNode:
    """The value of a change: a text, a number, or a list of three of them."""
    if isinstance(value, str):
        if not value.strip():
            raise OverrideError(f"{label}: an expression is missing")
        return yaml_tree.scalar(value, label)
    if isinstance(value, SupportsFloat) and not getattr(value, "shape", ()):
        number = float(value)
        if not math.isfinite(number):
            raise OverrideError(f"{label}: {number} is not a finite number")
        return yaml_tree.scalar(repr(number), label)
    if isinstance(value, Iterable) and not isinstance(value, (bytes, Mapping)):
        parts = [_node(label, part) for part in value]
        items = tuple(part for part in parts if isinstance(part, yaml_tree.Scalar))
        if len(items) == len(parts):
            return yaml_tree.Sequence(yaml_tree.as_text("", label), 0, 0, items)
    kind = type(value).__name__
    raise OverrideError(f"{label}: a number, an expression or three numbers are needed, not {kind}")


def _apply(root: yaml_tree.Mapping, name: str, value: yaml_tree.AnyNode) -> yaml_tree.Mapping:
    owner, field = _parts(name)
    if not field:
        parameters = root.get("parameters")
        if isinstance(parameters, yaml_tree.Mapping) and parameters.get(name) is not None:
            return _with(root, "parameters", _with(parameters, name, value))
        raise OverrideError(_unknown(root, name))
    if field in _INITIAL:
        return _set_field(root, name, (_INITIAL[field], owner, field), value)
    if field in _COMPONENTS:
        return _set_component(root, name, owner, value)
    raise OverrideError(_unknown(root, name))


def _set_field(
    root: yaml_tree.Mapping, name: str, path: tuple[str, str, str], value: yaml_tree.AnyNode
) -> yaml_tree.Mapping:
    section, owner, field = path
    entries = root.get(section)
    entry = entries.get(owner) if isinstance(entries, yaml_tree.Mapping) else None
    if entry is None or not isinstance(entries, yaml_tree.Mapping):
        raise OverrideError(_unknown(root, name))
    if yaml_tree.is_empty(entry):
        entry = yaml_tree.Mapping(entry.text, entry.start, entry.end, ())
    elif section == "coordinates" and isinstance(entry, yaml_tree.Scalar):
        # `X: 0` is short for `X: {value: 0}`.
        short = yaml_tree.scalar("value", "--set")
        entry = yaml_tree.Mapping(entry.text, entry.start, entry.end, ((short, entry),))
    if not isinstance(entry, yaml_tree.Mapping):
        return root  # the entry is no mapping: an error of the file, reported where it stands
    return _with(root, section, _with(entries, owner, _with(entry, field, value)))


def _set_component(
    root: yaml_tree.Mapping, name: str, owner: str, value: yaml_tree.AnyNode
) -> yaml_tree.Mapping:
    field, index = _COMPONENTS[_parts(name)[1]]
    particles = root.get("particles")
    entry = particles.get(owner) if isinstance(particles, yaml_tree.Mapping) else None
    if not isinstance(entry, yaml_tree.Mapping):
        raise OverrideError(_unknown(root, name))
    old = entry.get(field)
    if old is None and field == "velocity":
        zero = yaml_tree.scalar("0", f"--set {name}")
        old = yaml_tree.Sequence(zero.text, 0, 0, (zero, zero, zero))
    if not isinstance(old, yaml_tree.Sequence) or len(old.items) != 3:
        sentence = f"the {field} of `{owner}` is one expression; set `{owner}.{field}` whole"
        raise OverrideError(f"--set {name}: {sentence}")
    if not isinstance(value, yaml_tree.Scalar):
        raise OverrideError(f"--set {name}: a number or an expression is needed")
    items = tuple(value if i == index else item for i, item in enumerate(old.items))
    return _set_field(root, name, ("particles", owner, field), dataclasses.replace(old, items=items))


def _with(mapping: yaml_tree.Mapping, key: str, value: yaml_tree.AnyNode) -> yaml_tree.Mapping:
    """The mapping with `value` under `key`, at its old position or at the end."""
    if mapping.get(key) is None:
        entries = (*mapping.entries, (yaml_tree.scalar(key, "--set"), value))
    else:
        entries = tuple((k, value if k.value == key else v) for k, v in mapping.entries)
    return dataclasses.replace(mapping, entries=entries)


def _unknown(root: yaml_tree.Mapping, name: str) -> str:
    """The sentence for a name that nothing has; the fields of what bears the name are offered first."""
    known: list[str] = []
    for section, fields in (
        ("parameters", ("",)),
        ("coordinates", (".value", ".rate")),
        ("particles", (".position", ".velocity")),
    ):
        node = root.get(section)
        for key, _ in node if isinstance(node, yaml_tree.Mapping) else ():
            own = [key.value + field for field in fields]
            written, owner = key.value, _parts(name)[0]
            if owner in (written, written.partition("[")[0]) or owner.partition("[")[0] == written:
                return f"--set {name}: write " + " or ".join(f"`{word}`" for word in own)
            if "[" in owner and owner.partition("[")[0] == written.partition("[")[0]:
                return f"--set {name}: write " + " or ".join(f"`{owner}{field}`" for field in fields)
            known += own
    hint = diagnostics.nearest(name, known)
    sentence = f"--set {name}: there is no parameter or initial value of that name"
    return f"{sentence}; {hint}" if hint else sentence


_FIELDS = {"value": "value", "rate": "rate", "position": "start", "velocity": "start_velocity"}


def coordinates(
    formulas: Formulas, read: Sequence[model.Coordinate], changes: Sequence[OfMember]
) -> tuple[model.Coordinate, ...]:
    """The coordinates with the changes made. What is wrong with a value is reported; raises `OverrideError`."""
    changed = list(read)
    for change in changes:
        entry, member = _member(formulas, change, "coordinate")
        found = formulas.constant(change.value, f"the initial {change.field} of a coordinate")
        if found is not None:
            values = getattr(changed[entry], change.field).copy()
            values[member] = found
            changed[entry] = dataclasses.replace(changed[entry], **{change.field: values})
    return tuple(changed)


def particles(
    formulas: Formulas, read: Sequence[model.Particle], changes: Sequence[OfMember]
) -> tuple[model.Particle, ...]:
    """The particles with the changes made. What is wrong with a value is reported; raises `OverrideError`."""
    changed = list(read)
    for change in changes:
        entry, member = _member(formulas, change, "particle")
        particle = changed[entry]
        if particle.start is None:
            message = (
                f"`{change.owner}` has no initial values: its position is a function of coordinates or time"
            )
            formulas.report(change.value, "not-an-initial-value", message, "change the file instead")
            continue
        values = getattr(particle, _FIELDS[change.field]).copy()
        subject = f"an initial {change.field}"
        if change.axis is not None:
            found = formulas.constant(change.value, subject)
            values[member, change.axis] = 0.0 if found is None else found
        else:
            vectors = formulas.constant_vectors(change.value, subject)
            values[member] = 0.0 if vectors is None else vectors[0]
        changed[entry] = dataclasses.replace(particle, **{_FIELDS[change.field]: values})
    return tuple(changed)


def _member(formulas: Formulas, change: OfMember, kind: namespace.Kind) -> tuple[int, int]:
    """The entry of a member, and its number in it. Raises `OverrideError` where there is none."""
    try:
        written = parser.parse_reference(change.owner)
        assert isinstance(written, tree.Index)
        number = formulas.scope.indexed.numbers(written, {})
    except ExpressionError as error:
        hint = f"; {error.hint}" if error.hint else ""
        raise OverrideError(f"--set {change.name}: {error.message}{hint}") from None
    member_index = formulas.scope.names.member_indices[kind]
    entry = int(member_index.entries(number)[0])
    return entry, int(number[0]) - member_index.first(entry)
