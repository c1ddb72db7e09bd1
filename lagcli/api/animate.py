"""The scene of an animation: of a model that is simulated, or of a table."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from lagcli.api import simulate
from lagcli.api.models.load import Path, as_model
from lagcli.api.runs import run_settings
from lagcli.model.model import Model
from lagcli.output.animation import builder, links, page
from lagcli.output.animation.builder import Motion, PointTracks
from lagcli.output.animation.scene import Scene, TimeCurve
from lagcli.output.figures import labels
from lagcli.running.trajectory import SimulationStopped

Floats = npt.NDArray[np.float64]
Table = Mapping[str, Floats]

MOST_FRAMES = 1201  # ten seconds of 120 a second
FEWEST_FRAMES = 100  # fewer do not move smoothly: forces and multipliers are left out before
LEAST_FRAMES = 12  # of a page that is too large otherwise: fewer show no motion
MOST_CURVES = 24  # of multipliers: more cannot be told apart
MOST_PARTICLES = 5000  # each is drawn in every frame
ROUND_TRIPS = 6  # until a scene is small enough


def of_model(model: Model | Path, settings: Mapping[str, object]) -> Scene:
    """The scene of a run of a model; settings: keywords of `simulate`.

    Raises what `simulate` raises, and `builder.NothingToShow`.
    """
    model = as_model(model)
    require_few(model)
    return of_run(model, dict(simulate.simulate(model, **settings)))  # type: ignore[arg-type]


def as_far(model: Model, settings: Mapping[str, object], row: str | None) -> tuple[Scene, str]:
    """The scene of a run as far as it goes, and why it stopped before its end, or nothing.

    settings, row: as of `run_settings.of_options`, which raises `BadRequest`; otherwise as `of_model`, with
    `SimulationStopped` for a run without a row alone.
    """
    model = run_settings.of_options(model, settings, row)
    require_few(model)
    run, reason = simulate.as_far(model)
    if not len(run.rows):
        raise SimulationStopped(reason, run.stats.stopped.t if run.stats.stopped else 0.0, run)
    return of_run(model, dict(run)), reason


def require_few(model: Model) -> None:
    """Raise `builder.NothingToShow` for more particles than a page shows."""
    count = len(model.particle_names)
    if count > MOST_PARTICLES:
        raise builder.NothingToShow(
            f"the model has {count} particles; an animation shows up to {MOST_PARTICLES}"
        )


def of_run(model: Model, table: Table) -> Scene:
    """The scene of the table of a run of a model."""
    title = model.title or pathlib.Path(model.path).stem
    unit = labels.force_unit(model.units)
    return _fitting(table, model, title, (model.units.time, unit))


def of_file(path: Path, model: Model | None) -> Scene:
    """The scene of a table in a file; the model, if it is given, tells masses, forces, rods and surfaces.

    Raises `formats.UnknownFormat`, `MissingExtra`, `UnreadableTable`, `builder.NothingToShow`, OSError.
    """
    # Other runs read no tables.
    from lagcli.output.tables import table_format

    opened = table_format.opened(path)
    if "t" not in opened.columns:
        raise builder.NothingToShow(f"{path} has no column `t`")
    names = model.particle_names if model is not None else builder.particles_in(opened.columns)
    if model is not None and (lacking := builder.missing(names, opened.columns)):
        raise builder.NothingToShow(f"{path}: {lacking}")
    if model is None and not names:
        raise builder.NothingToShow(
            f"{path} has no columns NAME.x, NAME.y, NAME.z, NAME.vx of particles; give its model with --model"
        )
    # The columns of a table that are shown: a table may have others of any number
    own = {f"{name}.{part}" for name in names for part in ("x", "y", "z", "vx", "vy", "vz")} | {"t"}
    own |= {f"R.{name}.{axis}" for name in names for axis in "xyz"}
    if model is not None:
        own |= {part.format(name) for name in model.generalized_names for part in ("{}", "rate({})", "R.{}")}
    wanted = [name for name in opened.columns if name in own or name.startswith("lambda.")]
    rows = opened.take(wanted)
    table = dict(zip(wanted, rows.T, strict=True))
    _require_rows(str(path), table)
    if model is not None:
        require_few(model)
        _require_own(str(path), model, table)
        return of_run(model, table)
    return _fitting(table, None, pathlib.Path(path).stem, ("", ""))


def _require_own(path: str, model: Model, table: Table) -> None:
    """Refuse a table with multipliers of rows that the model does not have: it is of another model."""
    from lagcli.auditing.evidence.laws import ModelLaws

    laws = ModelLaws(model)
    known = {f"lambda.{row}" for row in (*laws.rows, *laws.contacts)}
    other = next((name for name in table if name.startswith("lambda.") and name not in known), None)
    if other is not None:
        raise builder.NothingToShow(
            f"{path} has the column `{other}`, and {model.path} no such row: it is of another model"
        )


def _require_rows(path: str, table: Table) -> None:
    t = table["t"]
    if not len(t):
        raise builder.NothingToShow(f"{path} has no rows")
    bad = next(
        (
            name
            for name, values in table.items()
            if not name.startswith(("lambda.", "R.")) and not np.isfinite(values).all()
        ),
        None,
    )
    if bad is not None:
        raise builder.NothingToShow(f"{path}: the column `{bad}` holds what is no finite number")
    if np.any(np.diff(t) < 0):
        raise builder.NothingToShow(f"{path}: its times do not increase")


def _fitting(table: Table, model: Model | None, title: str, units: tuple[str, str]) -> Scene:
    """The scene with as many instants as a page has room for."""
    plenty = len(table["t"])
    frames, parts = min(plenty, MOST_FRAMES), {"R": True, "F": True}
    room = (page.MOST_BYTES - page.fixed_bytes()) * 0.97
    for _ in range(ROUND_TRIPS):
        picked = np.unique(np.linspace(0, plenty - 1, frames).round().astype(np.int64))
        scene = _scene({name: values[picked] for name, values in table.items()}, model, title, units, parts)
        spent = sum(map(len, page.packed(scene)))
        if spent <= room:
            return _with_notes(scene, plenty, parts)
        frames = max(LEAST_FRAMES, int(len(picked) * room / spent * 0.98))
        if frames < FEWEST_FRAMES and (parts["F"] or parts["R"]):
            parts["F" if parts["F"] else "R"] = False
            frames = min(plenty, MOST_FRAMES)
    raise builder.NothingToShow(
        f"{scene.count} particles need more than the {page.MOST_BYTES} bytes that a page has: show a part of them"
    )


def _with_notes(scene: Scene, rows: int, parts: Mapping[str, bool]) -> Scene:
    notes = [*scene.notes]
    if len(scene.t) < rows:
        notes.append(
            f"{len(scene.t)} of {rows} rows are shown, evenly thinned; between them positions are interpolated"
        )
    notes += [f"{kind} is left out: there is no room for it in a page" for kind in "FR" if not parts[kind]]
    return dataclasses.replace(scene, notes=tuple(notes))


def _scene(
    table: Table, model: Model | None, title: str, units: tuple[str, str], parts: Mapping[str, bool]
) -> Scene:
    found = _tracks(table, model)
    notes = [found.note] if found.note else []
    multipliers = [
        (name.removeprefix("lambda."), values) for name, values in table.items() if name.startswith("lambda.")
    ]
    largest = sorted(multipliers, key=lambda pair: -float(np.nan_to_num(np.abs(pair[1])).max(initial=0.0)))[
        :MOST_CURVES
    ]
    shown = {name for name, _ in largest}
    if len(multipliers) > MOST_CURVES:
        notes.append(f"the {MOST_CURVES} largest of {len(multipliers)} multipliers are shown")
    R = found.reactions(table) if parts["R"] else None
    drawn = model if model is not None and model.particle_names else None
    if model is not None and drawn is None:
        notes += builder.unseen(model, set())
    motion = Motion(
        t=table["t"],
        names=found.names,
        particles=found.track,
        R=None if R is None else np.nan_to_num(R),
        F=forces(drawn, table) if drawn is not None and parts["F"] else None,
        curves=tuple(TimeCurve(name, values) for name, values in multipliers if name in shown),
        notes=tuple(notes),
        guide_lines=found.guide_lines,
        ties=tuple(ties(drawn)) if drawn is not None else (),
    )
    return builder.scene_of(motion, drawn, title, units)


def _tracks(table: Table, model: Model | None) -> PointTracks:
    names = model.particle_names if model is not None else builder.particles_in(tuple(table))
    if model is None or names:
        return builder.of_particles(names, table)
    return builder.of_coordinates(model.generalized_names, table)


def _state(model: Model, table: Table) -> tuple[Floats, Floats, Floats] | None:
    """t (T,), q and v (T, n), or None where the table lacks a column."""
    generalized = set(model.generalized_names)
    names = model.coordinate_names
    rates = [f"rate({name})" if name in generalized else f"{name[:-1]}v{name[-1]}" for name in names]
    if not all(name in table for name in (*names, *rates)):
        return None
    t = table["t"]
    q, v = (
        np.stack([table[name] for name in some], axis=1) if some else np.zeros((len(t), 0))
        for some in (names, rates)
    )
    return t, q, v


def forces(model: Model, table: Table) -> Floats | None:
    """F_k on all particles (T, N, 3), of forces and potentials; None where the table lacks a state."""
    from lagcli.auditing.evidence.laws import ModelLaws

    state = _state(model, table)
    if state is None:
        return None
    laws = ModelLaws(model)
    index, own = laws.index, laws.index.first_generalized
    with np.errstate(all="ignore"):
        values = laws.values(*state, np.zeros((len(state[0]), laws.C)))
    found = values.F.copy()
    found[:, index.cartesian] -= values.V_q[:, :own].reshape(len(found), -1, 3)
    found[:, index.dependent] -= values.V_x.reshape(len(found), -1, 3)
    return np.nan_to_num(found, posinf=0.0, neginf=0.0)


def positions(model: Model, t: Floats, q: Floats) -> Floats:
    """The positions of all particles (T, N, 3) at t (T,) and q (T, n)."""
    from lagcli.auditing.evidence.model_values import ModelIndex, ModelOnTable

    index = ModelIndex(model)
    found = np.zeros((len(t), len(index.particles), 3))
    found[:, index.cartesian] = q[:, : index.first_generalized].reshape(len(t), -1, 3)
    if index.dependent.size:
        scene = ModelOnTable(index, t[:, None], q, np.zeros_like(q))
        with np.errstate(all="ignore"):
            parts = scene.position(index.dependent)
            for axis, part in enumerate(parts):
                found[:, index.dependent, axis] = scene.wide(part, index.dependent.size)
    return found


def ties(model: Model) -> list[links.Tie]:
    """Distances that are constant whatever the coordinates are, of particles whose positions are functions of them."""
    from lagcli.auditing.evidence.model_values import ModelIndex

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
