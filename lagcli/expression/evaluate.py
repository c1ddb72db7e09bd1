"""The walk over a tree with any algebra: floats, CasADi or SymPy symbols, or the facts about an expression. A value is
a scalar or a vector, a tuple of three scalars, whose operations are written out here once."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Collection, Sequence
from typing import Protocol, TypeAlias, TypeVar

from lagcli.errors import diagnostics
from lagcli.expression import functions, hints, tree
from lagcli.expression.tree import ExpressionError

S = TypeVar("S")
R = TypeVar("R")
Triple = tuple[S, S, S]
Value: TypeAlias = S | tuple[S, S, S]  # a vector or a scalar

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
    value; operation: one of `functions.ARITHMETIC`, or a function by its name in the model format."""

    def number(self, node: tree.Number) -> S: ...

    def atom(self, node: tree.Reference) -> Value[S]: ...

    def special(self, node: tree.Call) -> Value[S]: ...

    def operation(self, node: tree.Node, name: str, *parts: S) -> S: ...


def difference(relation: tree.Node, algebra: Algebra[S]) -> tuple[S, ...]:
    """left - right of an equation, as one scalar or three. A bare 0 may stand for the zero vector."""
    assert isinstance(relation, tree.Relation)
    left, right = value(relation.left, algebra), value(relation.right, algebra)
    if isinstance(right, tuple) and _is_zero(relation.left):
        return tuple(algebra.operation(relation, "neg", part) for part in right)
    result = left if _is_zero(relation.right) else _added(relation, algebra, "sub", left, right)
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


def value(node: tree.Node, algebra: Algebra[S], own: Collection[str] = ()) -> Value[S]:
    """The value of a tree; `own`: functions of this algebra alone, which `special` knows. Raises `ExpressionError`."""
    match node:
        case tree.Name() | tree.Member() | tree.Index():
            return algebra.atom(node)
        case tree.Product():
            return _product(node, algebra, own)
        case tree.Number():
            return algebra.number(node)
        case tree.Sum():
            sign, first = node.terms[0]
            total = value(first, algebra, own)
            if sign < 0:
                total = each(functools.partial(algebra.operation, node, "neg"), total)
            for sign, term in itertools.islice(node.terms, 1, None):
                added, name = value(term, algebra, own), "add" if sign > 0 else "sub"
                # A sum may be long, so that scalars take the short way. The spot is the added term.
                if isinstance(total, tuple) or isinstance(added, tuple):
                    total = _added(term, algebra, name, total, added)
                else:
                    total = algebra.operation(term, name, total, added)
            return total
        case tree.Call():
            return _call(node, algebra, own)
        case tree.Power():
            base, exponent = scalar(node.base, algebra, own), scalar(node.exponent, algebra, own)
            return algebra.operation(node, "pow", base, exponent)
        case tree.Component():
            inner = node.vector
            if isinstance(inner, tree.Reference) and inner.member and inner.start == node.start:
                # `a.v.x`, and not `(a.v).x`: points of bodies alone have two dots.
                hint = hints.second_dot(inner.owner, inner.member, node.member)
                message = "only one dot may follow a name"
                raise ExpressionError("syntax", message, inner.end, inner.end + 1, hint)
            owner = f"{inner.function}(...)" if isinstance(inner, tree.Call) else "(...)"
            return component(node, value(inner, algebra, own), node.member, owner)
        case tree.Vector():
            if len(node.components) != 3:
                message = f"a vector has three components, and this one has {len(node.components)}"
                hint = hints.vector(len(node.components))
                raise ExpressionError("vector-length", message, node.start, node.end, hint)
            x, y, z = (scalar(part, algebra, own) for part in node.components)
            return x, y, z
    raise ExpressionError("syntax", "an equation has no value", node.start, node.end)


