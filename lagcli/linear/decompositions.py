"""Decompositions of dense matrices that are known to rounding, the only ones of the program; rows at a state, known to
fewer digits, are for `rank`. And directions that belong to no model, the same in every run and on every machine."""

from __future__ import annotations

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats


def lengths(rows: Floats) -> Floats:
    """The lengths (C,) of rows (C, n), 1 where one vanishes; squares of large entries do not overflow."""
    largest = np.abs(rows).max(axis=1, initial=0.0)
    largest[largest == 0.0] = 1.0
    found = largest * np.linalg.norm(rows / largest[:, None], axis=1)
    return np.where(found > 0.0, found, 1.0)


def unit(rows: Floats) -> Floats:
    """Rows (C, n) of length one; a row that vanishes stays zero."""
    return np.asarray(rows / lengths(rows)[:, None])


def least_squares(A: Floats, b: Floats) -> Floats:
    """The shortest x (n,) or (n, k) that makes |A x - b| least, A (m, n), b (m,) or (m, k)."""
    return np.asarray(np.linalg.lstsq(A, b, rcond=doubles.VALUE)[0], dtype=float)


def residual(A: Floats, b: Floats) -> Floats:
    """b - A x (m,) of the best x, A (m, n): the part of b that no combination of columns makes."""
    return np.asarray(b - A @ least_squares(A, b))


def pseudo_inverse(A: Floats) -> Floats:
    """The inverse (..., n, m) of Moore and Penrose of matrices (..., m, n)."""
    return np.asarray(np.linalg.pinv(A, rcond=doubles.VALUE), dtype=float)


def is_symmetric(A: Floats) -> bool:
    """True if slopes (n, n) are those of a gradient, but for rounding."""
    return bool(np.abs(A - A.T).max(initial=0.0) <= doubles.ZERO * np.abs(A).max(initial=0.0))


def singular_values(A: Floats) -> Floats:
    """Those of a matrix (m, n), the largest first."""
    return np.asarray(np.linalg.svd(A, compute_uv=False))


def axes(A: Floats) -> tuple[Floats, Floats]:
    """Singular values (k,), k = min(m, n), and all right singular vectors (n, n) in rows, of a matrix (m, n)."""
    _, sizes, right = np.linalg.svd(A, full_matrices=True)
    return np.asarray(sizes), np.asarray(right)


def range_basis(columns: Floats) -> Floats:
    """An orthonormal basis (m, r) of what columns (m, n) span."""
    sizes, left = column_axes(columns)
    return np.asarray(left[:, sizes > doubles.VALUE * sizes.max(initial=0.0)])


def column_axes(A: Floats) -> tuple[Floats, Floats]:
    """Singular values (k,), k = min(m, n), and their left vectors (m, k) in columns, of a matrix (m, n)."""
    left, sizes, _ = np.linalg.svd(A, full_matrices=False)
    return np.asarray(sizes), np.asarray(left)


def orthonormal(columns: Floats) -> tuple[Floats, Floats]:
    """Q (m, k) and R (k, n), k = min(m, n), with columns (m, n) = Q R, Q orthonormal and R upper triangular."""
    Q, R = np.linalg.qr(columns)
    return np.asarray(Q, dtype=float), np.asarray(R, dtype=float)


def triangle(columns: Floats) -> Floats:
    """The R of `orthonormal` alone."""
    return np.asarray(np.linalg.qr(columns, mode="r"), dtype=float)


# The first signs of `default_rng(0).choice((-1.0, 1.0))`, written out: a model with few coordinates need not
# load `numpy.random`, which takes a twentieth of the time of its whole run.
_FIRST_SIGNS = "+++------+++++++++"


def generic_direction(n: int, seed: int) -> Floats:
    """n numbers (n,) of mean square one that no model has: parts of squares times the golden ratio (Weyl)."""
    k = np.arange(n, dtype=np.uint64) + np.uint64(1 + seed * 1_000_003)  # a prime lies between the seeds
    golden = np.uint64(0x9E3779B97F4A7C15)  # the part beyond one, of 2^64
    return np.asarray((k * k * golden).astype(np.int64) * (3**0.5 / 2**63))


def generic_parts(count: int) -> tuple[float, ...]:
    """So many parts of a way, the last of them 1, at no common period."""
    return tuple(((np.arange(1, count + 1) / count) ** np.sqrt(2)).tolist())


def generic_signs(n: int) -> Floats:
    """n times -1 or 1 (n,), the first that the generator with the seed 0 chooses."""
    if n <= len(_FIRST_SIGNS):
        return np.array([1.0 if sign == "+" else -1.0 for sign in _FIRST_SIGNS[:n]])
    return np.random.default_rng(0).choice((-1.0, 1.0), size=n)
