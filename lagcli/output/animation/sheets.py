"""The surface of a row of one particle that is nothing simpler: a net of heights around what moves on it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.output.animation.wires import EXACT, Function, gradient

Floats = npt.NDArray[np.float64]
NODES = 17  # of the net along both directions
MOVING_NODES = 13  # the same of a net that moves, whose heights at each instant take room in a page
AROUND = 0.15  # of the size of the scene, by which the net reaches beyond what moves
STEPS = 30  # Newton's; where they have not ended by then the net is left open
DIFFERENCE = 1e-6  # of the size


def net(function: Function, track: Floats, size: float, moves: bool) -> Floats:
    """The nodes (1 or T, k * k, 3) of a net on function = 0 around a track (T, 3), by heights over the plane of two
    axes; nan where the surface has no height, empty where it has none at all."""
    count, nodes = (len(track), MOVING_NODES) if moves else (1, NODES)
    touched = track
    if not moves:
        gap = np.abs(np.broadcast_to(function(track[None]), (1, len(track))))
        touched = track[[int(np.argmin(np.where(np.isfinite(gap), gap, np.inf)))]]
    slope = np.abs(gradient(function, touched[:, None], size)).max(axis=(0, 1))
    if not np.isfinite(slope).all() or not slope.any():
        return np.zeros((1, 0, 3))
    up = _upright(function, touched, slope, size)
    across = [axis for axis in range(3) if axis != up]
    low, high = track.min(axis=0) - AROUND * size, track.max(axis=0) + AROUND * size
    lines = [np.linspace(low[axis], high[axis], nodes) for axis in across]
    start = np.zeros((count, nodes, nodes, 3))
    start[..., across[0]], start[..., across[1]] = np.meshgrid(*lines, indexing="ij")
    start[..., up] = touched[:, None, None, up]
    places, there = _lifted(function, start.reshape(count, -1, 3), up, size)
    there &= (places[..., up] > low[up] - AROUND * size) & (places[..., up] < high[up] + AROUND * size)
    places[~there, up] = np.nan
    return places if there.any() else np.zeros((1, 0, 3))


def triangles(nodes: Floats) -> Floats:
    """Corners (3 k, 3) of the triangles of a net (n * n, 3), two a square a b c d: a b c and a c d."""
    side = round(len(nodes) ** 0.5)
    grid = nodes.reshape(side, side, 3)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    squares = np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 6, 3)
    return squares[np.isfinite(squares).all(axis=(1, 2))].reshape(-1, 3)


def strings(nodes: Floats) -> Floats:
    """The lines of a net (n * n, 3) along both directions, as points (k, 3) with nan between them."""
    side = round(len(nodes) ** 0.5)
    grid = nodes.reshape(side, side, 3)
    gap = np.full((side, 1, 3), np.nan)
    ways = [np.concatenate([lines, gap], axis=1) for lines in (grid, grid.transpose(1, 0, 2))]
    return np.concatenate(ways).reshape(-1, 3)


def _upright(function: Function, places: Floats, slope: Floats, size: float) -> int:
    """The axis of heights: one along which the function is straight has one height everywhere, else the steepest."""
    steps = size * np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
    for axis in (2, 1, 0):
        line = np.repeat(places[:, None], len(steps), axis=1)
        line[..., axis] += steps
        values = np.broadcast_to(function(line), line.shape[:2])
        bend = np.abs(np.diff(values, 2, axis=1)).max()
        if np.isfinite(bend) and slope[axis] > 0 and bend <= EXACT * np.abs(values).max():
            return axis
    return int(np.argmax(slope))


def _lifted(function: Function, places: Floats, up: int, size: float) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Places (T, k, 3) moved along one axis onto the surface by Newton's steps, and which of them stand on it."""
    step = np.zeros(3)
    step[up] = DIFFERENCE * size
    places, there = places.copy(), np.zeros(places.shape[:2], dtype=bool)
    for _ in range(STEPS):
        values = np.broadcast_to(function(places), there.shape)
        slope = (function(places + step) - function(places - step)) / (2 * step[up])
        move = np.where(slope != 0, -values / np.where(slope != 0, slope, 1.0), np.inf)
        there = np.abs(move) <= EXACT * size
        if there.all():
            break
        places[..., up] += np.where(np.isfinite(move) & ~there, np.clip(move, -0.3 * size, 0.3 * size), 0.0)
    return places, there
