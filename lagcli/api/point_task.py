"""The plan of a sweep, and one point of it in any process: the model with its values, its run, and what is kept."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import hashlib
import math
import os
import pathlib
import threading
import time
from collections.abc import Mapping, Sequence

import numpy as np

from lagcli import __version__, progress
from lagcli.api import cache, prepare_run, reductions, run_settings
from lagcli.api.reductions import Reduction
from lagcli.api.sweep_points import BadPoints, Point, SweepPoints, joined
from lagcli.equations import system
from lagcli.errors import diagnostics
from lagcli.expression.tree import ExpressionError
from lagcli.input import document
from lagcli.input.overrides import OverrideError
from lagcli.model.model import Model
from lagcli.output.files import atomic_file
from lagcli.output.sweeps.sweep_table import DONE, INVALID, STOPPED, PlannedRows, PointRow
from lagcli.output.tables import sinks
from lagcli.running import table_columns
from lagcli.simulation.run_state import run_stop
from lagcli.start import assembly

OBJECTS = 50_000  # that are made between two looks for unneeded cycles: some megabytes
MOST_MESSAGE = 300  # characters of a message, which stands in a cell of a table


@dataclasses.dataclass(frozen=True, slots=True)
class SweepSettings:
    """The settings of all runs, what is None as the model says; seconds for proofs and for a point; tables: pattern
    with a `*` for the number of a point, of the files of full tables."""

    runs: Mapping[str, object]
    limit: float
    limit_each: float | None = None
    tables: str | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class PointTask:
    """The work for each point of a sweep, such that another process can do it.

    data, path: the text of the model and its name in messages; given: the values of `--set`; names: of the numbers of
    a point.
    """

    data: bytes | str
    path: str
    given: Mapping[str, object]
    names: tuple[str, ...]
    reductions: tuple[Reduction, ...]
    settings: SweepSettings

    @property
    def ends_only(self) -> bool:
        """True where no rows are needed but the first and the last of each run."""
        return self.settings.tables is None and reductions.are_of_ends(self.reductions)


@dataclasses.dataclass(frozen=True, slots=True)
class SweepPlan:
    """The work, the points, and the rows that are wanted of them."""

    task: PointTask
    points: SweepPoints
    rows: PlannedRows


def require_names(model: Model, part: SweepPoints, label: str) -> SweepPoints:
    """The points. Raises `BadPoints` where a name of them is of nothing that can be set, or is set already."""
    set_already = dict(model.changes)
    for name in part.names:
        if name in set_already:
            raise BadPoints(f"{label} {name}: --set has a value for it too; give one of them")
    if part.count:
        try:
            model.with_parameters(dict(zip(part.names, part.point(0), strict=True)))
        except OverrideError as error:
            raise BadPoints(str(error).replace("--set", label, 1)) from None
        except diagnostics.ModelError:
            pass  # the first point is invalid, which its row will say
    return part


def plan(
    model: Model,
    parts: Sequence[SweepPoints],
    reduce: Sequence[Reduction],
    settings: SweepSettings,
    part: tuple[int, int] = (1, 1),
) -> SweepPlan:
    """The plan of a sweep; reduce: by default the last row of all columns; part: which shard of how many.

    Raises `BadPoints`, `reductions.BadReduction`, `diagnostics.ModelError`, and `ValueError` for bad settings and for a
    model that is not as it was read.
    """
    origin = model.origin
    if not isinstance(origin, document.ModelOrigin):
        raise ValueError("the start of this model was changed after it was read: load the file anew")
    run_settings.chosen(model, settings.runs)
    if settings.limit_each is not None and not settings.limit_each >= 0:  # nan neither
        raise ValueError("limit_each: a number of seconds is needed, 0 or more")
    points = joined(parts)
    if not points.count:
        raise BadPoints("there are no points")
    # The columns are those of the run of the first point; where that is invalid, of the model as it is.
    try:
        built = cache.compiled(model.with_parameters(dict(zip(points.names, points.point(0), strict=True))))
    except (diagnostics.ModelError, OverrideError):  # of a member that another value has taken away, say
        built = cache.compiled(model)
    columns = ("t", *built.system.columns)
    values = system.values(built.system)
    forces = table_columns.GeneralizedForces(built.system, built.numeric, values, columns)
    known = {**model.constants, **{p.name: p.value for p in model.parameters}}
    reductions.check(reduce, (*columns, *forces.names), known)
    reduced = tuple(reduce) or reductions.of_last_row(columns)
    settings = dataclasses.replace(settings, runs=dict(settings.runs))
    task = PointTask(origin.file.data, origin.file.path, origin.changes, points.names, reduced, settings)
    # What makes two sweeps one, whatever computes them and in how many parts.
    identity: dict[str, object] = {
        "version": __version__,
        "sha256": model.sha256,
        "set": {name: str(value) for name, value in task.given.items()},
        "settings": {key: value for key, value in settings.runs.items() if value is not None},
        "limit": settings.limit,
        "limit_each": settings.limit_each,
        "names": list(task.names),
        "points": points.digest,
        "count": points.count,
        "reductions": [[one.name, one.text, one.is_last] for one in reduced],
    }
    names = tuple(one.name for one in reduced)
    planned = PlannedRows(identity, points.names, names, points.count, *part)
    try:
        planned.columns  # noqa: B018 - two of one name
    except ValueError as error:
        raise BadPoints(str(error)) from None
    return SweepPlan(task, points, planned)


def stopped(task: PointTask, number: int, point: Point, message: str, t: float = math.nan) -> PointRow:
    """The row of a point that was stopped at a time, or before its first row."""
    return PointRow(number, point, (math.nan,) * len(task.reductions), STOPPED, message, t)


class PointRunner:
    """Runs points of one task; the text is parsed once, and the equations are built once where they fit."""

    def __init__(self, task: PointTask) -> None:
        self.task = task
        self.file = document.ParsedFile(task.data, task.path)
        self._is_built = False
        self._t_end = math.nan  # that the run of the point has reached

    def run(self, number: int, point: Point) -> PointRow:
        """The row of a point."""
        task, most = self.task, self.task.settings.limit_each
        self._t_end = math.nan
        try:
            model = self.file.model({**task.given, **dict(zip(task.names, point, strict=True))})
            if not self._is_built:  # which takes its time once, and not that of a point
                self._is_built = cache.compiled(model) is not None
            with progress.ends_after(math.inf if most is None else most):
                results = self._results(model, number)
        except diagnostics.ModelError as error:
            first, more = error.diagnostics[0], len(error.diagnostics) - 1
            fault = f"{first.code}: {first.message}" + (f" (and {more} more)" if more else "")
        except (OverrideError, run_settings.BadSetting, reductions.MissingColumn) as error:
            fault = str(error)
        except run_stop.RunStop as stop:
            return stopped(task, number, point, _cut(stop.stop.reason), self._t_end)
        except progress.OverTime:
            where = "before its first row" if math.isnan(self._t_end) else f"at t = {self._t_end:.9g}"
            reason = f"it takes longer than {most:g} s and was ended {where}"
            return stopped(task, number, point, reason, self._t_end)
        else:
            numbers = tuple(found if math.isfinite(found) else math.nan for found in results)
            infinite = [one.name for one, x in zip(task.reductions, results, strict=True) if math.isinf(x)]
            message = f"`{infinite[0]}` is infinite" if infinite else ""
            return PointRow(number, point, numbers, DONE, message, self._t_end)
        return PointRow(number, point, (math.nan,) * len(task.reductions), INVALID, _cut(fault), math.nan)

    def _results(self, model: Model, number: int) -> list[float]:
        """The reductions of the run of a point, whose whole table goes into a file, or FILE.partial, if wanted."""
        task, asked = self.task, self.task.settings
        chosen, seconds = run_settings.chosen(model, asked.runs), run_settings.seconds(asked.limit)
        with progress.phase("preparing the run"):
            run = prepare_run.start(model, chosen, limit=seconds, ends_only=task.ends_only)
        everything = (*run.columns, *run.by_name)
        needed = [name for one in task.reductions for name in reductions.columns_of(one, everything)]
        names = tuple(dict.fromkeys(["t", *needed]))
        indices = [everything.index(name) for name in names]
        sink, blocks = None, []
        if asked.tables is not None:
            path = pathlib.Path(asked.tables.replace("*", f"{number:07d}"))
            whence = run.stats.provenance
            whence_text = None if whence is None else whence.as_json()
            sink = sinks.open_sink(path, run.columns, provenance=whence_text)

        def reach() -> None:
            """The run has come to a time without the rows up to there, which nobody needs."""
            if task.ends_only and run.report.complete:
                self._t_end = run.grid.time(run.report.complete - 1)

        try:
            for block in run.blocks():
                if len(block):
                    self._t_end = float(block[-1, 0])
                else:
                    reach()
                if sink is not None:
                    sink.write(block)
                blocks.append(run.taken(block, indices))
                progress.require_time()
            if sink is not None:
                sink.commit(planned=run.outcome.rows)
                sink = None
        except run_stop.RunStop:
            reach()
            raise
        finally:
            if sink is not None:
                sink.keep_partial()
        columns = dict(zip(names, np.concatenate(blocks).T, strict=True))
        parameters = {**model.constants, **{p.name: p.value for p in model.parameters}}
        try:
            return [reductions.value(one, columns, columns["t"], parameters) for one in task.reductions]
        except ExpressionError as error:
            raise reductions.MissingColumn(error.message) from None


def _cut(sentence: str) -> str:
    plain = " ".join(diagnostics.printable(sentence).split())
    return plain if len(plain) <= MOST_MESSAGE else plain[: MOST_MESSAGE - 3] + "..."


_runners: dict[str, PointRunner] = {}  # of the last task in this process
# Compiled systems serve one run at a time: where a worker has several threads they take turns.
_turn = threading.Lock()


def run_points(
    task: PointTask, numbers: Sequence[int], points: Sequence[Point]
) -> tuple[list[PointRow], float]:
    """The rows of some points, and the seconds they took."""
    with _turn, progress.reported_to(None), assembly.briefly():
        # The nouns of a model, made anew for every point, are thousands of objects: looking through them for unneeded
        # cycles takes a part of the time of a run.
        before = gc.get_threshold()
        if before[0]:  # else they are not looked for at all
            gc.set_threshold(max(before[0], OBJECTS), *before[1:])
        try:
            began = time.perf_counter()
            key = repr([task.path, task.given, task.names, task.reductions, task.settings])
            data = task.data.encode() if isinstance(task.data, str) else task.data
            key = hashlib.sha256(key.encode() + data).hexdigest()
            if key not in _runners:
                _runners.clear()
                _runners[key] = PointRunner(task)
            rows = [_runners[key].run(*each) for each in zip(numbers, points, strict=True)]
            return rows, time.perf_counter() - began
        finally:
            gc.set_threshold(*before)


def locked(tables: str | None, rows: PlannedRows) -> contextlib.AbstractContextManager[object]:
    """A lock on the full tables of the points of a shard, where they are written. Raises `OSError`."""
    if tables is None:
        return contextlib.nullcontext()
    part = f"part-{rows.part:05d}-of-{rows.parts:05d}"
    return atomic_file.FileLock(pathlib.Path(tables.replace("*", part)))


def require_folder(tables: str) -> str:
    """The pattern of the files of full tables, `FOLDER/*.parquet`, in a folder that is there now. Raises `OSError`."""
    head, tail = os.path.split(tables)
    if "*" not in tail:
        head, tail = tables, "point-*.csv"
    os.makedirs(head or os.curdir, exist_ok=True)
    return os.path.join(head, tail)
