"""Names: who declared them, and the facts about what they stand for.

Particles, coordinates, parameters, definitions and outputs share one namespace; functions have their own.
Facts are found when first asked for, so that a position may use a definition and a definition a position,
as long as they do not go in a circle. Several entries may bear one base name: `p[1]` and `p[i]` with `i` from 2.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

from lagcli import diagnostics
from lagcli.expression import evaluate, facts, tokens, tree, whole
from lagcli.expression.facts import Facts
from lagcli.expression.tree import ExpressionError
from lagcli.members import Members, MissingMember, Roll, Whole

Kind = Literal["parameter", "coordinate", "particle", "definition", "output"]
Shape = Literal["scalar", "vector", "body"]
Lookup = Callable[[tree.Node], Any]

RESERVED = ("t", "dt", "pi", "kinetic", "potential")
NOT_FOR_COLUMNS = ("all", "lambda", "R", "energy", "err")

VELOCITY = Facts(None, frozenset(("velocity",)), 1, 1)
RESULT = Facts(None, frozenset(("result",)))
PLACE = Facts(None, frozenset(("position",)))
OWN: dict[str, Any] = {
    "m": Facts(None, frozenset(("mass",))),
    "r": (Facts(None, frozenset(("position", "cartesian"))),) * 3,
    "v": (VELOCITY,) * 3,
}
_VELOCITY_MEMBERS = {"vx": 0, "vy": 1, "vz": 2}
_NUMBERED: tuple[Kind, ...] = ("particle", "coordinate", "output")

BROKEN = ""  # the code of an error that follows from one already reported


@dataclasses.dataclass(slots=True)
class Entry:
    """A declared entry. `find` computes its facts once, from those of the names it `uses`; a name that is not
    reached yet has none. A family that is asked for while its facts are searched has its members depend on one
    another; whether in a circle is found when they are put in order."""

    kind: Kind
    is_family: bool = False
    find: Callable[[], Any] | None = None
    uses: frozenset[str] = frozenset()
    value: Any = None
    searching: bool = False


@dataclasses.dataclass(slots=True)
class Law:
    """The entries of a constraint name: what each is, and that none of them is broken."""

    is_family: bool
    shapes: list[Shape] = dataclasses.field(default_factory=list)
    is_broken: bool = False


def _article(kind: Kind) -> str:
    return f"an {kind}" if kind == "output" else f"a {kind}"


class Scope:
    """The namespace of one model. The `key` of an entry is its name as written, `p[i]`; its base name is `p`."""

    def __init__(self) -> None:
        self._entries: dict[str, Entry] = {}
        self._keys: dict[str, list[str]] = {}  # base name -> the keys that bear it
        self._hints: dict[str, str] = {}
        self._settled: list[str] = []
        self.rolls: dict[Kind, Roll] = {kind: Roll() for kind in _NUMBERED}
        self._numbered: dict[Kind, list[str]] = {kind: [] for kind in _NUMBERED}  # keys, as in the roll
        self.laws: dict[str, Law] = {}
        self.law_roll = Roll()
        self._law_shapes: list[Shape] = []  # of the entries of `law_roll`
        self.structure: dict[str, float] = {}

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
            return f"{_article(kind)} may not be called `{base}`: columns of the table use that word"
        if base in self._keys:
            other = self._entries[self._keys[base][0]]
            if not (is_family and other.is_family and other.kind == kind):
                return f"`{base}` is already the name of {_article(other.kind)}"
        self._entries[key] = Entry(kind, is_family)
        self._keys.setdefault(base, []).append(key)
        return ""

    def spoil(self, base: str, kind: Kind) -> None:
        """Take a name whose declaration has been refused, so that its uses are not refused too."""
        for key in self._keys.setdefault(base, [base]):
            self._entries.setdefault(key, Entry(kind)).value = BROKEN

    def number(self, key: str, members: Members) -> str:
        """Number the members of a particle, coordinate or output entry; the name of one that is there already."""
        kind = self._entries[key].kind
        self._numbered[kind].append(key)
        return self.rolls[kind].add(members)

    def define(self, key: str, find: Callable[[], Any], uses: Iterable[str] = ()) -> None:
        """Say how the facts of a declared entry are found; from here on it may be used."""
        entry = self._entries.get(key)
        if entry is not None and entry.find is None:
            entry.find, entry.uses = find, frozenset(uses)

    def kind(self, base: str) -> Kind | None:
        """What the name was declared as."""
        keys = self._keys.get(base)
        return self._entries[keys[0]].kind if keys else None

    def is_broken(self, base: str) -> bool:
        """Whether something is wrong with a name that has been reported."""
        return any(self._entries[key].value is BROKEN for key in self._keys.get(base, ()))

    def is_family(self, base: str) -> bool:
        """Whether a name has members."""
        return any(self._entries[key].is_family for key in self._keys.get(base, ()))

    def names(self, *kinds: Kind) -> list[str]:
        """All declared base names of these kinds, in order."""
        return [base for base in self._keys if self.kind(base) in kinds]

    def constant(self, name: str) -> Any:
        """Value of a parameter: a float, a tuple of three, or None while it is broken."""
        found = self._entries[name].value
        if isinstance(found, tuple):
            return tuple(part.value for part in found)
        return found.value if isinstance(found, Facts) else None

    def settle(self, key: str) -> Any:
        """The facts of an entry, found now; None where it is broken."""
        entry = self._entries[key]
        if entry.find is not None and entry.value is None:
            self._settle(key)
        return None if entry.value is BROKEN else entry.value

    # -- what the leaves of an expression stand for ------------------------------------------------------------

    def lookup_in(self, members: Members, own: bool = False) -> Lookup:
        """The lookup for an expression of an entry; `own` opens `m`, `r`, `v` of a particle."""
        return lambda node: self._lookup(node, members.variables, own)

    def lookup(self, node: tree.Node) -> Any:
        """The facts a leaf or special call stands for in an expression of no family."""
        return self._lookup(node, {}, False)

    def _lookup(self, node: tree.Node, variables: Mapping[str, Whole], own: bool) -> Any:
        match node:
            case tree.Name():
                return self._name(node, variables, own)
            case tree.Member():
                return self._member(node, own)
            case tree.Call():
                return self._special(node, variables)
            case tree.Index():
                return self._of_family(node, variables)
            case _:
                raise TypeError(node)

    def whole(self, variables: Mapping[str, Whole]) -> Callable[[tree.Name], float | Whole]:
        """The lookup in an integer expression: parameters and index variables.

        What it gives decides the structure of the model, and is remembered.
        """

        def lookup(node: tree.Name) -> float | Whole:
            if node.name in variables:
                return variables[node.name]
            kind = self.kind(node.name)
            if kind is None:
                raise self._unknown(node, node.name, [*variables, *self.names("parameter")])
            if kind != "parameter":
                rule = "bounds and indices are integer expressions of parameters"
                message = f"{rule}, and `{node.name}` is {_article(kind)}"
                raise ExpressionError("not-a-whole-number", message, node.start, node.end)
            self._declared(node, node.name)
            value = self.constant(node.name)
            if isinstance(value, tuple):
                message = f"an index is a number, and `{node.name}` is a vector"
                raise ExpressionError("not-a-whole-number", message, node.start, node.end)
            self.structure[node.name] = value
            return float(value)

        return lookup

    def _name(self, node: tree.Name, variables: Mapping[str, Whole], own: bool) -> Any:
        name = node.name
        if name in variables:
            return Facts(variables[name].astype(float))
        if own and name in OWN:
            return OWN[name]
        if name == "t":
            return Facts(None, frozenset(("time",)))
        if name == "pi":
            return Facts(3.141592653589793)
        if name == "dt":
            return Facts(None, frozenset(("differential",)), 1, 1)
        if name in ("kinetic", "potential"):
            return RESULT
        if self.is_family(name):
            raise self._bare(node, name)
        return self._declared(node, name)

    def _bare(self, node: tree.Node, name: str) -> ExpressionError:
        if self.is_broken(name):
            return ExpressionError(BROKEN, "", node.start, node.end)
        message = (
            f"`{name}` is a family: alone it stands for all its members, and only in lists such as `to:`"
        )
        hint = f"write one of its members, for example `{name}[1]`"
        return ExpressionError("family-needs-index", message, node.start, node.end, hint)

    def _declared(self, node: tree.Node, name: str) -> Any:
        keys = self._keys.get(name)
        if not keys:
            raise self._unknown(node, name, [*self._keys, *RESERVED])
        return self._value(node, keys[0], name)

    def _value(self, node: tree.Node, key: str, name: str) -> Any:
        """The facts of one entry."""
        entry = self._entries[key]
        if entry.find is None and entry.value is None:
            message = f"the {entry.kind} `{name}` is used before it is declared"
            raise ExpressionError("used-before-declared", message, node.start, node.end)
        if entry.value is None:
            if entry.searching:
                if entry.is_family and entry.kind == "particle":
                    return (PLACE,) * 3
                message = f"`{name}` depends on itself"
                raise ExpressionError("circular", message, node.start, node.end)
            self._settle(key)
        if entry.value is BROKEN:
            raise ExpressionError(BROKEN, "", node.start, node.end)
        return entry.value

    def _settle(self, key: str) -> None:
        """Find the facts of an entry, those of all it uses before: a long chain needs no deep stack."""
        waiting = [key]
        while waiting:
            key = waiting[-1]
            entry = self._entries[key]
            if entry.value is None and not entry.searching:
                entry.searching = True
                used = sorted(key for base in entry.uses for key in self._keys.get(base, ()))
                waiting += [key for key in used if self._is_open(key)]
                continue
            waiting.pop()
            if entry.value is None and entry.find is not None:
                found = entry.find()
                entry.value = BROKEN if found is None else found
                entry.searching = False
                self._settled.append(key)

    def _is_open(self, key: str) -> bool:
        entry = self._entries[key]
        return entry.find is not None and entry.value is None and not entry.searching

    def _unknown(self, node: tree.Node, name: str, known: Iterable[str]) -> ExpressionError:
        if name in evaluate.FUNCTION_NAMES:
            hint = f"`{name}` is a function: write `{name}(...)`"
        elif name == "g":
            hint = "declare it under `parameters`, for example `g: 9.81`"
        else:
            if name not in self._hints:
                self._hints[name] = diagnostics.nearest(name, known)
            hint = self._hints[name]
        return ExpressionError("unknown-name", f"the name `{name}` is not known", node.start, node.end, hint)

    # -- members of families -----------------------------------------------------------------------------------

    def numbers(self, node: tree.Name | tree.Index, variables: Mapping[str, Whole]) -> Whole:
        """The numbers of the particles or generalized coordinates a reference stands for, (1,) or (K,).

        The base name must be one of a particle or coordinate. Raises `ExpressionError`.
        """
        base = node.owner if isinstance(node, tree.Index) else node.name
        kind = self.kind(base)
        assert kind in _NUMBERED, base
        if self.is_broken(base):
            raise ExpressionError(BROKEN, "", node.start, node.end)
        if isinstance(node, tree.Name):
            return self.rolls[kind].find(base, ())
        return self._find(node, self.rolls[kind], self.is_family(base), variables)

    def _find(self, node: tree.Index, roll: Roll, is_family: bool, variables: Mapping[str, Whole]) -> Whole:
        """The numbers of the members an index stands for."""
        base = node.owner
        if not is_family:
            message = f"`{base}` is no family and has no members"
            raise ExpressionError("not-a-family", message, node.start, node.end)
        indices = [whole.evaluate(index, self.whole(variables)) for index in node.indices]
        depth = roll.depth(base) if base in roll else None
        if depth is not None and depth != len(indices):
            message = f"the members of `{base}` have {depth} indices, and {len(indices)} stand here"
            raise ExpressionError("no-such-member", message, node.start, node.end)
        try:
            return roll.find(base, indices)
        except (MissingMember, KeyError) as missing:
            place = missing.place if isinstance(missing, MissingMember) else 0
            name = _member(base, missing.indices) if isinstance(missing, MissingMember) else base
            ends = roll.ends(base) if base in roll else None
            hint = (
                f"the members go from `{_member(base, ends[0])}` to `{_member(base, ends[1])}`"
                if ends
                else ""
            )
            message = f"there is no member `{name}`" if ends else f"the family `{base}` has no members"
            vector = any(not isinstance(index, int) for index in indices)
            raise ExpressionError(
                "no-such-member", message, node.start, node.end, hint, place=place if vector else None
            ) from None

    def _of_family(self, node: tree.Index, variables: Mapping[str, Whole]) -> Any:
        """The facts of `p[i]`, `p[i].x`, `theta[i]`: of all entries its members belong to together."""
        kind = self.kind(node.owner)
        if kind is None:
            raise self._unknown(node, node.owner, [*self._keys, *RESERVED])
        if kind not in _NUMBERED:
            message = f"`{node.owner}` is {_article(kind)}, no family, and has no members"
            raise ExpressionError("not-a-family", message, node.start, node.end)
        if any(
            self._entries[key].find is None and self._entries[key].value is None
            for key in self._keys[node.owner]
        ):
            self._value(node, self._keys[node.owner][0], node.owner)
        if self.is_broken(node.owner):
            raise ExpressionError(BROKEN, "", node.start, node.end)
        roll = self.rolls[kind]
        numbers = self._find(node, roll, self.is_family(node.owner), variables)
        entries = sorted(set(roll.entries(numbers).tolist()))
        keys = [self._numbered[kind][entry] for entry in entries] or self._keys[node.owner][:1]
        value = _together(node, [self._value(node, key, node.owner) for key in keys])
        if kind == "particle" and node.member:
            return self._particle_member(node, value, node.member)
        return evaluate.component(node, value, node.member, node.owner) if node.member else value

    def _member(self, node: tree.Member, own: bool) -> Any:
        spot = tree.Name(node.start, node.start + len(node.owner), node.owner)
        owner = self._name(spot, {}, own)
        if self.kind(node.owner) == "particle" and not (own and node.owner in OWN):
            return self._particle_member(node, owner, node.member)
        return evaluate.component(node, owner, node.member, node.owner)

    @staticmethod
    def _particle_member(node: tree.Member | tree.Index, position: Any, member: str) -> Any:
        if member == "v":
            return (VELOCITY,) * 3
        if member in _VELOCITY_MEMBERS:
            return VELOCITY
        if member not in evaluate.COMPONENTS:
            hint = "a particle has `.x` `.y` `.z`, `.vx` `.vy` `.vz` and the vector `.v`"
            message = f"a particle has no `.{member}`"
            raise ExpressionError("unknown-component", message, node.start, node.end, hint)
        return evaluate.component(node, position, member, node.owner)

    # -- special functions -------------------------------------------------------------------------------------

    def _special(self, node: tree.Call, variables: Mapping[str, Whole]) -> Any:
        argument = node.arguments[0]
        if node.function == "rate":
            return self._rate(node, argument, variables)
        if node.function == "reaction":
            if self._is_whole(argument) and self._argument_kind(argument) == "particle":
                self._lookup(argument, variables, False)
                return (RESULT,) * 3
            self._known_argument(argument, self.names("particle"), "particle", "reaction(...)")
        return self._multiplier(argument, variables)

    @staticmethod
    def _is_whole(argument: tree.Node) -> bool:
        """Whether the argument is a name or member of a family, without a component."""
        return isinstance(argument, tree.Name) or (isinstance(argument, tree.Index) and not argument.member)

    def _argument_kind(self, argument: tree.Node) -> Kind | None:
        return self.kind(str(getattr(argument, "owner", getattr(argument, "name", ""))))

    def _rate(self, node: tree.Call, argument: tree.Node, variables: Mapping[str, Whole]) -> Any:
        kind = self._argument_kind(argument)
        if kind in ("coordinate", "particle"):
            value = self._lookup(argument, variables, False)
            if self._is_whole(argument):
                return (VELOCITY,) * 3 if isinstance(value, tuple) else VELOCITY
            if kind == "particle":
                if getattr(argument, "member", "") in evaluate.COMPONENTS:
                    return VELOCITY
                message = "rates of velocities are accelerations"
                raise ExpressionError("bad-rate", message, node.start, node.end)
        if isinstance(argument, (tree.Name, tree.Index)):
            self._known_argument(argument, self.names("coordinate"), "coordinate", "rate(...)")
        hint = "in a differential constraint, `d(...)` takes any expression"
        message = "`rate(...)` takes the name of a generalized coordinate"
        raise ExpressionError("bad-rate", message, argument.start, argument.end, hint)

    def _known_argument(self, node: tree.Node, known: list[str], kind: str, call: str) -> None:
        name = str(getattr(node, "owner", getattr(node, "name", "")))
        if isinstance(node, (tree.Name, tree.Index)) and name not in self._keys:
            raise self._unknown(node, name, known)
        message = f"`{call}` takes the name of a {kind}"
        raise ExpressionError("wrong-arguments", message, node.start, node.end)

    def take_law(self, base: str, is_family: bool) -> None:
        """Take the name of a constraint."""
        self.laws.setdefault(base, Law(is_family))

    def number_law(self, members: Members, shape: Shape | None) -> str:
        """Number the members of a constraint, None for a broken one; the name of one that is there already."""
        law = self.laws[members.base]
        if shape is None:
            law.is_broken = True
            return ""
        law.shapes.append(shape)
        self._law_shapes.append(shape)
        return self.law_roll.add(members)

    def _multiplier(self, argument: tree.Node, variables: Mapping[str, Whole]) -> Any:
        name = str(getattr(argument, "owner", getattr(argument, "name", "")))
        law = self.laws.get(name)
        if law is not None and law.is_broken:
            raise ExpressionError(BROKEN, "", argument.start, argument.end)
        if law is None or not isinstance(argument, (tree.Name, tree.Member, tree.Index)):
            hint = diagnostics.nearest(name, self.laws)
            message = "`multiplier(...)` takes the name of a constraint"
            raise ExpressionError("unknown-constraint", message, argument.start, argument.end, hint)
        if not law.shapes:
            return RESULT  # the laws are not read yet, and where this stands no multiplier is allowed
        if law.is_family and not isinstance(argument, tree.Index):
            raise self._bare(argument, name)
        shapes: set[Shape] = set(law.shapes)
        if isinstance(argument, tree.Index):
            numbers = self._find(argument, self.law_roll, law.is_family, variables)
            shapes = {
                self._law_shapes[entry] for entry in set(self.law_roll.entries(numbers).tolist())
            } or shapes
        return self._multipliers(argument, name, shapes)

    @staticmethod
    def _multipliers(argument: tree.Node, name: str, shapes: set[Shape]) -> Any:
        """The facts of the multipliers of laws of these shapes."""
        member = str(getattr(argument, "member", ""))
        if len(shapes) > 1:
            message = "some of these constraints are vector equations and some are not"
            raise ExpressionError("vector-mismatch", message, argument.start, argument.end)
        (shape,) = shapes
        if shape == "body" and not member:
            message = f"the body `{name}` has several multipliers"
            hint = f"write `multiplier({name}.1)`, `multiplier({name}.2)`, ..."
            raise ExpressionError("wrong-arguments", message, argument.start, argument.end, hint)
        # The rows of a rigid body are known by number only once its geometry is; they are checked there.
        known = {
            "scalar": not member,
            "vector": member in ("", *evaluate.COMPONENTS),
            "body": member.isdigit(),
        }
        if known[shape]:
            return (RESULT,) * 3 if shape == "vector" and not member else RESULT
        message = "`multiplier(...)` takes the name of a constraint"
        raise ExpressionError("unknown-constraint", message, argument.start, argument.end)


def _member(base: str, indices: Iterable[int]) -> str:
    return base + "".join(f"[{i}]" for i in indices)


def _together(node: tree.Node, values: list[Any]) -> Any:
    """Facts that hold for any of several entries of a family."""
    if len(values) == 1:
        return values[0]
    if len({isinstance(value, tuple) for value in values}) > 1:
        message = "some of these members are vectors and some are not"
        raise ExpressionError("vector-mismatch", message, node.start, node.end)
    merged = [
        Facts(None, reads(tuple(parts)), min(p.low for p in parts), max(p.high for p in parts))
        for parts in zip(*(v if isinstance(v, tuple) else (v,) for v in values), strict=True)
    ]
    return tuple(merged) if isinstance(values[0], tuple) else merged[0]


def reads(value: Any) -> frozenset[facts.Flag]:
    """All that a scalar or vector reads."""
    parts = value if isinstance(value, tuple) else (value,)
    return frozenset[facts.Flag]().union(*(part.reads for part in parts))
