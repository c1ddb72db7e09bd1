"""Rigid bodies: a base of particles tied by distances, every further particle by three linear rows.

With r_1 ... r_{d+1} the base of a body of dimension d, a further particle is r_k = sum_j alpha_j r_j with sum_j alpha_j
= 1 from the start. The rows are independent: d (d + 1) / 2 + 3 (K - d - 1) for K particles leave 5 freedoms for a line,
6 otherwise. A body that is nearly flat keeps a base of three, and its particles off the plane stand at sum_j alpha_j
r_j + gamma (r_2 - r_1) x (r_3 - r_1): distances tie four particles near a plane too poorly.
"""

from __future__ import annotations

import itertools

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.frozen import frozen

# The base takes the first particles that extend the span well, by this part of the body's size; where none does,
# the one that extends it most, if by more than rounding.
WELL = 1e-2
# Distances between positions beyond this overflow.
FAR = 1e307


class DegenerateBody(ValueError):
    """All particles of the body stand at one point."""


@frozen
class Geometry:
    """Indices in the body's list: `base`, the `pairs` of the base with their `distances` (length), and for each
    of the `further` points its coefficients `alpha` (len(further), len(base)) and, where the body is a little off
    its plane, `gamma` (len(further),); otherwise `gamma` is empty."""

    base: tuple[int, ...]
    pairs: tuple[tuple[int, int], ...]
    distances: tuple[float, ...]
    further: tuple[int, ...]
    alpha: Floats
    gamma: Floats

    @property
    def shape(self) -> tuple[tuple[int, ...], tuple[int, ...], bool]:
        """The form of the rows, whatever their constants are."""
        return self.base, self.further, bool(self.gamma.size)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The constants of the rows: distances, alpha row by row, gamma."""
        return (*self.distances, *self.alpha.ravel().tolist(), *self.gamma.tolist())


def geometry(points: Floats) -> Geometry:
    """Geometry of a body from the positions of its particles, shape (K, 3), below `FAR`. Raises `DegenerateBody`."""
    offsets = points - points[0]
    size = float(np.abs(offsets).max())
    if size == 0.0:
        raise DegenerateBody
    points = offsets / size  # squares of lengths neither overflow nor vanish
    # The first particles that span the body, each well off the span of those before it, and an orthonormal basis (k, 3)
    # of the differences of their positions.
    base, directions = [0], np.zeros((0, 3))
    extent = np.linalg.norm(points, axis=1).max()
    while len(base) < 4:
        rest = points - points @ directions.T @ directions
        lengths = np.linalg.norm(rest, axis=1)
        well = np.flatnonzero(lengths > WELL * extent)
        k = int(well[0]) if well.size else int(np.argmax(lengths))
        # A fourth particle that is only a little off the plane of three is described by its height over them.
        if not well.size and (lengths[k] <= doubles.ZERO * extent or len(base) == 3):
            break
        base.append(k)
        directions = np.vstack([directions, rest[k] / lengths[k]])
    pairs = tuple(itertools.combinations(range(len(base)), 2))
    # In the order of the specification: (1,2), (1,3), (2,3), (1,4), ...
    pairs = tuple(sorted(pairs, key=lambda pair: (pair[1], pair[0])))
    distances = tuple(size * float(np.linalg.norm(points[base[i]] - points[base[j]])) for i, j in pairs)
    further = tuple(k for k in range(len(points)) if k not in base)
    edges = (points[list(base[1:])] - points[base[0]]).T
    alpha = np.zeros((len(further), len(base)))
    for row, k in enumerate(further):
        weights = np.linalg.solve(directions @ edges, directions @ (points[k] - points[base[0]]))
        alpha[row, 1:] = weights
        alpha[row, 0] = 1.0 - weights.sum()
    gamma = np.zeros(0)
    if len(base) == 3:
        normal = np.cross(edges[:, 0], edges[:, 1])
        heights = (points[list(further)] - points[base[0]]) @ normal / (normal @ normal)
        if np.abs(heights).max(initial=0.0) * np.linalg.norm(normal) > 1e-12:
            gamma = heights / size
    return Geometry(tuple(base), pairs, distances, further, alpha, gamma)
