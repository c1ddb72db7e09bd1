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
MOST_SHEETS = 3  # of a surface at rest
SAME = 1e-6  # of the size: heights closer than this are one
DIFFERENCE = 1e-6  # of the size


def nets(function: Function, track: Floats, size: float, moves: bool) -> list[Floats]:
    """The nodes (1 or T, k * k, 3) of nets on function = 0 around a track (T, 3), by heights over a plane of two axes;
    nan where the surface has no height. A surface that bends back has several nets, one that moves the nearest."""
    touched = track
    if not moves:
        gap = np.abs(np.broadcast_to(function(track[None]), (1, len(track))))
        touched = track[[int(np.argmin(np.where(np.isfinite(gap), gap, np.inf)))]]
    slope = np.abs(gradient(function, touched[:, None], size)).max(axis=(0, 1))
    if not np.isfinite(slope).all() or not slope.any():
        return []
    straight = _straight(function, touched, slope, size)
    if moves or straight is not None:
        up = int(np.argmax(slope)) if straight is None else straight
        found = _sheets(function, track, up, size, touched[:, up])
        return [found] if np.isfinite(found).any(axis=1).all() else []
    # Over each plane from below, from above and from the middle; the plane over which most of the track is met.
    best, most = list[Floats](), 0.0
    for up in range(3):
        heights = np.array(
            [track[:, up].min() - AROUND * size, track[:, up].max() + AROUND * size, touched[0, up]]
        )
        found = _apart(_sheets(function, track, up, size, heights), up, size)
        met = _met(found, track, size)
        if met > most:
            best, most = [one[None] for one in found if np.isfinite(one[:, up]).any()], met
    return best


def _sheets(function: Function, track: Floats, up: int, size: float, heights: Floats) -> Floats:
    """A net (H, k * k, 3) from each of the heights (H,) at which it is begun."""
    nodes = NODES if len(heights) <= MOST_SHEETS else MOVING_NODES
    across = [axis for axis in range(3) if axis != up]
    low, high = track.min(axis=0) - AROUND * size, track.max(axis=0) + AROUND * size
    lines = [np.linspace(low[axis], high[axis], nodes) for axis in across]
    start = np.zeros((len(heights), nodes, nodes, 3))
    start[..., across[0]], start[..., across[1]] = np.meshgrid(*lines, indexing="ij")
    start[..., up] = heights[:, None, None]
    places, there = _lifted(function, start.reshape(len(heights), -1, 3), up, size)
    there &= (places[..., up] > low[up] - AROUND * size) & (places[..., up] < high[up] + AROUND * size)
    places[~there, up] = np.nan
    return places


def _apart(sheets: Floats, up: int, size: float) -> Floats:
    """The nets (H, k, 3), without what an earlier one of them holds."""
    heights = sheets[..., up]
    for number in range(1, len(sheets)):
        gaps = np.abs(heights[number] - heights[:number])
        heights[number, (gaps <= SAME * size).any(axis=0)] = np.nan
    return sheets


def _met(sheets: Floats, track: Floats, size: float) -> float:
    """The part of a track (T, 3) that is near a node of the nets."""
    nodes = sheets.reshape(-1, 3)
    nodes = nodes[np.isfinite(nodes).all(axis=1)]
    if not len(nodes):
        return 0.0
    some = track[:: max(1, len(track) // 100)]
    apart = np.linalg.norm(some[:, None] - nodes, axis=-1).min(axis=1)
    return float(np.mean(apart <= 2 * size / NODES))


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


def _straight(function: Function, places: Floats, slope: Floats, size: float) -> int | None:
    """An axis along which the function is straight, so that there is one height everywhere; or None."""
    steps = size * np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
    for axis in (2, 1, 0):
        line = np.repeat(places[:, None], len(steps), axis=1)
        line[..., axis] += steps
        values = np.broadcast_to(function(line), line.shape[:2])
        bend = np.abs(np.diff(values, 2, axis=1)).max()
        if np.isfinite(bend) and slope[axis] > 0 and bend <= EXACT * np.abs(values).max():
            return axis
    return None


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
