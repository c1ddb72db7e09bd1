"""Exact ranks and null vectors of rows of rational numbers, by elimination: what numeric answers must agree with.

Nothing of the package is used. A row of a framework is half the gradient of the squared length of a rod, so that it
is rational wherever the points are.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

Row = list[Fraction]
Point = Sequence[Fraction]
# A rod between two points, or between a point and a fixed place.
Rod = tuple[int, "int | tuple[Fraction, ...]"]


def rows(numbers: Iterable[Iterable[Any]]) -> list[Row]:
    """Rows of anything that a Fraction can be made of: integers, "1/3", doubles (which are rational, as they are)."""
    return [[Fraction(x) for x in row] for row in numbers]


class Elimination:
    """Rows taken one after the other, each reduced by those before it that were independent."""

    def __init__(self) -> None:
        self.count = 0
        self.rank = 0
        # Pivot column -> (reduced row with 1 in the pivot, the combination of given rows it is).
        self._basis: dict[int, tuple[Row, dict[int, Fraction]]] = {}

    def take(self, row: Sequence[Fraction]) -> dict[int, Fraction] | None:
        """None if the row is independent of those taken before, else the null vector: row number -> weight.

        The weight of the row itself is 1.
        """
        rest, weights = list(row), {self.count: Fraction(1)}
        self.count += 1
        for column, (other, its) in self._basis.items():
            factor = rest[column]
            if factor:
                rest = _less(rest, factor, other)
                for i, weight in its.items():
                    weights[i] = weights.get(i, Fraction(0)) - factor * weight
        pivot = next((column for column, x in enumerate(rest) if x), None)
        if pivot is None:
            return {i: weight for i, weight in weights.items() if weight}
        lead = rest[pivot]
        reduced = [x / lead for x in rest]
        combination = {i: weight / lead for i, weight in weights.items()}
        for column, (other, its) in self._basis.items():
            factor = other[pivot]
            if factor:
                cleared = _less(other, factor, reduced)
                mixed = dict(its)
                for i, weight in combination.items():
                    mixed[i] = mixed.get(i, Fraction(0)) - factor * weight
                self._basis[column] = cleared, mixed
        self._basis[pivot] = reduced, combination
        self.rank += 1
        return None


def _less(row: Row, factor: Fraction, other: Row) -> Row:
    """row - factor other; most entries of rods are zero, and a sum of fractions is slow."""
    return [a - factor * b if b else a for a, b in zip(row, other, strict=True)]


def null_vectors(matrix: Sequence[Sequence[Fraction]]) -> list[dict[int, Fraction]]:
    """A basis of the left null vectors, one for each row that depends on rows before it."""
    found = Elimination()
    return [vector for row in matrix if (vector := found.take(row)) is not None]


def rank(matrix: Sequence[Sequence[Fraction]]) -> int:
    """The rank."""
    return len(matrix) - len(null_vectors(matrix))


def redundant(matrix: Sequence[Sequence[Fraction]]) -> list[int]:
    """The rows that depend on rows before them."""
    return [max(vector) for vector in null_vectors(matrix)]


def shared(matrix: Sequence[Sequence[Fraction]]) -> set[int]:
    """The rows that take part in any dependence: those whose multiplier is not unique.

    Of a basis of null vectors this is the union of the rows with a weight, for a combination has no others.
    """
    return set(itertools.chain.from_iterable(null_vectors(matrix)))


def rigidity(points: Sequence[Point], rods: Sequence[Rod]) -> list[Row]:
    """The rows of a framework, half the gradients of squared lengths, one column for each coordinate."""
    dimension = len(points[0])
    found = []
    for a, b in rods:
        row = [Fraction(0)] * (len(points) * dimension)
        far = points[b] if isinstance(b, int) else b
        for axis in range(dimension):
            apart = points[a][axis] - far[axis]
            row[a * dimension + axis] += apart
            if isinstance(b, int):
                row[b * dimension + axis] -= apart
        found.append(row)
    return found


def generic_rank(count: int, dimension: int, rods: Sequence[Rod], tries: int = 3) -> int:
    """The highest rank at random places: that of almost all frameworks with these rods (anchors moved, too)."""
    dice = random.Random(20061)

    def place() -> tuple[Fraction, ...]:
        return tuple(Fraction(dice.randint(-(10**6), 10**6), 997) for _ in range(dimension))

    found = []
    for _ in range(tries):
        moved: list[Rod] = [(a, b if isinstance(b, int) else place()) for a, b in rods]
        found.append(rank(rigidity([place() for _ in range(count)], moved)))
    return max(found)
