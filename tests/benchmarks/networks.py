"""Point masses and rods, released at rest, as numbers.

Masses are 1, gravity is 9.81 down z. The rods are as long as they are at the start.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from . import extrapolation

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.intp]

GRAVITY = 9.81
LONG = np.longdouble
DIRECTION = np.array([math.sin(0.5), 0.1, -math.cos(0.5)])
DIRECTION = DIRECTION / np.linalg.norm(DIRECTION)


@dataclasses.dataclass(frozen=True, slots=True)
class Network:
    """points (N, d) with d = 3, or 2 in a plane; the indices of those that are held fast; rods (C, 2) as pairs."""

    points: Floats
    held: tuple[int, ...]
    rods: Integers

    @property
    def free(self) -> Integers:
        """The indices of the points that move."""
        return np.setdiff1d(np.arange(len(self.points)), self.held)

    def as_json(self) -> dict[str, Any]:
        numbers = {"points": self.points.tolist(), "held": list(self.held), "rods": self.rods.tolist()}
        return numbers | {"is_plane": self.points.shape[1] == 2}


def pendulum() -> Network:
    """One rod in a plane."""
    return Network(np.array([[0.0, 0.0], [math.sin(0.5), -math.cos(0.5)]]), (0,), np.array([[0, 1]]))


def chain(links: int) -> Network:
    """A straight chain of rods of length 1 from the origin, which is point 0, along `DIRECTION`."""
    points = np.arange(links + 1)[:, None] * DIRECTION
    rods = np.stack([np.arange(links), np.arange(1, links + 1)], axis=1)
    return Network(points, (0,), rods)


def four_bar() -> Network:
    """A crank of 1 m, a coupler of 2 m and a rocker of 1.5 m in a plane, let go with the crank level."""
    joint = np.array([1.0, 0.0])
    far = 2.25
    # The joint of coupler and rocker, below: 2 m from the one, 1.5 m from the other end.
    base = far - joint[0]
    along = (base**2 + 2.0**2 - 1.5**2) / (2 * base)
    points = np.array([[0.0, 0.0], joint, [joint[0] + along, -math.sqrt(2.0**2 - along**2)], [far, 0.0]])
    return Network(points, (0, 3), np.array([[0, 1], [1, 2], [2, 3]]))


def cylinder(side: int) -> tuple[float, float]:
    """Radius, and the angle between neighbours of distance 1, of half a cylinder of `side` points."""
    turn = math.pi / (side - 1)
    return 1 / (2 * math.sin(turn / 2)), turn


class _Rods:
    """Accelerations of the free points by (D.24) with M = 1, f = (|u|^2 - L^2)/2, in numbers of 18 digits or more where
    the machine has them."""

    def __init__(self, network: Network) -> None:
        self._points = network.points.astype(LONG)
        self._free, self._rods = network.free, network.rods
        self._velocities = np.zeros_like(self._points)
        size = self._points.shape[1]
        self._weight = np.zeros((len(self._free), size), LONG)
        self._weight[:, -1] = LONG(str(-GRAVITY))

    def rate(self, y: Any) -> Any:
        """y' of y = (x, v) of the free points."""
        half = len(y) // 2
        self._points[self._free] = y[:half].reshape(self._weight.shape)
        self._velocities[self._free] = y[half:].reshape(self._weight.shape)
        first, second = self._rods.T
        u = self._points[second] - self._points[first]
        du = self._velocities[second] - self._velocities[first]
        B = np.zeros((len(self._rods), *self._points.shape), LONG)
        rows = np.arange(len(self._rods))
        B[rows, second] += u
        B[rows, first] -= u
        B = B[:, self._free].reshape(len(rows), -1)
        right = -(du * du).sum(axis=1) - B @ self._weight.ravel()
        return np.concatenate([y[half:], self._weight.ravel() + B.T @ _solved(B @ B.T, right)])


def _solved(S: Any, right: Any) -> Any:
    """x of S x = right for a positive definite S, by the factors L D L', which LAPACK has for doubles alone."""
    S, x = S.copy(), right.copy()
    for k in range(len(x)):
        below = slice(k + 1, k + 1 + np.flatnonzero(S[k, k:])[-1])
        S[below, below] -= np.outer(S[below, k], S[below, k] / S[k, k])
        x[below] -= S[below, k] * (x[k] / S[k, k])
    for k in reversed(range(len(x))):
        x[k] = (x[k] - S[k + 1 :, k] @ x[k + 1 :]) / S[k, k]
    return x


def reference(network: Network, duration: float) -> Floats:
    """Positions of the free points at the end, by extrapolation to rounding: neither CasADi nor Runge-Kutta."""
    start = network.points[network.free].ravel().astype(LONG)
    y = extrapolation.solve(_Rods(network).rate, np.concatenate([start, np.zeros_like(start)]), duration)
    return y[: start.size].astype(float)
