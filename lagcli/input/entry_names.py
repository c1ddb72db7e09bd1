"""The names in a document, those of its constraints, and the members of its families: `for:` and `if:` become index
vectors, without a loop over members."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from lagcli import yaml_tree
from lagcli.expression import integers, parser, tokens, tree
from lagcli.expression.tree import ExpressionError
from lagcli.input import key_hints, namespace, scope
from lagcli.input.scalars import Formulas
from lagcli.model import family
from lagcli.model.family import Family, Integers

NAMING: tuple[tuple[str, namespace.Kind], ...] = (
    ("parameters", "parameter"),
    ("coordinates", "coordinate"),
    ("particles", "particle"),
    ("definitions", "definition"),
    ("outputs", "output"),
    ("bodies", "body"),
)
CONSTRAINTS = ("holonomic", "rigid", "differential", "inequality")
FAMILIES = (
    "coordinates",
    "particles",
    "forces",
    "holonomic",
    "differential",
    "inequality",
    "outputs",
    "bodies",
    "joints",
)

Entries = Callable[[str], Iterator[tuple[yaml_tree.Scalar, yaml_tree.AnyNode]]]

# Members of all families of a model together, counted before `if:` filters them.
MAX_MEMBERS = 1_000_000


def is_family(name: yaml_tree.Scalar, entry: yaml_tree.AnyNode) -> bool:
    """True if an entry is written as a family."""
    written = isinstance(entry, yaml_tree.Mapping) and (entry.key("for") or entry.key("if"))
    return "[" in name.value or bool(written)


def base_of(name: yaml_tree.Scalar) -> str:
    """The part of an entry's name before its indices."""
    return name.value.partition("[")[0].strip()


