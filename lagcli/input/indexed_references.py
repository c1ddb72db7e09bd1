"""References with indices: `p[i-1]` -> the numbers of the members it stands for, one for each member that asks."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from lagcli.expression import integers, tree
from lagcli.expression.tree import ExpressionError
from lagcli.input import namespace
from lagcli.input.namespace import Namespace
from lagcli.model import family
from lagcli.model.family import Integers, MemberIndex, MissingMember


class Indexed:
    """Finds members by integer expressions of parameters and index variables.

    `structure`: the parameters these have used, with their values: they decide which members there are and
    which of them an expression speaks of.
    """

    def __init__(self, names: Namespace) -> None:
        self._names = names
        self.structure: dict[str, float] = {}

    def integer_lookup(self, variables: Mapping[str, Integers]) -> Callable[[tree.Name], float | Integers]:
        """The lookup in an integer expression: parameters and index variables."""
        names = self._names

        def lookup(node: tree.Name) -> float | Integers:
            if node.name in variables:
                return variables[node.name]
            kind = names.kind(node.name)
            if kind is None:
                raise names.unknown(node, node.name, "parameter", variables)
            if kind != "parameter":
                rule = "bounds and indices are integer expressions of parameters"
                message = f"{rule}, and `{node.name}` is {namespace.article(kind)}"
                raise ExpressionError("not-a-whole-number", message, node.start, node.end)
            names.value(node, node.name)
            value = names.constant(node.name)
            if isinstance(value, tuple):
                message = f"an index is a number, and `{node.name}` is a vector"
                raise ExpressionError("not-a-whole-number", message, node.start, node.end)
            assert isinstance(value, float)
            self.structure[node.name] = value
            return float(value)

        return lookup

    def numbers(self, node: tree.Name | tree.Index, variables: Mapping[str, Integers]) -> Integers:
        """The numbers of the particles or generalized coordinates a reference stands for, (1,) or (K,).

        The base name must be one of a particle or coordinate. Raises `ExpressionError`.
        """
        base = node.owner if isinstance(node, tree.Index) else node.name
        kind = self._names.kind(base)
        assert kind in namespace.NUMBERED, base
        if self._names.is_broken(base):
            raise namespace.broken(node)
        if isinstance(node, tree.Name):
            return self._names.member_indices[kind].find(base, ())
        return self.find(node, self._names.member_indices[kind], self._names.is_family(base), variables)

    def find(
        self, node: tree.Index, member_index: MemberIndex, is_family: bool, variables: Mapping[str, Integers]
    ) -> Integers:
        """The numbers in `member_index` of the members an index stands for. Raises `ExpressionError`."""
        base = node.owner
        if not is_family:
            message = f"`{base}` is no family and has no members"
            is_particle = self._names.kind(base) == "particle"
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
            raise ExpressionError(
                "no-such-member", message, node.start, node.end, hint, member=member
            ) from None
