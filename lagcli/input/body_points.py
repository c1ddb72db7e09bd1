"""The points and directions of bodies, written with the particles that a body is made of.

A body is P particles (`body_inertia`), named `crank.1` to `crank.P`. Its points and directions are linear in their
positions, sum_k w_k r_k, for a flat body with a part along the normal e_a x e_b of the directions in its plane. The
weights w are hidden parameters, so that another value of a parameter builds nothing anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from lagcli.errors import diagnostics
from lagcli.expression import tree
from lagcli.expression.tree import ExpressionError
from lagcli.frozen import frozen
from lagcli.model.bodies import AXES, CENTRE, PLANE, weight

FUNCTIONS = {"direction": "direction(body, [x, y, z])", "omega": "omega(body)"}
COMPONENTS = ("x", "y", "z")


@frozen
class BodyNames:
    """A body, or a family of them, as expressions see it: the names of its P particles and of its points."""

    name: str
    particles: tuple[str, ...]
    points: tuple[str, ...]
    is_family: bool = False

    @property
    def is_flat(self) -> bool:
        """True for three particles, with a normal."""
        return len(self.particles) == 3

    @property
    def has_directions(self) -> bool:
        """True if it has some extent across its axis."""
        return len(self.particles) > 2


class Writer:
    """Trees at the characters of an expression that they stand for; indices: of the member of a family."""

    def __init__(self, node: tree.Node | None = None, indices: tuple[tree.Node, ...] = ()) -> None:
        self.start, self.end = (0, 0) if node is None else (node.start, node.end)
        self._indices = indices

    def name(self, word: str) -> tree.Node:
        return tree.Name(self.start, self.end, word)

    def number(self, text: str) -> tree.Node:
        return tree.Number(self.start, self.end, text)

    def call(self, function: str, *arguments: tree.Node) -> tree.Node:
        return tree.Call(self.start, self.end, function, arguments)

    def sum(self, *terms: tree.Node) -> tree.Node:
        if len(terms) == 1:
            return terms[0]
        return tree.Sum(self.start, self.end, tuple((1, term) for term in terms))

    def difference(self, left: tree.Node, right: tree.Node) -> tree.Node:
        return tree.Sum(self.start, self.end, ((1, left), (-1, right)))

    def product(self, *factors: tree.Node) -> tree.Node:
        return tree.Product(self.start, self.end, tuple((1, factor) for factor in factors))

    def quotient(self, above: tree.Node, below: tree.Node) -> tree.Node:
        return tree.Product(self.start, self.end, ((1, above), (-1, below)))

    def component(self, vector: tree.Node, axis: str) -> tree.Node:
        return tree.Component(self.start, self.end, vector, axis)

    def point(self, body: BodyNames, word: str, motion: str = "") -> tree.Node:
        """The point or direction with the weights of a word; motion: `v` or `a` for its velocity or acceleration."""
        if word == CENTRE:
            every = self.sum(*(self._particle(name, motion) for name in body.particles))
            return self.quotient(every, self.number(str(len(body.particles))))
        linear = self._weighted(body, word, motion)
        if not body.is_flat:
            return linear
        return self.sum(
            linear, self.product(self.name(weight(body.name, word, "n")), self._normal(body, motion))
        )

    def _particle(self, name: str, motion: str) -> tree.Node:
        if self._indices:
            return tree.Index(self.start, self.end, name, self._indices, motion)
        return tree.Member(self.start, self.end, name, motion) if motion else self.name(name)

    def _weighted(self, body: BodyNames, word: str, motion: str) -> tree.Node:
        named = enumerate(body.particles, 1)
        pairs = [(self.name(weight(body.name, word, k)), self._particle(name, motion)) for k, name in named]
        return self.sum(*(self.product(*pair) for pair in pairs))

    def _normal(self, body: BodyNames, motion: str) -> tree.Node:
        """The normal of a flat body, or its first or second derivative."""

        def cross(*motions: str) -> tree.Node:
            sides = zip(PLANE, motions, strict=True)
            return self.call("cross", *(self._weighted(body, word, motion) for word, motion in sides))

        if not motion:
            return cross("", "")
        if motion == "v":
            return self.sum(cross("v", ""), cross("", "v"))
        return self.sum(cross("a", ""), self.product(self.number("2"), cross("v", "v")), cross("", "a"))

    def direction(self, body: BodyNames, components: Sequence[tree.Node]) -> tree.Node:
        """The direction with components in the axes of a body."""
        axes = (self.point(body, word) for word in AXES)
        return self.sum(*(self.product(*pair) for pair in zip(components, axes, strict=True)))

    def omega(self, body: BodyNames) -> tree.Node:
        """omega = sum_j e_j x e_j' / 2."""
        turns = (self.call("cross", self.point(body, word), self.point(body, word, "v")) for word in AXES)
        return self.product(self.number("0.5"), self.sum(*turns))

    def of_torque(self, body: BodyNames, k: int, torque: tree.Node) -> tree.Node:
        """The force on particle k of those that do the work of a torque, tau . omega: sum_j w_jk tau x e_j / 2.

        Of a flat body the part of e_j along the normal does it by (tau x e_j) . (e_a' x e_b + e_a x e_b').
        """
        parts = []
        for axis in AXES:
            across = self.call("cross", torque, self.point(body, axis))
            parts.append(self.product(self.name(weight(body.name, axis, k)), across))
            if body.is_flat:
                a, b = (self._weighted(body, word, "") for word in PLANE)
                of_a, of_b = (self.name(weight(body.name, word, k)) for word in PLANE)
                turned = self.difference(
                    self.product(of_a, self.call("cross", b, across)),
                    self.product(of_b, self.call("cross", a, across)),
                )
                parts.append(self.product(self.name(weight(body.name, axis, "n")), turned))
        return self.product(self.number("0.5"), self.sum(*parts))


