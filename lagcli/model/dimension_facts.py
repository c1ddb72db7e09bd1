"""The dimensions that a model tells: of the left sides f of its rows as powers of a length, and which coordinates are
angles.

Units are labels, and those of parameters and coordinates are not declared. But terms that are added have one
dimension: `norm(a) - L` is a length whatever L is. What the expressions leave open is not guessed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from lagcli.expression import functions, tree
from lagcli.frozen import frozen_value
from lagcli.model.model import Model

Power = float | None  # of a length; None where it is not known
POSITION = frozenset(("", "x", "y", "z", "v", "vx", "vy", "vz"))


@frozen_value
class _Kind:
    """The names of particles, whose positions are lengths, and of coordinates that are angles."""

    is_particle: Callable[[str], bool]
    is_angle: Callable[[str], bool]


def of_relation(
    relation: tree.Node, is_particle: Callable[[str], bool], is_angle: Callable[[str], bool]
) -> Power:
    """The dimension of both sides of an equation, where d(...) and velocities count as lengths; None where it is not
    known, or terms differ."""
    kind = _Kind(is_particle, is_angle)
    sides = (relation.left, relation.right) if isinstance(relation, tree.Relation) else (relation,)
    known = {found for side in sides for term in terms(side) if (found := _of(term, kind)) is not None}
    return known.pop() if len(known) == 1 else None


def terms(node: tree.Node) -> Iterator[tree.Node]:
    """The terms added in an expression; a number alone, as in `a.z = 1`, tells nothing."""
    if isinstance(node, tree.Sum):
        for _, term in node.terms:
            yield from terms(term)
    elif not isinstance(node, tree.Number):
        yield node


def _of(node: tree.Node, kind: _Kind) -> Power:
    if isinstance(node, tree.Number):
        return 0.0
    if isinstance(node, tree.Name):
        if kind.is_particle(node.name):
            return 1.0
        return 0.0 if node.name in ("pi", "deg") or kind.is_angle(node.name) else None
    if isinstance(node, (tree.Member, tree.Index)):
        if kind.is_particle(node.owner) and node.member in POSITION:
            return 1.0
        return 0.0 if kind.is_angle(node.owner) and not node.member else None
    if isinstance(node, tree.Component):
        return _of(node.vector, kind)
    if isinstance(node, tree.Power):
        base = _of(node.base, kind)
        exponent_text = node.exponent.text if isinstance(node.exponent, tree.Number) else ""
        return base * float(exponent_text) if base is not None and exponent_text else None
    if isinstance(node, tree.Product):
        powers = [(sign, _of(factor, kind)) for sign, factor in node.factors]
        return None if any(p is None for _, p in powers) else sum(sign * (p or 0.0) for sign, p in powers)
    if isinstance(node, tree.Call):
        return _of_call(node, kind)
    parts = [term for _, term in node.terms] if isinstance(node, tree.Sum) else tree.children(node)
    known = {found for part in parts for term in terms(part) if (found := _of(term, kind)) is not None}
    return known.pop() if len(known) == 1 else None


def _of_call(node: tree.Call, kind: _Kind) -> Power:
    known_function = functions.TABLE.get(node.function)
    power = known_function.dimension if known_function else None
    if power == 0.0:
        return 0.0
    parts = [_of(argument, kind) for argument in node.arguments]
    if power == 1.0 or node.function in ("norm", "distance", "d", "rate"):
        known = {p for p in parts if p is not None}
        return known.pop() if len(known) == 1 else None
    if node.function in ("dot", "cross"):
        return None if None in parts else sum(p or 0.0 for p in parts)
    return None if power is None or parts[0] is None else power * parts[0]


CIRCULAR = functions.named(lambda row: row.angle == "argument")


@frozen_value
class DimensionFacts:
    """The known dimensions, by the names of declarations, those of families without indices.

    lengths: of the f of constraints, as powers of a length; angles: coordinates of which a sine, cosine or tangent is
    taken; positions: particles.
    """

    lengths: dict[str, float]
    angles: frozenset[str]
    positions: frozenset[str]

    def length(self, row: str) -> float | None:
        """The power of a length of the f of a row such as `rod`, `link[3]` or `join.x`; None where it is open."""
        return self.lengths.get(base(row))


NOTHING = DimensionFacts({}, frozenset(), frozenset())


def base(name: str) -> str:
    """The name of the declaration that a member of a family, or a component, belongs to."""
    return re.split(r"[\[.]", name, maxsplit=1)[0]


def of(model: Model) -> DimensionFacts:
    """The dimensions that the expressions of a model tell."""
    particles = frozenset(particle.members.base for particle in model.particles)
    coordinates = frozenset(coordinate.members.base for coordinate in model.coordinates)
    trees = [expression.tree for expression in model.expressions()]
    angles = frozenset(_angles(trees, coordinates))
    lengths = {body.name: 1.0 for body in model.rigid}  # distances and positions of its particles
    for law in model.laws:
        power = of_relation(law.equation.tree, particles.__contains__, angles.__contains__)
        if power is not None:
            lengths[law.members.base] = power
    return DimensionFacts(lengths, angles, particles)


def _angles(trees: list[tree.Node], coordinates: frozenset[str]) -> Iterator[str]:
    """The coordinates that are a term, alone or times a number, of what a circular function is taken of."""
    waiting = list(trees)
    while waiting:
        node = waiting.pop()
        waiting += tree.children(node)
        if isinstance(node, tree.Call) and node.function in CIRCULAR:
            for term in terms(node.arguments[0]):
                name = _name(term)
                if name in coordinates:
                    yield name


def _name(term: tree.Node) -> str:
    """The name in `q`, `q[i]`, `2*q` or `q/2`; empty for other terms."""
    if isinstance(term, tree.Product):
        rest = [factor for sign, factor in term.factors if not isinstance(factor, tree.Number) and sign > 0]
        below = [factor for sign, factor in term.factors if not isinstance(factor, tree.Number) and sign < 0]
        if len(rest) != 1 or below:
            return ""
        (term,) = rest
    if isinstance(term, tree.Name):
        return term.name
    return term.owner if isinstance(term, tree.Index) and not term.member else ""
