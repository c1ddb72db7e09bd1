"""Changes to parameters and initial values that come from the command line (`--set`) or from Python."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import SupportsFloat

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.frozen import frozen_value

_INITIAL = {"value": "coordinates", "rate": "coordinates", "position": "particles", "velocity": "particles"}
_COMPONENTS: dict[str, tuple[str, int | None]] = {
    f"{prefix}{axis}": (field, i)
    for prefix, field in (("", "position"), ("v", "velocity"))
    for i, axis in enumerate("xyz")
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
        owner, word = _parts(name)
        field, axis = _COMPONENTS.get(word, (word, None))
        section = _INITIAL.get(field)
        entries = root.get(section or "parameters")
        if not word and isinstance(entries, yaml_tree.Mapping) and entries.get(name) is not None:
            root = _with(root, "parameters", _with(entries, name, node))
            continue
        if section is None or not isinstance(entries, yaml_tree.Mapping):
            raise OverrideError(_unknown(root, name))
        entry = entries.get(owner)
        if entry is None:
            base, bracket, _ = owner.partition("[")
            if not bracket or base not in {key.value.partition("[")[0] for key, _ in entries}:
                raise OverrideError(_unknown(root, name))
            # A member of a family that is one entry.
            if axis is not None:
                _require_scalar(name, node)
            of_members.append(OfMember(name, section, owner, field, axis, node))
            continue
        if axis is not None:  # a vector with one component changed
            if not isinstance(entry, yaml_tree.Mapping):
                raise OverrideError(_unknown(root, name))
            old = entry.get(field)
            if old is None and field == "velocity":
                zero = yaml_tree.scalar("0", f"--set {name}")
                old = yaml_tree.Sequence(zero.text, 0, 0, (zero, zero, zero))
            if not isinstance(old, yaml_tree.Sequence) or len(old.items) != 3:
                sentence = f"the {field} of `{owner}` is one expression; set `{owner}.{field}` whole"
                raise OverrideError(f"--set {name}: {sentence}")
            _require_scalar(name, node)
            items = tuple(node if i == axis else item for i, item in enumerate(old.items))
            node = dataclasses.replace(old, items=items)
        elif yaml_tree.is_empty(entry):
            entry = yaml_tree.Mapping(entry.text, entry.start, entry.end, ())
        elif section == "coordinates" and isinstance(entry, yaml_tree.Scalar):
            # `X: 0` is short for `X: {value: 0}`.
            short = yaml_tree.scalar("value", "--set")
            entry = yaml_tree.Mapping(entry.text, entry.start, entry.end, ((short, entry),))
        # What is no mapping is an error of the file, reported where it stands.
        if isinstance(entry, yaml_tree.Mapping):
            root = _with(root, section, _with(entries, owner, _with(entry, field, node)))
    return root, tuple(of_members)


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


def _require_scalar(name: str, value: yaml_tree.AnyNode) -> None:
    if not isinstance(value, yaml_tree.Scalar):
        raise OverrideError(f"--set {name}: a number or an expression is needed")


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