def expanded(node: tree.Node, bodies: Mapping[str, BodyNames]) -> tree.Node:
    """An expression with particles in place of bodies, their points and directions. Raises `ExpressionError`."""
    if isinstance(node, tree.Component) and isinstance(node.vector, (tree.Member, tree.Index)):
        inner = node.vector
        if inner.owner in bodies and inner.member in bodies[inner.owner].points:
            return _member(node, bodies[inner.owner], inner.indices, inner.member, node.member)
    if isinstance(node, tree.Reference) and node.owner in bodies:
        body = bodies[node.owner]
        if node.member in body.points:
            return _member(node, body, node.indices, node.member, "")
        return _member(node, body, node.indices, CENTRE, node.member)
    if isinstance(node, tree.Call) and node.function in FUNCTIONS:
        return _call(node, bodies)
    return tree.mapped(node, lambda child: expanded(child, bodies))


def _member(
    node: tree.Node, body: BodyNames, indices: tuple[tree.Node, ...], word: str, member: str
) -> tree.Node:
    """A point of a body, or what is asked of it: `.x`, `.v`, `.vx`, `.a`, `.ax`."""
    writer = _writer(node, body, indices)
    motion = member[0] if member[:1] in ("v", "a") else ""
    axis = member.removeprefix(motion)
    if member and axis not in ("", *COMPONENTS):
        message = f"`{body.name}` has no `.{member}`"
        hint = diagnostics.nearest(member, body.points) or "its points are declared under `points`"
        raise ExpressionError("unknown-component", message, node.start, node.end, hint)
    point = writer.point(body, word, motion)
    return writer.component(point, axis) if axis else point


def _writer(node: tree.Node, body: BodyNames, indices: tuple[tree.Node, ...]) -> Writer:
    if body.is_family and not indices:
        message = (
            f"`{body.name}` is a family: alone it means all its members, and only in lists such as `to:`"
        )
        hint = f"write one of its members, for example `{body.name}[1]`"
        raise ExpressionError("family-needs-index", message, node.start, node.end, hint)
    if indices and not body.is_family:
        message = f"`{body.name}` is no family and has no members"
        raise ExpressionError("not-a-family", message, node.start, node.end)
    return Writer(node, indices)


def _call(node: tree.Call, bodies: Mapping[str, BodyNames]) -> tree.Node:
    first = node.arguments[0] if node.arguments else None
    is_right = isinstance(first, tree.Reference) and first.owner in bodies and not first.member
    if not is_right or len(node.arguments) != (2 if node.function == "direction" else 1):
        message = f"`{node.function}` is written `{FUNCTIONS[node.function]}`"
        raise ExpressionError("wrong-arguments", message, node.start, node.end)
    assert isinstance(first, tree.Reference)
    body = bodies[first.owner]
    writer = _writer(node, body, first.indices)
    if not body.has_directions:
        message = (
            f"`{first.owner}` has no extent across its axis, so that its turning about it is not defined"
        )
        raise ExpressionError("rod-spin-undefined", message, node.start, node.end, "give it a radius")
    if node.function == "omega":
        return writer.omega(body)
    vector = expanded(node.arguments[1], bodies)
    if isinstance(vector, tree.Vector) and len(vector.components) == 3:
        return writer.direction(body, vector.components)
    return writer.direction(body, [writer.component(vector, axis) for axis in COMPONENTS])


def with_own(
    node: tree.Node, body: BodyNames, indices: tuple[tree.Node, ...], mass: Callable[[Writer], tree.Node]
) -> tree.Node:
    """A force on a body with what `m`, `r` and `v` are in it."""
    writer = Writer(node, indices)
    if isinstance(node, tree.Name) and node.name == "m":
        return mass(writer)
    if isinstance(node, (tree.Name, tree.Member)) and node.owner in ("r", "v"):
        vector = writer.point(body, CENTRE, "v" if node.owner == "v" else "")
        return writer.component(vector, node.member) if node.member else vector
    return tree.mapped(node, lambda child: with_own(child, body, indices, mass))
