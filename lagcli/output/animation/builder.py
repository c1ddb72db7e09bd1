"""The scene of a motion: the positions that the columns of a table tell, of particles or else of coordinates drawn as
positions, with what the rows of the model look like."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.model import model as nouns
from lagcli.output.animation import links, quadratic, row_pictures, scene
from lagcli.output.animation.links import PointTable, Tie
from lagcli.output.animation.row_pictures import RowPictures
from lagcli.output.animation.scene import STANDING, DrawnSurface, Link, Scene, steady
from lagcli.output.figures import chart

# Radii of particles as parts of the size of the scene: of the heaviest, and of the lightest at least.
LARGEST, LEAST = 0.022, 0.007
FEW = 20  # more particles are drawn smaller, so that together they cover no more of the picture
BESIDE = 0.3  # of the shortest rod: no particle is larger
ARROW = 0.15  # of the size of the scene: all but a few arrows are shorter
MOST_NAMED = 8  # rows that are not drawn
USUAL = 0.99  # a part of all instants: the largest arrows of the others do not set the scale
AXES = ("x", "y", "z")
MOST_SCALES = 60  # coordinates that are drawn as beads on scales
APART = 0.35  # of the length of a scale: the distance of two


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion that is shown, in T instants: t (T,), particles (T, N, 3), forces R and F (T, N, 3) or None, and
    curves beside it. guide_lines: lines that are drawn too; ties: distances that the coordinates keep; is_run: False
    for ways to swing, in which rods may stretch a little."""

    t: Floats
    names: tuple[str, ...]
    particles: Floats
    R: Floats | None = None
    F: Floats | None = None
    curves: Mapping[str, Floats] = dataclasses.field(default_factory=dict)
    notes: tuple[str, ...] = ()
    guide_lines: tuple[DrawnSurface, ...] = ()
    ties: tuple[Tie, ...] = ()
    is_run: bool = True


def scene_of(motion: Motion, model: nouns.Model | None, title: str, units: tuple[str, str]) -> Scene:
    """The scene of a motion; without a model there are neither rods nor surfaces, and all particles are alike. units:
    labels of time and force. Raises `NothingToShow` for lengths or times that no page holds."""
    far, (first, last) = float(np.abs(motion.particles).max(initial=0.0)), motion.t[[0, -1]].tolist()
    if not far * far < np.finfo(np.float64).max / motion.particles.size:
        raise NothingToShow(f"positions of up to {far:.3g} are too large to be drawn")
    if not last - first <= float(np.finfo(np.float32).max):
        raise NothingToShow(f"times from {first:.3g} to {last:.3g} are too far apart to be shown")
    points = PointTable(motion.particles, motion.is_run)
    found, surfaces = RowPictures(), list(motion.guide_lines)
    if model is not None:
        extent = scene.size(points.tracks)
        found = row_pictures.pictures(model, motion.t, motion.particles, points, extent)
    for tie in motion.ties:  # as thin lines
        other = tie.other if isinstance(tie.other, int) else points.point_at(tie.other)
        found.links.append(Link("string", "", (tie.particle, other), tie.length))
    hard = links.contact_radii(found.contacts, len(motion.names))
    tracks = list(points.tracks)
    for _, ball in found.rounds:
        if ball.kind == "sphere":  # which reaches farther than the particle on it
            half = np.linalg.norm(ball.frames[:, :3], axis=1)
            tracks += [ball.frames[:, 3] - half, ball.frames[:, 3] + half]
    # The direction of the constant forces on all particles together, where that is numbers alone
    view = scene.view(tracks, None if model is None else quadratic.weight(model))
    size, notes = scene.size(tracks), motion.notes
    masses = np.ones(len(motion.names))
    if model is not None:
        masses = np.concatenate([np.zeros(0), *(np.ravel(p.mass_values) for p in model.particles)])
        curves = row_pictures.curves(model, motion.t, motion.particles, view, found)
        surfaces += row_pictures.surfaces(found, motion.particles, hard, view) + curves
        notes = (*notes, *unseen(model, found.shown))
    if points.unenforced:
        off = f"{points.unenforced} rods or strings are not drawn: their lengths are not those of the rows"
        notes = (*notes, off)
    return Scene(
        title=title,
        t=motion.t,
        names=motion.names,
        points=tuple(points.tracks),
        radii=_radii(masses, found.links, hard, size),
        view=view,
        R=_tracks(motion.R),
        F=_tracks(motion.F),
        scale=_scale(motion, size),
        links=tuple(found.links),
        surfaces=tuple(surfaces),
        curves=motion.curves,
        units=units,
        notes=notes,
    )


def unseen(model: nouns.Model, shown: set[str]) -> Iterator[str]:
    """A sentence that names the rows that are kept and not drawn, or nothing."""
    laws: tuple[nouns.Law, ...] = (*model.holonomic, *model.inequality, *model.differential)
    hidden = [name for law in laws for name in law.rows if name not in shown]
    if hidden:
        yield f"kept, and not drawn: {diagnostics.first_of(hidden, most=MOST_NAMED)}"


def _radii(masses: Floats, rods: list[Link], hard: Floats, size: float) -> Floats:
    """Radii (N,): as the cube root of the mass, within bounds; of hard spheres their own."""
    largest = LARGEST * size * min(1.0, (FEW / len(masses)) ** 0.5)
    lengths = [link.length for link in rods if link.length > 0]
    if lengths:
        largest = min(largest, BESIDE * min(lengths))
    relative = np.cbrt(masses / (float(masses.max()) or 1.0))
    usual = np.maximum(largest * relative, min(LEAST * size, largest))
    return np.where(np.isnan(hard), usual, hard)


def _tracks(forces: Floats | None) -> tuple[Floats, ...]:
    if forces is None or not np.any(forces):
        return ()
    return tuple(steady(forces[:, k]) for k in range(forces.shape[1]))


def _scale(motion: Motion, size: float) -> float:
    """The length of an arrow of the unit of force, so that almost all are shorter than `ARROW` of the scene."""
    both = [part for part in (motion.R, motion.F) if part is not None and part.size]
    forces = [chart.sizes(part).max(axis=1) for part in both]
    if not forces:
        return 0.0
    largest = float(np.quantile(np.max(forces, axis=0), USUAL))
    # Forces of which no arrow can be told from none, or that are beyond all numbers, have none.
    is_drawn = np.finfo(float).tiny < largest < np.inf
    return ARROW * size / largest if is_drawn else 0.0


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
    known, stems = set(columns), (name[:-2] for name in columns if name.endswith(".x"))
    return tuple(stem for stem in stems if {f"{stem}.y", f"{stem}.z", f"{stem}.vx"} <= known)


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
    first = diagnostics.first_of([f"`{name}`" for name in lacking], most=1)
    return f"the table has no column {first}: it is not of this model" + (f"; {hint}" if hint else "")
