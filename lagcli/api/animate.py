"""The scene of an animation: of a model that is simulated, or of a table."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterator, Mapping

import numpy as np

from lagcli import doubles
from lagcli.api import run_settings, simulate
from lagcli.api.load import Path, as_model
from lagcli.arrays import Complex, Floats
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.model_values import ModelIndex, ModelOnTable
from lagcli.linearization.linear_modes import Modes
from lagcli.model.model import Model
from lagcli.output.animation import builder, links, page, scene
from lagcli.output.animation.builder import Motion, NothingToShow, PointTracks
from lagcli.output.animation.scene import Mode, Scene
from lagcli.output.figures import labels
from lagcli.running.trajectory import SimulationStopped

Table = Mapping[str, Floats]

MOST_FRAMES = 1201  # ten seconds of 120 a second
FEWEST_FRAMES = 100  # fewer do not move smoothly: forces and multipliers are left out before
LEAST_FRAMES = 12  # of a page that is too large otherwise: fewer show no motion
MOST_CURVES = 24  # of multipliers: more cannot be told apart
MOST_PARTICLES = 5000  # each is drawn in every frame
ROUND_TRIPS = 6  # until a scene is small enough

# Of modes
FRAMES = 49  # of one period, both ends counted
SWING = 0.12  # of the size of the system: the largest way that a particle goes
LARGEST = 0.6  # of an angle, and of a coordinate that moves nothing
MOST_MODES = 60  # as many as `modes` prints


def as_far(model: Model | Path, settings: Mapping[str, object], row: str | None = None) -> tuple[Scene, str]:
    """The scene of a run as far as it goes, and why it stopped before its end, or nothing.

    settings, row: as of `run_settings.of_options`, which raises `BadRequest`. Raises `builder.NothingToShow`, and what
    `simulate` raises, with `SimulationStopped` for a run without a row alone.
    """
    model = run_settings.of_options(as_model(model), settings, row)
    require_few(model)
    run, reason = simulate.as_far(model)
    if not len(run.rows):
        raise SimulationStopped(reason, run.stats.stopped.t if run.stats.stopped else 0.0, run)
    return of_run(model, dict(run)), reason


def require_few(model: Model) -> None:
    """Raise `builder.NothingToShow` for more particles than a page shows."""
    count = len(model.particle_names)
    if count > MOST_PARTICLES:
        raise NothingToShow(f"the model has {count} particles; an animation shows up to {MOST_PARTICLES}")


def of_file(path: Path, model: Model | None) -> Scene:
    """The scene of a table in a file; the model, if it is given, tells masses, forces, rods and surfaces.

    Raises `formats.UnknownFormat`, `MissingExtra`, `UnreadableTable`, `builder.NothingToShow`, OSError.
    """
    # Other runs read no tables.
    from lagcli.output.tables import table_format

    opened = table_format.opened(path)
    if "t" not in opened.columns:
        raise NothingToShow(f"{path} has no column `t`")
    names = model.particle_names if model is not None else builder.particles_in(opened.columns)
    if model is not None and (lacking := builder.missing(names, opened.columns)):
        raise NothingToShow(f"{path}: {lacking}")
    if model is None and not names:
        raise NothingToShow(
            f"{path} has no columns NAME.x, NAME.y, NAME.z, NAME.vx of particles; give its model with --model"
        )
    # The columns of a table that are shown: a table may have others of any number
    own = {f"{name}.{part}" for name in names for part in ("x", "y", "z", "vx", "vy", "vz")} | {"t"}
    own |= {f"R.{name}.{axis}" for name in names for axis in "xyz"}
    if model is not None:
        own |= {part.format(name) for name in model.generalized_names for part in ("{}", "rate({})", "R.{}")}
    wanted = [name for name in opened.columns if name in own or name.startswith("lambda.")]
    table = dict(zip(wanted, opened.take(wanted).T, strict=True))
    if not len(table["t"]):
        raise NothingToShow(f"{path} has no rows")
    for name, values in table.items():
        if not name.startswith(("lambda.", "R.")) and not np.isfinite(values).all():
            raise NothingToShow(f"{path}: the column `{name}` holds what is no finite number")
    if np.any(np.diff(table["t"]) < 0):
        raise NothingToShow(f"{path}: its times do not increase")
    if model is None:
        return of_run(None, table, pathlib.Path(path).stem)
    require_few(model)
    laws = ModelLaws(model)
    known = {f"lambda.{row}" for row in (*laws.rows, *laws.contacts)}
    for name in table:
        if name.startswith("lambda.") and name not in known:
            raise NothingToShow(
                f"{path} has the column `{name}`, and {model.path} no such row: it is of another model"
            )
    return of_run(model, table)


def of_run(model: Model | None, table: Table, title: str = "") -> Scene:
    """The scene of the table of a run, of a model where it is known, with as many instants as a page has room for."""
    units = ("", "")
    if model is not None:
        title = model.title or pathlib.Path(model.path).stem
        units = model.units.time, labels.force_unit(model.units)
    plenty = len(table["t"])
    frames, parts = min(plenty, MOST_FRAMES), {"R": True, "F": True}
    room = (page.MOST_BYTES - page.fixed_bytes()) * 0.97
    for _ in range(ROUND_TRIPS):
        picked = np.unique(np.linspace(0, plenty - 1, frames).round().astype(np.int64))
        made = _scene({name: values[picked] for name, values in table.items()}, model, title, units, parts)
        spent = sum(map(len, page.packed(made)))
        if spent <= room:
            notes = [*made.notes]
            if len(made.t) < plenty:
                notes.append(
                    f"{len(made.t)} of {plenty} rows are shown, evenly thinned; between them positions are"
                    " interpolated"
                )
            notes += [
                f"{kind} is left out: there is no room for it in a page" for kind in "FR" if not parts[kind]
            ]
            return dataclasses.replace(made, notes=tuple(notes))
        frames = max(LEAST_FRAMES, int(len(picked) * room / spent * 0.98))
        if frames < FEWEST_FRAMES and (parts["F"] or parts["R"]):
            parts["F" if parts["F"] else "R"] = False
            frames = min(plenty, MOST_FRAMES)
    raise NothingToShow(
        f"{made.count} particles need more than the {page.MOST_BYTES} bytes that a page has: show a part of them"
    )


def _scene(
    table: Table, model: Model | None, title: str, units: tuple[str, str], parts: Mapping[str, bool]
) -> Scene:
    names = model.particle_names if model is not None else builder.particles_in(tuple(table))
    drawn = model if names else None
    if model is None or names:
        found = builder.of_particles(names, table)
    else:
        found = builder.of_coordinates(model.generalized_names, table)
    notes = [found.note] if found.note else []
    multipliers = {
        name.removeprefix("lambda."): values for name, values in table.items() if name.startswith("lambda.")
    }
    shown = scene.largest(multipliers, MOST_CURVES)
    if len(multipliers) > MOST_CURVES:
        notes.append(f"the {MOST_CURVES} largest of {len(multipliers)} multipliers are shown")
    R = found.reactions(table) if parts["R"] else None
    if model is not None and drawn is None:
        notes += builder.unseen(model, set())
    motion = Motion(
        t=table["t"],
        names=found.names,
        particles=found.track,
        R=None if R is None else np.nan_to_num(R),
        F=forces(drawn, table) if drawn is not None and parts["F"] else None,
        curves={name: values for name, values in multipliers.items() if name in shown},
        notes=tuple(notes),
        guide_lines=found.guide_lines,
        ties=tuple(ties(drawn)) if drawn is not None else (),
    )
    return builder.scene_of(motion, drawn, title, units)


def forces(model: Model, table: Table) -> Floats | None:
    """F_k on all particles (T, N, 3), of forces and potentials; None where the table lacks a state."""
    names, rates = model.coordinate_names, model.rate_names
    if not all(name in table for name in (*names, *rates)):
        return None
    t = table["t"]
    q, v = (
        np.stack([table[name] for name in some], axis=1) if some else np.zeros((len(t), 0))
        for some in (names, rates)
    )
    laws = ModelLaws(model)
    with np.errstate(all="ignore"):
        values = laws.values(t, q, v, np.zeros((len(t), laws.C)))
    found = laws.index.components(values.F - values.V_q)
    return np.nan_to_num(found.reshape(len(t), -1, 3), posinf=0.0, neginf=0.0)


def positions(model: Model, t: Floats, q: Floats) -> Floats:
    """The positions of all particles (T, N, 3) at t (T,) and q (T, n)."""
    index = ModelIndex(model)
    found = np.zeros((len(t), len(index.particles), 3))
    found[:, index.cartesian] = q[:, : index.first_generalized].reshape(len(t), -1, 3)
    if index.dependent.size:
        values = ModelOnTable(index, t[:, None], q, np.zeros_like(q))
        with np.errstate(all="ignore"):
            for axis, part in enumerate(values.position(index.dependent)):
                found[:, index.dependent, axis] = values.wide(part, index.dependent.size)
    return found


def ties(model: Model) -> list[links.Tie]:
    """Distances that are constant whatever the coordinates are, of particles whose positions are functions of them."""
    index = ModelIndex(model)
    if not 0 < index.dependent.size <= links.MOST_TIED:
        return []
    random = np.random.default_rng(0)
    values = np.concatenate([np.ravel(one.value) for one in model.coordinates])
    q = np.zeros((links.SAMPLES, index.n))
    q[:, index.first_generalized :] = values + random.normal(0.0, 1.0, (links.SAMPLES, values.size))
    chosen = model.simulation
    t = chosen.start + (chosen.duration or 1.0) * random.random(links.SAMPLES)
    samples = positions(model, t, q)[:, index.dependent]
    return links.ties(samples, index.dependent) if np.isfinite(samples).all() else []


def of_modes(model: Model, found: Modes) -> Scene:
    """The scene of small oscillations. Raises `builder.NothingToShow` where there are no shapes."""
    require_few(model)
    if not len(found.shapes):
        raise NothingToShow(
            "the motion comes back to itself, and its multipliers have no shapes to show"
            if found.multipliers is not None
            else "nothing can swing: the rows leave the model no freedom to move"
        )
    turns = np.exp(2j * np.pi * np.linspace(0.0, 1.0, FRAMES))[:, None]
    q = np.array([found.at[name] for name in found.coordinates])
    rest = _swinging(model, np.tile(q, (FRAMES, 1)), found.notes)
    size = scene.size(rest.points)
    modes = []
    for name, note, swings, shape in _described(found):
        # The particles go as far as is good to look at.
        largest = float(np.abs(shape).max(initial=0.0)) or 1.0
        amplitude = LARGEST / largest
        if model.particle_names:
            step = doubles.STEP * max(1.0, float(np.abs(q).max(initial=0.0))) / largest
            tried = np.concatenate([q[None], q + np.stack([shape.real, shape.imag]) * step])
            track = positions(model, np.full(3, model.simulation.start), tried)
            way = float(np.linalg.norm(track[1:] - track[0], axis=-1).max(initial=0.0)) / step
            generalized = np.abs(shape[len(q) - len(model.generalized_names) :]).max(initial=0.0)
            limit = LARGEST / float(generalized) if generalized else np.inf
            amplitude = min(SWING * size / way if way > 0 else amplitude, limit)
        moved = _swinging(model, q + amplitude * np.imag(turns * shape), rest.notes)
        wide = [np.broadcast_to(track, (FRAMES, 3)) for track in moved.points]
        modes.append(Mode(name, note, swings, np.stack(wide, axis=1)))
    seen = scene.view([mode.points.reshape(-1, 3) for mode in modes], -rest.view.up)
    return dataclasses.replace(rest, view=seen, modes=tuple(modes))


def _swinging(model: Model, q: Floats, notes: tuple[str, ...]) -> Scene:
    """The scene of one period with the coordinates q (FRAMES, n)."""
    names, drawn = model.particle_names, model if model.particle_names else None
    if drawn is not None:
        track = positions(model, np.full(FRAMES, model.simulation.start), q)
        found = PointTracks(names, track, (("", "", ""),) * len(names))
    else:
        table = dict(zip(model.coordinate_names, q.T, strict=True))
        limits = {name: (values[0] - LARGEST, values[0] + LARGEST) for name, values in table.items()}
        found = builder.of_coordinates(model.generalized_names, table, limits)
    motion = Motion(
        np.linspace(0.0, 1.0, FRAMES),
        found.names,
        found.track,
        guide_lines=found.guide_lines,
        notes=(*notes, found.note) if found.note and found.note not in notes else notes,
        ties=tuple(ties(drawn)) if drawn is not None else (),
        is_run=False,
    )
    return builder.scene_of(motion, drawn, model.title or pathlib.Path(model.path).stem, ("", ""))


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
