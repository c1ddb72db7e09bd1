"""`lagcli.sweep`: many runs of one model, as a data frame with a row for each point."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Unpack

import numpy as np

from lagcli import progress
from lagcli.api import point_task, reductions, run_settings, sweep_engines, sweep_points
from lagcli.api.load import Path, as_model
from lagcli.api.point_task import SweepPlan, SweepSettings
from lagcli.api.sweep_points import SweepPoints, TableOfPoints
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats, interrupts, write_guard
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.sweeps.sweep_table import STOPPED, PointRow, SweepAccount, SweepEnding
from lagcli.output.sweeps.written_sweep import SweepRequest, SweepStep, WrittenSweep
from lagcli.output.tables import table_format

if TYPE_CHECKING:
    import pandas

Values = str | float | Sequence[float]

# Points above which a sweep is asked for with --yes: days of computing, which a slip of the finger has asked for.
MOST_POINTS = 10_000_000


@progress.phase("sweeping")
@run_settings.keywords()
def sweep(
    model: Model | Path,
    points: Mapping[str, Values] | Sequence[Mapping[str, float]] | pandas.DataFrame | Path | None = None,
    *,
    reduce: Mapping[str, str] | None = None,
    uncertain: Mapping[str, str] | None = None,
    draws: int = 1024,
    seed: int = 0,
    sampling: str = "sobol",
    executor: Executor | None = None,
    jobs: int = 1,
    limit_each: float | None = None,
    tables: str | None = None,
    limit: float | None = None,
    **settings: Unpack[RunSettings],
) -> pandas.DataFrame:
    """Run a model at many points and return a row for each, in their order, as `pandas.DataFrame`.

    points: names with their values for a grid, `{"L": "0.5:2:16", "m": [1, 2, 5]}`, the last name changing first; a
    data frame, a list of mappings or the file of a table, a row a point; `uncertain`: names with distributions,
    `{"L": "normal(1, 0.01)"}`, of which `draws` points are drawn, quasi-random or, with `sampling="random"`, random,
    for each of `points`. reduce: names of columns with expressions, `{"peak": "max(abs(lambda.rod))"}`; by default the
    last row of all columns. Parts go to the `executor`, of any kind that is a `concurrent.futures.Executor`, or to so
    many `jobs`, processes of this machine. `limit_each` ends a point after so many seconds; `tables` is a folder for
    full tables. The other options are as of `simulate`; each row is that of a run of its own, to the last bit.
    Columns: `point`, the numbers of the point, the reductions, `status` (0, 1 invalid, 3 stopped), `message`, `t_end`;
    `attrs` of the frame holds the account. Raises `ModelError`, `ValueError`, `OSError`,
    `RuntimeError` where workers were lost again and again, and `ImportError` without pandas.
    """
    try:
        import pandas
    except ModuleNotFoundError as error:  # before the runs, and not after them
        raise ImportError("sweep() needs pandas: pip install pandas") from error

    model = as_model(model)
    parts = [] if points is None else _points(model, points)
    if uncertain:
        laws = [sweep_points.read_law(model, f"{name}~{text}") for name, text in uncertain.items()]
        parts.append(sweep_points.draw(laws, draws, seed, sampling))
    if not parts:
        raise ValueError("points: there are none; give points or uncertain")
    if executor is not None and jobs != 1:
        raise ValueError("executor and jobs both say who computes; give one of them")
    for part in parts:
        point_task.require_names(model, part, "points")
    reduced = [reductions.Reduction(name, text) for name, text in (reduce or {}).items()]
    pattern = None if tables is None else point_task.require_folder(os.fspath(tables))
    chosen = SweepSettings(settings, run_settings.seconds(limit), limit_each, pattern)
    plan = point_task.plan(model, parts, reduced, chosen)
    rows: list[PointRow] = []
    with point_task.locked(pattern, plan.rows):
        with sweep_engines.local(jobs) if executor is None else sweep_engines.given(executor) as engine:
            for found in sweep_engines.rows(engine, plan.task, plan.points, plan.rows.numbers):
                rows += found
        account = SweepAccount(plan.rows.results, bool(uncertain))
        account.take(rows)
        account.lost = engine.lost
    numbers = np.array([(*row.point, *row.results) for row in rows])
    names = plan.rows.columns[1:-3]
    frame = pandas.DataFrame(numbers.reshape(len(rows), len(names)), columns=list(names))
    frame.insert(0, "point", [row.number for row in rows])
    frame["status"] = [row.status for row in rows]
    frame["message"] = [row.message for row in rows]
    frame["t_end"] = [row.t_end for row in rows]
    frame.attrs.update(account.as_json() | {"sweep": plan.rows.identity})
    return frame


def _points(
    model: Model, points: Mapping[str, Values] | Sequence[Mapping[str, float]] | pandas.DataFrame | Path
) -> list[SweepPoints]:
    """The sources of the points. Raises `ValueError` for what is none."""
    if isinstance(points, (str, os.PathLike)):
        columns, rows = table_format.read(points)
        return [TableOfPoints(columns, rows, os.fspath(points))]
    if isinstance(points, Mapping):
        return [
            sweep_points.over(model, f"{name}={values}")
            if isinstance(values, str)
            else TableOfPoints([name], np.array(values, dtype=np.float64).reshape(-1, 1), "points")
            for name, values in points.items()
        ]
    if hasattr(points, "columns"):
        names = [str(name) for name in points.columns]
        return [TableOfPoints(names, np.array(points, dtype=np.float64), "points")]
    if not len(points):
        raise ValueError("points: there are none")
    names = list(points[0])
    if any(list(point) != names for point in points):
        raise ValueError("points: all of them need the same names in the same order")
    numbers = np.array([[float(value) for value in point.values()] for point in points])
    return [TableOfPoints(names, numbers.reshape(-1, len(names)), "points")]


@dataclasses.dataclass(frozen=True, slots=True)
class AskedSweep:
    """The options of `lagcli sweep` that say what is computed, as they are written: which points there are, what is
    kept of each run, the settings of the runs, None where the file's stay, and seconds for proofs and for a point."""

    over: tuple[str, ...]
    points: str | None
    uncertain: tuple[str, ...]
    draws: int
    seed: int
    sampling: str
    yes: bool
    reduce: tuple[str, ...]
    settings: Mapping[str, object]
    limit: float
    limit_each: float | None


