"""`lagcli.compare`: a model in every formulation that fits it, or two models, side by side."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Unpack

import numpy as np

from lagcli import progress
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.api import prepare_run, run_settings
from lagcli.api.cache import CompiledModel
from lagcli.api.load import Path, as_model
from lagcli.equations import particle_form, size_limits
from lagcli.errors import diagnostics
from lagcli.formulations import comparison, formulation_plan, maggi
from lagcli.formulations.comparison import Comparison, Formulation, Principles, RunEvent
from lagcli.input import given_expression
from lagcli.input.overrides import OverrideError
from lagcli.model import settings as model_settings
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.output.files import write_guard
from lagcli.output.tables import provenance, table_format
from lagcli.running import run_tables, table_columns
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state import run_stop

# With the vakonomic motion the reduction by the null space, which solves for a basis in every stage, is made of models
# of up to so many coordinates.
MOST_REDUCED = 24
COMPARED_ROWS = 101  # of tables that are compared, where no number of samples is given


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
    # The settings of all runs are the first model's, as long as both last.
    given = {key: value for key, value in settings.items() if value is not None}
    if not given.keys() & {"samples", "output_step"}:
        given["samples"] = COMPARED_ROWS
    chosen = run_settings.chosen(model, given)
    if second is not None:
        if second.simulation.start != model.simulation.start:
            raise ValueError(f"{model.path} and {second.path} start at different times; give one start")
        if "duration" not in given:
            chosen = dataclasses.replace(chosen, duration=min(chosen.duration, second.simulation.duration))
    run = prepare_run.start(model, chosen)
    first = _table(formulation_plan.declared(model, len(run.built.rows.rows)), run)
    kinds = comparison.kinds(model, [first.columns[i] for i in table_format.select(first.columns, columns)])
    notes = [f"{model.path}, {line}" for line in prepare_run.moves_of(run)]
    left_out: list[str] = []
    if second is None:
        formulations = _reformulated(run, first, vakonomic)
        others = [(one, formulation_plan.comparable(model, one, kinds)) for one in formulations]
    else:
        # The other model as it stands, and the columns that both have and that are unique in both.
        beside = prepare_run.start(
            second, dataclasses.replace(run.model.simulation, assemble=second.simulation.assemble, keep=())
        )
        found_beside = _table(formulation_plan.declared(second, len(beside.built.rows.rows)), beside)
        shared = {name: kind for name, kind in kinds.items() if name in found_beside.columns}
        if not shared:
            raise ValueError(f"{model.path} and {second.path} share none of these columns")
        loose = {f"lambda.{name}" for one in (run, beside) for name in one.stats.indeterminate}
        left_out = [name for name in shared if name in loose]
        notes += [f"{second.path}, {line}" for line in prepare_run.moves_of(beside)]
        others = [(found_beside, {name: kind for name, kind in shared.items() if name not in loose})]
    near = np.zeros(len(first.table), dtype=bool)
    if run.stats.singular_times:
        states = table_columns.States(model, run.columns)(first.table)
        near = formulation_plan.singular(run.numeric, states, run.parameters, run.report.rank)
    found = formulation_plan.compared(model, first, others, tolerance, near)
    found = dataclasses.replace(found, notes=(*notes, *found.notes))
    if vakonomic and len(first.table):
        found = _with_principles(found, run, kinds, mu or {})
    if not left_out:
        return found
    note = f"not compared, for they are not unique in one of the models: {', '.join(left_out)}"
    return dataclasses.replace(found, notes=(*found.notes, note))


def _reformulated(run: SimulationRun, first: Formulation, vakonomic: bool) -> Iterator[Formulation]:
    """The model in the other formulations that fit it; vakonomic: without the reduction of many coordinates."""
    if not len(first.table):
        return
    (t,), (q,), (v,) = table_columns.States(run.model, run.columns)(first.table[:1])
    if any(particle.is_dependent and particle.members.count for particle in run.model.particles):
        particle_model = particle_form.model(run.built, float(t), q, v)
        size_limits.require_built(particle_model)
        ready = CompiledModel(particle_form.build(run.built, particle_model))
        yield _table("freed", prepare_run.start_compiled(ready, KnownIntegrals()))
    is_too_large = vakonomic and first.coordinates > MOST_REDUCED
    if not is_too_large and formulation_plan.is_reducible(run.model, first.rows, first.coordinates):
        chosen = dataclasses.replace(run.model.simulation, start=float(t), assemble=False, keep=())
        table, statistics, stop = maggi.run(run.built, run.grid, (q, v, run.parameters), chosen)
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


def _with_principles(
    found: Comparison, run: SimulationRun, compared: Mapping[str, str], given: Mapping[str, float | str]
) -> Comparison:
    """The comparison with the vakonomic motion after the others.

    given: mu at the start of differential rows, zero for the others. Raises `OverrideError` for mu of a row there is
    not, otherwise as `_vakonomic`.
    """
    # Most comparisons are of one principle.
    from lagcli.analysis.classification import classify

    built, model, first = run.built, run.model, found.formulations[0]
    names = [row.name for row in built.rows.rows[built.holonomic_count :]]
    mu = dict.fromkeys(names, 0.0)
    for name, value in given.items():
        if name not in mu:
            raise OverrideError(f"--mu {name}: {_no_differential_row(model, name, names)}")
        mu[name] = given_expression.number(model, f"--mu {name}", value)
    vakonomic, left_out, notes = _vakonomic(run, first, mu)
    shared = {
        name: kind
        for name, kind in compared.items()
        if kind in comparison.COMPARED and name in vakonomic.columns
    }
    agreement = comparison.compare(shared, first, vakonomic, np.zeros(len(first.table), dtype=bool))
    kinds: dict[str, str] = {}
    if names:
        verdicts = classify.classified(built, run.numeric, model_settings.LIMIT).found.verdicts
        kinds = {verdict.row: verdict.kind for verdict in verdicts}
    principles = Principles(
        mu=mu,
        integrable=tuple(n for n in names if kinds.get(n) in ("exact", "integrable", "jointly-integrable")),
        nonholonomic=tuple(n for n in names if kinds.get(n) == "nonholonomic"),
        undecided=tuple(n for n in names if kinds.get(n, "undecided") == "undecided"),
        tolerance=found.tolerance,
        digits=min((one.digits for kind, one in agreement.items() if kind in ("r", "v")), default=None),
        parting=comparison.parting(shared, first, vakonomic, found.tolerance),
        left_out=left_out,
        until=min(first.reached, vakonomic.reached) if first.stopped or vakonomic.stopped else None,
    )
    if vakonomic.stopped:
        notes.append(f"the vakonomic motion {vakonomic.stopped}")
    reducible = formulation_plan.is_reducible(model, first.rows, first.coordinates)
    if reducible and first.coordinates > MOST_REDUCED:
        notes.append(
            "the reduction by the null space is left out beside the vakonomic motion above"
            f" {MOST_REDUCED} coordinates"
        )
    return dataclasses.replace(
        found,
        formulations=(*found.formulations, vakonomic),
        agreements=(*found.agreements, agreement),
        notes=(*found.notes, *notes),
        principles=principles,
    )


@progress.phase("following the other principle")
def _vakonomic(
    run: SimulationRun, first: Formulation, mu: Mapping[str, float]
) -> tuple[Formulation, tuple[str, ...], list[str]]:
    """The vakonomic motion from the start of a run whose table is `first`, outputs without a value in it, and notes.

    Raises `ModelError` for forces without a potential, one-sided rows, hidden conditions and rows that are too many.
    """
    from lagcli.formulations import vakonomic_system

    built, model = run.built, run.model
    differential = built.rows.rows[built.holonomic_count :]
    t, q, v = (part[0] for part in table_columns.States(model, run.columns)(first.table[:1]))
    vakonomic_system.require_action(built, float(t), q, run.parameters)
    for condition in run.conditions:
        where = next(row.location for row in built.rows.rows if row.name in condition.rows)
        message = (
            f"the row demands the hidden condition `{condition.text} = 0`, which no multiplier holds: its vakonomic"
            " equations are not written"
        )
        hint = "write the condition under `holonomic` in its place"
        raise diagnostics.error("not-of-an-action", message, where, hint)
    if not differential:
        return dataclasses.replace(first, name="vakonomic"), (), []
    values = np.array(list(mu.values()))
    independent = tuple(i for i in run.report.selection.independent if i < len(built.rows.rows))
    start = vakonomic_system.VakonomicStart(float(t), q, v, values, independent)
    start = dataclasses.replace(start, mu=vakonomic_system.effective(built, start))
    extended, left_out = vakonomic_system.model(built, start)
    size_limits.require_built(extended)
    try:
        ready = CompiledModel(vakonomic_system.build(built, extended, start))
    except vakonomic_system.TooLargeError:
        where = differential[0].location
        message = "the vakonomic equations are too large: the rows are too many to be solved for mu'"
        message += " in written-out form"
        raise diagnostics.error("too-large-to-build", message, where, "model fewer members") from None
    found = _table("vakonomic", prepare_run.start_compiled(ready, KnownIntegrals(run.integrals)))
    columns, indices = vakonomic_system.table(found.columns, model, differential)
    found = dataclasses.replace(
        found,
        path=first.path,
        coordinates=first.coordinates,
        freedoms=first.freedoms,
        columns=tuple(columns),
        table=found.table[:, indices],
    )
    notes = []
    moved = [f"{name} {new:.6g}" for name, new, old in zip(mu, start.mu, values, strict=True) if new != old]
    if moved:
        notes.append(
            "differential rows follow from others, and their initial mu is carried by those: mu begins as "
            + ", ".join(moved)
        )
    if left_out:
        notes.append(
            "without a value in vakonomic motion, for they read multipliers of differential rows or whole reactions:"
            f" {', '.join(left_out)}"
        )
    return found, left_out, notes


def _no_differential_row(model: Model, name: str, rows: Sequence[str]) -> str:
    """Why a name is none of the differential `rows`."""
    constrained = [row for law in model.holonomic for row in law.rows]
    constrained += [base for law in model.holonomic for base in law.members.names]
    constrained += [body.name for body in model.rigid]
    if name in constrained or name.rpartition(".")[0] in constrained:
        return f"`{name}` is holonomic: its multiplier follows from the motion and has no initial value"
    parts = [row for row in rows if row.startswith((f"{name}.", f"{name}["))]
    hint = f"its rows are `{parts[0]}` to `{parts[-1]}`" if parts else diagnostics.nearest(name, rows)
    hint = hint or (f"they are {', '.join(rows[:6])}" if rows else "the model has none")
    return f"there is no differential row `{name}`; {hint}"


def compare_to_files(
    models: Sequence[Model], asked: Mapping[str, object], output: str | None, plot: str | None
) -> tuple[Comparison, list[str]]:
    """The comparison of one model or two, and lines to print about its table, if any.

    asked: keywords of `compare`; output: `-` for standard output. Raises what `compare` raises, `WriteError`,
    `BadRequest`.
    """
    found = compare(*models, **asked)  # type: ignore[arg-type]
    model, lines = models[0], []
    if found.principles is None:
        return found, []
    first, vakonomic = found.formulations[0], found.formulations[-1]
    if output is not None:
        whence = provenance.of(model).as_json() | {"vakonomic": {"mu": dict(found.principles.mu)}}
        is_partial = bool(vakonomic.stopped)
        saved = run_tables.write(output, vakonomic.columns, vakonomic.table, whence, is_partial)
        if is_partial:
            lines.append(f"lagcli: the vakonomic motion stopped; {saved}" if saved else "")
    if plot is not None:
        with write_guard.drawing(plot):
            # matplotlib takes a third of a second to load: only where a figure is asked for.
            from lagcli.output.figures import figure_page, result_figures

            tables = {
                name: dict(zip(run.columns, run.table.T, strict=True))
                for name, run in (("d'Alembert", first), ("vakonomic", vakonomic))
            }
            # Positions in the order of the table, those that differ most of all where they are many.
            kinds = comparison.kinds(model, first.columns)
            shown = [name for name, kind in kinds.items() if kind == "r" and name in vakonomic.columns]
            count = min(len(first.table), len(vakonomic.table))

            def gap(name: str) -> float:
                one, two = (table[name][:count] for table in tables.values())
                return float(np.abs(one - two).max(initial=0.0))

            most = set(sorted(shown, key=gap, reverse=True)[: result_figures.MOST_COLUMNS])
            shown = [name for name in shown if name in most]
            title = f"{model.title or pathlib.Path(model.path).stem}: two principles"
            figure_page.write(plot, result_figures.motions(tables, shown, title, model.units.time))
    return found, lines
