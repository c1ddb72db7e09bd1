"""Curves that two rows of one particle keep it on, followed step by step; and the line of a wall in a planar motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Function = Callable[[Floats], Floats]  # of places (k, 3) to values (k,)

STEPS = 400  # of a curve, each way
FINE = 240.0  # steps to the size of what is seen
REACH = 0.6  # sizes of the scene from its centre at which a curve is broken off
CORRECTIONS, EXACT = 8, 1e-9
DIFFERENCE = 1e-6  # of the size: the step of differences, whose rounding and truncation are both 1e-10


def gradient(function: Function, place: Floats, size: float) -> Floats:
    """Central differences at a place (3,)."""
    step = DIFFERENCE * size
    places = np.concatenate([place + step * np.eye(3), place - step * np.eye(3)])
    values = np.broadcast_to(function(places), 6)
    return np.asarray((values[:3] - values[3:]) / (2 * step))


def nearest(functions: Sequence[Function], place: Floats, size: float) -> Floats | None:
    """The place near this one at which all functions are zero, by Newton's steps of least length, or None."""
    for _ in range(CORRECTIONS * 2):
        values = np.array([float(np.ravel(one(place[None]))[0]) for one in functions])
        rows = np.array([gradient(one, place, size) for one in functions])
        if not np.isfinite(rows).all() or not np.isfinite(values).all():
            return None
        lengths = np.linalg.norm(rows, axis=1)
        if not np.all(lengths > 0):
            return None
        if np.all(np.abs(values) <= EXACT * size * lengths):
            return place
        move = np.linalg.lstsq(rows, -values, rcond=None)[0]
        if np.linalg.norm(move) > size:
            return None
        place = place + move
    return None


def followed(functions: Sequence[Function], start: Floats, size: float, centre: Floats) -> Floats:
    """The curve on which two functions are zero, as points (k, 3), both ways from a start near it; closed curves end
    where they begin, others where they leave what is seen. Empty where there is none."""
    first = nearest(functions, start, size)
    if first is None:
        return np.zeros((0, 3))
    ahead, closed = _one_way(functions, first, (size, 1.0), centre)
    if closed:
        return np.array([first, *ahead, first])
    back, _ = _one_way(functions, first, (size, -1.0), centre)
    return np.array([*reversed(back), first, *ahead])


def _one_way(
    functions: Sequence[Function], first: Floats, scale: tuple[float, float], centre: Floats
) -> tuple[list[Floats], bool]:
    size, sign = scale
    step, place, last = size / FINE, first, None
    found: list[Floats] = []
    for count in range(4 * STEPS):
        rows = [gradient(one, place, size) for one in functions]
        direction = np.cross(rows[0], rows[1])
        length = np.linalg.norm(direction)
        if not np.isfinite(length) or length <= EXACT * np.linalg.norm(rows[0]) * np.linalg.norm(rows[1]):
            return found, False
        direction = direction / length
        direction = sign * direction if last is None else direction * np.sign(direction @ last or 1.0)
        there = nearest(functions, place + step * direction, size)
        if there is None or not 0.2 * step < np.linalg.norm(there - place) < 3 * step:
            return found, False
        last, place = direction, there
        if count > 2 and np.linalg.norm(place - first) < 0.8 * step:
            return found, True
        found.append(place)
        if np.linalg.norm(place - centre) > REACH * size:
            return found, False
    return found, False
