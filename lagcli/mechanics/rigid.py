"""Rigid bodies: a base of particles tied by distances, every further particle by three linear rows.

With r_1 ... r_{d+1} the base of a body of dimension d, a further particle is r_k = sum_j alpha_j r_j with
sum_j alpha_j = 1, the alpha_j taken from the start. The rows are independent, and motion and R are those of
the rigid body: d (d + 1) / 2 + 3 (K - d - 1) rows for K particles leave 5 freedoms for a line, 6 otherwise.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# A particle closer to the span of those before it than this part of the body's size does not extend the base.
SPAN_TOLERANCE = 1e-7


class DegenerateBody(ValueError):
    """All particles of the body stand at one point."""


@dataclasses.dataclass(frozen=True, slots=True)
class Geometry:
    """Places in the body's list: `base`, the `pairs` of the base with their `distances` (length), and for each
    of the `further` places its coefficients `alpha` (len(further), len(base))."""

    base: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]
    distances: tuple[float, ...]
    further: tuple[int, ...]
    alpha: Floats

    @property
    def shape(self) -> tuple[tuple[int, ...], ...]:
        """What the rows look like, whatever their constants are."""
        return self.base, self.further

    @property
    def row_constants(self) -> int:
        """Number of constants in the rows."""
        return len(self.distances) + self.alpha.size

    @property
    def numbers(self) -> tuple[float, ...]:
        """The constants of the rows: distances, then alpha row by row."""
        return (*self.distances, *self.alpha.ravel().tolist())


def geometry(points: Floats) -> Geometry:
    """Geometry of a body from the positions of its particles, shape (K, 3). Raises `DegenerateBody`."""
    size = float(np.max(np.linalg.norm(points - points[0], axis=1)))
    if size == 0.0:
        raise DegenerateBody
    base = _base(points, SPAN_TOLERANCE * size)
    pairs = tuple(itertools.combinations(range(len(base)), 2))
    # In the order of the specification: (1,2), (1,3), (2,3), (1,4), ...
    pairs = tuple(sorted(pairs, key=lambda pair: (pair[1], pair[0])))
    distances = tuple(float(np.linalg.norm(points[base[i]] - points[base[j]])) for i, j in pairs)
    further = tuple(k for k in range(len(points)) if k not in base)
    edges = (points[list(base[1:])] - points[base[0]]).T
    alpha = np.zeros((len(further), len(base)))
    for row, k in enumerate(further):
        weights = np.linalg.lstsq(edges, points[k] - points[base[0]], rcond=None)[0]
        alpha[row, 1:] = weights
        alpha[row, 0] = 1.0 - weights.sum()
    return Geometry(tuple(base), pairs, distances, further, alpha)


def _base(points: Floats, tolerance: float) -> list[int]:
    """The first particles that span the body: each lies off the span of those before it."""
    base = [0]
    directions = np.zeros((0, 3))
    for k in range(1, len(points)):
        offset = points[k] - points[0]
        rest = offset - directions.T @ (directions @ offset)
        length = float(np.linalg.norm(rest))
        if length > tolerance:
            base.append(k)
            directions = np.vstack([directions, rest / length])
        if len(base) == 4:
            break
    return base
