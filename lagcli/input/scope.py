"""The leaves of an expression where it is read: their facts, or the error that says why not.

Constraints have a namespace of their own, in which `multiplier(...)` is a scalar, a vector or a row of a rigid body.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from lagcli.errors import diagnostics
from lagcli.expression import evaluate, facts, hints, tree
from lagcli.expression.facts import Either, Facts, Lookup
from lagcli.expression.tree import ExpressionError
from lagcli.input import namespace
from lagcli.input.namespace import Kind, Namespace
from lagcli.model.family import Family, Integers, MemberIndex
from lagcli.model.model import CONSTANTS

if TYPE_CHECKING:
    from lagcli.input.body_points import BodyNames  # most models have none

Shape = Literal["scalar", "vector", "body"]

RESULT = Facts(None, frozenset(("result",)))
REACTION = "reaction(a, ...)"  # a call that asks for a constraint


@dataclasses.dataclass(slots=True)
class LawShape:
    """The entries of a constraint name: what each is, and that none of them is broken."""

    is_family: bool
    shapes: list[Shape] = dataclasses.field(default_factory=list)
    is_broken: bool = False


class LawNames:
    """The constraints of one model, which have a namespace of their own."""

    def __init__(self, names: Namespace) -> None:
        self._names = names
        self._laws: dict[str, LawShape] = {}
        self._member_index = MemberIndex()
        self._shapes: list[Shape] = []  # of the entries of the roll

    def __contains__(self, base: str) -> bool:
        return base in self._laws

    def take(self, base: str, is_family: bool) -> None:
        self._laws.setdefault(base, LawShape(is_family))
        self._names.laws.add(base)

    def number(self, members: Family, shape: Shape | None) -> str:
        """Number the members of a constraint, None for a broken one; the name of one that is there already."""
        law = self._laws[members.base]
        if shape is None:
            law.is_broken = True
            return ""
        law.shapes.append(shape)
        # The walls of one condition are a family too.
        law.is_family |= any(members.indices)
        self._shapes.append(shape)
        return self._member_index.add(members)

    def multiplier(
        self, argument: tree.Node, variables: Mapping[str, Integers], call: str = "multiplier(...)"
    ) -> Either:
        """The facts of the multipliers of a constraint, or of one of its rows. Raises `ExpressionError`."""
        name, member = _owner(argument), str(getattr(argument, "member", ""))
        law = self._laws.get(name)
        if law is not None and law.is_broken:
            raise namespace.broken(argument)
        if law is None or not isinstance(argument, tree.Reference):
            hint = diagnostics.nearest(name, self._laws)
            if not hint and self._laws:
                hint = "the constraints are " + diagnostics.listed(self._laws)
            where = "as its second argument " if "," in call else ""
            message = f"`{call}` takes {where}the name of a constraint"
            raise ExpressionError("unknown-constraint", message, argument.start, argument.end, hint)
        if not law.shapes:
            return RESULT  # it is not read yet: no result is allowed here, and that is reported
        if law.is_family and not isinstance(argument, tree.Index):
            raise self._names.bare(argument, name)
        shapes: set[Shape] = set(law.shapes)
        if isinstance(argument, tree.Index):
            numbers = self._names.find(argument, self._member_index, law.is_family, variables)
            own = {self._shapes[entry] for entry in set(self._member_index.entries(numbers).tolist())}
            shapes = own or shapes
        if call == REACTION and not member:
            return RESULT  # of the whole constraint, whatever it is
        if len(shapes) > 1:
            message = "some of these constraints are vector equations and some are not"
            raise ExpressionError("vector-mismatch", message, argument.start, argument.end)
        (shape,) = shapes
        if shape == "body" and not member:
            message = f"the body `{name}` has several multipliers"
            hint = f"write `multiplier({name}.1)`, `multiplier({name}.2)`, ..."
            raise ExpressionError("wrong-arguments", message, argument.start, argument.end, hint)
        # The rows of a rigid body are known by number only once its geometry is; they are checked there.
        is_known, hint = {
            "scalar": (not member, f"it has one row: write `{call.replace('...', name)}`"),
            "vector": (
                member in ("", *evaluate.COMPONENTS),
                f"its rows are `{name}.x`, `{name}.y`, `{name}.z`",
            ),
            "body": (member.isdigit(), f"its rows are numbered: `{name}.1`, `{name}.2`, ..."),
        }[shape]
        if not is_known:
            message = f"the constraint `{name}` has no row `{member}`"
            raise ExpressionError("unknown-constraint", message, argument.start, argument.end, hint)
        return (RESULT,) * 3 if shape == "vector" and not member else RESULT


VELOCITY = Facts(None, frozenset(("velocity",)), 1, 1)
ACCELERATION = Facts(None, frozenset(("acceleration",)))
OWN: dict[str, Either] = {
    "m": Facts(None, frozenset(("mass",))),
    "r": (Facts(None, frozenset(("position", "cartesian"))),) * 3,
    "v": (VELOCITY,) * 3,
}
# The members of a particle beside its components: of a vector, or of one component of it.
_MOTIONS = {
    **dict.fromkeys(("v", "vx", "vy", "vz"), VELOCITY),
    **dict.fromkeys(("a", "ax", "ay", "az"), ACCELERATION),
}


class Scope:
    """The names of one model and of its constraints, and the members their indices speak of."""

    def __init__(self) -> None:
        self.names = Namespace()
        self.laws = LawNames(self.names)
        self.bodies: dict[str, BodyNames] = {}

    def lookup_in(self, members: Family, own: bool = False) -> Lookup:
        """The lookup for an expression of an entry; `own` opens `m`, `r`, `v` of a particle."""
        return lambda node: self._lookup(node, members.variables, own)

    def lookup(self, node: tree.Node) -> Either:
        return self._lookup(node, {}, False)

    def _lookup(self, node: tree.Node, variables: Mapping[str, Integers], own: bool) -> Either:
        match node:
            case tree.Name():
                return self._name(node, variables, own)
            case tree.Member():
                spot = tree.Name(node.start, node.start + len(node.owner), node.owner)
                owner = self._name(spot, variables, own)
                if self.names.kind(node.owner) == "particle" and not (own and node.owner in OWN):
                    return _particle_member(node, owner, node.member)
                if self.names.kind(node.owner) == "coordinate":
                    message = f"the coordinate `{node.owner}` has no component `{node.member}`"
                    meant = diagnostics.meant("members of coordinates")
                    otherwise = "a coordinate is a number and has no components"
                    hint = meant.get(node.member, otherwise).format(node.owner)
                    raise ExpressionError("unknown-component", message, node.start, node.end, hint)
                return evaluate.component(node, owner, node.member, node.owner)
            case tree.Call():
                argument = node.arguments[0]
                if node.function == "rate":
                    return self._rate(node, argument, variables)
                if node.function == "reaction":
                    return self._reaction(node, argument, variables)
                name = _owner(argument)
                if self.names.kind(name) == "particle" and name not in self.laws:
                    message = "`multiplier(...)` takes the name of a constraint"
                    hint = f"`{name}` is a particle: the force of its constraints is `reaction(...)`"
                    raise ExpressionError("unknown-constraint", message, argument.start, argument.end, hint)
                return self.laws.multiplier(argument, variables)
            case tree.Index():
                return self._of_family(node, variables)
            case _:
                raise TypeError(node)

    def _name(self, node: tree.Name, variables: Mapping[str, Integers], own: bool) -> Either:
        name = node.name
        if name in variables:
            return Facts(variables[name].astype(float))
        if own and name in OWN:
            return OWN[name]
        if name == "t":
            return Facts(None, frozenset(("time",)))
        if name in CONSTANTS and name not in self.names:
            return Facts(CONSTANTS[name])
        if name == "dt":
            return Facts(None, frozenset(("differential",)), 1, 1)
        if name in ("kinetic", "potential"):
            return RESULT
        if self.names.is_family(name):
            raise self.names.bare(node, name)
        return self.names.value(node, name)

    def _of_family(self, node: tree.Index, variables: Mapping[str, Integers]) -> Either:
        """The facts of `p[i]`, `p[i].x`, `theta[i]`: of all entries its members belong to together."""
        names, base = self.names, node.owner
        kind = names.kind(base)
        if kind is None and base not in variables and base not in namespace.RESERVED:
            raise names.unknown(node, base)
        if kind is None or kind not in namespace.NUMBERED:
            what = f"is {namespace.article(kind)}, no family," if kind else "is no family"
            message = f"`{base}` {what} and has no members"
            hint = f"components are written `{base}.x`, `{base}.y`, `{base}.z`" if kind == "particle" else ""
            raise ExpressionError("not-a-family", message, node.start, node.end, hint)
        if not names.is_reached(base):
            names.value(node, base)
        numbers = names.numbers(node, variables)
        keys = names.keys(base, sorted(set(names.member_indices[kind].entries(numbers).tolist())))
        value = _together(node, [names.value_of(node, key, base) for key in keys])
        if kind == "particle" and node.member:
            return _particle_member(node, value, node.member)
        return evaluate.component(node, value, node.member, base) if node.member else value

    def _reaction(self, node: tree.Call, argument: tree.Node, variables: Mapping[str, Integers]) -> Either:
        """The facts of R of a particle, or with a second argument of the part that one constraint has in it."""
        if not _names_particle(argument) or self.names.kind(_owner(argument)) != "particle":
            name = _owner(argument)
            if name in self.laws and name not in self.names:
                message = f"`reaction(...)` takes the name of a particle, and `{name}` is a constraint"
                hint = f"its force on a particle `a` is `reaction(a, {name})`, its multiplier `multiplier({name})`"
                raise ExpressionError("wrong-arguments", message, argument.start, argument.end, hint)
            self._known_argument(argument, "particle", "reaction(...)")
        self._lookup(argument, variables, False)
        if len(node.arguments) > 1:
            self.laws.multiplier(node.arguments[1], variables, REACTION)
        return (RESULT,) * 3

    def _rate(self, node: tree.Call, argument: tree.Node, variables: Mapping[str, Integers]) -> Either:
        found = VELOCITY
        if len(node.arguments) > 1:
            order = node.arguments[1]
            if not isinstance(order, tree.Number) or float(order.text) not in (1.0, 2.0):
                hint = "`rate(theta)` is the rate of `theta`, `rate(theta, 2)` its acceleration"
                message = "the second argument of `rate(...)` is the order, 1 or 2"
                raise ExpressionError("bad-rate", message, order.start, order.end, hint)
            found = VELOCITY if float(order.text) == 1.0 else ACCELERATION
        kind = self.names.kind(_owner(argument))
        if kind in ("coordinate", "particle"):
            value = self._lookup(argument, variables, False)
            if _names_particle(argument):
                return (found,) * 3 if isinstance(value, tuple) else found
            if kind == "particle":
                if getattr(argument, "member", "") in evaluate.COMPONENTS:
                    return found
                message = "rates of velocities are accelerations"
                raise ExpressionError("bad-rate", message, node.start, node.end, hints.NO_ACCELERATION)
        if isinstance(argument, (tree.Name, tree.Index)):
            self._known_argument(argument, "coordinate", "rate(...)")
        if isinstance(argument, tree.Call) and argument.function == "rate":
            message = "rates of rates are accelerations"
            raise ExpressionError("bad-rate", message, node.start, node.end, hints.NO_ACCELERATION)
        hint = "in a differential constraint, `d(...)` takes any expression"
        message = "`rate(...)` takes the name of a generalized coordinate"
        raise ExpressionError("bad-rate", message, argument.start, argument.end, hint)

    def _known_argument(self, node: tree.Node, kind: Kind, call: str) -> None:
        name = _owner(node)
        known = name in self.names or name in namespace.RESERVED
        if isinstance(node, (tree.Name, tree.Index)) and not known:
            raise self.names.unknown(node, name, kind)
        message = f"`{call}` takes the name of a {kind}"
        if isinstance(node, tree.Name):
            message += f", and `{name}` is none"
        hint = "in a differential constraint, `d(...)` takes any expression"
        if call != "rate(...)":
            is_coordinate = self.names.kind(name) == "coordinate"
            hint = f"the table has the column `R.{name}`" if is_coordinate else ""
        raise ExpressionError("wrong-arguments", message, node.start, node.end, hint)


def _owner(node: tree.Node) -> str:
    return str(getattr(node, "owner", ""))


def _names_particle(argument: tree.Node) -> bool:
    """True if the argument is a name or member of a family, without a component."""
    return isinstance(argument, tree.Name) or (isinstance(argument, tree.Index) and not argument.member)


def _particle_member(node: tree.Member | tree.Index, position: Either, member: str) -> Either:
    if member in _MOTIONS:
        found = _MOTIONS[member]
        return (found,) * 3 if len(member) == 1 else found
    if member not in evaluate.COMPONENTS:
        hint = hints.particle_member(member)
        message = f"a particle has no `.{member}`"
        raise ExpressionError("unknown-component", message, node.start, node.end, hint)
    return evaluate.component(node, position, member, node.owner)


def _together(node: tree.Node, values: list[Either]) -> Either:
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
    if len(merged) == 1:
        return merged[0]
    x, y, z = merged
    return x, y, z


def reads(value: Either | tuple[Facts, ...]) -> frozenset[facts.Flag]:
    """All that a scalar or vector reads."""
    parts = value if isinstance(value, tuple) else (value,)
    return frozenset[facts.Flag]().union(*(part.reads for part in parts))
