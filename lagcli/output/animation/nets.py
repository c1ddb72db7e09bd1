"""Curves and nets on which functions of one point are zero: curves are followed step by step, at all T instants at
once where they move, and a surface that is nothing simpler is a net of heights around what moves on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.linear import surface

# Of points (T, k, 3) to values (T, k); T = 1 for what does not move.
Function = Callable[[Floats], Floats]

STEPS = 1600  # of a curve, each way
FINE = 240  # steps to the size of what is seen
COARSE = 80  # the same of a curve that moves, of which each instant is followed
CORNERS = 64  # of a curve that moves, at each instant
REACH = 0.6  # sizes of the scene from its centre at which a curve is broken off
NODES = 17  # of the net along both directions
MOVING_NODES = 13  # the same of a net that moves, whose heights at each instant take room in a page
AROUND = 0.15  # of the size of the scene, by which the net reaches beyond what moves
MOST_SHEETS = 3  # of a surface at rest


def gradient(function: Function, points: Floats, size: float) -> Floats:
    """Central differences at points (T, k, 3), as (T, k, 3)."""
    return _expanded([function], points, size)[1][:, :, 0]


def _expanded(functions: Sequence[Function], points: Floats, size: float) -> tuple[Floats, Floats]:
    """Values (T, k, m) of m functions at points (T, k, 3), and their gradients (T, k, m, 3)."""
    count, width = points.shape[:2]
    step = doubles.STEP * size
    moves = step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    around = (points[:, :, None] + moves).reshape(count, -1, 3)
    found = [np.broadcast_to(one(around), around.shape[:2]).reshape(count, width, 7) for one in functions]
    values = np.stack(found, axis=2)
    return values[..., 0], (values[..., 1:4] - values[..., 4:]) / (2 * step)


def nearest(functions: Sequence[Function], points: Floats, size: float) -> tuple[Floats, Floats]:
    """The points (T, k, 3) near these at which all functions are zero, nan for none, and the gradients there (T, k, m,
    3)."""
    met, rows = surface.nearby_all(lambda points: _expanded(functions, points, size), points, size)
    is_far = np.linalg.norm(met - points, axis=-1) > size  # on another sheet
    return np.where(is_far[..., None], np.nan, met), rows


def followed(functions: Sequence[Function], starts: Floats, size: float, centre: Floats) -> Floats:
    """The curve on which two functions are zero, as points (T, k, 3), both ways from starts (T, 3) near it, until it
    closes or leaves what is seen. nan where there is none; empty if there is none at any instant."""
    count = len(starts)
    step = size / (FINE if count == 1 else COARSE)
    first, rows = nearest(functions, starts[:, None], size)
    point, rows = np.repeat(first, 2, axis=1), np.repeat(rows, 2, axis=1)
    going = np.isfinite(point).all(axis=-1)
    last = np.cross(rows[:, :, 0], rows[:, :, 1]) * np.array([1.0, -1.0])[:, None]
    closed = np.zeros(count, dtype=bool)
    path = []
    for number in range(STEPS):
        direction = np.cross(rows[:, :, 0], rows[:, :, 1])
        length = np.linalg.norm(direction, axis=-1)
        going &= length > doubles.ZERO * np.linalg.norm(rows, axis=-1).prod(axis=-1)
        turned = np.where((direction * last).sum(axis=-1) < 0, -length, length)
        last = direction / np.where(going, turned, np.nan)[..., None]
        there, rows = nearest(functions, point + step * last, size)
        gap = np.linalg.norm(there - point, axis=-1)
        going &= (gap > 0.2 * step) & (gap < 3 * step)
        if number > 2:
            back = going[:, 0] & (np.linalg.norm(there[:, 0] - first[:, 0], axis=-1) < 0.8 * step)
            closed |= back
            going[back] = False
        point = np.where(going[..., None], there, np.nan)
        path.append(point)
        going &= np.linalg.norm(there - centre, axis=-1) <= REACH * size
        if not going.any():
            break
    ways = np.array(path).reshape(-1, count, 2, 3)
    # At each instant both ways are joined; a curve of fewer than three points is none.
    lines = []
    for k in range(count):
        middle = first[k]
        ahead, back = (way[np.isfinite(way).all(axis=-1)] for way in (ways[:, k, 0], ways[:, k, 1]))
        line = np.concatenate([middle, ahead, middle] if closed[k] else [back[::-1], middle, ahead])
        lines.append(line if len(line) > 2 and np.isfinite(middle).all() else np.zeros((0, 3)))
    if count == 1 or not any(map(len, lines)):
        return lines[0][None] if count == 1 else np.zeros((count, 0, 3))
    # `CORNERS` points evenly along each
    found = np.full((count, CORNERS, 3), np.nan)
    for k, line in enumerate(lines):
        if len(line):
            along = np.concatenate([[0.0], np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()])
            wanted = np.linspace(0.0, along[-1], CORNERS)
            found[k] = np.stack([np.interp(wanted, along, line[:, axis]) for axis in range(3)], axis=-1)
    return found


def touched(function: Function, track: Floats) -> Floats:
    """The point (1, 3) of a track (T, 3) that is nearest to function = 0, by the size of its values."""
    with np.errstate(all="ignore"):
        gap = np.abs(np.broadcast_to(function(track[None]), (1, len(track))))
    return track[[int(np.argmin(np.where(np.isfinite(gap), gap, np.inf)))]]


def over_track(function: Function, track: Floats, size: float, moves: bool) -> list[Floats]:
    """The nodes (1 or T, k * k, 3) of nets on function = 0 around a track (T, 3), by heights over a plane of two axes;
    nan where the surface has no height. A surface that bends back has several nets, one that moves the nearest."""
    points = track if moves else touched(function, track)
    slope = np.abs(gradient(function, points[:, None], size)).max(axis=(0, 1))
    if not np.isfinite(slope).all() or not slope.any():
        return []
    straight = _straight(function, points, slope, size)
    if moves or straight is not None:
        up = int(np.argmax(slope)) if straight is None else straight
        found = _sheets(function, track, up, size, points[:, up])
        return [found] if np.isfinite(found).any(axis=1).all() else []
    # Over each plane from below, from above and from the middle; the plane over which most of the track is met.
    best, most = list[Floats](), 0.0
    for up in range(3):
        heights = np.array(
            [track[:, up].min() - AROUND * size, track[:, up].max() + AROUND * size, points[0, up]]
        )
        found = _apart(_sheets(function, track, up, size, heights), up, size)
        # The part of the track that is near a node of the nets
        nodes = found.reshape(-1, 3)
        nodes = nodes[np.isfinite(nodes).all(axis=1)]
        met = 0.0
        if len(nodes):
            some = track[:: max(1, len(track) // 100)]
            apart = np.linalg.norm(some[:, None] - nodes, axis=-1).min(axis=1)
            met = float(np.mean(apart <= 2 * size / NODES))
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
    begin = start.reshape(len(heights), -1, 3)

    def along_one_axis(points: Floats) -> tuple[Floats, Floats]:
        values, rows = _expanded([function], points, size)
        return values, np.where(np.arange(3) == up, rows, 0.0)

    # Moved along one axis onto the surface by Newton's steps
    met, _ = surface.nearby_all(along_one_axis, begin, size)
    there = np.asarray(np.isfinite(met).all(axis=-1))
    points = np.where(there[..., None], met, begin)
    there &= (points[..., up] > low[up] - AROUND * size) & (points[..., up] < high[up] + AROUND * size)
    points[~there, up] = np.nan
    return points


def _apart(sheets: Floats, up: int, size: float) -> Floats:
    """The nets (H, k, 3), without what an earlier one of them holds."""
    heights = sheets[..., up]
    for number in range(1, len(sheets)):
        gaps = np.abs(heights[number] - heights[:number])
        heights[number, (gaps <= doubles.ROOT * size).any(axis=0)] = np.nan
    return sheets


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


def _straight(function: Function, points: Floats, slope: Floats, size: float) -> int | None:
    """An axis along which the function is straight, so that there is one height everywhere; or None."""
    steps = size * np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
    for axis in (2, 1, 0):
        line = np.repeat(points[:, None], len(steps), axis=1)
        line[..., axis] += steps
        values = np.broadcast_to(function(line), line.shape[:2])
        bend = np.abs(np.diff(values, 2, axis=1)).max()
        if np.isfinite(bend) and slope[axis] > 0 and bend <= doubles.ZERO * np.abs(values).max():
            return axis
    return None
