"""`lagcli sweep`: many runs of one model, a row of each of which is written as it comes."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping

from lagcli.api.sweeps import (
    dask_engine,
    drawn_points,
    engines,
    point_sources,
    point_task,
    reductions,
    sweep_plan,
)
from lagcli.api.sweeps.point_sources import SweepPoints
from lagcli.model.model import Model
from lagcli.output.files import formats, interrupts, write_guard
from lagcli.output.files.write_guard import BadRequest
from lagcli.output.sweeps.sweep_table import STOPPED, SweepAccount, SweepEnding
from lagcli.output.sweeps.written_sweep import SweepRequest, SweepStep, WrittenSweep
from lagcli.output.tables import table_format

# Points above which a sweep is asked for with --yes: days of computing, which a slip of the finger has asked for.
MOST_POINTS = 10_000_000


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

    @property
    def has_spreads(self) -> bool:
        """True if the points are drawn alone, so that their results have a distribution."""
        return bool(self.uncertain) and not self.over and self.points is None


def steps(model: Model, asked: AskedSweep, request: SweepRequest) -> Iterator[SweepStep]:
    """Plan the sweep, compute it and write it: a step for each part of the points that is there, texts, the ending.

    Raises `BadRequest`, worded for the options of the command, `WriteError`, `diagnostics.ModelError`, and
    `interrupts.Interrupted`, when the rows there are have been put in order.
    """
    began = time.monotonic()
    plan = _plan(model, asked, request)
    account = SweepAccount(plan.rows.results, asked.has_spreads)
    interrupts.leave()
    with interrupts.unwinding(), interrupts.shielded(), _tables_locked(plan), _engine(request) as engine:
        written = WrittenSweep(
            plan.rows,
            request,
            account,
            lambda numbers: engines.rows(engine, plan.task, plan.points, numbers),
        )
        try:
            yield from written.steps()
        except engines.WorkersLost as lost:
            again = "" if request.target is None else "; --resume goes on after the rows there are"
            yield f"lagcli: {lost}{again}"
            yield SweepEnding(STOPPED, (), None)
            return
    account.lost = engine.lost
    seconds = f"computed in {time.monotonic() - began:.3g} s"
    told = () if request.quiet else (*account.sentences(), seconds)
    counted = {**account.as_json(), "sweep": plan.rows.identity} if request.as_json else None
    yield SweepEnding(account.code, told, counted)


def _plan(model: Model, asked: AskedSweep, request: SweepRequest) -> sweep_plan.SweepPlan:
    """The sweep that is asked for. Raises `BadRequest`, `WriteError`, `ModelError`."""
    try:
        parts = list(_sources(model, asked))
        if not parts:
            raise BadRequest("no points: give --over NAME=LOW:HIGH:COUNT, --points FILE or --uncertain")
        count = point_sources.joined(parts).count
        if count > MOST_POINTS and not asked.yes:
            raise BadRequest(f"these are {count} points: --yes runs more than {MOST_POINTS}")
        part, pattern = request.part, None
        if request.tables is not None:
            with write_guard.writing(request.tables):
                pattern = point_task.require_folder(request.tables)
            formats.of(pathlib.Path(pattern), formats.TABLES)
        chosen = sweep_plan.SweepSettings(asked.settings, asked.limit, asked.limit_each, pattern)
        return sweep_plan.plan(model, parts, reductions.read(asked.reduce), chosen, part)
    except ValueError as error:
        raise BadRequest(str(error)) from None


def _sources(model: Model, asked: AskedSweep) -> Iterator[SweepPoints]:
    """The sources of the points. Raises `BadRequest`, `BadPoints`, `ModelError`."""
    if asked.over and asked.points is not None:
        raise BadRequest("--over and --points both say which points there are; give one of them")
    for text in asked.over:
        yield _known(model, point_sources.over(model, text), "--over")
    if asked.points is not None:
        yield _known(model, _table(asked.points), f"--points {_shown(asked.points)}:")
    if asked.uncertain:
        laws = [drawn_points.read(model, text) for text in asked.uncertain]
        drawn = drawn_points.draw(laws, asked.draws, asked.seed, asked.sampling)
        yield _known(model, drawn, drawn_points.LABEL)


def _known(model: Model, part: SweepPoints, label: str) -> SweepPoints:
    sweep_plan.require_names(model, part, label)
    return part


def _shown(points: str) -> str:
    return "<stdin>" if points == "-" else points


def _table(points: str) -> point_sources.TableOfPoints:
    """The points of a table. Raises `BadRequest`, `BadPoints`."""
    label = f"--points {_shown(points)}"
    with contextlib.ExitStack() as stack:
        path = points
        if os.path.isdir(path):
            raise BadRequest(f"--points: {points} is a folder, and a table of points is needed")
        if points == "-":
            # Tables are read twice, first their names: what comes through a pipe is put aside.
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            path = os.path.join(folder, "points.csv")
            pathlib.Path(path).write_bytes(sys.stdin.buffer.read())
        try:
            names, rows = table_format.read(path)
        except FileNotFoundError:
            raise BadRequest(f"--points: there is no file {points}") from None
        except OSError as error:
            raise BadRequest(f"--points: cannot read {points}: {error.strerror}") from None
        except table_format.UNREADABLE as error:
            raise BadRequest(f"--points {str(error).replace(path, _shown(points))}") from None
    return point_sources.TableOfPoints(names, rows, label)


def _tables_locked(plan: sweep_plan.SweepPlan) -> contextlib.AbstractContextManager[object]:
    with write_guard.writing(plan.task.tables or ""):
        return point_task.locked(plan.task.tables, plan.rows)


@contextlib.contextmanager
def _engine(request: SweepRequest) -> Iterator[engines.Engine]:
    """The engine that computes. Raises `BadRequest` where there is no such cluster."""
    if request.scheduler is None:
        with engines.local(request.jobs) as engine:
            yield engine
        return
    with contextlib.ExitStack() as stack:
        try:
            engine = stack.enter_context(dask_engine.cluster(request.scheduler))
        except dask_engine.NoCluster as error:
            raise BadRequest(f"--scheduler: {error}") from None
        yield engine
