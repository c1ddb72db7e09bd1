"""Hints for sections and keys that are written otherwise than the format has them: words of other programs or of paper,
and slips of YAML."""

from __future__ import annotations

from collections.abc import Iterable

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.input import keys

# Sections whose entries are written over several lines, and often without an indent.
_Item = tuple[yaml_tree.Scalar, yaml_tree.AnyNode]
_OFTEN_FLAT = ("particles", "coordinates", "forces", "inequality", "events")


def section(name: str, value: yaml_tree.AnyNode, before: str) -> str:
    """For an unknown section; `before`: an empty section just before it, or an empty text."""
    inside = keys.FORMAT.key(before) if before else None
    if inside is not None and inside.entries and isinstance(value, yaml_tree.Mapping):
        return f"if `{name}` belongs to `{before}`, indent it and what follows"
    if sentence := diagnostics.meant("sections").get(name):
        return sentence
    if name in keys.FORMAT.key("simulation").names:
        return f"`{name}` belongs under `simulation`"
    for owner in ("particles", "coordinates", "forces"):
        if name in keys.FORMAT.key(owner).names:
            return f"`{name}` belongs to an entry of `{owner}`: indent it"
    near = diagnostics.nearest(name, keys.FORMAT.names)
    setting = diagnostics.meant("keys of simulation").get(name)
    if not near and setting:
        return f"`{setting}` belongs under `simulation`"
    return near or "the sections are " + ", ".join(keys.FORMAT.names)


def key(owner: keys.Key, name: yaml_tree.Scalar, value: yaml_tree.AnyNode) -> str:
    """For an unknown key of an entry of a section."""
    word, colon, rest = name.value.partition(":")
    if colon and word in owner.names:
        return f"a colon needs a space after it: `{word}: {rest}`"
    if is_decimal_part(name, value):
        return "a decimal point is written `.`, not `,`"
    if sentence := diagnostics.meant(f"sentences of {owner.name}").get(name.value):
        return sentence
    if alias := diagnostics.meant(f"keys of {owner.name}").get(name.value):
        return f"did you mean `{alias}`?"
    known = ", ".join(f"`{k.name}`" for k in owner.keys)
    return diagnostics.nearest(name.value, owner.names) or f"the keys here are {known}"


def meant_keys(owner: keys.Key, names: Iterable[yaml_tree.Scalar]) -> set[str]:
    """The keys that unknown ones stand for: these are not missing as well."""
    found, meant = set(), diagnostics.meant(f"keys of {owner.name}")
    for name in names:
        word = name.value.partition(":")[0]
        found.add(word if word in owner.names else meant.get(name.value, ""))
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
        short = f"`{{to: all, force: {vector}}}`"
        return f"a force says what it acts on: {short}; a potential is `{{potential: V}}`"
    if owner.name == "particles":
        return "write `{mass: 1, position: [x, y, z]}`"
    if owner.name == "events" and isinstance(node, yaml_tree.Scalar) and 0 < len(node.value) < 60:
        return f"write `{{when: {node.value.strip()}}}`"
    if owner.name == "coordinates":
        return "write `{value: 0.5, rate: 0}`"
    example = diagnostics.meant("examples").get(owner.name)
    return f"for example {example}" if example else ""


def indented(
    root: yaml_tree.Mapping,
) -> tuple[yaml_tree.Mapping, list[tuple[yaml_tree.Scalar, yaml_tree.Scalar]]]:
    """The document with keys moved under the empty entry they follow, and each such entry with its first key. `a:` with
    `mass:` and `position:` at its own level declares three empty particles; it is read as one."""
    found: list[tuple[yaml_tree.Scalar, yaml_tree.Scalar]] = []
    sections = []
    for name, node in root:
        if name.value in _OFTEN_FLAT and isinstance(node, yaml_tree.Mapping):
            owner = keys.FORMAT.key(name.value)
            # Each entry with the keys that follow it on its own level.
            entries: list[tuple[yaml_tree.Scalar, yaml_tree.AnyNode, list[_Item]]] = []
            for key, value in node:
                written = not isinstance(value, yaml_tree.Mapping) and not yaml_tree.is_empty(value)
                if key.value in owner.names and written and entries and yaml_tree.is_empty(entries[-1][1]):
                    entries[-1][2].append((key, value))
                else:
                    entries.append((key, value, []))
            items: list[_Item] = []
            for entry, value, inner in entries:
                if inner:
                    first, last = inner[0][0], inner[-1][1]
                    found.append((entry, first))
                    value = yaml_tree.Mapping(first.text, first.start, last.end, tuple(inner))
                items.append((entry, value))
            node = yaml_tree.Mapping(node.text, node.start, node.end, tuple(items))
        sections.append((name, node))
    if not found:
        return root, found
    return yaml_tree.Mapping(root.text, root.start, root.end, tuple(sections)), found
