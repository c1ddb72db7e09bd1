"""Point masses and rods, released at rest: the chain and the cloth, as numbers.

Masses are 1, gravity is 9.81 down z. The rods are as long as they are at the start.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import linalg

from . import extrapolation

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.intp]

GRAVITY = 9.81
DIRECTION = np.array([math.sin(0.5), 0.1, -math.cos(0.5)])
DIRECTION = DIRECTION / np.linalg.norm(DIRECTION)


@dataclasses.dataclass(frozen=True, slots=True)
class Network:
    """points (N, 3), the indices of those that are held fast, rods (C, 2) as pairs of indices."""

    points: Floats
    held: tuple[int, ...]
    rods: Integers

    @property
    def free(self) -> Integers:
        """The indices of the points that move."""
        return np.setdiff1d(np.arange(len(self.points)), self.held)

    def as_json(self) -> dict[str, Any]:
        return {"points": self.points.tolist(), "held": list(self.held), "rods": self.rods.tolist()}


def chain(links: int) -> Network:
    """A straight chain of rods of length 1 from the origin, which is point 0, along `DIRECTION`."""
    points = np.arange(links + 1)[:, None] * DIRECTION
    rods = np.stack([np.arange(links), np.arange(1, links + 1)], axis=1)
    return Network(points, (0,), rods)


def cloth(side: int) -> Network:
    """side x side points in a half cylinder of rods of length 1, held at the two corners with j = 1.

    Point (i, j) has the index (i - 1) side + j - 1; i runs along the arc, j along the axis.
    """
    i, j = np.divmod(np.arange(side * side), side)
    radius, turn = cylinder(side)
    angle = (i - (side - 1) / 2) * turn
    points = np.stack([radius * np.sin(angle), j.astype(float), -radius * np.cos(angle)], axis=1)
    index = np.arange(side * side).reshape(side, side)
    along = np.stack([index[:-1].ravel(), index[1:].ravel()], axis=1)
    across = np.stack([index[:, :-1].ravel(), index[:, 1:].ravel()], axis=1)
    return Network(points, (0, side * (side - 1)), np.concatenate([along, across]))


def cylinder(side: int) -> tuple[float, float]:
    """Radius, and the angle between neighbours of distance 1, of half a cylinder of `side` points."""
    turn = math.pi / (side - 1)
    return 1 / (2 * math.sin(turn / 2)), turn


class _Rods:
    """Accelerations of the free points by (D.24) with M = 1, f = (|u|^2 - L^2)/2."""

    def __init__(self, network: Network) -> None:
        free = network.free
        place = np.full(len(network.points), -1)
        place[free] = np.arange(len(free))
        self._points = network.points.copy()
        self._free, self._rods = free, network.rods
        self._velocities = np.zeros_like(self._points)
        self._weight = np.tile([0.0, 0.0, -GRAVITY], len(free))
        entries = [(place[network.rods[:, end]], sign) for end, sign in ((0, -1.0), (1, 1.0))]
        self._moving = [(at >= 0, sign) for at, sign in entries]
        rows = [np.repeat(np.flatnonzero(at >= 0), 3) for at, _ in entries]
        columns = [(3 * at[at >= 0][:, None] + np.arange(3)).ravel() for at, _ in entries]
        self._places = (np.concatenate(rows), np.concatenate(columns))
        self._shape = (len(network.rods), 3 * len(free))

    def rate(self, y: Floats) -> Floats:
        """y' of y = (x, v) of the free points."""
        half = len(y) // 2
        self._points[self._free] = y[:half].reshape(-1, 3)
        self._velocities[self._free] = y[half:].reshape(-1, 3)
        first, second = self._rods.T
        u = self._points[second] - self._points[first]
        du = self._velocities[second] - self._velocities[first]
        data = np.concatenate([sign * u[moving].ravel() for moving, sign in self._moving])
        B = sparse.csr_matrix((data, self._places), shape=self._shape)
        right = -np.einsum("ij,ij->i", du, du) - B @ self._weight
        lam = linalg.splu((B @ B.T).tocsc(), permc_spec="MMD_AT_PLUS_A").solve(right)
        return np.concatenate([y[half:], self._weight + B.T @ lam])


def reference(network: Network, duration: float) -> Floats:
    """Positions of the free points at the end, (3 n,), by extrapolation to rounding: neither CasADi nor Runge-Kutta."""
    start = network.points[network.free].ravel()
    y = extrapolation.solve(_Rods(network).rate, np.concatenate([start, np.zeros_like(start)]), duration)
    return y[: start.size]
