"""The walk over a tree with any algebra: floats, CasADi or SymPy symbols, or the facts about an expression. A value is
a scalar or a vector, a tuple of three scalars, whose operations are written out here once."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Collection
from typing import Generic, Protocol, TypeAlias, TypeVar

from lagcli.errors import diagnostics
from lagcli.expression import functions, hints, tree
from lagcli.expression.functions import Number
from lagcli.expression.tree import ExpressionError

S = TypeVar("S")
R = TypeVar("R")
Triple = tuple[S, S, S]
Value: TypeAlias = S | tuple[S, S, S]  # a vector or a scalar
Operation = Callable[[tree.Node, S, S], S]

VECTOR_FUNCTIONS: dict[str, int] = {"dot": 2, "cross": 2, "norm": 1, "distance": 2}
# Functions of what is written: the least and the largest number of arguments.
SPECIAL_FUNCTIONS: dict[str, tuple[int, int]] = {
    "rate": (1, 2),
    "d": (1, 1),
    "multiplier": (1, 1),
    "reaction": (1, 2),
}

FUNCTION_NAMES = (*functions.TABLE, *VECTOR_FUNCTIONS, *SPECIAL_FUNCTIONS)

COMPONENTS = ("x", "y", "z")


class Algebra(Protocol[S]):
    """A set of scalars with their operations. Each is told its node, so that errors can be located. atom: the scalar or
    vector a name stands for; special: `rate`, `d`, `multiplier`, `reaction`, functions of what is written and not of a
    value; add: left + sign right; power: base ** exponent; function: by its name in the model format."""

    def number(self, node: tree.Number) -> S: ...

    def atom(self, node: tree.Reference) -> Value[S]: ...

    def special(self, node: tree.Call) -> Value[S]: ...

    def add(self, node: tree.Node, left: S, sign: int, right: S) -> S: ...

    def negate(self, node: tree.Node, value: S) -> S: ...

    def multiply(self, node: tree.Node, left: S, right: S) -> S: ...

    def divide(self, node: tree.Node, left: S, right: S) -> S: ...

    def power(self, node: tree.Node, base: S, exponent: S) -> S: ...

    def function(self, node: tree.Node, name: str, arguments: tuple[S, ...]) -> S: ...


def value(node: tree.Node, algebra: Algebra[S]) -> Value[S]:
    """The value of a tree: a scalar, or a tuple of three for a vector. Raises `ExpressionError`."""
    return _Walk(algebra).value(node)


def scalar(node: tree.Node, algebra: Algebra[S], own: Collection[str] = ()) -> S:
    """The value of a tree that must be a scalar; `own`: functions of this algebra alone, which `special` knows."""
    return _Walk(algebra, own).scalar(node)


def vector(node: tree.Node, algebra: Algebra[S]) -> Triple[S]:
    """The value of a tree that must be a vector."""
    return _Walk(algebra).vector(node)


def difference(relation: tree.Node, algebra: Algebra[S]) -> tuple[S, ...]:
    """left - right of an equation, as one scalar or three. A bare 0 may stand for the zero vector."""
    assert isinstance(relation, tree.Relation)
    walk = _Walk(algebra)
    left, right = walk.value(relation.left), walk.value(relation.right)
    if isinstance(left, tuple) and _is_zero(relation.right):
        return left
    if isinstance(right, tuple) and _is_zero(relation.left):
        return tuple(algebra.negate(relation, v) for v in right)
    result = walk.add(relation, left, -1, right) if not _is_zero(relation.right) else left
    return result if isinstance(result, tuple) else (result,)


def each(function: Callable[[S], R], value: Value[S]) -> Value[R]:
    """A function of a scalar, or of each component of a vector."""
    if isinstance(value, tuple):
        x, y, z = map(function, value)
        return x, y, z
    return function(value)


def component(node: tree.Node, value: Value[S], member: str, owner: str) -> S:
    """`.x`, `.y` or `.z` of a vector."""
    if member not in COMPONENTS:
        message = f"`{owner}` has no component `{member}`"
        raise ExpressionError(
            "unknown-component", message, node.start, node.end, "components are `.x` `.y` `.z`"
        )
    if not isinstance(value, tuple):
        message = f"`{owner}` is a scalar and has no component `{member}`"
        raise ExpressionError("not-a-vector", message, node.start, node.end)
    return value[COMPONENTS.index(member)]


def _is_zero(node: tree.Node) -> bool:
    return isinstance(node, tree.Number) and float(node.text) == 0.0


class _Walk(Generic[S]):
    def __init__(self, algebra: Algebra[S], own: Collection[str] = ()) -> None:
        self._algebra, self._own = algebra, own

    def value(self, node: tree.Node) -> Value[S]:
        match node:
            case tree.Name() | tree.Member() | tree.Index():
                return self._algebra.atom(node)
            case tree.Product():
                return self._product(node)
            case tree.Number():
                return self._algebra.number(node)
            case tree.Sum():
                return self._sum(node)
            case tree.Call():
                return self._call(node)
            case tree.Power():
                return self._algebra.power(node, self.scalar(node.base), self.scalar(node.exponent))
            case tree.Component():
                vector = node.vector
                owner = f"{vector.function}(...)" if isinstance(vector, tree.Call) else "(...)"
                return component(node, self.value(vector), node.member, owner)
            case tree.Vector():
                if len(node.components) != 3:
                    message = f"a vector has three components, and this one has {len(node.components)}"
                    hint = hints.vector(len(node.components))
                    raise ExpressionError("vector-length", message, node.start, node.end, hint)
                x, y, z = map(self.scalar, node.components)
                return x, y, z
        raise ExpressionError("syntax", "an equation has no value", node.start, node.end)

    def scalar(self, node: tree.Node) -> S:
        value = self.value(node)
        if isinstance(value, tuple):
            message = "a scalar is needed here, and this is a vector"
            hint = "take a component such as `.x`, or `dot(u, w)`, `norm(u)`, `distance(u, w)`"
            raise ExpressionError("not-a-scalar", message, node.start, node.end, hint)
        return value

    def vector(self, node: tree.Node) -> Triple[S]:
        value = self.value(node)
        if not isinstance(value, tuple):
            message = "a vector is needed here, and this is a scalar"
            hint = "a vector is written `[x, y, z]`"
            raise ExpressionError("not-a-vector", message, node.start, node.end, hint)
        return value[0], value[1], value[2]

    def add(self, node: tree.Node, left: Value[S], sign: int, right: Value[S]) -> Value[S]:
        if isinstance(left, tuple) and isinstance(right, tuple):
            return self._vector_sum(node, left, sign, right)
        if isinstance(left, tuple) or isinstance(right, tuple):
            message = "a vector and a scalar cannot be added"
            hint = "a vector is written `[x, y, z]`"
            raise ExpressionError("vector-mismatch", message, node.start, node.end, hint)
        return self._algebra.add(node, left, sign, right)

    def _vector_sum(self, node: tree.Node, left: Triple[S], sign: int, right: Triple[S]) -> Triple[S]:
        x, y, z = (self._algebra.add(node, u, sign, w) for u, w in zip(left, right, strict=True))
        return x, y, z

    def _sum(self, node: tree.Sum) -> Value[S]:
        sign, first = node.terms[0]
        total = self.value(first)
        if sign < 0:
            total = each(functools.partial(self._algebra.negate, node), total)
        plain = self._algebra.add
        for sign, term in itertools.islice(node.terms, 1, None):
            value = self.value(term)
            # A sum may be long, so that scalars are not sent through `add`. The spot is the added term.
            if isinstance(total, tuple) or isinstance(value, tuple):
                total = self.add(term, total, sign, value)
            else:
                total = plain(term, total, sign, value)
        return total

    def _product(self, node: tree.Product) -> Value[S]:
        algebra = self._algebra
        total = self.value(node.factors[0][1])
        last = node.factors[-1][1]
        for exponent, factor in itertools.islice(node.factors, 1, None):
            spot = node if factor is last else tree.Node(node.start, factor.end)
            value = self.value(factor)
            if not isinstance(value, tuple):
                total = self._scaled(spot, total, value, algebra.multiply if exponent > 0 else algebra.divide)
            elif exponent < 0:
                message = "a division by a vector has no meaning"
                raise ExpressionError("vector-mismatch", message, spot.start, spot.end)
            elif isinstance(total, tuple):
                message = "a product of two vectors has two meanings"
                hint = "write `dot(u, w)` or `cross(u, w)`"
                raise ExpressionError("vector-mismatch", message, spot.start, spot.end, hint)
            else:
                total = self._scaled(spot, value, total, algebra.multiply)
        return total

    @staticmethod
    def _scaled(node: tree.Node, value: Value[S], by: S, operation: Operation[S]) -> Value[S]:
        if isinstance(value, tuple):
            x, y, z = (operation(node, u, by) for u in value)
            return x, y, z
        return operation(node, value, by)

    def _call(self, node: tree.Call) -> Value[S]:
        name, given = node.function, len(node.arguments)
        if name in self._own:
            return self._algebra.special(node)
        if name in SPECIAL_FUNCTIONS:
            least, most = SPECIAL_FUNCTIONS[name]
        elif name in VECTOR_FUNCTIONS:
            least = most = VECTOR_FUNCTIONS[name]
        elif name in functions.TABLE:
            # One argument of many is enough, and two are asked for where there is none.
            least = most = functions.TABLE[name].arguments or given or 2
        else:
            raise unknown_function(node)
        if not least <= given <= most:
            plural = "argument" if most == 1 else "arguments"
            wanted = f"{least}" if least == most else f"{least} or {most}"
            counted = {0: "none was", 1: "1 was"}.get(given, f"{given} were")
            message = f"`{name}` takes {wanted} {plural}, but {counted} given"
            hint = diagnostics.meant("arguments of functions").get(name, "")
            raise ExpressionError("wrong-arguments", message, node.start, node.end, hint)
        if name in SPECIAL_FUNCTIONS:
            return self._algebra.special(node)
        if name in VECTOR_FUNCTIONS:
            return self._vector_function(node, name, [self.vector(a) for a in node.arguments])
        return self._algebra.function(node, name, tuple(self.scalar(a) for a in node.arguments))

    def _vector_function(self, node: tree.Node, name: str, vectors: list[Triple[S]]) -> Value[S]:
        algebra = self._algebra
        if name == "dot":
            return self._dot(node, *vectors)
        if name == "norm":
            return algebra.function(node, "sqrt", (self._dot(node, vectors[0], vectors[0]),))
        if name == "distance":
            u = self._vector_sum(node, vectors[0], -1, vectors[1])
            return algebra.function(node, "sqrt", (self._dot(node, u, u),))
        (a, b, c), (x, y, z) = vectors

        def minor(p: S, q: S, r: S, s: S) -> S:
            return algebra.add(node, algebra.multiply(node, p, s), -1, algebra.multiply(node, q, r))

        return minor(b, c, y, z), minor(c, a, z, x), minor(a, b, x, y)

    def _dot(self, node: tree.Node, u: Triple[S], w: Triple[S]) -> S:
        algebra = self._algebra
        terms = [algebra.multiply(node, a, b) for a, b in zip(u, w, strict=True)]
        return algebra.add(node, algebra.add(node, terms[0], 1, terms[1]), 1, terms[2])


def unknown_function(node: tree.Call) -> ExpressionError:
    """The error for a function the format does not have."""
    end = node.start + len(node.function)
    hint = hints.unknown_function(node.function) or diagnostics.nearest(node.function, FUNCTION_NAMES)
    message = f"there is no function `{node.function}`"
    return ExpressionError("unknown-function", message, node.start, end, hint)


class Operators:
    """The arithmetic of `evaluate.Algebra` by the operators of the scalars."""

    def add(self, node: tree.Node, left: Number, sign: int, right: Number) -> Number:
        return left + right if sign > 0 else left - right

    def negate(self, node: tree.Node, value: Number) -> Number:
        return -value

    def multiply(self, node: tree.Node, left: Number, right: Number) -> Number:
        return left * right

    def divide(self, node: tree.Node, left: Number, right: Number) -> Number:
        return left / right
