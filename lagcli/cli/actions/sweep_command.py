"""`lagcli sweep`: its points, its rows on their way into a file, and its account."""

from __future__ import annotations

import contextlib
import itertools
import os
import pathlib
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence

from lagcli.api.sweeps import (
    dask_engine,
    engines,
    finished_rows,
    point_sources,
    point_task,
    reductions,
    shard_merge,
    sweep_account,
    sweep_journal,
    sweep_plan,
    sweep_table,
)
from lagcli.api.sweeps.point_task import PointRow
from lagcli.api.sweeps.sweep_account import SweepAccount
from lagcli.api.sweeps.sweep_plan import SweepPlan
from lagcli.api.sweeps.sweep_table import SweepTable
from lagcli.cli.requests.asked_points import UNREADABLE, AskedPoints
from lagcli.cli.requests.asked_sweep import SweepFiles
from lagcli.cli.terminal import console, exits
from lagcli.model.model import Model
from lagcli.output.files import atomic_file, formats, interrupts, json_text, write_guard
from lagcli.output.tables import table_format

# Points above which a sweep is asked for with --yes: days of computing, which a slip of the finger has asked for.
MOST_POINTS = 10_000_000
SYNC = 1.0  # seconds between times that rows are put on the disk for power cuts


def plan(
    model: Model,
    asked: AskedPoints,
    reduce: Sequence[str],
    settings: Mapping[str, object],
    limits: tuple[float, float | None],
    files: SweepFiles,
) -> SweepPlan:
    """The sweep that is asked for. Raises `exits.UsageError`, `write_guard.WriteError`, `ModelError`."""
    try:
        parts = asked.read(model)
        count = point_sources.joined(parts).count
        if count > MOST_POINTS and not asked.yes:
            raise exits.UsageError(f"these are {count} points: --yes runs more than {MOST_POINTS}")
        shard = _shard(files.shard)
        pattern = None
        if files.tables is not None:
            with write_guard.writing(files.tables):
                pattern = point_task.require_folder(files.tables)
            formats.of(pathlib.Path(pattern), formats.TABLES)
        chosen = sweep_plan.SweepSettings(settings, *limits, pattern)
        return sweep_plan.plan(model, parts, reductions.read(reduce), chosen, shard)
    except (point_sources.BadPoints, reductions.BadReduction, formats.UnknownFormat, ValueError) as error:
        raise exits.UsageError(str(error)) from None


def _shard(text: str | None) -> sweep_plan.Shard:
    """The part of `--shard I/N`. Raises `exits.UsageError`."""
    if text is None:
        return sweep_plan.Shard()
    number, sign, count = (part.strip() for part in text.partition("/"))
    is_whole = sign and number.isdecimal() and count.isdecimal()
    if not is_whole or not 1 <= int(number) <= int(count):
        raise exits.UsageError(f"--shard {text}: write I/N, the part I of N, from 1/N to N/N")
    return sweep_plan.Shard(int(number), int(count))


def run(plan: SweepPlan, files: SweepFiles, has_spreads: bool) -> None:
    """Compute and write. Raises `exits.Exit` with 1 or 3 where a point is not done."""
    began = time.monotonic()
    account = SweepAccount([one.name for one in plan.task.reductions], has_spreads)
    interrupts.leave()
    with interrupts.unwinding(), interrupts.shielded(), _engine(files) as engine:
        try:
            if files.target is None:
                _to_stdout(plan, files, engine, account)
            else:
                _to_file(plan, files, engine, account)
        except engines.WorkersLost as lost:
            again = "" if files.target is None else "; --resume goes on after the rows there are"
            exits.print_err(f"lagcli: {lost}{again}")
            raise exits.Exit(exits.STOPPED) from None
    account.lost = engine.lost
    _tell(plan, account, files, time.monotonic() - began)
    raise exits.Exit(account.code)


