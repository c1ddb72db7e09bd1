"""Iterated Lie brackets of the fields that satisfy a block of constraint rows, in doubles (D.3), from


    omega([Y, Z]) = Y(omega(Z)) - Z(omega(Y)) - d omega(Y, Z)         (H. Cartan)

A shape says how a bracket is nested: `LEAF` is a field of the kernel D of the independent rows A_I, a pair the bracket
of two shapes. All are tangent to every f = const. Up to fields of D a bracket is known by its values w = omega_I(Y), so
that a field is given by a vector u, the part in D, or by w.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TypeVar

import casadi as ca

from lagcli.compiled.row_block import RowBlock
from lagcli.smoothness.sized_function import SizedFunction

Shape = tuple["Shape", ...]  # () or (Shape, Shape)

LEAF: Shape = ()

# An entry may be a pivot if it is no smaller than this part of the largest of its row.
PIVOT = 0.1
SOLVER = "ldl"

T = TypeVar("T", float, ca.SX)


def leaves(shape: Shape) -> int:
    """The number of fields a bracket is made of."""
    return 1 if shape == LEAF else leaves(shape[0]) + leaves(shape[1])


class Brackets:
    """Values of nested brackets on the independent differential rows in doubles, each shape built once."""

    def __init__(self, block: RowBlock, independent: Sequence[int]) -> None:
        self._block, self._field = block, factored_field(block, independent)
        s = len(block.holonomic)
        self._independent = [i - s for i in independent if i >= s]
        self._known: dict[Shape, ca.Function] = {}

    def values(self, shape: Shape) -> ca.Function:
        """values(x, p, U) -> omega of the bracket on the independent differential rows; U (N, leaves)."""
        if shape not in self._known:
            size, count = self._block.size, len(self._independent)
            x, p = ca.MX.sym("x", size), ca.MX.sym("p", self._block.p.numel())
            U, split = ca.MX.sym("U", size, leaves(shape)), leaves(shape[0])
            given = list(zip(shape, (U[:, :split], U[:, split:]), strict=True))
            w = [None if part == LEAF else self.values(part)(x, p, u) for part, u in given]
            Y, Z = (
                self._field(x, p, u, ca.MX.zeros(count))
                if value is None
                else self._field(x, p, ca.MX.zeros(size), value)
                for (_, u), value in zip(given, w, strict=True)
            )
            found = -self._block.curl(x, p, Y, Z)[self._independent]
            if w[1] is not None:
                found += ca.jtimes(w[1], x, Y)
            if w[0] is not None:
                found -= ca.jtimes(w[0], x, Z)
            self._known[shape] = SizedFunction("values", [x, p, U], [ca.densify(found)])
        return self._known[shape]


class TooMuchFill(Exception):
    """The elimination of the rows would be too large to be written out."""


def pivots(A: ca.DM, fill: int) -> list[tuple[int, int]]:
    """Pivots (row, column) of the elimination of independent rows A (C, N) of numbers, of little fill (Markowitz).
    Raises `TooMuchFill` beyond `fill` operations."""
    rows: dict[int, dict[int, float]] = {i: {} for i in range(A.shape[0])}
    for i, j, value in zip(*A.sparsity().get_triplet(), A.nonzeros(), strict=True):
        rows[i][j] = value
    found: list[tuple[int, int]] = []
    while rows:
        # The operations that each pivot would bring: that of least work is taken.
        counts = Counter(j for row in rows.values() for j in row)
        candidates: list[tuple[int, float, int, int]] = []
        for i, row in rows.items():
            largest = max((abs(value) for value in row.values()), default=0.0)
            if largest == 0.0:
                raise TooMuchFill  # a row that vanishes is not independent
            candidates += (
                ((len(row) - 1) * (counts[j] - 1), -abs(value) / largest, i, j)
                for j, value in row.items()
                if abs(value) >= PIVOT * largest
            )
        work, _, i, j = min(candidates)
        fill -= work
        if fill < 0:
            raise TooMuchFill
        found.append((i, j))
        pivot = rows.pop(i)
        for row in rows.values():
            if j in row:
                _eliminate(row, pivot, j, row.pop(j) / pivot[j], 0.0)
    return found


def _eliminate(row: dict[int, T], pivot: dict[int, T], j: int, factor: T, nothing: T) -> None:
    """row - factor pivot beside column j."""
    for k, value in pivot.items():
        if k != j:
            row[k] = row.get(k, nothing) - factor * value


def expanded_field(
    block: RowBlock, independent: Sequence[int], order: Sequence[tuple[int, int]]
) -> ca.Function:
    """field(x, p, u, w) -> Y with A_I Y = (0, w) and Y = u (N,) beside the pivots, written out. independent: the rows
    I, in their order; order: `pivots` of A_I; w: values of the independent differential rows."""
    u, s = ca.SX.sym("u", block.size), len(block.holonomic)
    w = ca.SX.sym("w", sum(i >= s for i in independent))
    A = block.A[list(independent), :]
    bound = {j for _, j in order}
    rows: list[dict[int, ca.SX]] = [{} for _ in independent]
    right = [ca.SX(0) if i < s else w[k - len(independent) + w.numel()] for k, i in enumerate(independent)]
    for i, j, value in zip(*A.sparsity().get_triplet(), ca.vertsplit(ca.vec(A.nz[:])), strict=True):
        if j in bound:
            rows[i][j] = value
        else:
            right[i] = right[i] - value * u[j]
    for n, (i, j) in enumerate(order):
        for k, _ in order[n + 1 :]:
            if j in rows[k]:
                factor = rows[k].pop(j) / rows[i][j]
                right[k] = right[k] - factor * right[i]
                _eliminate(rows[k], rows[i], j, factor, ca.SX(0))
    Y = ca.vertsplit(u)
    for i, j in reversed(order):
        pivot = rows[i].pop(j)
        Y[j] = (right[i] - sum(value * Y[k] for k, value in rows[i].items())) / pivot
    return SizedFunction("field", [block.x, block.p, u, w], [ca.cse(ca.densify(ca.vertcat(*Y)))])


def factored_field(block: RowBlock, independent: Sequence[int]) -> ca.Function:
    """field(x, p, u, w) -> the Y nearest to u with A_I Y = (0, w), its equations solved numerically at each call."""
    s = len(block.holonomic)
    count = sum(i >= s for i in independent)
    A_I = SizedFunction("rows", [block.x, block.p], [block.A[list(independent), :]])
    sizes = (block.size, block.p.numel(), block.size, count)
    x, p, u, w = inputs = [ca.MX.sym(name, size) for name, size in zip("xpuw", sizes, strict=True)]
    A = A_I(x, p)
    wanted = ca.vertcat(ca.MX.zeros(len(independent) - count), w)
    weights = ca.solve(ca.mtimes(A, A.T), wanted - ca.mtimes(A, u), SOLVER)
    return SizedFunction("field", inputs, [ca.densify(u + ca.mtimes(A.T, weights))])
