"""The nodes of an expression.

Sums and products hold any number of terms, so that a sum of a hundred thousand terms is one node and a tree
is never deeper than its parentheses. `start` and `end` are offsets in the expression's text.
Nodes are never changed once made. They are not declared frozen because making a frozen one costs three times
as much, and that is most of the time in which a long sum is read.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator


class ExpressionError(Exception):
    """Something is wrong with an expression: code, message, hint, and the offsets of the spot."""

    def __init__(self, code: str, message: str, start: int, end: int, hint: str = "") -> None:
        super().__init__(message)
        self.code, self.message, self.hint = code, message, hint
        self.start, self.end = start, end


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Node:
    """Characters `start` to `end` of the expression."""

    start: int
    end: int


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Number(Node):
    """A decimal number; `text` keeps it exact for exact algebras."""

    text: str


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Name(Node):
    """A name that stands alone: parameter, coordinate, particle, definition, `t`, `pi` ..."""

    name: str


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Member(Node):
    """`owner.member`, such as `a.x` or `a.v`."""

    owner: str
    member: str


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Index(Node):
    """`owner[i][j]` or `owner[i].member`: a member of a family."""

    owner: str
    indices: tuple[Node, ...]
    member: str


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Call(Node):
    """`function(arguments)`."""

    function: str
    arguments: tuple[Node, ...]


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Sum(Node):
    """Terms added (sign +1) or subtracted (sign -1); a single negative term is a negation."""

    terms: tuple[tuple[int, Node], ...]


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Product(Node):
    """Factors multiplied (exponent +1) or divided by (exponent -1), from left to right."""

    factors: tuple[tuple[int, Node], ...]


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Power(Node):
    """`base ** exponent`."""

    base: Node
    exponent: Node


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Vector(Node):
    """`[x, y, z]`."""

    components: tuple[Node, ...]


@dataclasses.dataclass(slots=True, unsafe_hash=True)
class Relation(Node):
    """`left relation right`, where relation is `=`, `>=` or `<=`; only at the top of an entry."""

    left: Node
    relation: str
    right: Node


def children(node: Node) -> tuple[Node, ...]:
    """The nodes directly below `node`."""
    match node:
        case Call():
            return node.arguments
        case Sum():
            return tuple(term for _, term in node.terms)
        case Product():
            return tuple(factor for _, factor in node.factors)
        case Power():
            return node.base, node.exponent
        case Vector():
            return node.components
        case Relation():
            return node.left, node.right
        case Index():
            return node.indices
        case _:
            return ()


def walk(node: Node) -> Iterator[Node]:
    """All nodes of the tree, parents first, without recursion."""
    stack = [node]
    while stack:
        top = stack.pop()
        yield top
        stack.extend(reversed(children(top)))


def names(node: Node) -> set[str]:
    """The names an expression refers to (functions are no names)."""
    found = set()
    for part in walk(node):
        if isinstance(part, Name):
            found.add(part.name)
        elif isinstance(part, (Member, Index)):
            found.add(part.owner)
    return found