@contextlib.contextmanager
def _engine(files: SweepFiles) -> Iterator[engines.Engine]:
    """Who computes. Raises `exits.UsageError` where there is no such cluster."""
    if files.scheduler is None:
        with engines.local(files.jobs) as engine:
            yield engine
        return
    with contextlib.ExitStack() as stack:
        try:
            engine = stack.enter_context(dask_engine.cluster(files.scheduler))
        except dask_engine.NoCluster as error:
            raise exits.UsageError(f"--scheduler: {error}") from None
        yield engine


def _blocks(
    plan: SweepPlan, files: SweepFiles, engine: engines.Engine, there: int
) -> Iterator[list[PointRow]]:
    """The rows after those that are there; an interrupt breaks off only what computes them."""
    numbers = plan.numbers
    rows = engines.rows(engine, plan.task, plan.points, numbers[there:])
    with console.progress(0, len(numbers), files.quiet) as bar:
        while True:
            with interrupts.window():
                bar.at(there)
                block = next(rows, None)
            if block is None:
                return
            there += len(block)
            yield block


def _to_stdout(plan: SweepPlan, files: SweepFiles, engine: engines.Engine, account: SweepAccount) -> None:
    with write_guard.writing("standard output"):
        table = SweepTable(sys.stdout.buffer, plan.columns, None, plan.shard_of if plan.is_shard else "")
        for block in _blocks(plan, files, engine, 0):
            with interrupts.shielded(interrupts.PATIENCE):
                table.write(block)
            account.take(block)
        with interrupts.shielded(interrupts.PATIENCE):
            table.commit()


def _to_file(plan: SweepPlan, files: SweepFiles, engine: engines.Engine, account: SweepAccount) -> None:
    target = files.path(plan.shard.number, plan.shard.count)
    with write_guard.writing(os.fspath(target)):
        target.parent.mkdir(exist_ok=True)
    path = sweep_journal.path_of(target)
    identity = {**plan.identity, "shard": [plan.shard.number, plan.shard.count]}
    if files.resume and _is_complete(plan, target, sweep_journal.ended_with(path, identity), account):
        if not files.quiet:
            exits.print_err(f"note: {target} holds all rows of this sweep already")
        return
    with write_guard.writing(os.fspath(path)):
        try:
            journal = sweep_journal.SweepJournal(path, identity, files.resume)
        except sweep_journal.UnfitJournal as error:
            raise exits.UsageError(f"--resume: {error}" if files.resume else str(error)) from None
    is_resumed = journal.count > 0
    if is_resumed and not files.quiet:
        exits.print_err(f"note: {journal.count} of {len(plan.numbers)} points are there of the sweep before")
    _compute(plan, files, engine, journal, target)
    with write_guard.writing(os.fspath(target)):
        for rows in _written(plan, journal, target, lambda table: table.commit()):
            account.take(rows)
        if files.resume and finished_rows.is_silent(target, plan):
            journal.end_with(target)
        else:
            journal.remove()
        if is_resumed:  # what an interrupt has kept of it is in the table
            atomic_file.partial_of(files.rows_so_far(target)).unlink(missing_ok=True)


def _is_complete(plan: SweepPlan, target: pathlib.Path, digest: str, account: SweepAccount) -> bool:
    """True if the file holds all rows of the sweep, which are counted. Raises `exits.UsageError` where that cannot be
    told."""
    with write_guard.writing(os.fspath(target)):
        if sweep_journal.is_under_way(sweep_journal.path_of(target)):
            return False
        try:
            there = finished_rows.found(target, plan, digest)
        except finished_rows.OfUnknownSweep as error:
            raise exits.UsageError(f"--resume: {error}") from None
    account.take(there or [])
    return there is not None


