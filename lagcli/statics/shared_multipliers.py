"""Multipliers that are not unique: of all that balance, those of least weighted norm; contacts only push."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.contact import load_sharing

Floats = npt.NDArray[np.float64]

RANK = 1e-9  # of rows of length one: singular values below it belong to dependent rows


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


def pushing(rows: Floats, lam: Floats, M: Floats, equalities: int) -> tuple[Floats, bool]:
    """lambda (C,) with the same rows^T lambda, no less than 0 after the first `equalities`, of least norm in the mass
    metric, and whether it is the only one: the same as in a run. rows (C, n), M (n, n)."""
    unit, size = _in_metric(rows, M)
    shared, same = load_sharing.shared(unit, lam * size, equalities)
    return np.asarray(np.divide(shared, size, out=np.zeros_like(lam), where=size > 0)), bool(same.all())


def _in_metric(rows: Floats, M: Floats) -> tuple[Floats, Floats]:
    """Rows (C, n) of length one in the mass metric and their lengths, in the plain metric where M is singular."""
    try:
        found = np.linalg.solve(np.linalg.cholesky((M + M.T) / 2), rows.T).T
    except np.linalg.LinAlgError:
        found = rows
    size = np.linalg.norm(found, axis=1)
    return np.asarray(found / np.where(size > 0, size, 1.0)[:, None]), size


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
