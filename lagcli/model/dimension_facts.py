"""The dimensions that a model tells: of the left sides f of its rows, and which coordinates are angles.

Units are labels, and those of parameters and coordinates are not declared; what the expressions leave open is not
guessed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from lagcli.expression import dimensions, functions, tree
from lagcli.frozen import frozen_value
from lagcli.model.model import Model

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
        power = dimensions.of_relation(law.equation.tree, particles.__contains__, angles.__contains__)
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
            for term in dimensions.terms(node.arguments[0]):
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
