"""Iterated Lie brackets of the fields that satisfy a block of constraint rows, in doubles (D.3).

Values of a bracket need derivatives of values alone:

    omega([Y, Z]) = Y(omega(Z)) - Z(omega(Y)) - d omega(Y, Z)         (H. Cartan)

A shape says how a bracket is nested: `LEAF` is a field of the kernel, a pair (a, b) the bracket of two shapes.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from lagcli.compiled import kernel_fields
from lagcli.compiled.row_block import RowBlock

Shape = tuple["Shape", ...]  # () or (Shape, Shape)

LEAF: Shape = ()


def leaves(shape: Shape) -> int:
    """The number of fields a bracket is made of."""
    return 1 if shape == LEAF else leaves(shape[0]) + leaves(shape[1])


class Brackets:
    """Values of nested brackets on the independent differential rows in doubles, each shape built once."""

    def __init__(self, block: RowBlock, independent: Sequence[int]) -> None:
        self._block, self._field = block, kernel_fields.factored(block, independent)
        s = len(block.holonomic)
        self._kept = [i - s for i in independent if i >= s]
        self._known: dict[Shape, ca.Function] = {}

    def values(self, shape: Shape) -> ca.Function:
        """values(x, p, U) -> omega of the bracket on the independent differential rows; U (N, leaves)."""
        if shape not in self._known:
            x, p = ca.MX.sym("x", self._block.size), ca.MX.sym("p", self._block.p.numel())
            U = ca.MX.sym("U", self._block.size, leaves(shape))
            self._known[shape] = ca.Function("values", [x, p, U], [ca.densify(self._value(shape, x, p, U))])
        return self._known[shape]

    def _value(self, shape: Shape, x: ca.MX, p: ca.MX, U: ca.MX) -> ca.MX:
        split = leaves(shape[0])
        given = list(zip(shape, (U[:, :split], U[:, split:]), strict=True))
        w = [None if part == LEAF else self.values(part)(x, p, u) for part, u in given]
        Y, Z = (
            self._field(x, p, u, ca.MX.zeros(len(self._kept)))
            if value is None
            else self._field(x, p, ca.MX.zeros(self._block.size), value)
            for (_, u), value in zip(given, w, strict=True)
        )
        found = -self._block.curl(x, p, Y, Z)[self._kept]
        if w[1] is not None:
            found += ca.jtimes(w[1], x, Y)
        if w[0] is not None:
            found -= ca.jtimes(w[0], x, Z)
        return found
