"""The names of constraints, and what `multiplier(...)` of them is: a scalar, a vector or a row of a rigid body."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Literal

from lagcli.errors import diagnostics
from lagcli.expression import evaluate, tree
from lagcli.expression.facts import Either, Facts
from lagcli.expression.tree import ExpressionError
from lagcli.input import namespace
from lagcli.input.indexed_references import Indexed
from lagcli.input.namespace import Namespace
from lagcli.model.family import Family, Integers, MemberIndex

Shape = Literal["scalar", "vector", "body"]

RESULT = Facts(None, frozenset(("result",)))


@dataclasses.dataclass(slots=True)
class LawShape:
    """The entries of a constraint name: what each is, and that none of them is broken."""

    is_family: bool
    shapes: list[Shape] = dataclasses.field(default_factory=list)
    is_broken: bool = False


class LawNames:
    """The constraints of one model, which have a namespace of their own."""

    def __init__(self, names: Namespace, indexed: Indexed) -> None:
        self._names, self._indexed = names, indexed
        self._laws: dict[str, LawShape] = {}
        self._member_index = MemberIndex()
        self._shapes: list[Shape] = []  # of the entries of the roll

    def __contains__(self, base: str) -> bool:
        return base in self._laws

    def take(self, base: str, is_family: bool) -> None:
        """Take the name of a constraint."""
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

    def multiplier(self, argument: tree.Node, variables: Mapping[str, Integers]) -> Either:
        """The facts of `multiplier(argument)`. Raises `ExpressionError`."""
        name, shapes = self._shapes_of(argument, variables, "multiplier(...)")
        return _facts(argument, name, shapes) if shapes else RESULT

    def force(self, argument: tree.Node, variables: Mapping[str, Integers]) -> None:
        """Check the constraint of `reaction(a, argument)`, whole or one of its rows. Raises `ExpressionError`."""
        name, shapes = self._shapes_of(argument, variables, "reaction(a, ...)")
        if shapes and isinstance(argument, (tree.Member, tree.Index)) and argument.member:
            _facts(argument, name, shapes, "reaction(a, ...)")

    def _shapes_of(
        self, argument: tree.Node, variables: Mapping[str, Integers], call: str
    ) -> tuple[str, set[Shape]]:
        """The name of a constraint and what its entries are; of laws that are not read yet none.

        Where these are asked for no result is allowed, and that is reported.
        """
        name = str(getattr(argument, "owner", getattr(argument, "name", "")))
        law = self._laws.get(name)
        if law is not None and law.is_broken:
            raise namespace.broken(argument)
        if law is None or not isinstance(argument, (tree.Name, tree.Member, tree.Index)):
            hint = diagnostics.nearest(name, self._laws)
            if not hint and self._laws:
                hint = "the constraints are " + diagnostics.listed(self._laws)
            where = "as its second argument " if "," in call else ""
            message = f"`{call}` takes {where}the name of a constraint"
            raise ExpressionError("unknown-constraint", message, argument.start, argument.end, hint)
        if not law.shapes:
            return name, set()
        if law.is_family and not isinstance(argument, tree.Index):
            raise self._names.bare(argument, name)
        shapes: set[Shape] = set(law.shapes)
        if isinstance(argument, tree.Index):
            numbers = self._indexed.find(argument, self._member_index, law.is_family, variables)
            shapes = {
                self._shapes[entry] for entry in set(self._member_index.entries(numbers).tolist())
            } or shapes
        return name, shapes


def _facts(argument: tree.Node, name: str, shapes: set[Shape], call: str = "multiplier(...)") -> Either:
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
    message = f"the constraint `{name}` has no row `{member}`"
    hint = {"scalar": f"it has one row: write `{call.replace('...', name)}`"}.get(
        shape, f"its rows are `{name}.x`, `{name}.y`, `{name}.z`"
    )
    if shape == "body":
        hint = f"its rows are numbered: `{name}.1`, `{name}.2`, ..."
    raise ExpressionError("unknown-constraint", message, argument.start, argument.end, hint)
