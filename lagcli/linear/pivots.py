"""Choice of independent rows out of dense ones, by Gram-Schmidt (twice, for rounding)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def farthest(
    rows: Floats, count: int, first: Sequence[int] = (), nearly: float = 1.0, least: float = 0.0
) -> list[int]:
    """Numbers of `count` independent rows, those in `first`, which are independent, before all, in order of choice.

    Each next one is the first that is `nearly` as far from those before it as the farthest: which of several alike is
    taken must not depend on rounding, as it does with the pivots of LAPACK. It ends where all are nearer than `least`.
    """
    kept = list(first)
    basis = np.linalg.qr(rows[kept].T)[0]
    rest = rows - rows @ basis @ basis.T
    while len(kept) < count:
        lengths = np.linalg.norm(rest, axis=1)
        lengths[kept] = 0.0
        if lengths.max(initial=0.0) < least:
            break
        row = int(np.flatnonzero(lengths >= nearly * lengths.max())[0])
        direction = rest[row] / lengths[row]
        for _ in range(2):
            rest -= np.outer(rest @ direction, direction)
        kept.append(row)
    return kept


def leading(rows: Floats, least: float) -> list[int]:
    """Numbers of the rows that are farther than `least` from all combinations of rows before them."""
    kept: list[int] = []
    basis = np.zeros((0, rows.shape[1]))
    for i, row in enumerate(rows):
        rest = row.copy()
        for _ in range(2):
            rest -= basis.T @ (basis @ rest)
        length = float(np.linalg.norm(rest))
        if length > least:
            kept.append(i)
            basis = np.vstack([basis, rest / length])
    return kept
