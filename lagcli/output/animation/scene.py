"""A scene: all that an animation shows, as numbers over T instants, whatever shows it.

Lengths, times and forces are in the units of the model. What does not move has arrays of one row in place of T.
"""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Link:
    """Two points (by their numbers in `Scene.points`) with something between them.

    length: of a rod or a string, which is slack where the points are closer; 0 for a spring.
    """

    kind: Literal["rod", "string", "spring"]
    name: str
    ends: tuple[int, int]
    length: float = 0.0


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

    def places(self, frame: int) -> Floats:
        """The places (k, 3) of the corners of a line or a net at an instant."""
        return np.asarray(self.corners[min(frame, len(self.corners) - 1)])


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
class TimeCurve:
    """A quantity over time, (T,), such as lambda of a constraint."""

    name: str
    values: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A way to move: a name, what is known of it, if it swings, and the places of the points over one period,
    (T, P, 3)."""

    name: str
    note: str
    swings: bool
    points: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """points: places of P points, (1 or T, 3) each, the N particles first, then what rods hang on. radii (N,); R and F
    (N entries, 1 or T, 3) in units of force, or empty. scale: the length of an arrow of the unit of force. notes: what
    was left out or thinned. modes: where ways to swing are shown in place of a run."""

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
    curves: tuple[TimeCurve, ...] = ()
    units: tuple[str, str] = ("", "")
    notes: tuple[str, ...] = ()
    modes: tuple[Mode, ...] = ()

    @property
    def count(self) -> int:
        """N, the number of particles."""
        return len(self.names)

    def at(self, point: int, frame: int) -> Floats:
        """The place of a point at an instant."""
        track = self.points[point]
        return np.asarray(track[min(frame, len(track) - 1)])


def steady(values: Floats) -> Floats:
    """An array over instants, (T, ...), as one row if it never changes by more than rounding."""
    size = float(np.abs(values).max(initial=0.0))
    if len(values) and float(np.ptp(values, axis=0).max(initial=0.0)) <= ROUNDING * size:
        return values[:1]
    return values


ROUNDING = 1e-12  # a part of the largest value: less is no motion
