"""The names in a document and what has them: its names, those of its constraints, and the members of its families.

`for:` and `if:` of an entry become index vectors; there is never a loop over members.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np

from lagcli import yaml_tree
from lagcli.expression import integers, parser, tokens, tree
from lagcli.expression.tree import ExpressionError
from lagcli.input import key_hints, namespace, scope
from lagcli.input.scalars import Formulas
from lagcli.model import family
from lagcli.model.family import Family, Integers

# Members of all families of a model together, counted before `if:` filters them.
MAX_MEMBERS = 1_000_000


def is_family(name: yaml_tree.Scalar, entry: yaml_tree.AnyNode) -> bool:
    """True if an entry is written as a family."""
    written = isinstance(entry, yaml_tree.Mapping) and (entry.key("for") or entry.key("if"))
    return "[" in name.value or bool(written)


def base_of(name: yaml_tree.Scalar) -> str:
    """The part of an entry's name before its indices."""
    return name.value.partition("[")[0].strip()


@dataclasses.dataclass(slots=True)
class Budget:
    """The number of members that a model may still have."""

    left: int = MAX_MEMBERS


class Reader:
    """Reads the members of entries; `closed` are names an index may not have, beside declared ones."""

    def __init__(self, formulas: Formulas, budget: Budget, closed: tuple[str, ...] = ()) -> None:
        self._formulas = formulas
        self._budget = budget
        self._closed = closed

    def read(self, name: yaml_tree.Scalar, entry: yaml_tree.AnyNode) -> Family | None:
        """The members of an entry, or None with the error reported."""
        key = self._key(name)
        loop = entry.get("for") if isinstance(entry, yaml_tree.Mapping) else None
        condition = entry.get("if") if isinstance(entry, yaml_tree.Mapping) else None
        ranges = [] if loop is None else self._ranges(loop)
        if key is None or ranges is None:
            return None
        if condition is not None and not ranges:
            message = "an `if` filters the members of a family, and here is no `for`"
            self._formulas.report(condition, "bad-range", message)
            return None
        variables: dict[str, Integers] = {}
        count = 1
        for node, one in ranges:
            expanded = self._expanded(node, one, variables, count)
            if expanded is None:
                return None
            variables, count = expanded
        if condition is not None:
            found = self._filtered(condition, variables, count)
            if found is None:
                return None
            variables, count = found
        try:
            lookup = self._formulas.scope.indexed.integer_lookup(variables)
            if not self._formulas.can_evaluate(name, key, count):
                return None
            columns = [np.broadcast_to(integers.evaluate(index, lookup), count) for index in key.indices]
        except ExpressionError as error:
            if not variables and error.code == "unknown-name":
                index = name.value[error.start : error.end]
                error.hint = error.hint or f"a family needs the range of its index: `for: {index} = 1..N`"
            self._formulas.within(family.with_indices("", (), variables)).trouble(name, error)
            return None
        self._budget.left -= count
        indices = list(zip(*(column.tolist() for column in columns), strict=True))
        return family.with_indices(key.owner, indices, variables)

    def _key(self, name: yaml_tree.Scalar) -> tree.Index | None:
        if not tokens.is_name(base_of(name)):
            return None  # reported where names are taken
        try:
            key = parser.parse_reference(name.value)
        except ExpressionError as error:
            self._formulas.trouble(name, error)
            return None
        if isinstance(key, tree.Index):
            return key
        message = "the name of a family shows its indices"
        self._formulas.report(name, "bad-range", message, f"for example `{name.value}[i]`")
        return None

    def _ranges(self, node: yaml_tree.AnyNode) -> list[tuple[yaml_tree.Scalar, tree.Range]] | None:
        items = node.items if isinstance(node, yaml_tree.Sequence) else (node,)
        ranges: list[tuple[yaml_tree.Scalar, tree.Range]] = []
        taken: set[str] = set()
        for item in items:
            if not isinstance(item, yaml_tree.Scalar) or yaml_tree.is_empty(item):
                self._formulas.report(item, "bad-range", "a range is needed here", "for example `i = 1..N`")
                return None
            try:
                one = parser.parse_range(item.value)
            except ExpressionError as error:
                self._formulas.trouble(item, error)
                return None
            trouble = self._taken(one.name, taken)
            if trouble:
                self._formulas.report(item, "bad-range", trouble, "give the index another name")
                return None
            taken.add(one.name)
            ranges.append((item, one))
        if not items:
            self._formulas.report(node, "bad-range", "the list of ranges is empty")
            return None
        return ranges

    def _taken(self, name: str, indices: set[str]) -> str:
        """The reason why an index may not have this name, or an empty text."""
        if name in indices:
            return f"the index `{name}` has two ranges"
        if name in namespace.RESERVED:
            return f"`{name}` is reserved"
        if name in self._closed:
            return f"`{name}` is the particle's own in a force"
        kind = self._formulas.scope.names.kind(name)
        if kind is not None:
            return f"`{name}` is already the name of {namespace.article(kind)}"
        return ""

    def _expanded(
        self, node: yaml_tree.Scalar, one: tree.Range, variables: dict[str, Integers], count: int
    ) -> tuple[dict[str, Integers], int] | None:
        """The index vectors with one more range: each member so far, repeated for the values of the new index."""
        lookup = self._formulas.scope.indexed.integer_lookup(variables)
        if not all(self._formulas.can_evaluate(node, bound, count) for bound in (one.low, one.high)):
            return None
        try:
            low, high = (integers.evaluate(bound, lookup) for bound in (one.low, one.high))
        except ExpressionError as error:
            self._formulas.within(family.with_indices("", (), variables)).trouble(node, error)
            return None
        first = np.broadcast_to(np.asarray(low, dtype=np.int64), count)
        lengths = np.maximum(0, high - first + 1)
        if float(np.sum(lengths, dtype=float)) > self._budget.left:
            message = f"the families of a model have at most {MAX_MEMBERS} members"
            self._formulas.report(node, "too-many-members", message)
            return None
        total = int(lengths.sum())
        earlier = np.repeat(np.arange(count), lengths)
        within = np.arange(total) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        outer = {name: values[earlier] for name, values in variables.items()}
        return {**outer, one.name: first[earlier] + within}, total

    def _filtered(
        self, node: yaml_tree.AnyNode, variables: dict[str, Integers], count: int
    ) -> tuple[dict[str, Integers], int] | None:
        if not isinstance(node, yaml_tree.Scalar) or yaml_tree.is_empty(node):
            self._formulas.report(node, "bad-range", "a condition is needed here", "for example `i != j`")
            return None
        try:
            condition = parser.parse_filter(node.value)
            if not self._formulas.can_evaluate(node, condition, count):
                return None
            holds = integers.holds(condition, self._formulas.scope.indexed.integer_lookup(variables))
        except ExpressionError as error:
            self._formulas.within(family.with_indices("", (), variables)).trouble(node, error)
            return None
        chosen = np.flatnonzero(np.broadcast_to(holds, count))
        return {name: values[chosen] for name, values in variables.items()}, chosen.size


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
                has_members = section in FAMILIES and is_family(name, value)
                base = base_of(name) if has_members else name.value
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
                has_members = section in FAMILIES and is_family(name, value)
                word = base_of(name) if has_members else name.value
                if not tokens.is_name(word):
                    message = "a name is a letter or `_`, then letters, digits and `_`"
                    self._formulas.report(name, "bad-name", message)
                elif word in namespace.RESERVED:
                    self._formulas.report(name, "bad-name", f"`{word}` is reserved")
                elif section in CONSTRAINTS and word in axes:
                    message = f"the impulse of `{word}` would have the name of a component of the particle `impulse`"
                    self._formulas.report(name, "duplicate-name", message, "rename one of them")
                elif section in CONSTRAINTS:
                    if word in taken and not (has_members and taken[word] == (section, True)):
                        message = f"`{word}` is already a constraint under `{taken[word][0]}`"
                        self._formulas.report(
                            name, "duplicate-name", message, "two columns would have one name"
                        )
                    taken.setdefault(word, (section, has_members))
                    self._scope.laws.take(word, has_members)

    def count_members(self, entries: Entries) -> None:
        """Say of every entry which members it has."""
        budget = Budget()
        for section in FAMILIES:
            closed = tuple(scope.OWN) if section == "forces" else ()
            reader = Reader(self._formulas, budget, closed)
            for name, value in entries(section):
                key = (section, name.value)
                if not is_family(name, value):
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
        base = base_of(name)
        if found is None:
            self._scope.names.reserve(name.value, base, kind)
        elif not self._scope.names.is_broken(base):
            self.refuse_repeated(name, found, self._scope.names.number(name.value, found))

    def refuse_repeated(self, name: yaml_tree.Scalar, found: Family, repeated: str) -> None:
        """Report two members of one name."""
        if repeated and len(found.base) < len(repeated):
            hint = "different indices need different names; an index that is not in the name makes copies"
            self._formulas.report(name, "duplicate-name", f"`{repeated}` is declared twice", hint)
