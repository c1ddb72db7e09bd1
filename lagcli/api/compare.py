"""`lagcli.compare`: a model in every formulation that fits it, or two models, side by side."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Unpack

import numpy as np

from lagcli import progress
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.api import assemble_start
from lagcli.api.models.cache import CompiledModel
from lagcli.api.models.load import Path, as_model
from lagcli.api.runs import prepare_run, run_settings
from lagcli.equations import particle_form, size_limits
from lagcli.formulations import comparison, formulation_plan, reduced_run
from lagcli.formulations.comparison import Comparison, Formulation, RunEvent
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings, Simulation
from lagcli.output.files import write_guard
from lagcli.output.tables import provenance, table_format
from lagcli.running import safe_table, table_columns
from lagcli.running.safe_table import TablePlan
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state import run_stop

# With the vakonomic motion the reduction by the null space, which solves for a basis in every stage, is made of models
# of up to so many coordinates.
MOST_REDUCED = 24
COMPARED_ROWS = 101  # of tables that are compared, where no number of samples is given
TOO_LARGE = f"the reduction by the null space is left out beside the vakonomic motion above {MOST_REDUCED} coordinates"


@progress.phase("comparing")
@run_settings.keywords("start", "method", "keep")
def compare(
    model: Model | Path,
    other: Model | Path | None = None,
    *,
    columns: str = "*",
    tolerance: float | None = None,
    vakonomic: bool = False,
    mu: Mapping[str, float | str] | None = None,
    **settings: Unpack[RunSettings],
) -> Comparison:
    """Run a model in every formulation that fits it, or two models, and compare their shared columns.

    `tolerance` (1e-8): the largest difference that passes, as a part of the largest value of its kind; `columns`:
    patterns of the columns to compare; the other options as of `simulate` (samples: 101). `agree` is the verdict,
    `agreements` has the digits. `vakonomic` adds the motion of the other principle, with the initial multipliers `mu`
    of differential rows (0; numbers or expressions of parameters): the last of `formulations`, and `principles` says
    how it compares. Raises `ModelError`, `ValueError` for bad options and models that share no column, `OverrideError`
    for `mu` of a row there is not.
    """

    model = as_model(model)
    if tolerance is None:
        tolerance = comparison.TOLERANCE
    if not tolerance > 0:
        raise ValueError("tolerance: a positive number is needed")
    if mu and not vakonomic:
        raise ValueError("mu: initial multipliers are those of vakonomic motion, which is not asked for")
    if vakonomic and other is not None:
        raise ValueError("vakonomic: the two principles are compared for one model")
    second = None if other is None else as_model(other)
    run = prepare_run.start(model, _settings(model, second, settings))
    first = _table(formulation_plan.declared(model, len(run.built.rows.rows)), run)
    kinds = comparison.kinds(model, [first.columns[i] for i in table_format.select(first.columns, columns)])
    left_out: list[str] = []
    moved = [f"{model.path}, {line}" for line in assemble_start.of_run(run)]
    if second is None:
        formulations = _reformulated(run, first, vakonomic)
        others = [(one, formulation_plan.comparable(model, one, kinds)) for one in formulations]
    else:
        beside, shared, left_out, moved_too = _beside(run, second, kinds)
        moved += moved_too
        others = [(beside, shared)]
    near = np.zeros(len(first.table), dtype=bool)
    if run.stats.singular_times:
        states = table_columns.States(model, run.columns)(first.table)
        near = formulation_plan.singular(run.numeric, states, run.parameters, run.report.rank)
    found = formulation_plan.compared(model, first, others, tolerance, near)
    found = dataclasses.replace(found, notes=(*moved, *found.notes))
    if vakonomic and len(first.table):
        found = _with_principles(found, run, kinds, mu or {})
    if not left_out:
        return found
    note = f"not compared, for they are not unique in one of the models: {', '.join(left_out)}"
    return dataclasses.replace(found, notes=(*found.notes, note))


def _with_principles(
    found: Comparison, run: SimulationRun, kinds: Mapping[str, str], mu: Mapping[str, float | str]
) -> Comparison:
    """The comparison with the vakonomic motion after the others."""
    # Most comparisons are of one principle.
    from lagcli.api import compare_principles

    first = found.formulations[0]
    other = compare_principles.beside(run, first, mu, _table)
    near = np.zeros(len(first.table), dtype=bool)
    shared = {
        name: kind
        for name, kind in kinds.items()
        if kind in comparison.COMPARED and name in other.run.columns
    }
    agreement = comparison.compare(shared, first, other.run, near)
    principles = dataclasses.replace(
        other.principles,
        tolerance=found.tolerance,
        digits=comparison.digits_of_motion(agreement),
        until=min(first.reached, other.run.reached) if first.stopped or other.run.stopped else None,
        parting=comparison.parting(shared, first, other.run, found.tolerance),
    )
    stops = [f"the vakonomic motion {other.run.stopped}"] if other.run.stopped else []
    reducible = formulation_plan.is_reducible(run.model, first.rows, first.coordinates)
    too_large = [TOO_LARGE] if reducible and first.coordinates > MOST_REDUCED else []
    return dataclasses.replace(
        found,
        formulations=(*found.formulations, other.run),
        agreements=(*found.agreements, agreement),
        notes=(*found.notes, *other.notes, *stops, *too_large),
        principles=principles,
    )


def _settings(model: Model, other: Model | None, changes: Mapping[str, object]) -> Simulation:
    """The settings of all runs: the first model's, as long as both last."""
    given = {key: value for key, value in changes.items() if value is not None}
    if not given.keys() & {"samples", "output_step"}:
        given["samples"] = COMPARED_ROWS
    chosen = run_settings.chosen(model, given)
    if other is None:
        return chosen
    if other.simulation.start != model.simulation.start:
        raise ValueError(f"{model.path} and {other.path} start at different times; give one start")
    if "duration" not in given:
        chosen = dataclasses.replace(chosen, duration=min(chosen.duration, other.simulation.duration))
    return chosen


