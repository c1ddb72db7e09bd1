"""Columns over members: a scalar of a family is an SX (K, 1) with one value for each of its members."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.model.family import Whole

Triple = tuple[Any, Any, Any]


class Columns:
    """Scalars or vectors of numbered members, such as positions of particles, filled batch by batch."""

    def __init__(self, count: int) -> None:
        self._batches: list[tuple[Any, ...]] = []
        self._batch = np.full(count, -1, dtype=np.int64)
        self._row = np.zeros(count, dtype=np.int64)

    def fill(self, numbers: Whole, parts: tuple[Any, ...]) -> None:
        """Take one column (K, 1), or three of a vector, for the members of these numbers (K,)."""
        self._batch[numbers] = len(self._batches)
        self._row[numbers] = np.arange(numbers.size)
        self._batches.append(parts)

    def has(self, numbers: Whole) -> npt.NDArray[np.bool_]:
        """Which of these are filled, (K,)."""
        return np.asarray(self._batch[numbers] >= 0)

    def take(self, numbers: Whole) -> tuple[Any, ...]:
        """The columns (K, 1) of members that are filled."""
        batches, rows = self._batch[numbers], self._row[numbers]
        used, which = np.unique(batches, return_inverse=True)
        parts = [self._batches[batch] for batch in used.tolist()]
        if len(parts) == 1:
            return parts[0] if _is_all(rows, parts[0][0]) else tuple(taken(part, rows) for part in parts[0])
        if not parts:
            return (ca.SX(0, 1),) * 3
        sizes = [part[0].numel() for part in parts]
        places = rows + (np.cumsum(sizes) - sizes)[which]
        return tuple(taken(ca.vertcat(*columns), places) for columns in zip(*parts, strict=True))


def taken(column: Any, rows: Whole) -> Any:
    """Rows of a column, in any order."""
    if rows.size == 1:
        return column[int(rows[0])]
    return ca.vec(column[rows.tolist()])  # CasADi takes of a single row a line, not a column


def _is_all(rows: Whole, column: Any) -> bool:
    return rows.size == column.numel() and bool((rows == np.arange(rows.size)).all())


def column(value: Any, count: int) -> Any:
    """A scalar (1, 1) or a column (K, 1) as a dense column of this length."""
    if value.numel() == count:
        return ca.densify(value)
    return ca.repmat(ca.densify(value), count, 1)


def interleaved(parts: Sequence[Any], count: int) -> Any:
    """Columns x, y, z (or one) of K members as x1, y1, z1, x2, ...: the order of rows and coordinates."""
    if len(parts) == 1:
        return column(parts[0], count)
    return ca.vec(ca.horzcat(*(column(part, count) for part in parts)).T)


def rate(value: Any, q: Any, v: Any, t: Any) -> Any:
    """d/dt of a function of (q, t), its differential divided by dt, dense; of one that holds v too, with v held."""
    return ca.densify(ca.jtimes(value, q, v) + ca.jtimes(value, t, ca.SX(1)))


def scattered(values: Any, rows: Whole, n: int) -> Any:
    """A column (n, 1) with each value added to its row."""
    if rows.size == 0:
        return ca.SX.zeros(n)
    places = ca.Sparsity.triplet(n, rows.size, rows.tolist(), list(range(rows.size)))
    return ca.densify(ca.mtimes(ca.SX(ca.DM(places, 1.0)), ca.densify(values)))
