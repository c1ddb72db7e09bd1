"""One point of a sweep: the model with its values, its run, and what is kept of it. It runs in any process."""

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
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.api.models import cache
from lagcli.api.runs import prepare_run, run_settings
from lagcli.api.sweeps import reductions
from lagcli.api.sweeps.point_sources import Point
from lagcli.api.sweeps.reductions import Reduction
from lagcli.errors import diagnostics
from lagcli.expression.tree import ExpressionError
from lagcli.input import document
from lagcli.input.overrides import OverrideError
from lagcli.model.model import Model
from lagcli.output.files import file_lock
from lagcli.output.sweeps.sweep_table import DONE, INVALID, STOPPED, PlannedRows, PointRow
from lagcli.output.tables import sinks
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state import run_stop
from lagcli.start import assembly

Floats = npt.NDArray[np.float64]

OBJECTS = 50_000  # that are made between two looks for unneeded cycles: some megabytes
MOST_MESSAGE = 300  # characters of a message, which stands in a cell of a table


@dataclasses.dataclass(frozen=True, slots=True)
class PointTask:
    """The work for each point of a sweep, such that another process can do it.

    data, path: the text of the model and its name in messages; given: the values of `--set`; settings: of the runs,
    what is None is as the model says; names: of the numbers of a point; limit: seconds for proofs; limit_each: seconds
    for a point; tables: pattern with a `*` for the number of a point, of the files of full tables.
    """

    data: bytes | str
    path: str
    given: Mapping[str, object]
    settings: Mapping[str, object]
    names: tuple[str, ...]
    reductions: tuple[Reduction, ...]
    limit: float
    limit_each: float | None = None
    tables: str | None = None

    @property
    def ends_only(self) -> bool:
        """True where no rows are needed but the first and the last of each run."""
        return self.tables is None and reductions.are_of_ends(self.reductions)

    @property
    def key(self) -> str:
        """A text that tells tasks apart."""
        parts = [self.path, self.given, self.settings, self.names, self.reductions, self.limit]
        found = hashlib.sha256(repr([*parts, self.limit_each, self.tables]).encode())
        found.update(self.data.encode() if isinstance(self.data, str) else self.data)
        return found.hexdigest()


def stopped(task: PointTask, number: int, point: Point, message: str) -> PointRow:
    """The row of a point that was stopped before its first row."""
    return PointRow(number, point, (math.nan,) * len(task.reductions), STOPPED, message, math.nan)


class PointRunner:
    """Runs points of one task; the text is parsed once, and the equations are built once where they fit."""

    def __init__(self, task: PointTask) -> None:
        self.task = task
        self.file = document.ParsedFile(task.data, task.path)
        self._is_built = False

    def model(self, point: Point) -> Model:
        """The model of a point. Raises `ModelError`, `OverrideError`."""
        return self.file.model({**self.task.given, **dict(zip(self.task.names, point, strict=True))})

    def run(self, number: int, point: Point) -> PointRow:
        """The row of a point."""
        data = _RunData(self.task)
        nothing, most = (math.nan,) * len(self.task.reductions), self.task.limit_each
        try:
            model = self.model(point)
            if not self._is_built:  # which takes its time once, and not that of a point
                self._is_built = cache.compiled(model) is not None
            with progress.ends_after(math.inf if most is None else most):
                chosen = run_settings.chosen(model, self.task.settings)
                seconds = run_settings.seconds(self.task.limit)
                with progress.phase("preparing the run"):
                    run = prepare_run.start(model, chosen, limit=seconds, ends_only=self.task.ends_only)
                data.begin(run, number)
                try:
                    for block in run.blocks():
                        data.take(run, block)
                        progress.require_time()
                    results = data.results(run)
                finally:
                    data.end()
        except diagnostics.ModelError as error:
            return PointRow(number, point, nothing, INVALID, _sentence(error), math.nan)
        except (OverrideError, run_settings.BadSetting, reductions.MissingColumn) as error:
            return PointRow(number, point, nothing, INVALID, _cut(str(error)), math.nan)
        except run_stop.RunStop as stop:
            data.reach(run)
            return PointRow(number, point, nothing, STOPPED, _cut(stop.stop.reason), data.t_end)
        except progress.OverTime:
            where = "before its first row" if math.isnan(data.t_end) else f"at t = {data.t_end:.9g}"
            reason = f"it takes longer than {most:g} s and was ended {where}"
            return PointRow(number, point, nothing, STOPPED, reason, data.t_end)
        numbers = tuple(found if math.isfinite(found) else math.nan for found in results)
        infinite = [one.name for one, x in zip(self.task.reductions, results, strict=True) if math.isinf(x)]
        message = f"`{infinite[0]}` is infinite" if infinite else ""
        return PointRow(number, point, numbers, DONE, message, data.t_end)