def _beside(
    run: SimulationRun, other: Model, kinds: Mapping[str, str]
) -> tuple[Formulation, dict[str, str], list[str], list[str]]:
    """Another model as it stands, the columns that it shares with a run, those that are not unique in one of them, and
    how far its start was moved.

    Raises `ValueError` where they share none.
    """

    chosen = dataclasses.replace(run.model.simulation, assemble=other.simulation.assemble, keep=())
    beside = prepare_run.start(other, chosen)
    second = _table(formulation_plan.declared(other, len(beside.built.rows.rows)), beside)
    shared = {name: kind for name, kind in kinds.items() if name in second.columns}
    if not shared:
        raise ValueError(f"{run.model.path} and {other.path} share none of these columns")
    loose = {f"lambda.{name}" for one in (run, beside) for name in one.stats.indeterminate}
    unique = {name: kind for name, kind in shared.items() if name not in loose}
    moved = [f"{other.path}, {line}" for line in assemble_start.of_run(beside)]
    return second, unique, [name for name in shared if name in loose], moved


def _reformulated(run: SimulationRun, first: Formulation, vakonomic: bool) -> Iterator[Formulation]:
    """The model of a run in the other formulations that fit it, from the same start; vakonomic: without the
    reduction of many coordinates."""

    if not len(first.table):
        return
    (t,), (q,), (v,) = table_columns.States(run.model, run.columns)(first.table[:1])
    if formulation_plan.has_dependent(run.model):
        particle_model = particle_form.model(run.built, float(t), q, v)
        size_limits.require_built(particle_model)
        ready = CompiledModel(particle_form.build(run.built, particle_model))
        yield _table("freed", prepare_run.start_compiled(ready, KnownIntegrals()))
    is_too_large = vakonomic and first.coordinates > MOST_REDUCED
    if not is_too_large and formulation_plan.is_reducible(run.model, first.rows, first.coordinates):
        chosen = dataclasses.replace(run.model.simulation, start=float(t), assemble=False, keep=())
        table, statistics, stop = reduced_run.run(run.built, run.grid, (q, v, run.parameters), chosen)
        yield dataclasses.replace(
            first,
            name="reduced",
            rows=0,
            steps=statistics.steps,
            seconds=statistics.seconds,
            table=table,
            stopped="" if stop is None else f"stopped at t = {stop.t:.9g}: {stop}",
        )