def steps(model: Model, asked: AskedSweep, request: SweepRequest) -> Iterator[SweepStep]:
    """Plan the sweep, compute it and write it: a step for each part of the points that is there, texts, the ending.

    Raises `BadRequest`, worded for the options of the command, `WriteError`, `diagnostics.ModelError`, and
    `interrupts.Interrupted`, when the rows there are have been put in order.
    """
    began = time.monotonic()
    try:
        plan = _plan(model, asked, request)
    except ValueError as error:
        raise BadRequest(str(error)) from None
    # Of points that are drawn alone the results have a distribution.
    has_spreads = bool(asked.uncertain) and not asked.over and asked.points is None
    account = SweepAccount(plan.rows.results, has_spreads)
    interrupts.leave()
    with interrupts.unwinding(), interrupts.shielded(), contextlib.ExitStack() as stack:
        tables = plan.task.settings.tables
        with write_guard.writing(tables or ""):
            stack.enter_context(point_task.locked(tables, plan.rows))
        if request.scheduler is None:
            engine = stack.enter_context(sweep_engines.local(request.jobs))
        else:
            try:
                engine = stack.enter_context(sweep_engines.cluster(request.scheduler))
            except sweep_engines.NoCluster as error:
                raise BadRequest(f"--scheduler: {error}") from None
        written = WrittenSweep(
            plan.rows,
            request,
            account,
            lambda numbers: sweep_engines.rows(engine, plan.task, plan.points, numbers),
        )
        try:
            yield from written.steps()
        except sweep_engines.WorkersLost as lost:
            again = "" if request.target is None else "; --resume goes on after the rows there are"
            yield f"lagcli: {lost}{again}"
            yield SweepEnding(STOPPED, (), None)
            return
    account.lost = engine.lost
    seconds = f"computed in {time.monotonic() - began:.3g} s"
    told = () if request.quiet else (*account.sentences(), seconds)
    counted = {**account.as_json(), "sweep": plan.rows.identity} if request.as_json else None
    yield SweepEnding(account.code, told, counted)


def _plan(model: Model, asked: AskedSweep, request: SweepRequest) -> SweepPlan:
    """The sweep that is asked for. Raises `ValueError`, `WriteError`, `ModelError`."""
    if asked.over and asked.points is not None:
        raise BadRequest("--over and --points both say which points there are; give one of them")
    parts = [point_task.require_names(model, sweep_points.over(model, text), "--over") for text in asked.over]
    if asked.points is not None:
        # The points of a table. Raises `BadRequest`, `BadPoints`
        if os.path.isdir(asked.points):
            raise BadRequest(f"--points: {asked.points} is a folder, and a table of points is needed")
        path = asked.points
        shown = "<stdin>" if path == "-" else path
        with contextlib.ExitStack() as stack, run_settings.reading("--points", path):
            if path == "-":
                # Tables are read twice, first their names: what comes through a pipe is put aside.
                folder = stack.enter_context(tempfile.TemporaryDirectory())
                path = os.path.join(folder, "points.csv")
                pathlib.Path(path).write_bytes(sys.stdin.buffer.read())
            try:
                names, rows = table_format.read(path)
            except table_format.UNREADABLE as error:
                raise BadRequest(f"--points {str(error).replace(path, shown)}") from None
        table = TableOfPoints(names, rows, f"--points {shown}")
        parts.append(point_task.require_names(model, table, f"--points {shown}:"))
    if asked.uncertain:
        laws = [sweep_points.read_law(model, text) for text in asked.uncertain]
        drawn = sweep_points.draw(laws, asked.draws, asked.seed, asked.sampling)
        parts.append(point_task.require_names(model, drawn, sweep_points.UNCERTAIN))
    if not parts:
        raise BadRequest("no points: give --over NAME=LOW:HIGH:COUNT, --points FILE or --uncertain")
    count = sweep_points.joined(parts).count
    if count > MOST_POINTS and not asked.yes:
        raise BadRequest(f"these are {count} points: --yes runs more than {MOST_POINTS}")
    part, pattern = request.part, None
    if request.tables is not None:
        with write_guard.writing(request.tables):
            pattern = point_task.require_folder(request.tables)
        formats.of(pathlib.Path(pattern), formats.TABLES)
    chosen = SweepSettings(asked.settings, asked.limit, asked.limit_each, pattern)
    return point_task.plan(model, parts, reductions.read(asked.reduce), chosen, part)
