"""Columns over members: a scalar of a family is an SX (K, 1) with one value for each of its members."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.expression import evaluate
from lagcli.model.family import Integers

Triple = evaluate.Triple[ca.SX]
Value = evaluate.Value[ca.SX]  # a column, or three of a vector


class Columns:
    """Scalars or vectors of numbered members, such as positions of particles, filled batch by batch."""

    def __init__(self, count: int) -> None:
        self._batches: list[tuple[ca.SX, ...]] = []
        self._batch = np.full(count, -1, dtype=np.int64)
        self._row = np.zeros(count, dtype=np.int64)

    def fill(self, numbers: Integers, parts: tuple[ca.SX, ...]) -> None:
        """Take one column (K, 1), or three of a vector, for the members of these numbers (K,)."""
        self._batch[numbers] = len(self._batches)
        self._row[numbers] = np.arange(numbers.size)
        self._batches.append(parts)

    def has(self, numbers: Integers) -> npt.NDArray[np.bool_]:
        """True for those that are filled, (K,)."""
        return np.asarray(self._batch[numbers] >= 0)

    def take(self, numbers: Integers) -> tuple[ca.SX, ...]:
        """The columns (K, 1) of members that are filled."""
        batches, rows = self._batch[numbers], self._row[numbers]
        used, which = np.unique(batches, return_inverse=True)
        parts = [self._batches[batch] for batch in used.tolist()]
        if len(parts) == 1:
            return parts[0] if _is_all(rows, parts[0][0]) else tuple(taken(part, rows) for part in parts[0])
        if not parts:
            return (ca.SX(0, 1),) * 3
        sizes = [part[0].numel() for part in parts]
        indices = rows + (np.cumsum(sizes) - sizes)[which]
        return tuple(taken(ca.vertcat(*columns), indices) for columns in zip(*parts, strict=True))

    def vectors(self, numbers: Integers) -> Triple:
        """The columns x, y, z (K, 1) of members that are filled, each with a vector."""
        x, y, z = self.take(numbers)
        return x, y, z


def taken(column: ca.SX, rows: Integers) -> ca.SX:
    """Rows of a column, in any order."""
    if rows.size == 1:
        return column[int(rows[0])]
    return ca.vec(column[rows.tolist()])  # CasADi takes of a single row a line, not a column


def _is_all(rows: Integers, column: ca.SX) -> bool:
    return rows.size == column.numel() and bool((rows == np.arange(rows.size)).all())


def column(value: ca.SX, count: int) -> ca.SX:
    """A scalar (1, 1) or a column (K, 1) as a dense column of this length."""
    if value.numel() == count:
        return ca.densify(value)
    return ca.repmat(ca.densify(value), count, 1)


def interleaved(parts: Sequence[ca.SX], count: int) -> ca.SX:
    """Columns x, y, z (or one) of K members as x1, y1, z1, x2, ...: the order of rows and coordinates."""
    if len(parts) == 1:
        return column(parts[0], count)
    return ca.vec(ca.horzcat(*(column(part, count) for part in parts)).T)


def rate(value: ca.SX, q: ca.SX, v: ca.SX, t: ca.SX) -> ca.SX:
    """d/dt of a function of (q, t), its differential divided by dt, dense; of one that holds v too, with v fixed."""
    return ca.densify(ca.jtimes(value, q, v) + ca.jtimes(value, t, ca.SX(1)))


def scattered(values: ca.SX, rows: Integers, n: int) -> ca.SX:
    """A column (n, 1) with each value added to its row."""
    if rows.size == 0:
        return ca.SX.zeros(n)
    pattern = ca.Sparsity.triplet(n, rows.size, rows.tolist(), list(range(rows.size)))
    return ca.densify(ca.mtimes(ca.SX(ca.DM(pattern, 1.0)), ca.densify(values)))
