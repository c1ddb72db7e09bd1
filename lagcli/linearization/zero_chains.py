"""Zero eigenvalues of a matrix, taken out by rank: chains at zero blur an eigenvalue to the square root of rounding,
the ranks that they are made of stay clear."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

# A singular value that is this many roundings a row of the largest is zero.
ROUNDINGS = 64.0
EPS = float(np.finfo(float).eps)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class WithoutZeros:
    """S x = 0 for x in `null` (n, k), bases of the generalized null space; `rest` (m, m) has the other eigenvalues,
    in the orthonormal basis `others` (n, m); `coupling` (k, m): S others = others rest + null coupling, step by step
    in `steps`."""

    zeros: int
    null: Floats
    rest: Floats
    steps: tuple[tuple[Floats, Floats, Floats], ...]

    def whole(self, values: Complex, vectors: Complex) -> Complex:
        """Eigenvectors of S (n, m) from those (m, m) of `rest` with their values, none of which is zero."""
        for null, others, coupling in reversed(self.steps):
            vectors = null @ (coupling @ vectors / values) + others @ vectors
        return vectors


def floor(n: int) -> float:
    """The part of its largest singular value that is zero in a matrix of n rows."""
    return ROUNDINGS * EPS * max(n, 8)


def deflate(S: Floats, noise: float = 0.0) -> WithoutZeros:
    """S (n, n) without its zero eigenvalues; noise: singular values that are none."""
    rest, steps, found, into = S, [], [], np.eye(len(S))
    least = max(floor(len(S)) * float(np.linalg.norm(S, 2)), noise) if S.size else 0.0
    while len(rest):
        _, sigma, Vt = np.linalg.svd(rest)
        nullity = int((sigma <= least).sum())
        if not nullity:
            break
        null, others = Vt[len(rest) - nullity :].T, Vt[: len(rest) - nullity].T
        steps.append((null, others, null.T @ rest @ others))
        found.append(into @ null)
        into = into @ others
        rest = others.T @ rest @ others
    null_space = np.hstack(found) if found else np.zeros((len(S), 0))
    return WithoutZeros(null_space.shape[1], null_space, rest, tuple(steps))
