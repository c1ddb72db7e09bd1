"""Rank of constraint rows by a gap in their singular values; no gap means undecided.

Rows are taken in the mass-weighted metric (B M^-1/2) and normalized, so that the answer depends neither on how
a row is scaled nor on units of mass.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.metric import Metric

Floats = npt.NDArray[np.float64]

# Singular values of normalized rows: above LARGE they count, below SMALL they are rounding, between is undecided.
# The start is on the surface to rounding, 1e-16, and where rows are dependent on a surface but not beside it the
# rest they show is its square root.
LARGE, SMALL = 3e-6, 1e-7
# A row takes part in a dependence if its weight in the null vector is above this.
WEIGHT = 1e-6


@dataclasses.dataclass(frozen=True, slots=True)
class Rank:
    """The rank lies between `low` and `high`; `dependences` are the left null vectors beyond `low` (d, C)."""

    low: int
    high: int
    singular_values: Floats
    dependences: Floats

    @property
    def value(self) -> int | None:
        """The rank, or None where no gap separates the singular values."""
        return self.low if self.low == self.high else None


def normalized(B: Floats, metric: Metric) -> Floats:
    """Rows of B M^-1/2 of length one; shape (C, n)."""
    return unit(metric.whitened(B))


def unit(rows: Floats) -> Floats:
    """Rows of length one; a row that vanishes stays zero."""
    lengths = np.linalg.norm(rows, axis=1)
    return np.asarray(rows / np.where(lengths > 0, lengths, 1.0)[:, None])


def rank(rows: Floats) -> Rank:
    """Rank of normalized rows (C, n)."""
    if rows.shape[0] == 0:
        return Rank(0, 0, np.zeros(0), np.zeros((0, 0)))
    padded = np.zeros(rows.shape[0])
    sigma = np.linalg.svd(rows, compute_uv=False)
    padded[: sigma.size] = sigma
    large, small = int((padded > LARGE).sum()), int((padded > SMALL).sum())
    if large == rows.shape[0]:
        return Rank(large, small, padded, np.zeros((0, rows.shape[0])))
    return Rank(large, small, padded, np.linalg.svd(rows)[0].T[large:])


def redundant(rows: Floats) -> npt.NDArray[np.bool_]:
    """Which rows depend on rows before them (Gram-Schmidt in their order, twice for rounding)."""
    basis = np.zeros((0, rows.shape[1]))
    flags = np.zeros(rows.shape[0], dtype=bool)
    for i, row in enumerate(rows):
        rest = row.copy()
        for _ in range(2):
            rest -= basis.T @ (basis @ rest)
        length = float(np.linalg.norm(rest))
        flags[i] = length <= LARGE
        if not flags[i]:
            basis = np.vstack([basis, rest / length])
    return flags


def null_basis(rows: Floats) -> Floats:
    """An orthonormal basis of the kernel of the rows, shape (n, n - rank)."""
    if rows.shape[0] == 0:
        return np.eye(rows.shape[1])
    _, sigma, Vt = np.linalg.svd(rows, full_matrices=True)
    return np.asarray(Vt[int((sigma > LARGE).sum()) :].T)


def participants(null_vector: Floats) -> list[int]:
    """The rows that take part in a dependence."""
    weights = np.abs(null_vector)
    return [int(i) for i in np.flatnonzero(weights > WEIGHT * weights.max(initial=1.0))]