def scalar(node: tree.Node, algebra: Algebra[S], own: Collection[str] = ()) -> S:
    """The value of a tree that must be a scalar."""
    found = value(node, algebra, own)
    if isinstance(found, tuple):
        message = "a scalar is needed here, and this is a vector"
        hint = "take a component such as `.x`, or `dot(u, w)`, `norm(u)`, `distance(u, w)`"
        raise ExpressionError("not-a-scalar", message, node.start, node.end, hint)
    return found


def vector(node: tree.Node, algebra: Algebra[S], own: Collection[str] = ()) -> Triple[S]:
    """The value of a tree that must be a vector."""
    found = value(node, algebra, own)
    if not isinstance(found, tuple):
        message = "a vector is needed here, and this is a scalar"
        hint = "a vector is written `[x, y, z]`"
        raise ExpressionError("not-a-vector", message, node.start, node.end, hint)
    return found[0], found[1], found[2]


def _added(node: tree.Node, algebra: Algebra[S], name: str, left: Value[S], right: Value[S]) -> Value[S]:
    """The sum or difference (`name`) of two scalars or two vectors."""
    if isinstance(left, tuple) and isinstance(right, tuple):
        x, y, z = (algebra.operation(node, name, u, w) for u, w in zip(left, right, strict=True))
        return x, y, z
    if isinstance(left, tuple) or isinstance(right, tuple):
        message = "a vector and a scalar cannot be added"
        hint = "a vector is written `[x, y, z]`"
        raise ExpressionError("vector-mismatch", message, node.start, node.end, hint)
    return algebra.operation(node, name, left, right)


def _product(node: tree.Product, algebra: Algebra[S], own: Collection[str]) -> Value[S]:
    total = value(node.factors[0][1], algebra, own)
    last = node.factors[-1][1]
    for exponent, factor in itertools.islice(node.factors, 1, None):
        spot = node if factor is last else tree.Node(node.start, factor.end)
        by, name = value(factor, algebra, own), "mul" if exponent > 0 else "div"
        if isinstance(by, tuple):
            if exponent < 0:
                message = "a division by a vector has no meaning"
                raise ExpressionError("vector-mismatch", message, spot.start, spot.end)
            if isinstance(total, tuple):
                message = "a product of two vectors has two meanings"
                hint = "write `dot(u, w)` or `cross(u, w)`"
                raise ExpressionError("vector-mismatch", message, spot.start, spot.end, hint)
            x, y, z = (algebra.operation(spot, name, part, total) for part in by)
            total = x, y, z
        elif isinstance(total, tuple):
            x, y, z = (algebra.operation(spot, name, part, by) for part in total)
            total = x, y, z
        else:
            total = algebra.operation(spot, name, total, by)
    return total


def _call(node: tree.Call, algebra: Algebra[S], own: Collection[str]) -> Value[S]:
    name, given = node.function, len(node.arguments)
    if name in own:
        return algebra.special(node)
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
        return algebra.special(node)
    if name in functions.TABLE:
        return algebra.operation(node, name, *(scalar(a, algebra, own) for a in node.arguments))
    done = functools.partial(algebra.operation, node)
    vectors: list[Sequence[S]] = [vector(argument, algebra, own) for argument in node.arguments]
    if name == "cross":
        (a, b, c), (x, y, z) = vectors
        minors = [(b, z, c, y), (c, x, a, z), (a, y, b, x)]
        x, y, z = (done("sub", done("mul", p, s), done("mul", q, r)) for p, s, q, r in minors)
        return x, y, z
    if name == "distance":
        vectors = [[done("sub", u, w) for u, w in zip(*vectors, strict=True)]]
    terms = [done("mul", u, w) for u, w in zip(vectors[0], vectors[-1], strict=True)]
    square = done("add", done("add", terms[0], terms[1]), terms[2])
    return square if name == "dot" else done("sqrt", square)


def unknown_function(node: tree.Call) -> ExpressionError:
    """The error for a function the format does not have."""
    end = node.start + len(node.function)
    hint = hints.unknown_function(node.function) or diagnostics.nearest(node.function, FUNCTION_NAMES)
    message = f"there is no function `{node.function}`"
    return ExpressionError("unknown-function", message, node.start, end, hint)
