"""Three components recognized as the vector they are: (x_b - x_a, y_b - y_a, z_b - z_a)/d is (r_b - r_a)/d."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import sympy

from lagcli.derivation.symbolic.calculus import Key, Triple, slope
from lagcli.pfaffian.forms.notation import ZERO

NOTHING: Triple = (ZERO, ZERO, ZERO)


@dataclasses.dataclass(frozen=True, slots=True)
class RecognizedVector:
    """sum of coefficient * vector, plus `rest` along x, y, z."""

    parts: Mapping[str, sympy.Expr]
    rest: Triple


class VectorRecognizer:
    """Recognizes vectors by the symbols of their components."""

    def __init__(self) -> None:
        self._axes: tuple[dict[sympy.Symbol, str], ...] = ({}, {}, {})
        self._components: set[sympy.Symbol] = set()
        self.triples: dict[str, Triple] = {}
        self._order: dict[str, int] = {}
        self._found: dict[Triple, RecognizedVector | None] = {}

    def know(self, name: str, triple: Sequence[sympy.Symbol]) -> None:
        """Note that three symbols are the components of the vector of this name."""
        self._order[name] = len(self._order)
        self.triples[name] = (triple[0], triple[1], triple[2])
        for known, symbol in zip(self._axes, triple, strict=True):
            known[symbol] = name
            self._components.add(symbol)

    def vector(self, triple: Triple) -> RecognizedVector | None:
        """The vector, or None where the components are no such combination."""
        if triple not in self._found:
            self._found[triple] = self._vector(triple)
        return self._found[triple]

    def _vector(self, triple: Triple) -> RecognizedVector | None:
        by_axis: list[dict[str, sympy.Expr]] = []
        rest = []
        for value, names in zip(triple, self._axes, strict=True):
            own = [s for s in value.free_symbols if s in names]
            linear = {s: slope(value, s) for s in own}
            if any(c.free_symbols & self._components for c in linear.values()):
                return None
            left = value.xreplace(dict.fromkeys(own, ZERO))
            if left.free_symbols & self._components:
                return None
            rest.append(left)
            by_axis.append({names[s]: linear[s] for s in own})
        x, y, z = by_axis
        if not (x.keys() == y.keys() == z.keys()):
            return None
        if any(not _same(x[n], y[n]) or not _same(x[n], z[n]) for n in x):
            return None
        order = sorted(x, key=self._order.__getitem__)
        return RecognizedVector({n: x[n] for n in order}, (rest[0], rest[1], rest[2]))

    def components(self, key: Key) -> Triple:
        """The components of a combination."""
        parts, rest = key
        x, y, z = (sum((c * self.triples[n][axis] for n, c in parts), rest[axis]) for axis in range(3))
        return x, y, z


def _same(one: sympy.Expr, other: sympy.Expr) -> bool:
    return bool(one == other or sympy.expand(one - other) == 0)


def pieces(vector: RecognizedVector) -> list[tuple[sympy.Expr, Key]]:
    """The vector as a sum of scalar * (plain combination): forces along differences of positions are such sums.

    The rest along the axes, where there is one, is the last piece.
    """
    summands = _differences(dict(vector.parts)) or _with_shared_factor(vector.parts)
    if vector.rest != NOTHING:
        summands.append((sympy.Integer(1), ((), vector.rest)))
    return summands


def _differences(parts: dict[str, sympy.Expr]) -> list[tuple[sympy.Expr, Key]]:
    """sum of c_j (r_j - r_k), where the coefficients cancel in the sum."""
    if len(parts) < 3 or sympy.expand(sum(parts.values())) != 0:
        return []
    centre = max(parts, key=lambda n: (parts[n].count_ops(), n))
    merged: dict[sympy.Expr, dict[str, int]] = {}
    for name, c in parts.items():
        if name != centre:
            merged.setdefault(c, {})[name] = 1
    differences = []
    for c, names in merged.items():
        combination = (*((n, sympy.Integer(1)) for n in names), (centre, sympy.Integer(-len(names))))
        differences.append(_signed(c, tuple(sorted(combination, key=lambda part: part[0]))))
    return differences


def _with_shared_factor(parts: Mapping[str, sympy.Expr]) -> list[tuple[sympy.Expr, Key]]:
    """Vectors whose coefficients differ by a number or a constant share one factor."""
    groups: list[tuple[sympy.Expr, list[tuple[str, sympy.Expr]]]] = []
    for name, c in parts.items():
        for first, members in groups:
            ratio = c / first
            if ratio.is_number:
                members.append((name, ratio))
                break
        else:
            groups.append((c, [(name, sympy.Integer(1))]))
    return [_signed(c, tuple(members)) for c, members in groups]


def _signed(c: sympy.Expr, combination: tuple[tuple[str, sympy.Expr], ...]) -> tuple[sympy.Expr, Key]:
    """Its first vector gets a positive sign, so that r_a - r_b and r_b - r_a are one thing."""
    if combination[0][1].is_negative:
        return -c, (tuple((name, -weight) for name, weight in combination), NOTHING)
    return c, (combination, NOTHING)
