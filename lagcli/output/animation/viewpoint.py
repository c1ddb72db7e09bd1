"""From where a scene is seen: planar motion face on, other motion from above and aside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.output.animation.scene import Viewpoint

Floats = npt.NDArray[np.float64]
FLAT = 1e-6  # a part of the extent: points closer than this to a plane lie in it
ASIDE = np.array([0.45, -1.0, 0.4])  # towards the eye, where z is up
LEAST = 1e-300  # for what is divided by: no extent at all


def bounds(tracks: Sequence[Floats]) -> tuple[Floats, Floats]:
    """The corners of the box around all tracks (k, 3) each."""
    low = np.min([track.min(axis=0) for track in tracks], axis=0)
    high = np.max([track.max(axis=0) for track in tracks], axis=0)
    return low, high


def size(tracks: Sequence[Floats]) -> float:
    """The diagonal of that box; 1 where all stands at one point."""
    low, high = bounds(tracks)
    return float(np.linalg.norm(high - low)) or 1.0


def view(tracks: Sequence[Floats], down: Floats | None) -> Viewpoint:
    """The view of points with tracks (k, 3). down: the direction of gravity, where there is one."""
    low, high = bounds(tracks)
    centre, extent = (low + high) / 2, float(np.linalg.norm(high - low))
    up = np.array([0.0, 0.0, 1.0])
    if down is not None and np.linalg.norm(down) > 0:
        up = -down / np.linalg.norm(down)
    axes, spread = _spread([track - centre for track in tracks])
    flat = spread[2] <= FLAT * max(spread[0], LEAST) and extent > 0
    if not flat:
        towards = _turned(up)
        return Viewpoint(towards / np.linalg.norm(towards), up, centre, extent / 2 or 1.0, False)
    normal, up = _face(axes, spread, up)
    return Viewpoint(normal, up, centre, extent / 2, True)


def _spread(tracks: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Principal directions (rows), and how far points reach along each."""
    total = sum((track.T @ track for track in tracks), np.zeros((3, 3)))
    scale = float(np.abs(total).max()) or 1.0
    _, vectors = np.linalg.eigh(total / scale)
    axes = vectors.T[::-1]
    return axes, np.array([max(float(np.abs(track @ axis).max()) for track in tracks) for axis in axes])


def _turned(up: Floats) -> Floats:
    """The direction aside, for another direction that is up."""
    if abs(up[2]) > 1 - FLAT:
        return np.asarray(ASIDE * np.array([1.0, 1.0, np.sign(up[2])]))
    right = np.cross(up, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.asarray(ASIDE[0] * right + ASIDE[1] * np.cross(up, right) + ASIDE[2] * up)


def _face(axes: Floats, spread: Floats, up: Floats) -> tuple[Floats, Floats]:
    """The direction towards the eye and up, of points in the plane of the first two axes, or on the first alone."""
    normal = axes[2]
    if spread[1] <= FLAT * spread[0]:  # on a line: the plane with up in it
        line = axes[0]
        normal = np.cross(line, up)
        if np.linalg.norm(normal) <= FLAT:
            normal = np.array([0.0, -1.0, 0.0]) if abs(line[1]) < 1 - FLAT else np.array([1.0, 0.0, 0.0])
    normal = normal / np.linalg.norm(normal)
    up = up - (up @ normal) * normal
    if np.linalg.norm(up) <= 0.1:  # it looks at the eye
        y = np.array([0.0, 1.0, 0.0])
        up = y - (y @ normal) * normal
        if np.linalg.norm(up) <= 0.1:
            up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    up = up / np.linalg.norm(up)
    right = np.cross(up, normal)
    # x runs to the right, or else y; z towards the eye in a plane z = 0.
    leading = right[int(np.argmax(np.abs(right).round(6)))]
    return (normal if leading >= 0 else -normal), up
