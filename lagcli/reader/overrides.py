"""Changes to parameters and initial values that come from the command line (`--set`) or from Python."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from lagcli import diagnostics, source

_INITIAL = {"value": "coordinates", "rate": "coordinates", "position": "particles", "velocity": "particles"}
_COMPONENTS = {"x": ("position", 0), "y": ("position", 1), "z": ("position", 2)} | {
    "vx": ("velocity", 0), "vy": ("velocity", 1), "vz": ("velocity", 2),
}  # fmt: skip


class OverrideError(Exception):
    """A change names nothing that can be changed, or is no expression."""


def apply(root: source.Mapping, changes: Mapping[str, object]) -> source.Mapping:
    """The document with the changes written into it. Raises `OverrideError`."""
    for name, value in changes.items():
        root = _apply(root, name, _node(name, value))
    return root


def _node(name: str, value: object) -> source.AnyNode:
    label = f"--set {name}"
    if isinstance(value, str):
        if len(value) > source.MAX_BYTES or not value.strip():
            raise OverrideError(f"{label}: an expression is missing")
        return source.scalar(value, label)
    if isinstance(value, (list, tuple)):
        items = tuple(source.scalar(repr(float(part)), label) for part in value)
        return source.Sequence(source.as_text("", label), 0, 0, items)
    if isinstance(value, (int, float)) or hasattr(value, "__float__"):
        return source.scalar(repr(float(value)), label)
    raise OverrideError(f"{label}: a number, an expression or three numbers are needed, not {type(value).__name__}")


def _apply(root: source.Mapping, name: str, value: source.AnyNode) -> source.Mapping:
    owner, _, field = name.partition(".")
    if not field:
        parameters = root.get("parameters")
        if isinstance(parameters, source.Mapping) and parameters.get(name) is not None:
            return _with(root, "parameters", _with(parameters, name, value))
        raise OverrideError(_unknown(root, name))
    if field in _INITIAL:
        return _set_field(root, name, _INITIAL[field], (owner, field), value)
    if field in _COMPONENTS:
        return _set_component(root, name, owner, _COMPONENTS[field], value)
    raise OverrideError(_unknown(root, name))


def _set_field(
    root: source.Mapping, name: str, section: str, path: tuple[str, str], value: source.AnyNode
) -> source.Mapping:
    owner, field = path
    entries = root.get(section)
    entry = entries.get(owner) if isinstance(entries, source.Mapping) else None
    if entries is None or entry is None or not isinstance(entries, source.Mapping):
        raise OverrideError(_unknown(root, name))
    if not isinstance(entry, source.Mapping):
        entry = source.Mapping(entry.text, entry.start, entry.end, ())
    return _with(root, section, _with(entries, owner, _with(entry, field, value)))


def _set_component(
    root: source.Mapping, name: str, owner: str, component: tuple[str, int], value: source.AnyNode
) -> source.Mapping:
    field, index = component
    particles = root.get("particles")
    entry = particles.get(owner) if isinstance(particles, source.Mapping) else None
    if not isinstance(entry, source.Mapping):
        raise OverrideError(_unknown(root, name))
    old = entry.get(field)
    if old is None and field == "velocity":
        zero = source.scalar("0", f"--set {name}")
        old = source.Sequence(zero.text, 0, 0, (zero, zero, zero))
    if not isinstance(old, source.Sequence) or len(old.items) != 3:
        raise OverrideError(f"--set {name}: the {field} of `{owner}` is one expression; set `{owner}.{field}` whole")
    items = tuple(value if i == index else item for i, item in enumerate(old.items))
    return _set_field(root, name, "particles", (owner, field), dataclasses.replace(old, items=items))


def _with(mapping: source.Mapping, key: str, value: source.AnyNode) -> source.Mapping:
    """The mapping with `value` under `key`, in its old place or at the end."""
    if mapping.get(key) is None:
        entries = (*mapping.entries, (source.scalar(key, "--set"), value))
    else:
        entries = tuple((k, value if k.value == key else v) for k, v in mapping.entries)
    return dataclasses.replace(mapping, entries=entries)


def _unknown(root: source.Mapping, name: str) -> str:
    known = []
    for section, fields in (("parameters", ("",)), ("coordinates", (".value", ".rate"))):
        node = root.get(section)
        if isinstance(node, source.Mapping):
            known += [key.value + field for key, _ in node for field in fields]
    hint = diagnostics.nearest(name, known)
    return f"--set {name}: there is no parameter or initial value of that name" + (f"; {hint}" if hint else "")
