"""Second variations where contacts touch and carry nothing: only the directions that they allow count.

Such a contact holds nothing, but one may not pass it. The sign of u^T H u on the cone of what is left decides (strict
copositivity), and not the eigenvalues of H: on x >= 0, y >= 0 nothing is less than x y + x^2 + y^2 - 3 x y / 2 at 0.
"""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# All sets of so many contacts are gone through.
MOST = 8
# Of rows and directions of length one: what is behind a contact.
BEHIND = 1e-9


def extremes(H: Floats, G: Floats) -> tuple[float, float] | None:
    """The least and the greatest u^T H u of all u of length one with G u >= 0, None where only u = 0 is left.

    H (d, d) symmetric, G (k, d) with k <= MOST. Both are reached at an eigenvector of H restricted to a face of the
    cone, on which some rows are zero, and of several the smaller faces have their own.
    """
    lengths = np.linalg.norm(G, axis=1)
    rows = G[lengths > BEHIND] / lengths[lengths > BEHIND, None]
    found: list[float] = []
    for size in range(len(rows) + 1):
        for on in itertools.combinations(range(len(rows)), size):
            face = _kernel(rows[list(on)], H.shape[0])
            if not face.shape[1]:
                continue
            values, vectors = np.linalg.eigh(face.T @ H @ face)
            above = rows @ (face @ vectors)
            inside = (above >= -BEHIND).all(axis=0) | (above <= BEHIND).all(axis=0)
            found += values[inside].tolist()
    return (min(found), max(found)) if found else None


def _kernel(rows: Floats, n: int) -> Floats:
    if not len(rows):
        return np.eye(n)
    _, sigma, Vt = np.linalg.svd(rows)
    return np.asarray(Vt[int((sigma > BEHIND).sum()) :].T)
