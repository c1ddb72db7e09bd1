"""The walk over a tree with any algebra: floats, CasADi symbols, SymPy symbols, or the facts about an expression.

A value is a scalar of the algebra or a vector, a tuple of three scalars. Vector operations are written out
here once, in terms of the algebra's scalar operations.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

from lagcli import diagnostics
from lagcli.expression import tree
from lagcli.expression.tree import ExpressionError

S = TypeVar("S")

SCALAR_FUNCTIONS: dict[str, int] = {
    **dict.fromkeys(
        "sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs sign".split(), 1
    ),  # name: number of arguments
    "atan2": 2,
}
MANY_ARGUMENT_FUNCTIONS = ("min", "max")
VECTOR_FUNCTIONS: dict[str, int] = {"dot": 2, "cross": 2, "norm": 1, "distance": 2}
SPECIAL_FUNCTIONS = ("rate", "d", "multiplier", "reaction")

FUNCTION_NAMES = (*SCALAR_FUNCTIONS, *MANY_ARGUMENT_FUNCTIONS, *VECTOR_FUNCTIONS, *SPECIAL_FUNCTIONS)

COMPONENTS = ("x", "y", "z")


class Algebra(Protocol[S]):
    """What a set of scalars must offer. Every operation is told its node, so that errors can be located."""

    def number(self, node: tree.Number) -> S:
        """The value of a literal."""

    def atom(self, node: tree.Name | tree.Member | tree.Index) -> Any:
        """The scalar or vector a name stands for."""

    def special(self, node: tree.Call) -> Any:
        """`rate`, `d`, `multiplier`, `reaction`: functions of what is written, not of a value."""

    def add(self, node: tree.Node, left: S, sign: int, right: S) -> S:
        """left + sign right."""

    def negate(self, node: tree.Node, value: S) -> S:
        """-value."""

    def multiply(self, node: tree.Node, left: S, right: S) -> S:
        """left right."""

    def divide(self, node: tree.Node, left: S, right: S) -> S:
        """left / right."""

    def power(self, node: tree.Node, base: S, exponent: S) -> S:
        """base ** exponent."""

    def function(self, node: tree.Node, name: str, arguments: tuple[S, ...]) -> S:
        """A scalar function, by its name in the model format."""


def evaluate(node: tree.Node, algebra: Algebra[S]) -> Any:
    """The value of a tree: a scalar, or a tuple of three for a vector. Raises `ExpressionError`."""
    return _Walk(algebra).value(node)


def scalar(node: tree.Node, algebra: Algebra[S]) -> S:
    """The value of a tree that must be a scalar."""
    return _Walk(algebra).scalar(node)


def vector(node: tree.Node, algebra: Algebra[S]) -> tuple[S, S, S]:
    """The value of a tree that must be a vector."""
    return _Walk(algebra).vector(node)


def difference(relation: tree.Relation, algebra: Algebra[S]) -> tuple[S, ...]:
    """left - right of an equation, as one scalar or three. A bare 0 may stand for the zero vector."""
    walk = _Walk(algebra)
    left, right = walk.value(relation.left), walk.value(relation.right)
    if isinstance(left, tuple) and _is_zero(relation.right):
        return left
    if isinstance(right, tuple) and _is_zero(relation.left):
        return tuple(algebra.negate(relation, v) for v in right)
    result = walk.add(relation, left, -1, right) if not _is_zero(relation.right) else left
    return result if isinstance(result, tuple) else (result,)


def component(node: tree.Node, value: Any, member: str, owner: str) -> Any:
    """`.x`, `.y` or `.z` of a vector."""
    if member not in COMPONENTS:
        message = f"`{owner}` has no component `{member}`"
        raise ExpressionError("unknown-component", message, node.start, node.end, "components are `.x` `.y` `.z`")
    if not isinstance(value, tuple):
        message = f"`{owner}` is a scalar and has no component `{member}`"
        raise ExpressionError("not-a-vector", message, node.start, node.end)
    return value[COMPONENTS.index(member)]


def _is_zero(node: tree.Node) -> bool:
    return isinstance(node, tree.Number) and float(node.text) == 0.0


class _Walk:
    def __init__(self, algebra: Algebra[Any]) -> None:
        self._algebra = algebra

    def value(self, node: tree.Node) -> Any:
        match node:
            case tree.Number():
                return self._algebra.number(node)
            case tree.Name() | tree.Member() | tree.Index():
                return self._algebra.atom(node)
            case tree.Sum():
                return self._sum(node)
            case tree.Product():
                return self._product(node)
            case tree.Power():
                return self._algebra.power(node, self.scalar(node.base), self.scalar(node.exponent))
            case tree.Vector():
                return self._vector_literal(node)
            case tree.Call():
                return self._call(node)
            case _:
                raise ExpressionError("syntax", "an equation has no value", node.start, node.end)

    def scalar(self, node: tree.Node) -> Any:
        value = self.value(node)
        if isinstance(value, tuple):
            message = "a scalar is needed here, and this is a vector"
            hint = "take a component such as `.x`, or `dot(u, w)`, `norm(u)`, `distance(u, w)`"
            raise ExpressionError("not-a-scalar", message, node.start, node.end, hint)
        return value

    def vector(self, node: tree.Node) -> tuple[Any, Any, Any]:
        value = self.value(node)
        if not isinstance(value, tuple):
            message = "a vector is needed here, and this is a scalar"
            raise ExpressionError("not-a-vector", message, node.start, node.end, "a vector is written `[x, y, z]`")
        return value[0], value[1], value[2]

    def add(self, node: tree.Node, left: Any, sign: int, right: Any) -> Any:
        algebra = self._algebra
        if isinstance(left, tuple) != isinstance(right, tuple):
            message = "a vector and a scalar cannot be added"
            raise ExpressionError("vector-mismatch", message, node.start, node.end, "a vector is written `[x, y, z]`")
        if isinstance(left, tuple):
            return tuple(algebra.add(node, u, sign, w) for u, w in zip(left, right, strict=True))
        return algebra.add(node, left, sign, right)

    def _sum(self, node: tree.Sum) -> Any:
        sign, first = node.terms[0]
        total = self.value(first)
        if sign < 0:
            if isinstance(total, tuple):
                total = tuple(self._algebra.negate(node, u) for u in total)
            else:
                total = self._algebra.negate(node, total)
        for sign, term in node.terms[1:]:
            total = self.add(tree.Node(node.start, term.end), total, sign, self.value(term))
        return total

    def _product(self, node: tree.Product) -> Any:
        total = self.value(node.factors[0][1])
        for exponent, factor in node.factors[1:]:
            spot = tree.Node(node.start, factor.end)
            value = self.value(factor)
            if exponent < 0:
                if isinstance(value, tuple):
                    raise ExpressionError("vector-mismatch", "a division by a vector has no meaning", spot.start, spot.end)
                total = self._scaled(spot, total, value, self._algebra.divide)
            elif isinstance(value, tuple) and not isinstance(total, tuple):
                total = self._scaled(spot, value, total, self._algebra.multiply)
            elif isinstance(value, tuple):
                hint = "write `dot(u, w)` or `cross(u, w)`"
                message = "a product of two vectors has two meanings"
                raise ExpressionError("vector-mismatch", message, spot.start, spot.end, hint)
            else:
                total = self._scaled(spot, total, value, self._algebra.multiply)
        return total

    @staticmethod
    def _scaled(node: tree.Node, value: Any, by: Any, operation: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(operation(node, u, by) for u in value)
        return operation(node, value, by)

    def _vector_literal(self, node: tree.Vector) -> tuple[Any, ...]:
        if len(node.components) != 3:
            message = f"a vector has three components, and this one has {len(node.components)}"
            raise ExpressionError("vector-length", message, node.start, node.end)
        return tuple(self.scalar(part) for part in node.components)

    def _call(self, node: tree.Call) -> Any:
        name = node.function
        if name in SPECIAL_FUNCTIONS:
            self._count(node, 1)
            return self._algebra.special(node)
        if name in VECTOR_FUNCTIONS:
            self._count(node, VECTOR_FUNCTIONS[name])
            return self._vector_function(node, name, [self.vector(a) for a in node.arguments])
        if name in SCALAR_FUNCTIONS:
            self._count(node, SCALAR_FUNCTIONS[name])
            return self._algebra.function(node, name, tuple(self.scalar(a) for a in node.arguments))
        if name in MANY_ARGUMENT_FUNCTIONS:
            if not node.arguments:
                self._count(node, 2)
            return self._algebra.function(node, name, tuple(self.scalar(a) for a in node.arguments))
        raise unknown_function(node)

    @staticmethod
    def _count(node: tree.Call, expected: int) -> None:
        if len(node.arguments) != expected:
            plural = "argument" if expected == 1 else "arguments"
            message = f"`{node.function}` takes {expected} {plural}, and {len(node.arguments)} stand here"
            raise ExpressionError("wrong-arguments", message, node.start, node.end)

    def _vector_function(self, node: tree.Node, name: str, vectors: list[tuple[Any, Any, Any]]) -> Any:
        algebra = self._algebra
        if name == "dot":
            return self._dot(node, *vectors)
        if name == "norm":
            return algebra.function(node, "sqrt", (self._dot(node, vectors[0], vectors[0]),))
        if name == "distance":
            u = self.add(node, vectors[0], -1, vectors[1])
            return algebra.function(node, "sqrt", (self._dot(node, u, u),))
        (a, b, c), (x, y, z) = vectors
        minor = lambda p, q, r, s: algebra.add(node, algebra.multiply(node, p, s), -1, algebra.multiply(node, q, r))
        return minor(b, c, y, z), minor(c, a, z, x), minor(a, b, x, y)

    def _dot(self, node: tree.Node, u: tuple[Any, Any, Any], w: tuple[Any, Any, Any]) -> Any:
        algebra = self._algebra
        terms = [algebra.multiply(node, a, b) for a, b in zip(u, w, strict=True)]
        return algebra.add(node, algebra.add(node, terms[0], 1, terms[1]), 1, terms[2])


def unknown_function(node: tree.Call) -> ExpressionError:
    """The error for a function the format does not have."""
    end = node.start + len(node.function)
    hint = diagnostics.nearest(node.function, FUNCTION_NAMES)
    return ExpressionError("unknown-function", f"there is no function `{node.function}`", node.start, end, hint)
