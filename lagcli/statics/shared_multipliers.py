"""Multipliers that are not unique: of all that balance, those of least weighted norm."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

RANK = 1e-9


def least(rows: Floats, force: Floats, lengths: Floats) -> Floats:
    """lambda (C,) with rows^T lambda = force and the least sum of (lambda_i length_i)^2; 0 of rows of no length.

    rows (C, n), force (n,), lengths (C,) in the mass metric, as in a run.
    """
    if not len(rows):
        return np.zeros(0)
    divisors = np.where(lengths > 0, lengths, np.inf)
    unit = rows / divisors[:, None]
    found: Floats = np.linalg.lstsq(unit.T, force, rcond=RANK)[0] / divisors
    return found


def lengths(rows: Floats, M: Floats) -> Floats:
    """sqrt(B_i M^-1 B_i^T) of rows (C, n), by the plain metric where M is singular."""
    if not len(rows):
        return np.zeros(0)
    try:
        solved = np.linalg.solve(M, rows.T)
    except np.linalg.LinAlgError:
        solved = rows.T
    squares = np.einsum("ij,ji->i", rows, solved)
    if not np.isfinite(squares).all() or (squares < 0).any():
        squares = np.einsum("ij,ij->i", rows, rows)
    return np.asarray(np.sqrt(squares))
