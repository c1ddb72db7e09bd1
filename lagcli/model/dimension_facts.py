"""The dimensions that a model tells: of the left sides f of its rows as powers of a length, and which coordinates are
angles. Terms that are added have one dimension: `norm(a) - L` is a length whatever L is."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from lagcli import memory
from lagcli.expression import functions, tree
from lagcli.frozen import frozen_value
from lagcli.model.model import Model

Power = float | None  # of a length; None where it is not known
Names = frozenset[str]
CIRCULAR = functions.named(lambda row: row.angle == "argument")
POSITION = frozenset(("", "x", "y", "z", "v", "vx", "vy", "vz"))


@frozen_value
class DimensionFacts:
    """The known dimensions, by the names of declarations. lengths: of the f of constraints, in powers; angles:
    coordinates of which a sine, cosine or tangent is taken; positions: particles."""

    lengths: dict[str, float]
    angles: Names
    positions: Names

    def length(self, row: str) -> Power:
        """The power of a length of the f of a row such as `rod`, `link[3]` or `join.x`; None where it is open."""
        return self.lengths.get(base(row))


NOTHING = DimensionFacts({}, frozenset(), frozenset())


def base(name: str) -> str:
    """The name of the declaration that a member of a family, or a component, belongs to."""
    return re.split(r"[\[.]", name, maxsplit=1)[0]


_found = memory.Memory()


def of(model: Model) -> DimensionFacts:
    """The dimensions that the expressions of a model tell; d(...) and velocities count as lengths."""
    return _found.answer((model.path, model.fingerprint), lambda: _find(model))


def _find(model: Model) -> DimensionFacts:
    particles = frozenset(particle.members.base for particle in model.particles)
    coordinates = frozenset(coordinate.members.base for coordinate in model.coordinates)
    # Angles are a term, alone or times a number, of what a circular function is taken of.
    angles = frozenset(
        name
        for expression in model.expressions()
        for node in tree.walk(expression.tree)
        if isinstance(node, tree.Call) and node.function in CIRCULAR
        for term in _terms(node.arguments[0])
        if (name := _name(term)) in coordinates
    )
    lengths = {body.name: 1.0 for body in model.rigid}  # distances and positions of its particles
    for law in model.laws:
        power = _common([law.equation.tree], particles, angles)
        if power is not None:
            lengths[law.members.base] = power
    return DimensionFacts(lengths, angles, particles)


def _name(term: tree.Node) -> str:
    """The name in `q`, `q[i]`, `2*q` or `q/2`; empty for other terms."""
    if isinstance(term, tree.Product):
        others = [(sign, factor) for sign, factor in term.factors if not isinstance(factor, tree.Number)]
        if len(others) != 1 or others[0][0] < 0:
            return ""
        term = others[0][1]
    if isinstance(term, tree.Name):
        return term.name
    return term.owner if isinstance(term, tree.Index) and not term.member else ""


def _terms(node: tree.Node) -> Iterator[tree.Node]:
    """The terms added in an expression; a number alone, as in `a.z = 1`, tells nothing."""
    if isinstance(node, tree.Sum):
        for _, term in node.terms:
            yield from _terms(term)
    elif not isinstance(node, tree.Number):
        yield node


def _common(nodes: Iterable[tree.Node], particles: Names, angles: Names) -> Power:
    """The dimension of all terms of expressions and sides of equations; None where terms differ or it is not known."""
    sides = [s for n in nodes for s in ((n.left, n.right) if isinstance(n, tree.Relation) else (n,))]
    powers = [_of(term, particles, angles) for side in sides for term in _terms(side)]
    known = {power for power in powers if power is not None}
    return known.pop() if len(known) == 1 else None


def _of(node: tree.Node, particles: Names, angles: Names) -> Power:
    match node:
        case tree.Number():
            return 0.0
        case tree.Name():
            if node.name in particles:
                return 1.0
            return 0.0 if node.name in ("pi", "deg") or node.name in angles else None
        case tree.Member() | tree.Index():
            if node.owner in particles and node.member in POSITION:
                return 1.0
            return 0.0 if node.owner in angles and not node.member else None
        case tree.Component():
            return _of(node.vector, particles, angles)
        case tree.Power():
            base = _of(node.base, particles, angles)
            exponent_text = node.exponent.text if isinstance(node.exponent, tree.Number) else ""
            return base * float(exponent_text) if base is not None and exponent_text else None
        case tree.Product():
            powers = [(sign, _of(factor, particles, angles)) for sign, factor in node.factors]
            return None if any(p is None for _, p in powers) else sum(sign * (p or 0.0) for sign, p in powers)
        case tree.Call():
            known_function = functions.TABLE.get(node.function)
            power = known_function.dimension if known_function else None
            if power == 0:
                return 0.0
            parts = [_of(argument, particles, angles) for argument in node.arguments]
            if power == 1 or node.function in ("norm", "distance", "d", "rate"):
                known = {p for p in parts if p is not None}
                return known.pop() if len(known) == 1 else None
            if node.function in ("dot", "cross"):
                return None if None in parts else sum(p or 0.0 for p in parts)
            return None if power is None or parts[0] is None else power * parts[0]
    return _common(tree.children(node), particles, angles)
