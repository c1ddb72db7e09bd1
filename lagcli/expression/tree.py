"""The nodes of an expression.

Sums and products hold any number of terms, so that a tree is never deeper than its parentheses. `start` and `end` are
offsets in the text. Nodes are never changed, and not declared frozen, which costs three times as much to make.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator


class ExpressionError(Exception):
    """Something is wrong with an expression: code, message, hint, and the offsets of the spot. `member` is, for an
    expression over a family, the first member (from 0) that it is wrong for."""

    def __init__(
        self, code: str, message: str, start: int, end: int, hint: str = "", *, member: int | None = None
    ) -> None:
        super().__init__(message)
        self.code, self.message, self.hint = code, message, hint
        self.start, self.end = start, end
        self.member = member


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Node:
    """Characters `start` to `end` of the expression. Methods are shared: they are slow to make at import."""

    start: int
    end: int

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self._parts() == other._parts()

    def __hash__(self) -> int:
        return hash(self._parts())

    def __repr__(self) -> str:
        return f"{type(self).__name__}{self._parts()}"

    def _parts(self) -> tuple[object, ...]:
        return tuple(getattr(self, field.name) for field in dataclasses.fields(self))


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Number(Node):
    """A decimal number; `text` keeps it exact for exact algebras."""

    text: str


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Name(Node):
    """A name that stands alone: parameter, coordinate, particle, definition, `t`, `pi` ..."""

    name: str
    indices = ()
    member = ""

    @property
    def owner(self) -> str:
        return self.name


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Member(Node):
    """`owner.member`, such as `a.x` or `a.v`."""

    owner: str
    member: str
    indices = ()


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Index(Node):
    """`owner[i][j]` or `owner[i].member`: a member of a family."""

    owner: str
    indices: tuple[Node, ...]
    member: str


Reference = Name | Member | Index


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Call(Node):
    """`function(arguments)`."""

    function: str
    arguments: tuple[Node, ...]


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Component(Node):
    """`reaction(a).x` or `(a - b).x`: a component of a vector that is not a name."""

    vector: Node
    member: str


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Sum(Node):
    """Terms added (sign +1) or subtracted (sign -1); a single negative term is a negation."""

    terms: tuple[tuple[int, Node], ...]


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Product(Node):
    """Factors multiplied (exponent +1) or divided by (exponent -1), from left to right."""

    factors: tuple[tuple[int, Node], ...]


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Power(Node):
    """`base ** exponent`."""

    base: Node
    exponent: Node


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Vector(Node):
    """`[x, y, z]`."""

    components: tuple[Node, ...]


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Relation(Node):
    """`left relation right`, where relation is `=`, `>=` or `<=`; only at the top of an entry."""

    left: Node
    relation: str
    right: Node


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Range(Node):
    """`name = low .. high`: the values of an index, both bounds included; only at the top of a `for`."""

    name: str
    low: Node
    high: Node


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class ComparisonNode(Node):
    """`a < b <= c`: operands with a relation between each two; only in a filter, as all that follow."""

    operands: tuple[Node, ...]
    relations: tuple[str, ...]


@dataclasses.dataclass(slots=True, eq=False, repr=False)
class Logical(Node):
    """`not` of a comparison, or two and more that are joined with `and` or `or`."""

    word: str
    parts: tuple[Node, ...]


_CHILDREN: dict[type[Node], Callable[..., tuple[Node, ...]]] = {
    Call: lambda node: node.arguments,
    Sum: lambda node: tuple(term for _, term in node.terms),
    Product: lambda node: tuple(factor for _, factor in node.factors),
    Power: lambda node: (node.base, node.exponent),
    Component: lambda node: (node.vector,),
    Vector: lambda node: node.components,
    Relation: lambda node: (node.left, node.right),
    Index: lambda node: node.indices,
    Range: lambda node: (node.low, node.high),
    ComparisonNode: lambda node: node.operands,
    Logical: lambda node: node.parts,
}


def children(node: Node) -> tuple[Node, ...]:
    """The nodes directly below `node`."""
    below = _CHILDREN.get(type(node))
    return below(node) if below else ()


def mapped(node: Node, change: Callable[[Node], Node]) -> Node:
    """The node with other nodes directly below it."""
    if type(node) not in _CHILDREN:
        return node
    make: Callable[..., Node] = type(node)
    return make(*(_mapped(getattr(node, field.name), change) for field in dataclasses.fields(node)))


def _mapped(value: object, change: Callable[[Node], Node]) -> object:
    """A part of a node: a node, several, pairs with one, or what is none."""
    if isinstance(value, Node):
        return change(value)
    return tuple(_mapped(part, change) for part in value) if isinstance(value, tuple) else value


def walk(node: Node) -> Iterator[Node]:
    """All nodes of the tree, parents first, without recursion."""
    stack = [node]
    while stack:
        top = stack.pop()
        yield top
        stack.extend(reversed(children(top)))


def names(node: Node) -> set[str]:
    """The names an expression refers to (functions are no names)."""
    return {part.owner for part in walk(node) if isinstance(part, Reference)}


def words(node: Node) -> frozenset[str]:
    """The words of an expression: the names it refers to, `.member` and `function(`; `**` where a power is not known to
    be whole, and `/` where something is divided by what is no number, or has a power below zero."""
    found: set[str] = set()
    for part in walk(node):
        if isinstance(part, Name):
            found.add(part.name)
        elif isinstance(part, Reference):
            found.update((part.owner, f".{part.member}"))
        elif isinstance(part, Call):
            found.add(f"{part.function}(")
        elif isinstance(part, Power):
            exponent = part.exponent
            terms = exponent.terms if isinstance(exponent, Sum) else ((1, exponent),)
            sign, size = terms[0]
            if len(terms) == 1 and sign < 0:
                found.add("/")
            if len(terms) > 1 or not isinstance(size, Number) or not size.text.isdigit():
                found.add("**")
        elif isinstance(part, Component):
            found.add(f".{part.member}")
        elif isinstance(part, Product) and any(
            sign < 0 and not isinstance(factor, Number) for sign, factor in part.factors
        ):
            found.add("/")
    return frozenset(found)
