"""The namespace of a model: who declared a name, and the facts about what it stands for.

Facts are found when first asked for, so that a position may use a definition and a definition a position, as long as
they do not go in a circle. Several entries may bear one base name: `p[1]` and `p[i]` with `i` from 2.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Literal

from lagcli.errors import diagnostics
from lagcli.expression import evaluate, hints, integers, tokens, tree
from lagcli.expression.facts import Either, Facts, Value
from lagcli.expression.tree import ExpressionError
from lagcli.model import family
from lagcli.model.family import Family, Integers, MemberIndex, MissingMember

Kind = Literal["parameter", "coordinate", "particle", "definition", "output", "body"]

RESERVED = ("t", "dt", "pi", "kinetic", "potential")
NOT_FOR_COLUMNS = ("all", "lambda", "R", "energy", "err")

POSITION = Facts(None, frozenset(("position",)))
NUMBERED: tuple[Kind, ...] = ("particle", "coordinate", "output")

BROKEN = ""  # the code of an error that follows from one already reported


@dataclasses.dataclass(slots=True)
class Entry:
    """A declared entry. `find` computes its facts once, from those of the names it `uses`; a name that is not
    reached yet has none. A family that is asked for while its facts are searched has its members depend on one
    another; whether in a circle is found when they are put in order."""

    kind: Kind
    is_family: bool = False
    find: Callable[[], Either | None] | None = None
    uses: frozenset[str] = frozenset()
    value: Either | str | None = None  # BROKEN where something is wrong with it
    searching: bool = False

    @property
    def is_reached(self) -> bool:
        return self.find is not None or self.value is not None


class Namespace:
    """The namespace of one model. The `key` of an entry is its name as written, `p[i]`; its base name is `p`."""

    def __init__(self) -> None:
        self._entries: dict[str, Entry] = {}
        self._keys: dict[str, list[str]] = {}  # base name -> the keys that bear it
        self._families: set[str] = set()
        self._hints: dict[str, str] = {}
        self.laws: set[str] = set()  # names of constraints, for hints
        # The parameters that indices have used, with their values: they decide which members there are and which of
        # them an expression speaks of.
        self.structure: dict[str, float] = {}
        self.member_indices: dict[Kind, MemberIndex] = {kind: MemberIndex() for kind in NUMBERED}
        self._numbered: dict[Kind, list[str]] = {kind: [] for kind in NUMBERED}  # keys, as in the roll

    def __contains__(self, base: str) -> bool:
        return base in self._keys

    def declare(self, key: str, base: str, kind: Kind) -> str:
        """Take a name; the returned sentence says why it cannot be taken, or is empty."""
        is_family = key != base
        if not tokens.is_name(base):
            return "a name is a letter or `_`, then letters, digits and `_`"
        if base in RESERVED:
            return f"`{base}` is reserved"
        if kind in ("particle", "coordinate", "output") and base in NOT_FOR_COLUMNS:
            return f"{article(kind)} may not be called `{base}`: columns of the table use that word"
        if base in self._keys:
            other = self._entries[self._keys[base][0]]
            if not (is_family and other.is_family and other.kind == kind):
                return f"`{base}` is already the name of {article(other.kind)}"
        self._entries[key] = Entry(kind, is_family)
        if is_family:
            self._families.add(base)
        self._keys.setdefault(base, []).append(key)
        return ""

    def add_hidden(self, key: str, kind: Kind, value: Either, is_family: bool = False) -> None:
        """An entry that no text of the file can name, with its facts."""
        self._entries[key] = Entry(kind, is_family, value=value)
        self._keys[key] = [key]
        if is_family:
            self._families.add(key)

    def reserve(self, key: str, base: str, kind: Kind) -> None:
        """Take a name whose declaration has been refused, so that its uses are not refused too."""
        keys = self._keys.setdefault(base, [])
        if key not in keys:
            keys.append(key)
        for each in keys:
            self._entries.setdefault(each, Entry(kind)).value = BROKEN

    def number(self, key: str, members: Family) -> str:
        """Number the members of a particle, coordinate or output entry; the name of one that is there already."""
        kind = self._entries[key].kind
        self._numbered[kind].append(key)
        return self.member_indices[kind].add(members)

    def define(self, key: str, find: Callable[[], Either | None], uses: Iterable[str] = ()) -> None:
        """Say how the facts of a declared entry are found; from here on it may be used."""
        entry = self._entries.get(key)
        if entry is not None and not entry.is_reached:
            entry.find, entry.uses = find, frozenset(uses)

    def kind(self, base: str) -> Kind | None:
        keys = self._keys.get(base)
        return self._entries[keys[0]].kind if keys else None

    def is_broken(self, base: str) -> bool:
        return any(self._entries[key].value is BROKEN for key in self._keys.get(base, ()))

    def is_family(self, base: str) -> bool:
        return base in self._families

    def is_reached(self, base: str) -> bool:
        return all(self._entries[key].is_reached for key in self._keys[base])

    def of(self, *kinds: Kind) -> list[str]:
        return [base for base in self._keys if self.kind(base) in kinds]

    def keys(self, base: str, numbers: Iterable[int]) -> list[str]:
        """The keys of the entries that have the members of these numbers; of no members, one that bears the name."""
        kind = self.kind(base)
        assert kind is not None
        return [self._numbered[kind][entry] for entry in numbers] or self._keys[base][:1]

    def constant(self, name: str) -> Value | tuple[Value | None, ...] | None:
        """Value of a parameter: a float, a tuple of three, or None while it is broken."""
        found = self._entries[name].value
        if isinstance(found, tuple):
            return tuple(part.value for part in found)
        return found.value if isinstance(found, Facts) else None

    def settle(self, key: str) -> Either | None:
        """The facts of an entry, found now; None where it is broken."""
        entry = self._entries[key]
        if entry.find is not None and entry.value is None:
            self._settle(key)
        return None if isinstance(entry.value, str) else entry.value

    def value(self, node: tree.Node, name: str) -> Either:
        keys = self._keys.get(name)
        if not keys:
            raise self.unknown(node, name)
        return self.value_of(node, keys[0], name)

    def value_of(self, node: tree.Node, key: str, name: str) -> Either:
        entry = self._entries[key]
        if not entry.is_reached:
            message, hint = f"the {entry.kind} `{name}` is used before it is declared", ""
            if entry.kind == "output":
                message = f"the output `{name}` is used before it is known: only later outputs may use it"
                hint = "outputs are results; a formula that other entries share belongs under `definitions`"
            raise ExpressionError("used-before-declared", message, node.start, node.end, hint)
        if entry.value is None:
            if entry.searching:
                if entry.is_family and entry.kind == "particle":
                    return (POSITION,) * 3
                message = f"`{name}` depends on itself"
                raise ExpressionError("circular", message, node.start, node.end)
            self._settle(key)
        found = entry.value
        if isinstance(found, str):
            raise broken(node)
        assert found is not None
        return found

    def _settle(self, key: str) -> None:
        """Find the facts of an entry, those of all it uses before: a long chain needs no deep stack."""
        waiting = [key]
        while waiting:
            key = waiting[-1]
            entry = self._entries[key]
            if entry.value is None and not entry.searching:
                entry.searching = True
                for used in sorted(key for base in entry.uses for key in self._keys.get(base, ())):
                    other = self._entries[used]
                    if other.find is not None and other.value is None and not other.searching:
                        waiting.append(used)
                continue
            waiting.pop()
            if entry.value is None and entry.find is not None:
                found = entry.find()
                entry.value = BROKEN if found is None else found
                # Who finds them holds this namespace: together they would stay until a collection of garbage.
                entry.searching, entry.find = False, None

    def unknown(
        self, node: tree.Node, name: str, kind: Kind | None = None, further: Iterable[str] = ()
    ) -> ExpressionError:
        """The error for a name that nothing declares, where those of a kind and further ones may stand, or all."""
        if name in evaluate.FUNCTION_NAMES:
            hint = f"`{name}` is a function: write `{name}(...)`"
        elif undeclared := hints.undeclared(name):
            hint = undeclared
        elif name == "g":
            hint = "declare it under `parameters`, for example `g: 9.81`"
        else:
            if name not in self._hints:
                known = self.of(kind) if kind else [*self._keys, *RESERVED]
                derivative = hints.derivative_of(name, self.of("coordinate"))
                folded = {coordinate.casefold() for coordinate in self.of("coordinate")}
                if not derivative and name.casefold() not in folded:
                    derivative = hints.part_of(name, set(self.of("particle")), self.laws)
                self._hints[name] = derivative or diagnostics.nearest(name, [*further, *known])
            hint = self._hints[name]
        return ExpressionError("unknown-name", f"the name `{name}` is not known", node.start, node.end, hint)

    def bare(self, node: tree.Node, name: str) -> ExpressionError:
        if self.is_broken(name):
            return broken(node)
        message = f"`{name}` is a family: alone it means all its members, and only in lists such as `to:`"
        hint = f"write one of its members, for example `{name}[1]`"
        return ExpressionError("family-needs-index", message, node.start, node.end, hint)

    def integer_lookup(self, variables: Mapping[str, Integers]) -> Callable[[tree.Name], float | Integers]:
        def lookup(node: tree.Name) -> float | Integers:
            if node.name in variables:
                return variables[node.name]
            kind = self.kind(node.name)
            if kind is None:
                raise self.unknown(node, node.name, "parameter", variables)
            if kind != "parameter":
                rule = "bounds and indices are integer expressions of parameters"
                message = f"{rule}, and `{node.name}` is {article(kind)}"
                raise ExpressionError("not-a-whole-number", message, node.start, node.end)
            self.value(node, node.name)
            value = self.constant(node.name)
            if isinstance(value, tuple):
                message = f"an index is a number, and `{node.name}` is a vector"
                raise ExpressionError("not-a-whole-number", message, node.start, node.end)
            assert isinstance(value, float)
            self.structure[node.name] = value
            return float(value)

        return lookup

    def numbers(self, node: tree.Name | tree.Index, variables: Mapping[str, Integers]) -> Integers:
        """The numbers of the particles or generalized coordinates a reference stands for, (1,) or (K,). The base name
        must be one of a particle or coordinate. Raises `ExpressionError`."""
        base = node.owner
        kind = self.kind(base)
        assert kind in NUMBERED, base
        if self.is_broken(base):
            raise broken(node)
        if isinstance(node, tree.Name):
            return self.member_indices[kind].find(base, ())
        return self.find(node, self.member_indices[kind], self.is_family(base), variables)

    def find(
        self, node: tree.Index, member_index: MemberIndex, is_family: bool, variables: Mapping[str, Integers]
    ) -> Integers:
        """The numbers in `member_index` of the members an index stands for. Raises `ExpressionError`."""
        base = node.owner
        if not is_family:
            message = f"`{base}` is no family and has no members"
            is_particle = self.kind(base) == "particle"
            hint = f"components are written `{base}.x`, `{base}.y`, `{base}.z`" if is_particle else ""
            raise ExpressionError("not-a-family", message, node.start, node.end, hint)
        depth = member_index.depth(base) if base in member_index else None
        if depth is not None and depth != len(node.indices):
            word = "index" if depth == 1 else "indices"
            message = f"the members of `{base}` have {depth} {word}, but {len(node.indices)} were given"
            raise ExpressionError("no-such-member", message, node.start, node.end)
        indices = [integers.evaluate(index, self.integer_lookup(variables)) for index in node.indices]
        try:
            return member_index.find(base, indices)
        except MissingMember as missing:
            if depth is None:
                message = f"the family `{base}` has no members"
                raise ExpressionError("no-such-member", message, node.start, node.end) from None
            least, most = member_index.ends(base)
            hint = f"the members go from `{family.name(base, least)}` to `{family.name(base, most)}`"
            message = f"there is no member `{family.name(base, missing.indices)}`"
            member = missing.position if any(not isinstance(index, int) for index in indices) else None
            spot = node.start, node.end
            raise ExpressionError("no-such-member", message, *spot, hint, member=member) from None


def known(value: Either | None) -> Callable[[], Either | None]:
    """Finds the facts of an entry that are known already."""
    return lambda: value


def article(kind: Kind) -> str:
    """`a particle`, `an output`."""
    return f"an {kind}" if kind == "output" else f"a {kind}"


def broken(node: tree.Node) -> ExpressionError:
    """An error that follows from one already reported; it is not reported."""
    return ExpressionError(BROKEN, "", node.start, node.end)
