"""The scene of small oscillations: each mode as a way to swing."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lagcli.api import animate
from lagcli.linearization.linear_modes import Modes
from lagcli.model.model import Model
from lagcli.output.animation import builder, scene
from lagcli.output.animation.builder import Motion
from lagcli.output.animation.scene import Mode, Scene

Floats = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

FRAMES = 49  # of one period, both ends counted
SWING = 0.12  # of the size of the system: the largest way that a particle goes
LARGEST = 0.6  # of an angle, and of a coordinate that moves nothing
TRIED = 1e-6  # of a coordinate: the step in which the way of the particles is measured
MOST_MODES = 60  # as many as `modes` prints


def of_modes(model: Model, found: Modes) -> Scene:
    """The scene of the modes of a model. Raises `builder.NothingToShow` where there are no shapes."""
    animate.require_few(model)
    if not len(found.shapes):
        raise builder.NothingToShow(
            "the motion comes back to itself, and its multipliers have no shapes to show"
            if found.multipliers is not None
            else "nothing can swing: the rows leave the model no freedom to move"
        )
    t = np.linspace(0.0, 1.0, FRAMES)
    q = np.array([found.at[name] for name in found.coordinates])
    start = np.full(FRAMES, model.simulation.start)
    rest = _scene(model, t, _track(model, start, np.tile(q, (FRAMES, 1))), found.notes)
    size = scene.size(rest.points)
    modes = []
    for name, note, swings, shape in _described(found):
        swung = q + _amplitude(model, q, shape, size) * np.imag(np.exp(2j * np.pi * t)[:, None] * shape)
        moved = _scene(model, t, _track(model, start, swung), rest.notes)
        wide = [np.broadcast_to(track, (FRAMES, 3)) for track in moved.points]
        modes.append(Mode(name, note, swings, np.stack(wide, axis=1)))
    seen = scene.view([mode.points.reshape(-1, 3) for mode in modes], -rest.view.up)
    return dataclasses.replace(rest, view=seen, modes=tuple(modes))


def _scene(model: Model, t: Floats, found: builder.PointTracks, notes: tuple[str, ...]) -> Scene:
    drawn = model if model.particle_names else None
    notes = (*notes, found.note) if found.note and found.note not in notes else notes
    motion = Motion(t, found.names, found.track, guide_lines=found.guide_lines, notes=notes, is_run=False)
    if drawn is not None:
        motion = dataclasses.replace(motion, ties=tuple(animate.ties(drawn)))
    return builder.scene_of(motion, drawn, model.title or pathlib.Path(model.path).stem, ("", ""))


def _track(model: Model, t: Floats, q: Floats) -> builder.PointTracks:
    if model.particle_names:
        names = model.particle_names
        return builder.PointTracks(names, animate.positions(model, t, q), (("", "", ""),) * len(names))
    table = dict(zip(model.coordinate_names, q.T, strict=True))
    limits = {name: (values[0] - LARGEST, values[0] + LARGEST) for name, values in table.items()}
    return builder.of_coordinates(model.generalized_names, table, limits)


def _amplitude(model: Model, q: Floats, shape: Complex, size: float) -> float:
    """The factor of a shape with which the particles go as far as is good to look at."""
    largest = float(np.abs(shape).max(initial=0.0)) or 1.0
    if not model.particle_names:
        return LARGEST / largest
    parts = np.stack([shape.real, shape.imag]) * (
        TRIED * max(1.0, float(np.abs(q).max(initial=0.0))) / largest
    )
    step = float(np.abs(parts).max()) / largest
    t = np.full(3, model.simulation.start)
    track = animate.positions(model, t, np.concatenate([q[None], q + parts]))
    way = float(np.linalg.norm(track[1:] - track[0], axis=-1).max(initial=0.0)) / step
    generalized = np.abs(shape[len(q) - len(model.generalized_names) :]).max(initial=0.0)
    limit = LARGEST / float(generalized) if generalized else np.inf
    wanted = SWING * size / way if way > 0 else LARGEST / largest
    return float(min(wanted, limit))


def _described(found: Modes) -> Iterator[tuple[str, str, bool, Complex]]:
    """The name of each mode, what is known of it, if it swings, and its shape; of two that are conjugate one."""
    unit = found.units.time if found.units else "s"
    if found.frequencies is not None:
        for k, (w, shape) in enumerate(zip(found.frequencies[:MOST_MODES], found.shapes, strict=False)):
            period = f"period {2 * np.pi / w:.6g} {unit}" if w else "it drifts and does not come back"
            yield f"{k + 1}: ω = {w:.6g}/{unit}", f"{period}; the swing is enlarged", bool(w > 0), shape
        return
    for k, (z, shape) in enumerate(zip(found.eigenvalues[:MOST_MODES], found.shapes, strict=False)):
        if z.imag < 0:
            continue
        sign = f" ± {z.imag:.5g}i" if z.imag else ""
        yield f"{k + 1}: s = {z.real:.5g}{sign}", "as exp(s t); its growth is not shown", bool(z.imag), shape
