"""The scene of a motion, with what the rows of its model look like."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lagcli.model import model as nouns
from lagcli.output.animation import links, quadratic_algebra, row_pictures, scene
from lagcli.output.animation.curve_pictures import CurvePictures
from lagcli.output.animation.links import PointTable, Tie
from lagcli.output.animation.point_tracks import NothingToShow
from lagcli.output.animation.row_pictures import RowPictures
from lagcli.output.animation.scene import DrawnSurface, Link, Scene, TimeCurve, steady
from lagcli.output.figures import chart

Floats = npt.NDArray[np.float64]

# Radii of particles as parts of the size of the scene: of the heaviest, and of the lightest at least.
LARGEST, LEAST = 0.022, 0.007
FEW = 20  # more particles are drawn smaller, so that together they cover no more of the picture
BESIDE = 0.3  # of the shortest rod: no particle is larger
ARROW = 0.15  # of the size of the scene: all but a few arrows are shorter
MOST_NAMED = 8  # rows that are not drawn
USUAL = 0.99  # a part of all instants: the largest arrows of the others do not set the scale


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
    curves: tuple[TimeCurve, ...] = ()
    notes: tuple[str, ...] = ()
    guide_lines: tuple[DrawnSurface, ...] = ()
    ties: tuple[Tie, ...] = ()
    is_run: bool = True


def scene_of(motion: Motion, model: nouns.Model | None, title: str, units: tuple[str, str]) -> Scene:
    """The scene of a motion; without a model there are neither rods nor surfaces, and all particles are alike. units:
    labels of time and force. Raises `NothingToShow` for lengths or times that no page holds."""
    far = float(np.abs(motion.particles).max(initial=0.0))
    if not far * far < np.finfo(np.float64).max / motion.particles.size:
        raise NothingToShow(f"positions of up to {far:.3g} are too large to be drawn")
    if not float(motion.t[-1]) - float(motion.t[0]) <= float(np.finfo(np.float32).max):
        raise NothingToShow(
            f"times from {motion.t[0]:.3g} to {motion.t[-1]:.3g} are too far apart to be shown"
        )
    points = PointTable(motion.particles, motion.is_run)
    found, surfaces = RowPictures(), list(motion.guide_lines)
    if model is not None:
        extent = scene.size(points.tracks)
        found = row_pictures.pictures(model, motion.t, motion.particles, points, extent)
    found.links += [points.tie(tie) for tie in motion.ties]
    hard = links.contact_radii(found.pairs, found.lines, len(motion.names))
    tracks = [*points.tracks, *_reaches(found)]
    # The direction of the constant forces on all particles together, where that is numbers alone
    view = scene.view(tracks, None if model is None else quadratic_algebra.weight(model))
    size, notes = scene.size(tracks), motion.notes
    if model is not None:
        curves = CurvePictures(model, motion.t, motion.particles, view, found).all()
        surfaces += row_pictures.surfaces(found, motion.particles, hard, view) + curves
        notes = (*notes, *unseen(model, found.shown))
    if points.unenforced:
        notes = (
            *notes,
            f"{points.unenforced} rods or strings are not drawn: their lengths are not those of the rows",
        )
    return Scene(
        title=title,
        t=motion.t,
        names=motion.names,
        points=tuple(points.tracks),
        radii=_radii(_masses(model, len(motion.names)), found.links, hard, size),
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
        more = f" and {len(hidden) - MOST_NAMED} others" if len(hidden) > MOST_NAMED else ""
        yield f"kept, and not drawn: {', '.join(hidden[:MOST_NAMED])}{more}"


def _reaches(found: RowPictures) -> list[Floats]:
    """The outermost points of round surfaces that hold a particle."""
    tracks = []
    for _, ball in found.rounds:
        half = np.linalg.norm(ball.frames[:, :3], axis=1)
        if ball.kind == "sphere":
            tracks += [ball.frames[:, 3] - half, ball.frames[:, 3] + half]
    return tracks


def _masses(model: nouns.Model | None, count: int) -> Floats:
    if model is None:
        return np.ones(count)
    return np.concatenate([np.zeros(0), *(np.ravel(p.mass_values) for p in model.particles)])


def _radii(masses: Floats, rods: list[Link], hard: Floats, size: float) -> Floats:
    """Radii (N,): as the cube root of the mass, within bounds; of hard spheres their own."""
    if not len(masses):
        return np.zeros(0)
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
    forces = [
        chart.sizes(part).max(axis=1) for part in (motion.R, motion.F) if part is not None and part.size
    ]
    if not forces:
        return 0.0
    largest = float(np.quantile(np.max(forces, axis=0), USUAL))
    # Forces of which no arrow can be told from none, or that are beyond all numbers, have none.
    is_drawn = np.finfo(float).tiny < largest < np.inf
    return ARROW * size / largest if is_drawn else 0.0
