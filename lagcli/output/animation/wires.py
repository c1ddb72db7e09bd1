"""Curves that two rows of one particle keep it on, followed step by step; and the line of a wall in a planar motion.

A curve that moves is followed at all T instants at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
# Of places (T, k, 3) to values (T, k); T = 1 for what does not move.
Function = Callable[[Floats], Floats]

STEPS = 1600  # of a curve, each way
FINE = 240.0  # steps to the size of what is seen
COARSE = 80.0  # the same of a curve that moves, of which each instant is followed
CORNERS = 64  # of a curve that moves, at each instant
REACH = 0.6  # sizes of the scene from its centre at which a curve is broken off
CORRECTIONS, EXACT = 16, 1e-9  # Newton's steps onto the curve, and how far from it they may end
DIFFERENCE = 1e-6  # of the size: the step of differences, whose rounding and truncation are both 1e-10


def gradient(function: Function, places: Floats, size: float) -> Floats:
    """Central differences at places (T, k, 3), as (T, k, 3)."""
    return _expanded([function], places, size)[1][:, :, 0]


def _expanded(functions: Sequence[Function], places: Floats, size: float) -> tuple[Floats, Floats]:
    """Values (T, k, m) of m functions at places (T, k, 3), and their gradients (T, k, m, 3)."""
    count, width = places.shape[:2]
    step = DIFFERENCE * size
    moves = step * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    around = (places[:, :, None] + moves).reshape(count, -1, 3)
    found = [np.broadcast_to(one(around), around.shape[:2]).reshape(count, width, 7) for one in functions]
    values = np.stack(found, axis=2)
    return values[..., 0], (values[..., 1:4] - values[..., 4:]) / (2 * step)


def nearest(functions: Sequence[Function], places: Floats, size: float) -> tuple[Floats, Floats]:
    """The places (T, k, 3) near these at which all functions are zero, by Newton's steps of least length, nan where
    there is none; and the gradients there (T, k, m, 3)."""
    for _ in range(CORRECTIONS):
        values, rows = _expanded(functions, places, size)
        lengths = np.linalg.norm(rows, axis=-1)
        known = (
            np.isfinite(values).all(axis=-1) & np.isfinite(lengths).all(axis=-1) & (lengths > 0).all(axis=-1)
        )
        reached = known & np.all(np.abs(values) <= EXACT * size * lengths, axis=-1)
        if np.all(reached | ~known):
            break
        moving = known & ~reached
        inverse = np.linalg.pinv(np.where(moving[..., None, None], rows, 0.0))
        move = -(inverse @ np.where(moving[..., None], values, 0.0)[..., None])[..., 0]
        move[np.linalg.norm(move, axis=-1) > size] = np.nan
        places = np.where(known[..., None], places + move, np.nan)
    return np.where(reached[..., None], places, np.nan), rows


def followed(functions: Sequence[Function], starts: Floats, size: float, centre: Floats) -> Floats:
    """The curve on which two functions are zero, as points (T, k, 3), both ways from starts (T, 3) near it; closed
    curves end where they begin, others where they leave what is seen. nan where there is none; empty if there is none
    at any instant."""
    count = len(starts)
    step = size / (FINE if count == 1 else COARSE)
    first, rows = nearest(functions, starts[:, None], size)
    place, rows = np.repeat(first, 2, axis=1), np.repeat(rows, 2, axis=1)
    going = np.isfinite(place).all(axis=-1)
    last = np.cross(rows[:, :, 0], rows[:, :, 1]) * np.array([1.0, -1.0])[:, None]
    closed = np.zeros(count, dtype=bool)
    path = []
    for number in range(STEPS):
        direction = np.cross(rows[:, :, 0], rows[:, :, 1])
        length = np.linalg.norm(direction, axis=-1)
        going &= length > EXACT * np.linalg.norm(rows, axis=-1).prod(axis=-1)
        turned = np.where((direction * last).sum(axis=-1) < 0, -length, length)
        last = direction / np.where(going, turned, np.nan)[..., None]
        there, rows = nearest(functions, place + step * last, size)
        gap = np.linalg.norm(there - place, axis=-1)
        going &= (gap > 0.2 * step) & (gap < 3 * step)
        if number > 2:
            back = going[:, 0] & (np.linalg.norm(there[:, 0] - first[:, 0], axis=-1) < 0.8 * step)
            closed |= back
            going[back] = False
        place = np.where(going[..., None], there, np.nan)
        path.append(place)
        going &= np.linalg.norm(there - centre, axis=-1) <= REACH * size
        if not going.any():
            break
    ways = np.array(path).reshape(-1, count, 2, 3)
    lines = [_joined(first[k, 0], ways[:, k], bool(closed[k])) for k in range(count)]
    if not any(map(len, lines)):
        return np.zeros((count, 0, 3))
    return lines[0][None] if count == 1 else np.array([_even(one) for one in lines])


def _joined(first: Floats, ways: Floats, closed: bool) -> Floats:
    """The points (k, 3) of a curve from one place both ways (K, 2, 3), which end in nan; none of fewer than three."""
    ahead, back = (way[np.isfinite(way).all(axis=-1)] for way in (ways[:, 0], ways[:, 1]))
    middle = first[None]
    found = np.concatenate([middle, ahead, middle] if closed else [back[::-1], middle, ahead])
    return found if len(found) > 2 and np.isfinite(first).all() else np.zeros((0, 3))


def _even(line: Floats) -> Floats:
    """`CORNERS` points of a line (k, 3), evenly along it; nan of none."""
    if not len(line):
        return np.full((CORNERS, 3), np.nan)
    along = np.concatenate([[0.0], np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()])
    wanted = np.linspace(0.0, along[-1], CORNERS)
    return np.stack([np.interp(wanted, along, line[:, axis]) for axis in range(3)], axis=-1)
