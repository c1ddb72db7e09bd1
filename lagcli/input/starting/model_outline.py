"""The names in a model, right or wrong: what a shell completes. Nothing is computed and no number is looked at.

A model may be broken in any way while it is written. What cannot be read gives no names.
"""

from __future__ import annotations

import contextlib

from lagcli import yaml_tree
from lagcli.errors import diagnostics
from lagcli.expression import parser, tokens, tree
from lagcli.frozen import frozen_value
from lagcli.input import keys

# A larger file is not read while somebody waits for the next letter.
MAX_BYTES = 2**20
AXES = ("x", "y", "z")
_CONSTRAINTS = ("holonomic", "rigid", "differential", "inequality")


@frozen_value
class Outline:
    """Names by section; a family is `p[*]`, a pattern for the columns of its members. vectors: the constraints that
    stand for three rows."""

    names: dict[str, tuple[str, ...]]
    vectors: frozenset[str]

    def of(self, *sections: str) -> tuple[str, ...]:
        """The names in these sections, in their order."""
        return tuple(name for section in sections for name in self.names.get(section, ()))

    def columns(self) -> tuple[str, ...]:
        """The columns of a table of this model; several at once where only the integrated model could tell them."""
        particles, coordinates, bodies = self.of("particles"), self.of("coordinates"), self.of("rigid")
        multipliers: list[str] = []
        for name in self.of(*_CONSTRAINTS):
            if name in self.vectors:
                multipliers += [f"lambda.{name}.{axis}" for axis in AXES]
            else:
                multipliers.append(f"lambda.{name}.*" if name in bodies else f"lambda.{name}")
        return (
            "t",
            *(f"{name}.{part}" for name in particles for part in (*AXES, "vx", "vy", "vz")),
            *(column for name in coordinates for column in (name, f"rate({name})")),
            *multipliers,
            *(f"R.{name}.{part}" for name in particles for part in AXES),
            *(f"R.{name}" for name in coordinates),
            "energy",
            *self.of("outputs"),
        )

    def settable(self) -> tuple[str, ...]:
        """The names that `--set` takes: parameters and initial values, but for those of families."""
        fields = (("coordinates", ("value", "rate")), ("particles", (*AXES, "vx", "vy", "vz")))
        names = ((name, parts) for section, parts in fields for name in self.of(section) if "[" not in name)
        return (*self.of("parameters"), *(f"{name}.{part}" for name, parts in names for part in parts))


EMPTY = Outline({}, frozenset())


def read(data: bytes | str) -> Outline:
    """The names in a document; `EMPTY` where it is no document, or a very long one."""
    if len(data) > MAX_BYTES:
        return EMPTY
    try:
        root = yaml_tree.parse(data, "")
    except diagnostics.ModelError:
        return EMPTY
    sections = {key.name for key in keys.FORMAT.keys if key.entries}
    entries, names = dict[str, yaml_tree.Mapping](), dict[str, tuple[str, ...]]()
    for name, node in root:
        if name.value in sections and isinstance(node, yaml_tree.Mapping):
            entries[name.value] = node
            names[name.value] = tuple(dict.fromkeys(filter(None, (_pattern(one) for one, _ in node))))
    # Particles, and the parameters that are written as a list
    given = entries.get("parameters") or ()
    vector_names = {name.value for name, node in given if isinstance(node, yaml_tree.Sequence)}
    vector_names |= {*names.get("particles", ())}
    laws = set()
    for section in ("holonomic", "differential"):
        for name, node in entries.get(section, ()):
            written = node.get("equation") if isinstance(node, yaml_tree.Mapping) else node
            if isinstance(written, yaml_tree.Scalar):
                with contextlib.suppress(tree.ExpressionError):
                    if _is_vector(parser.parse_equation(written.value), vector_names):
                        laws.add(_pattern(name))
    return Outline(names, frozenset(laws))


def _pattern(name: yaml_tree.Scalar) -> str:
    """The name of an entry, `p[*]` for the family `p[i]`; nothing where it is no name."""
    base, *indices = name.value.replace(" ", "").split("[")
    return base + "[*]" * len(indices) if tokens.is_name(base) else ""


def _is_vector(node: tree.Node, vectors: set[str]) -> bool:
    """True for the equation of two vectors, as far as it can be told from particles, lists and `cross`."""
    match node:
        case tree.Name():
            return node.name in vectors
        case tree.Member() | tree.Index():
            # A whole particle of a family
            return node.member in ("v", "a") or (
                isinstance(node, tree.Index)
                and not node.member
                and f"{node.owner}{'[*]' * len(node.indices)}" in vectors
            )
        case tree.Vector():
            return True
        case tree.Call():
            return node.function == "cross" or (node.function == "d" and _any(node, vectors))
        case tree.Relation() | tree.Sum() | tree.Product():
            return _any(node, vectors)
    return False


def _any(node: tree.Node, vectors: set[str]) -> bool:
    return any(_is_vector(child, vectors) for child in tree.children(node))