def _table(name: str, run: SimulationRun) -> Formulation:
    """A run to its end, or as far as it goes."""

    blocks, stopped = [np.zeros((0, len(run.columns)))], ""
    events: list[RunEvent] = []
    try:
        for block in run.blocks():
            blocks.append(block)
            events += [RunEvent(one.t, one.kind, one.name) for one in run.incidents]
    except run_stop.RunStop as stop:
        stopped = stop.stop.reason
    n, stats = len(run.model.coordinate_names), run.stats
    return Formulation(
        name=name,
        path=run.model.path,
        coordinates=n,
        freedoms=n - run.report.rank,
        rows=len(run.built.rows.rows),
        steps=stats.steps,
        seconds=stats.solve_seconds,
        columns=run.columns,
        table=np.concatenate(blocks),
        exchanged=run.report.exchanged,
        stopped=stopped,
        events=tuple(events),
    )


def compare_to_files(
    models: Sequence[Model], asked: Mapping[str, object], output: str | None, plot: str | None
) -> tuple[Comparison, list[str]]:
    """The comparison of one model or two, and lines to print about its table, if any.

    asked: keywords of `compare`; output: `-` for standard output. Raises what `compare` raises, `WriteError`,
    `BadRequest`.
    """
    found = compare(*models, **asked)  # type: ignore[arg-type]
    lines = []
    if found.principles is not None and output is not None:
        vakonomic = found.formulations[-1]
        whence = provenance.of(models[0]).as_json() | {"vakonomic": {"mu": dict(found.principles.mu)}}
        plan, is_partial = TablePlan.of_option(output, vakonomic.columns), bool(vakonomic.stopped)
        saved = safe_table.write(plan, whence, vakonomic.table, is_partial)
        if is_partial:
            lines.append(f"lagcli: the vakonomic motion stopped; {saved}" if saved else "")
    if found.principles is not None and plot is not None:
        _draw(models[0], found, plot)
    return found, lines


def _draw(model: Model, found: Comparison, path: str) -> None:
    first, other = found.formulations[0], found.formulations[-1]
    with write_guard.drawing(path):
        # matplotlib takes a third of a second to load: only where a figure is asked for.
        from lagcli.output.figures import figure_page, principles_figure

        tables = (
            principles_figure.MotionTable("d'Alembert", first.columns, first.table),
            principles_figure.MotionTable("vakonomic", other.columns, other.table),
        )
        title = f"{model.title or pathlib.Path(model.path).stem}: two principles"
        shown = _apart(model, first, other)
        figure_page.write(path, principles_figure.compose(tables, shown, title, model.units.time))


def _apart(model: Model, first: Formulation, other: Formulation) -> list[str]:
    """Positions in the order of the table, those that differ most of all where they are many."""
    from lagcli.output.figures.principles_figure import MOST

    of = comparison.kinds(model, first.columns)
    shared = [name for name, kind in of.items() if kind == "r" and name in other.columns]
    count = min(len(first.table), len(other.table))

    def gap(name: str) -> float:
        one, two = (run.table[:count, run.columns.index(name)] for run in (first, other))
        return float(np.abs(one - two).max(initial=0.0))

    chosen = set(sorted(shared, key=gap, reverse=True)[:MOST])
    return [name for name in shared if name in chosen]
