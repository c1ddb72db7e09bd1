"""The names in a document and what has them: its names, those of its constraints, and the members of its families."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from lagcli import yaml_tree
from lagcli.expression import tokens
from lagcli.input import family_ranges, key_hints, namespace, scope
from lagcli.input.scalars import Formulas
from lagcli.model import family
from lagcli.model.family import Family

NAMING: tuple[tuple[str, namespace.Kind], ...] = (
    ("parameters", "parameter"),
    ("coordinates", "coordinate"),
    ("particles", "particle"),
    ("definitions", "definition"),
    ("outputs", "output"),
)
CONSTRAINTS = ("holonomic", "rigid", "differential", "inequality")
FAMILIES = ("coordinates", "particles", "forces", "holonomic", "differential", "inequality", "outputs")

Entries = Callable[[str], Iterator[tuple[yaml_tree.Scalar, yaml_tree.AnyNode]]]


class EntryNames:
    """The names of the entries of a document, and the `members` of each by its section and key: None where broken."""

    def __init__(self, reading: scope.Scope, formulas: Formulas) -> None:
        self._scope, self._formulas = reading, formulas
        self.members: dict[tuple[str, str], Family | None] = {}

    def declare(self, entries: Entries) -> None:
        """Take the names of all that expressions may name."""
        for section, kind in NAMING:
            for name, value in entries(section):
                is_family = section in FAMILIES and family_ranges.is_family(name, value)
                base = family_ranges.base(name) if is_family else name.value
                trouble = self._scope.names.declare(name.value, base, kind)
                if trouble:
                    code = "duplicate-name" if base in self._scope.names else "bad-name"
                    hint = (
                        "a decimal point is written `.`, not `,`"
                        if key_hints.is_decimal_part(name, value)
                        else ""
                    )
                    self._formulas.report(name, code, trouble, hint)
                    self._scope.names.reserve(name.value, base, kind)

    def take_constraint_names(self, entries: Entries) -> None:
        """Constraints have names of their own, told apart in the columns `lambda.NAME`; so have forces, and events."""
        taken: dict[str, tuple[str, bool]] = {}
        # Impulses of a constraint `x` stand beside the positions of a particle of this name.
        axes = {"x", "y", "z"} if any(name.value == "impulse" for name, _ in entries("particles")) else set()
        for section in (*CONSTRAINTS, "forces", "events"):
            for name, value in entries(section):
                is_family = section in FAMILIES and family_ranges.is_family(name, value)
                word = family_ranges.base(name) if is_family else name.value
                if not tokens.is_name(word):
                    message = "a name is a letter or `_`, then letters, digits and `_`"
                    self._formulas.report(name, "bad-name", message)
                elif word in namespace.RESERVED:
                    self._formulas.report(name, "bad-name", f"`{word}` is reserved")
                elif section in CONSTRAINTS and word in axes:
                    message = f"the impulse of `{word}` would have the name of a component of the particle `impulse`"
                    self._formulas.report(name, "duplicate-name", message, "rename one of them")
                elif section in CONSTRAINTS:
                    if word in taken and not (is_family and taken[word] == (section, True)):
                        message = f"`{word}` is already a constraint under `{taken[word][0]}`"
                        self._formulas.report(
                            name, "duplicate-name", message, "two columns would have one name"
                        )
                    taken.setdefault(word, (section, is_family))
                    self._scope.laws.take(word, is_family)

    def count_members(self, entries: Entries) -> None:
        """Say of every entry which members it has."""
        budget = family_ranges.Budget()
        for section in FAMILIES:
            closed = tuple(scope.OWN) if section == "forces" else ()
            reader = family_ranges.Reader(self._formulas, budget, closed)
            for name, value in entries(section):
                key = (section, name.value)
                if not family_ranges.is_family(name, value):
                    self.members[key] = family.one(name.value)
                else:
                    self.members[key] = reader.read(name, value)
                self._number(section, name)

    def _number(self, section: str, name: yaml_tree.Scalar) -> None:
        """Number the members of an entry that others may speak of."""
        found = self.members[section, name.value]
        kind = dict(NAMING).get(section)
        if kind is None:
            return
        base = family_ranges.base(name)
        if found is None:
            self._scope.names.reserve(name.value, base, kind)
        elif not self._scope.names.is_broken(base):
            self.refuse_repeated(name, found, self._scope.names.number(name.value, found))

    def refuse_repeated(self, name: yaml_tree.Scalar, found: Family, repeated: str) -> None:
        """Report two members of one name."""
        if repeated and len(found.base) < len(repeated):
            hint = "different indices need different names; an index that is not in the name makes copies"
            self._formulas.report(name, "duplicate-name", f"`{repeated}` is declared twice", hint)
