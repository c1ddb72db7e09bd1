"""A formula as it stands on paper: nodes without meaning, which every renderer can write."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True, slots=True)
class Node:
    """Anything that can stand on paper."""


@dataclasses.dataclass(frozen=True, slots=True)
class Sign(Node):
    """A letter or word with `sub`scripts and `dots` above it; `vector` is printed bold where there is bold type."""

    base: str
    sub: tuple[str, ...] = ()
    dots: int = 0
    vector: bool = False


@dataclasses.dataclass(frozen=True, slots=True)
class Number(Node):
    """Digits as they are printed."""

    text: str


@dataclasses.dataclass(frozen=True, slots=True)
class Words(Node):
    """Plain words in a formula."""

    text: str


@dataclasses.dataclass(frozen=True, slots=True)
class Sum(Node):
    """Terms with their signs, +1 or -1."""

    terms: tuple[tuple[int, Node], ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Product(Node):
    """Factors side by side; sums among them get parentheses."""

    factors: tuple[Node, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Fraction(Node):
    """above / below."""

    above: Node
    below: Node


@dataclasses.dataclass(frozen=True, slots=True)
class Power(Node):
    """base to the exponent."""

    base: Node
    exponent: Node


@dataclasses.dataclass(frozen=True, slots=True)
class Root(Node):
    """A square root."""

    inner: Node


@dataclasses.dataclass(frozen=True, slots=True)
class Bars(Node):
    """|inner|, an absolute value or the length of a vector."""

    inner: Node


@dataclasses.dataclass(frozen=True, slots=True)
class Apply(Node):
    """name(arguments); `power` as in sin^2."""

    name: str
    arguments: tuple[Node, ...]
    power: Node | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class Triple(Node):
    """(x, y, z), or any other list in parentheses."""

    parts: tuple[Node, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Dot(Node):
    """left . right, of vectors."""

    left: Node
    right: Node


ZERO, ONE = Number("0"), Number("1")


def negative(node: Node) -> Node:
    """-node."""
    if isinstance(node, Sum):
        return Sum(tuple((-sign, term) for sign, term in node.terms))
    return Sum(((-1, node),))


@dataclasses.dataclass(frozen=True, slots=True)
class Slope(Node):
    """d above / d below, partial or (`total`) the whole rate."""

    above: Node | None
    below: Node
    total: bool = False


def lagrange(letter: Sign, q: Sign, q_dot: Sign) -> Node:
    """d/dt dL/dq' - dL/dq, for L or T."""
    rate = Product((Slope(None, Sign("t"), total=True), Slope(letter, q_dot)))
    return Sum(((1, rate), (-1, Slope(letter, q))))
