"""A scene: all that an animation shows, as numbers over T instants in the units of the model, and whence it is seen.
What does not move has arrays of one row in place of T."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats

# Seconds on the clock of who watches: a run whose time is in seconds and lasts no longer than `WATCHABLE` keeps its own
# time if it lasts `SHORT` at least, any other is shown within `SHOWN`.
SHORT, WATCHABLE, SHOWN = 2, 40, 10
# A part of the size or length: what is off by more in a table is no rod there, or not on a surface.
OFF = 1e-5
TOWARDS_EYE = np.array([0.45, -1.0, 0.4])  # towards the eye, where z is up
# The directions of space, for shapes whose corners are points.
STANDING = np.concatenate([np.eye(3), np.zeros((1, 3))])[None]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Link:
    """Two points (by their numbers in `Scene.points`) with something between them. length: of a rod, or of a string,
    which is slack where they are closer; 0 for a spring; lengths (T,): of a string that is let out or pulled in."""

    kind: Literal["rod", "string", "spring"]
    name: str
    ends: tuple[int, int]
    length: float = 0.0
    lengths: Floats | None = None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class DrawnSurface:
    """A surface or curve that a row holds a particle on, or on one side of.

    frames (1 or T, 4, 3): three vectors u, v, w and an origin o. A point (a, b, c) of the shape stands at
    o + a u + b v + c w. The shapes: the polygon `corners` (k, 3) with c = 0; the unit sphere; the round side of the
    cylinder a^2 + b^2 = 1, |c| <= 1; the circle a^2 + b^2 = 1, c = 0; the line through `corners` (1 or T, k, 3) and
    the net with n * n of them, row by row, nan where there is none.
    """

    kind: Literal["plane", "sphere", "cylinder", "circle", "line", "net"]
    name: str
    one_sided: bool
    frames: Floats
    corners: Floats = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))

    def corners_at(self, frame: int) -> Floats:
        """The positions (k, 3) of the corners of a line or a net at an instant."""
        return at_instant(self.corners, frame)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Viewpoint:
    """The direction from which a scene is seen, and the one that points up in the picture; centre and size (the radius
    of what is to be seen). flat: the motion stays in a plane, which is seen face on."""

    towards: Floats
    up: Floats
    centre: Floats
    size: float
    flat: bool


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A way to move: its name, what is known of it, if it swings, and the positions of the points over one period (T,
    P, 3)."""

    name: str
    note: str
    swings: bool
    points: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """points: positions of P points, (1 or T, 3) each, the N particles first, then what rods hang on. radii (N,); R and
    F (N entries, 1 or T, 3) in units of force, or empty. scale: the length of an arrow of the unit of force. curves:
    quantities over time (T,), such as lambda of constraints. notes: what was left out or decimated. modes: where ways
    to swing are shown in place of a run."""

    title: str
    t: Floats
    names: tuple[str, ...]
    points: tuple[Floats, ...]
    radii: Floats
    view: Viewpoint
    R: tuple[Floats, ...] = ()
    F: tuple[Floats, ...] = ()
    scale: float = 0.0
    links: tuple[Link, ...] = ()
    surfaces: tuple[DrawnSurface, ...] = ()
    curves: Mapping[str, Floats] = dataclasses.field(default_factory=dict)
    units: tuple[str, str] = ("", "")
    notes: tuple[str, ...] = ()
    modes: tuple[Mode, ...] = ()

    @property
    def count(self) -> int:
        """N, the number of particles."""
        return len(self.names)

    @property
    def rate(self) -> float:
        """Units of the time of the run in a second of who watches."""
        span = float(self.t[-1] - self.t[0])
        if not self.modes and self.units[0].strip() == "s" and SHORT <= span <= WATCHABLE:
            return 1.0
        return span / SHOWN if not self.modes else span / SHORT

    def at(self, point: int, frame: int) -> Floats:
        """The position of a point at an instant."""
        return at_instant(self.points[point], frame)


def at_instant(values: Floats, frame: int) -> Floats:
    """Of values (1 or T, ...) those at an instant."""
    return np.asarray(values[min(frame, len(values) - 1)])


def largest(curves: Mapping[str, Floats], most: int) -> dict[str, Floats]:
    """The curves with the largest values, so many of them, the largest first."""
    sizes = {name: float(np.nan_to_num(np.abs(values)).max(initial=0.0)) for name, values in curves.items()}
    return {name: curves[name] for name in sorted(curves, key=lambda name: -sizes[name])[:most]}


def steady(values: Floats) -> Floats:
    """An array over instants, (T, ...), as one row if it never changes by more than rounding."""
    size = float(np.abs(values).max(initial=0.0))
    if len(values) and float(np.ptp(values, axis=0).max(initial=0.0)) <= doubles.VALUE * size:
        return values[:1]
    return values


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
    steepest = 0.0 if down is None else float(np.abs(down).max())
    if down is not None and 0 < steepest < np.inf:
        up = -down / steepest / np.linalg.norm(down / steepest)
    # Principal directions (rows), and how far points reach along each
    moved = [track - centre for track in tracks]
    total = sum((track.T @ track for track in moved), np.zeros((3, 3)))
    _, vectors = np.linalg.eigh(total / (float(np.abs(total).max()) or 1.0))
    axes = vectors.T[::-1]
    spread = np.array([max(float(np.abs(track @ axis).max()) for track in moved) for axis in axes])
    flat = spread[2] <= doubles.ROOT * max(spread[0], doubles.TINY) and extent > 0
    if not flat:
        # The direction aside, for another direction that is up
        if abs(up[2]) > 1 - doubles.ROOT:
            towards = np.asarray(TOWARDS_EYE * np.array([1.0, 1.0, np.sign(up[2])]))
        else:
            right = np.cross(up, [0.0, 0.0, 1.0])
            right /= np.linalg.norm(right)
            towards = np.asarray(
                TOWARDS_EYE[0] * right + TOWARDS_EYE[1] * np.cross(up, right) + TOWARDS_EYE[2] * up
            )
        return Viewpoint(towards / np.linalg.norm(towards), up, centre, extent / 2 or 1.0, False)
    # The directions towards the eye and up, of points in the plane of the first two axes, or on the first alone
    normal = axes[2]
    if spread[1] <= doubles.ROOT * spread[0]:  # on a line: the plane with up in it
        line = axes[0]
        normal = np.cross(line, up)
        if np.linalg.norm(normal) <= doubles.ROOT:
            normal = (
                np.array([0.0, -1.0, 0.0]) if abs(line[1]) < 1 - doubles.ROOT else np.array([1.0, 0.0, 0.0])
            )
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
    return Viewpoint(normal if leading >= 0 else -normal, up, centre, extent / 2, True)