def _compute(
    plan: SweepPlan,
    files: SweepFiles,
    engine: engines.Engine,
    journal: sweep_journal.SweepJournal,
    target: pathlib.Path,
) -> None:
    """Bring the rows that are missing into the journal."""
    try:
        with write_guard.writing(os.fspath(journal.path)):
            synced = time.monotonic()
            for block in _blocks(plan, files, engine, journal.count):
                journal.write(block)
                if time.monotonic() - synced > SYNC:
                    journal.sync()
                    synced = time.monotonic()
            journal.sync()
    except interrupts.Interrupted:
        kept = _keep(plan, journal, files.rows_so_far(target))
        interrupts.leave(f"lagcli: interrupted; {kept}; --resume goes on after them")
        raise


def _written(
    plan: SweepPlan,
    journal: sweep_journal.SweepJournal,
    target: pathlib.Path,
    end: Callable[[SweepTable], object],
) -> Iterator[list[PointRow]]:
    """Write the rows of a journal into a table that is ended so; each block when it is written."""
    provenance = {**plan.identity, "shard": [plan.shard.number, plan.shard.count]}
    try:
        table = SweepTable(target, plan.columns, provenance, plan.shard_of if plan.is_shard else "")
    except table_format.MissingExtra as error:
        raise exits.UsageError(str(error)) from None
    with contextlib.ExitStack() as stack:
        stack.callback(table.discard)
        rows = journal.rows()
        while block := list(itertools.islice(rows, sweep_table.ROWS_AT_ONCE)):
            table.write(block)
            yield block
        stack.pop_all()
        end(table)


def _keep(plan: SweepPlan, journal: sweep_journal.SweepJournal, target: pathlib.Path) -> str:
    """Write the rows so far into `target`.partial; where they are, in words."""
    journal.sync()
    with write_guard.writing(os.fspath(target)):
        for _ in _written(plan, journal, target, lambda table: table.keep_partial()):
            pass
    return f"{journal.count} of {len(plan.numbers)} points are in {atomic_file.partial_of(target)}"


def _tell(plan: SweepPlan, account: SweepAccount, files: SweepFiles, seconds: float) -> None:
    if files.as_json:
        print(json_text.text({**account.as_json(), "sweep": plan.identity}))
    if files.quiet:
        return
    exits.print_err(account.sentence())
    if account.lost:
        exits.print_err(account.of_workers())
    for name, spread in account.spreads().items():
        told = ", ".join(
            f"{100 * q:g} %: {value:.6g}"
            for q, value in zip(sweep_account.QUANTILES, spread.quantiles, strict=True)
        )
        exits.print_err(f"{name}: mean {spread.mean:.6g}, standard deviation {spread.sd:.3g}; {told}")
    exits.print_err(f"computed in {seconds:.3g} s")


def merge(paths: Sequence[str], files: SweepFiles, is_alone: bool) -> None:
    """Put the tables of shards together. Raises `exits.UsageError`, `exits.Exit` as the whole sweep would."""
    if not is_alone:
        raise exits.UsageError("--merge puts tables together that are there: it goes with -o FILE alone")
    files.require_merge(paths)
    try:
        found = shard_merge.merged(paths)
    except FileNotFoundError as error:
        raise exits.UsageError(f"--merge: there is no file {error.filename}") from None
    except OSError as error:
        raise exits.UsageError(f"--merge: cannot read {error.filename}: {error.strerror}") from None
    except (*UNREADABLE, shard_merge.BadShards) as error:
        raise exits.UsageError(f"--merge: {error}") from None
    account = SweepAccount([], False)
    target = sys.stdout.buffer if files.output in (None, "-") else pathlib.Path(str(files.output))
    with write_guard.writing(files.output or "standard output"):
        table = SweepTable(target, found.columns, None)
        with contextlib.ExitStack() as stack:
            stack.callback(table.discard)
            table.write_all(found.rows)
            stack.pop_all()
            table.commit()
    account.take(found.rows)
    if not files.quiet:
        exits.print_err(account.sentence())
    raise exits.Exit(account.code)
