"""The surface of a row of one particle that is nothing simpler: a net of triangles around what moves on it."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

from lagcli.output.animation.wires import EXACT, Function, gradient

Floats = npt.NDArray[np.float64]
NODES = 17  # of the net along both directions
AROUND = 0.15  # of the size of the scene, by which the net reaches beyond what moves
STEPS = 30
DIFFERENCE = 1e-6  # of the size


def triangles(function: Function, track: Floats, size: float) -> Floats:
    """Corners (3 k, 3) of triangles on function = 0 around a track (T, 3), by heights over the plane of two axes; empty
    where the surface has no such heights there."""
    touched = track[int(np.argmin(np.abs(np.broadcast_to(function(track), len(track)))))]
    slope = np.abs(gradient(function, touched, size))
    if not np.isfinite(slope).all() or not slope.any():
        return np.zeros((0, 3))
    up = _upright(function, touched, slope, size)
    across = [axis for axis in range(3) if axis != up]
    low, high = track.min(axis=0) - AROUND * size, track.max(axis=0) + AROUND * size
    lines = [np.linspace(low[axis], high[axis], NODES) for axis in across]
    net = np.zeros((NODES, NODES, 3))
    net[..., across[0]], net[..., across[1]] = np.meshgrid(*lines, indexing="ij")
    net[..., up] = touched[up]
    places, there = _lifted(function, net.reshape(-1, 3), up, size)
    bounded = (places[:, up] > low[up] - AROUND * size) & (places[:, up] < high[up] + AROUND * size)
    there = (there & bounded).reshape(NODES, NODES)
    net = places.reshape(NODES, NODES, 3)
    found = []
    for i, j in itertools.product(range(NODES - 1), range(NODES - 1)):
        if there[i : i + 2, j : j + 2].all():
            a, b, c, d = net[i, j], net[i + 1, j], net[i + 1, j + 1], net[i, j + 1]
            found += [a, b, c, a, c, d]
    return np.array(found).reshape(-1, 3)


def _upright(function: Function, place: Floats, slope: Floats, size: float) -> int:
    """The axis of heights: one along which the function is straight has one height everywhere, else the steepest."""
    steps = size * np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
    for axis in (2, 1, 0):
        places = np.tile(place, (len(steps), 1))
        places[:, axis] += steps
        values = np.broadcast_to(function(places), len(steps))
        bend = np.abs(np.diff(values, 2)).max()
        if np.isfinite(bend) and slope[axis] > 0 and bend <= EXACT * np.abs(values).max():
            return axis
    return int(np.argmax(slope))


def _lifted(function: Function, places: Floats, up: int, size: float) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Places (k, 3) moved along one axis onto the surface by Newton's steps, and which of them stand on it."""
    step = np.zeros(3)
    step[up] = DIFFERENCE * size
    places, there = places.copy(), np.zeros(len(places), dtype=bool)
    for _ in range(STEPS):
        values = np.broadcast_to(function(places), len(places))
        slope = (function(places + step) - function(places - step)) / (2 * step[up])
        move = np.where(slope != 0, -values / np.where(slope != 0, slope, 1.0), np.inf)
        there = np.abs(move) <= EXACT * size
        places[:, up] += np.where(np.isfinite(move) & ~there, np.clip(move, -0.3 * size, 0.3 * size), 0.0)
    return places, there