class EntryNames:
    """The names of the entries of a document, and the `members` of each by its section and key: None where broken."""

    def __init__(self, reading: scope.Scope, formulas: Formulas) -> None:
        self._scope, self._formulas = reading, formulas
        self._left = MAX_MEMBERS  # members that the model may still have
        self.members: dict[tuple[str, str], Family | None] = {}

    def declare(self, entries: Entries) -> None:
        """Take the names of all that expressions may name."""
        names = self._scope.names
        for section, kind in NAMING:
            for name, value in entries(section):
                has_members = section in FAMILIES and is_family(name, value)
                base = base_of(name) if has_members else name.value
                trouble = names.declare(name.value, base, kind)
                if trouble:
                    code = "duplicate-name" if base in names else "bad-name"
                    is_decimal = key_hints.is_decimal_part(name, value)
                    hint = "a decimal point is written `.`, not `,`" if is_decimal else ""
                    self._formulas.report(name, code, trouble, hint)
                    names.reserve(name.value, base, kind)

    def take_constraint_names(self, entries: Entries) -> None:
        """Constraints have names of their own, told apart in the columns `lambda.NAME`; so have forces, and events."""
        taken: dict[str, tuple[str, bool]] = {}
        report = self._formulas.report
        # Impulses of a constraint `x` stand beside the positions of a particle of this name.
        axes = {"x", "y", "z"} if any(name.value == "impulse" for name, _ in entries("particles")) else set()
        for section in (*CONSTRAINTS, "joints", "forces", "events"):
            for name, value in entries(section):
                has_members = section in FAMILIES and is_family(name, value)
                word = base_of(name) if has_members else name.value
                if not tokens.is_name(word):
                    report(name, "bad-name", "a name is a letter or `_`, then letters, digits and `_`")
                elif word in namespace.RESERVED:
                    report(name, "bad-name", f"`{word}` is reserved")
                elif section in CONSTRAINTS and word in axes:
                    message = f"the impulse of `{word}` would have the name of a component of the particle `impulse`"
                    report(name, "duplicate-name", message, "rename one of them")
                elif section in (*CONSTRAINTS, "joints"):
                    if word in taken and not (has_members and taken[word] == (section, True)):
                        message = f"`{word}` is already a constraint under `{taken[word][0]}`"
                        report(name, "duplicate-name", message, "two columns would have one name")
                    taken.setdefault(word, (section, has_members))
                    self._scope.laws.take(word, has_members)

    def count_members(self, entries: Entries) -> None:
        """Say of every entry which members it has, and number those that others may speak of."""
        names, kinds = self._scope.names, dict(NAMING)
        for section in FAMILIES:
            closed = tuple(scope.OWN) if section == "forces" else ()
            for name, value in entries(section):
                found: Family | None = family.one(name.value)
                if is_family(name, value):
                    found = self._members(name, value, closed)
                self.members[section, name.value] = found
                kind, base = kinds.get(section), base_of(name)
                if kind not in namespace.NUMBERED:
                    continue
                if found is None:
                    names.reserve(name.value, base, kind)
                elif not names.is_broken(base):
                    self.refuse_repeated(name, found, names.number(name.value, found))

    def refuse_repeated(self, name: yaml_tree.Scalar, found: Family, repeated: str) -> None:
        if repeated and len(found.base) < len(repeated):
            hint = "different indices need different names; an index that is not in the name makes copies"
            self._formulas.report(name, "duplicate-name", f"`{repeated}` is declared twice", hint)

    def _members(
        self, name: yaml_tree.Scalar, entry: yaml_tree.AnyNode, closed: tuple[str, ...]
    ) -> Family | None:
        """The members of a family, or None with the error reported; closed: names its indices may not have."""
        formulas, key = self._formulas, None
        if tokens.is_name(base_of(name)):  # else it is reported where names are taken
            try:
                key = parser.parse_reference(name.value)
            except ExpressionError as error:
                formulas.trouble(name, error)
            if isinstance(key, tree.Name):
                message = "the name of a family shows its indices"
                formulas.report(name, "bad-range", message, f"for example `{name.value}[i]`")
                key = None
        loop = entry.get("for") if isinstance(entry, yaml_tree.Mapping) else None
        condition = entry.get("if") if isinstance(entry, yaml_tree.Mapping) else None
        ranges = [] if loop is None else self._ranges(loop, closed)
        if key is None or ranges is None:
            return None
        if condition is not None and not ranges:
            message = "an `if` filters the members of a family, and here is no `for`"
            formulas.report(condition, "bad-range", message)
            return None
        variables: dict[str, Integers] = {}
        count, spot, lookup_in = 1, name, self._scope.names.integer_lookup
        try:
            for spot, one in ranges:
                bounds = (one.low, one.high)
                if not all(formulas.can_evaluate(spot, bound, count) for bound in bounds):
                    return None
                low, high = (integers.evaluate(bound, lookup_in(variables)) for bound in bounds)
                first = np.broadcast_to(np.asarray(low, dtype=np.int64), count)
                lengths = np.maximum(0, high - first + 1)
                if float(np.sum(lengths, dtype=float)) > self._left:
                    message = f"the families of a model have at most {MAX_MEMBERS} members"
                    formulas.report(spot, "too-many-members", message)
                    return None
                # Each member so far is repeated for the values of the new index.
                earlier, count = np.repeat(np.arange(count), lengths), int(lengths.sum())
                within = np.arange(count) - np.repeat(np.cumsum(lengths) - lengths, lengths)
                variables = {name: values[earlier] for name, values in variables.items()}
                variables[one.name] = first[earlier] + within
            if condition is not None:
                if not isinstance(condition, yaml_tree.Scalar) or yaml_tree.is_empty(condition):
                    message = "a condition is needed here"
                    formulas.report(condition, "bad-range", message, "for example `i != j`")
                    return None
                spot = condition
                chosen = parser.parse_filter(condition.value)
                if not formulas.can_evaluate(spot, chosen, count):
                    return None
                holds = np.broadcast_to(integers.holds(chosen, lookup_in(variables)), count)
                variables = {name: values[holds] for name, values in variables.items()}
                count = int(np.count_nonzero(holds))
            spot = name
            if not formulas.can_evaluate(name, key, count):
                return None
            lookup = lookup_in(variables)
            columns = [np.broadcast_to(integers.evaluate(index, lookup), count) for index in key.indices]
        except ExpressionError as error:
            if spot is name and not variables and error.code == "unknown-name":
                index = name.value[error.start : error.end]
                error.hint = error.hint or f"a family needs the range of its index: `for: {index} = 1..N`"
            formulas.within(family.with_indices("", (), variables)).trouble(spot, error)
            return None
        self._left -= count
        indices = list(zip(*(column.tolist() for column in columns), strict=True))
        return family.with_indices(key.owner, indices, variables)

    def _ranges(
        self, node: yaml_tree.AnyNode, closed: tuple[str, ...]
    ) -> list[tuple[yaml_tree.Scalar, tree.Range]] | None:
        """The ranges under `for:`, or None with the error reported."""
        items = node.items if isinstance(node, yaml_tree.Sequence) else (node,)
        ranges: list[tuple[yaml_tree.Scalar, tree.Range]] = []
        report = self._formulas.report
        for item in items:
            if not isinstance(item, yaml_tree.Scalar) or yaml_tree.is_empty(item):
                report(item, "bad-range", "a range is needed here", "for example `i = 1..N`")
                return None
            try:
                one = parser.parse_range(item.value)
            except ExpressionError as error:
                self._formulas.trouble(item, error)
                return None
            name, kind, trouble = one.name, self._scope.names.kind(one.name), ""
            if any(name == other.name for _, other in ranges):
                trouble = f"the index `{name}` has two ranges"
            elif name in namespace.RESERVED:
                trouble = f"`{name}` is reserved"
            elif name in closed:
                trouble = f"`{name}` is the particle's own in a force"
            elif kind is not None:
                trouble = f"`{name}` is already the name of {namespace.article(kind)}"
            if trouble:
                report(item, "bad-range", trouble, "give the index another name")
                return None
            ranges.append((item, one))
        if not items:
            report(node, "bad-range", "the list of ranges is empty")
            return None
        return ranges
