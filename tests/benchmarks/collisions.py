"""Hard spheres from event to event in closed form: the reference of motions with impacts."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def spheres(
    places: Floats, velocities: Floats, sizes: tuple[float, float], duration: float
) -> tuple[Floats, int]:
    """Places at the end, (N, 3), and the number of impacts, of equal spheres in a cube: elastic, without gravity.

    sizes: diameter of the spheres, side of the cube.
    """
    x, v = places.copy(), velocities.copy()
    diameter, side = sizes
    first, second = np.array(list(itertools.combinations(range(len(x)), 2))).T
    t, impacts = 0.0, 0
    while True:
        u, w = x[second] - x[first], v[second] - v[first]
        # |u + w s| = diameter, first root, where they come nearer.
        near, speed = (u * w).sum(axis=1), (w * w).sum(axis=1)
        root = near**2 - speed * ((u * u).sum(axis=1) - diameter**2)
        with np.errstate(invalid="ignore", divide="ignore"):
            hits = np.where((near < 0) & (root > 0), (-near - np.sqrt(root)) / speed, np.inf)
            walls = np.where(v > 0, (side - diameter / 2 - x) / v, (diameter / 2 - x) / v)
        walls[v == 0] = np.inf
        pair, (ball, axis) = int(np.argmin(hits)), np.unravel_index(np.argmin(walls), walls.shape)
        step = min(hits[pair], walls[ball, axis])
        if t + step >= duration:
            return x + v * (duration - t), impacts
        x, t, impacts = x + v * step, t + step, impacts + 1
        if walls[ball, axis] <= hits[pair]:
            v[ball, axis] *= -1
        else:
            i, j = first[pair], second[pair]
            normal = (x[j] - x[i]) / diameter
            push = np.dot(v[j] - v[i], normal) * normal
            v[i], v[j] = v[i] + push, v[j] - push
