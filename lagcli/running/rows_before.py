"""The rows of the run before, with which the table of a run that is resumed begins, and what is refused about them."""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
from collections.abc import Sequence

from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import row_file, table_format
from lagcli.running import run_tables
from lagcli.running.run_request import RunRequest
from lagcli.running.run_tables import RowsBefore, TablePlan
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state.checkpoint import Checkpoint, CheckpointTable


def record(ready: SimulationRun, resume: str, plan: TablePlan) -> CheckpointTable | None:
    """The words of the checkpoint about a table, where the run before wrote the same one."""
    point = ready.resumed
    if point is None or plan.file is None:
        return None
    record = point.events if plan.option == "--events" else point.table
    is_same = record is not None and run_tables.table_of(pathlib.Path(resume), record.file) == plan.path
    return record if is_same else None


def before(ready: SimulationRun, resume: str, plan: TablePlan) -> RowsBefore | None:
    """The rows before a resumed run, where it writes the same table and that table was never completed.

    Raises `BadRequest` where they do not fit together, for they would be lost.
    """
    point, written = ready.resumed, record(ready, resume, plan)
    if point is None or written is None:
        return None
    path, option_text = row_file.path_of(plan.path), f"{plan.option} {plan.file}"
    if not path.is_file():
        return None
    instead = f"give another file for the {plan.noun} after it alone"
    if written.step != plan.step:
        raise BadRequest(
            f"{option_text}: the run before wrote rows {written.step:.9g} apart into it, and this one {plan.step:.9g};"
            f" {instead}"
        )
    if written.has_event_rows != plan.has_event_rows:
        with_them, without = ("the run before", "this one")[:: 1 if written.has_event_rows else -1]
        raise BadRequest(
            f"{option_text}: {with_them} writes rows of --event-rows into it, and {without} none; {instead}"
        )
    state, end = point.run_state, ready.grid.end
    t_end, reached = point.t_end, state.origin + state.t
    if t_end > end and not ready.grid.is_rounding(t_end - end, end):
        raise BadRequest(
            f"{option_text}: the run before wrote {plan.noun} up to t = {t_end:.9g} into it, and this one ends at"
            f" {end:.9g}: give its duration, or a longer one, or {instead.removeprefix('give ')}"
        )
    if ready.skipped_rows:
        raise BadRequest(
            f"{option_text}: the run before went on to t = {reached:.9g} without a row at {end:.9g}, where this one"
            f" ends: give a longer duration, or {instead.removeprefix('give ')}"
        )
    rows = row_file.SafeRows(written.count, written.checksum)
    try:
        with contextlib.closing(row_file.read(path, plan.names, rows)) as blocks:
            for _ in blocks:
                pass
    except row_file.UnfitRows as error:
        raise BadRequest(f"{option_text}: {error}; {instead}") from None
    except OSError as error:
        raise BadRequest(f"{option_text}: cannot read {path}: {error.strerror}") from None
    return RowsBefore(path, rows, t_end)


def unfinished(ready: SimulationRun, request: RunRequest, plans: Sequence[TablePlan]) -> str:
    """Return why the files of a run with nothing left to do are not known to be complete; empty where they are.

    A figure and an account are made as rows are computed.
    """
    resume = request.resume or ""
    if request.is_stdout_taken:
        return "rows that went to standard output are not there"
    if request.plot is not None:
        return f"--plot {request.plot}: `lagcli plot` draws a table"
    if request.as_json:
        return "--json: the account was printed by the run before"
    if request.checkpoint is not None and os.path.realpath(request.checkpoint) != os.path.realpath(resume):
        return f"--checkpoint {request.checkpoint}: {resume} is the checkpoint of the end"
    for plan in plans:
        if difference := _difference(ready, resume, plan):
            return f"{plan.option} {plan.file}: {difference}"
    if request.stats is not None:
        # The step beyond the last row is in no checkpoint, so that the steps are not compared.
        expected = ready.stats.as_json()
        try:
            found = json.loads(pathlib.Path(request.stats).read_bytes())
        except (ValueError, RecursionError, OSError):
            found = None
        keys = ("provenance", "stopped", "rows", "t_end", "impacts")
        if not isinstance(found, dict) or any(
            found.get(key) != json.loads(json.dumps(expected[key])) for key in keys
        ):
            return f"--stats {request.stats}: it is not the account of this run"
    return ""


def _difference(ready: SimulationRun, resume: str, plan: TablePlan) -> str:
    """Name the difference of a complete table from the one this run writes, whose rows the checkpoint counts."""
    point, written = ready.resumed, record(ready, resume, plan)
    if point is None or written is None:
        return "the run before did not write it"
    end, t_end = ready.grid.end, point.t_end
    if t_end != end and not ready.grid.is_rounding(t_end - end, end):
        return f"the run before ended at t = {t_end:.9g}"
    if (written.step, written.has_event_rows) != (plan.step, plan.has_event_rows):
        return "the run before wrote other rows into it"
    try:
        found = table_format.opened(plan.path)
        if found.columns != plan.names:
            return "it has other columns"
        # All else that rows depend on is in the checkpoint, with which the run agrees.
        if found.provenance is not None and found.provenance.get("sha256") != ready.model.sha256:
            return "its provenance is that of a different model file"
        texts = [found.words(name) for name in plan.words]
        rows = found.take([name for name in plan.names if name not in plan.words])
    except (*table_format.UNREADABLE, OSError) as error:
        return str(error)
    is_known = all(set(cells) <= set(words) for cells, words in zip(texts, plan.words.values(), strict=True))
    safe = row_file.SafeRows(written.count, written.checksum)
    if is_known and row_file.of_rows(plan.names, plan.numbers(rows, texts)) == safe:
        return ""
    return "its rows are not those of the run before"


def elsewhere(point: Checkpoint, resume: str, noun: str) -> str:
    """The location of the rows or the events before a resumed run if their table was never completed, as a sentence, or
    nothing."""
    option, record = ("-o", point.table) if noun == "rows" else ("--events", point.events)
    if record is None:
        return ""
    table = run_tables.table_of(pathlib.Path(resume), record.file)
    path = row_file.path_of(table)
    if not path.is_file():
        return ""
    return (
        f"the {record.count} {noun} up to t = {point.t_end:.9g} of the run before are in {path};"
        f" `{option} {table}` writes one table of all"
    )