class _RunData:
    """The columns of a run that reductions need, and its whole table in a file where that is wanted."""

    def __init__(self, task: PointTask) -> None:
        self._task = task
        self._blocks: list[Floats] = []
        self._names: tuple[str, ...] = ()
        self._indices: list[int] = []
        self._sink: sinks.Sink | None = None
        self.t_end = math.nan

    def begin(self, run: SimulationRun, number: int) -> None:
        """The run has these columns. Raises `reductions.MissingColumn`."""
        everything = (*run.columns, *run.by_name)
        needed = [name for one in self._task.reductions for name in reductions.columns_of(one, everything)]
        self._names = tuple(dict.fromkeys(["t", *needed]))
        self._indices = [everything.index(name) for name in self._names]
        if self._task.tables is not None:
            path = pathlib.Path(self._task.tables.replace("*", f"{number:07d}"))
            whence = run.stats.provenance
            self._sink = sinks.open_sink(
                path, run.columns, provenance=None if whence is None else whence.as_json()
            )

    def take(self, run: SimulationRun, block: Floats) -> None:
        """Rows of the run."""
        if len(block):
            self.t_end = float(block[-1, 0])
        else:
            self.reach(run)
        if self._sink is not None:
            self._sink.write(block)
        self._blocks.append(run.taken(block, self._indices))

    def reach(self, run: SimulationRun) -> None:
        """The run has come to a time without the rows up to there, which nobody needs."""
        if self._task.ends_only and run.report.complete:
            self.t_end = run.grid.time(run.report.complete - 1)

    def results(self, run: SimulationRun) -> list[float]:
        """The reductions of the whole run, whose table is complete."""
        if self._sink is not None:
            self._sink.commit(planned=run.outcome.rows)
            self._sink = None
        rows = np.concatenate(self._blocks)
        columns = dict(zip(self._names, rows.T, strict=True))
        parameters = {**run.model.constants, **{p.name: p.value for p in run.model.parameters}}
        try:
            return [reductions.value(one, columns, columns["t"], parameters) for one in self._task.reductions]
        except ExpressionError as error:
            raise reductions.MissingColumn(error.message) from None

    def end(self) -> None:
        """A table that is not complete stands in FILE.partial."""
        if self._sink is not None:
            self._sink.keep_partial()


def _sentence(error: diagnostics.ModelError) -> str:
    first = error.diagnostics[0]
    more = len(error.diagnostics) - 1
    return _cut(f"{first.code}: {first.message}" + (f" (and {more} more)" if more else ""))


def _cut(sentence: str) -> str:
    plain = " ".join(diagnostics.printable(sentence).split())
    return plain if len(plain) <= MOST_MESSAGE else plain[: MOST_MESSAGE - 3] + "..."


_runners: dict[str, PointRunner] = {}
# Compiled systems serve one run at a time: where a worker has several threads they take turns.
_turn = threading.Lock()


def runner(task: PointTask) -> PointRunner:
    """The runner of a task in this process; that of the last one is kept."""
    key = task.key
    if key not in _runners:
        _runners.clear()
        _runners[key] = PointRunner(task)
    return _runners[key]


@contextlib.contextmanager
def _rarely_collecting() -> Iterator[None]:
    """Inside the block Python looks for unneeded cycles less often: the nouns of a model, made anew for every point,
    are thousands of objects, and looking through them takes a part of the time of a run."""
    before = gc.get_threshold()
    if before[0]:  # else they are not looked for at all
        gc.set_threshold(max(before[0], OBJECTS), *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


def run_points(
    task: PointTask, numbers: Sequence[int], points: Sequence[Point]
) -> tuple[list[PointRow], float]:
    """The rows of some points, and the seconds they took."""
    with _turn, progress.unreported(), assembly.briefly(), _rarely_collecting():
        began = time.perf_counter()
        here = runner(task)
        rows = [here.run(number, point) for number, point in zip(numbers, points, strict=True)]
        return rows, time.perf_counter() - began


def locked(tables: str | None, rows: PlannedRows) -> contextlib.AbstractContextManager[object]:
    """A lock on the full tables of the points of a shard, where they are written. Raises `OSError`."""
    if tables is None:
        return contextlib.nullcontext()
    part = f"part-{rows.part:05d}-of-{rows.parts:05d}"
    return file_lock.FileLock(pathlib.Path(tables.replace("*", part)))


def require_folder(tables: str) -> str:
    """The pattern of the files of full tables, in a folder that is there now: `FOLDER/`, `FOLDER/*.parquet`.

    Raises `OSError`.
    """
    head, tail = os.path.split(tables)
    if "*" not in tail:
        head, tail = tables, "point-*.csv"
    os.makedirs(head or os.curdir, exist_ok=True)
    return os.path.join(head, tail)
