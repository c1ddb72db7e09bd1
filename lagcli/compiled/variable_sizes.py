"""Sizes of variables, in which rows over metres, radians and seconds can be compared."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# Rounds in which rows and columns are scaled in turn.
ROUNDS, TINY = 3, 1e-4


def of(A: ca.DM, kinds: npt.NDArray[np.intp]) -> Floats:
    """Sizes (N,) of variables in which the entries of rows A (C, N) are of one size; 1 where none is touched.

    Variables of one of the `kinds` (N,) have one size. Entries that are tiny in their row, as at a special place,
    say nothing of sizes.
    """
    rows, columns = (np.asarray(part, dtype=np.intp) for part in A.sparsity().get_triplet())
    values = np.abs(np.array(A.nonzeros(), dtype=float))
    groups = kinds[columns]
    of_row, of_kind = np.ones(A.shape[0]), np.ones(int(kinds.max(initial=0)) + 1)
    for _ in range(ROUNDS):
        largest = np.zeros(of_row.size)
        np.maximum.at(largest, rows, values * of_kind[groups])
        of_row = 1 / np.where(largest > 0, largest, 1.0)
        relative = values * of_row[rows] * of_kind[groups]
        largest = np.zeros(of_kind.size)
        np.maximum.at(largest, groups, np.where(relative > TINY, relative, 0.0))
        of_kind /= np.where(largest > 0, largest, 1.0)
    return of_kind[kinds]


def applied(A: ca.DM, sizes: Floats) -> ca.DM:
    """Rows A (C, N) with their columns times the sizes (N,)."""
    columns = np.asarray(A.sparsity().get_col(), dtype=np.intp)
    return ca.DM(A.sparsity(), ca.DM(np.array(A.nonzeros(), dtype=float) * sizes[columns]))
