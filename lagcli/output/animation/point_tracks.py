"""The positions that the columns of a table tell: of particles, or else of coordinates drawn as positions."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from lagcli.errors import diagnostics
from lagcli.output.animation.scene import STANDING, DrawnSurface

Floats = npt.NDArray[np.float64]
AXES = ("x", "y", "z")
MOST_SCALES = 60  # coordinates that are drawn as beads on scales
APART = 0.35  # of the length of a scale: the distance of two


class NothingToShow(ValueError):
    """A table or a model has no positions to draw."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PointTracks:
    """names of N points; track (T, N, 3); guide_lines: the scales they slide on, if they are no positions in space;
    note: how coordinates are drawn; columns: those of reactions for each point and axis, "" where there is none."""

    names: tuple[str, ...]
    track: Floats
    columns: tuple[tuple[str, str, str], ...]
    guide_lines: tuple[DrawnSurface, ...] = ()
    note: str = ""

    def reactions(self, table: Mapping[str, Floats]) -> Floats | None:
        """R of the points (T, N, 3), zero along axes without a column; None where no column is there."""
        wanted = [name for triple in self.columns for name in triple]
        if not any(name in table for name in wanted):
            return None
        zero = np.zeros(len(self.track))
        found = [table.get(name, zero) for name in wanted]
        return np.stack(found, axis=1).reshape(len(self.track), -1, 3)


def particles_in(columns: Sequence[str]) -> tuple[str, ...]:
    """The names whose columns .x, .y, .z and .vx are in a table, in its order: particles, and not vector outputs."""
    known = set(columns)
    return tuple(
        name[:-2]
        for name in columns
        if name.endswith(".x") and all(f"{name[:-2]}.{part}" in known for part in ("y", "z", "vx"))
    )


def of_particles(names: Sequence[str], table: Mapping[str, Floats]) -> PointTracks:
    """The positions of particles."""
    parts = [table[f"{name}.{axis}"] for name in names for axis in AXES]
    track = np.stack(parts, axis=1).reshape(len(parts[0]), -1, 3)
    return PointTracks(tuple(names), track, tuple((f"R.{n}.x", f"R.{n}.y", f"R.{n}.z") for n in names))


def of_coordinates(
    names: Sequence[str], table: Mapping[str, Floats], limits: Mapping[str, tuple[float, float]] | None = None
) -> PointTracks:
    """Coordinates as positions: `x` and `y` (and `z`) as the position of one point, others as beads on scales side by
    side. limits: the lower and upper ends of the scales, by default the least and the greatest values. Raises
    `NothingToShow`."""
    if not names:
        raise NothingToShow("there are no particles and no coordinates: there is nothing to draw")
    zero = np.zeros(len(next(iter(table.values()))))
    if {"x", "y"} <= set(names):
        own = [axis for axis in AXES if axis in names]
        track = np.stack([table[axis] if axis in own else zero for axis in AXES], axis=-1)[:, None]
        note = f"there are no particles: the point stands at the coordinates {', '.join(own)}"
        point = f"({', '.join(own)})"
        x, y, z = (f"R.{axis}" for axis in AXES)
        return PointTracks((point,), track, ((x, y, z),), note=note)
    if len(names) > MOST_SCALES:
        raise NothingToShow(
            f"there are no particles, and {len(names)} coordinates: up to {MOST_SCALES} are drawn as beads on scales"
        )
    tracks, guide_lines = [], []
    for k, name in enumerate(names):
        values = table[name]
        low, high = limits[name] if limits is not None else (float(values.min()), float(values.max()))
        height = (values - low) / (high - low) if high > low else zero + 0.5
        tracks.append(np.stack([zero + APART * k, zero, height], axis=-1))
        corners = np.array([[APART * k, 0.0, 0.0], [APART * k, 0.0, 1.0]])
        guide_lines.append(DrawnSurface("line", name, False, STANDING, corners[None]))
    ends = "of one length for all" if limits is not None else "from its least value up to its greatest"
    note = f"there are no particles: each coordinate is a bead on a scale, {ends}"
    return PointTracks(
        tuple(names), np.stack(tracks, axis=1), (("", "", ""),) * len(names), tuple(guide_lines), note
    )


def missing(names: Sequence[str], columns: Sequence[str]) -> str:
    """A sentence on the positions of a model that a table lacks, or nothing."""
    known = set(columns)
    lacking = [f"{name}.{axis}" for name in names for axis in AXES if f"{name}.{axis}" not in known]
    if not lacking:
        return ""
    hint = diagnostics.nearest(lacking[0], list(columns))
    more = f" and {len(lacking) - 1} others" if len(lacking) > 1 else ""
    return f"the table has no column `{lacking[0]}`{more}: it is not of this model" + (
        f"; {hint}" if hint else ""
    )
