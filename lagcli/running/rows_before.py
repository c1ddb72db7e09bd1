"""The rows of the run before, with which the table of a run that is resumed begins, and what is refused about them."""

from __future__ import annotations

import contextlib
import json
import math
import os
import pathlib
from collections.abc import Sequence
from typing import Literal

from lagcli.output.files.write_guard import BadRequest
from lagcli.output.tables import row_file, table_format
from lagcli.running import checkpoint_file
from lagcli.running.run_request import RunRequest
from lagcli.running.safe_table import RowsBefore, TablePlan
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state.checkpoint import CheckpointTable


def _record(ready: SimulationRun, plan: TablePlan) -> CheckpointTable | None:
    """The words of a checkpoint about the table of the run before."""
    point = ready.resumed
    if point is None:
        return None
    return point.events if plan.option == "--events" else point.table


def _safe(record: CheckpointTable) -> row_file.SafeRows:
    return row_file.SafeRows(record.count, record.checksum)


def before(ready: SimulationRun, resume: str | None, plan: TablePlan) -> RowsBefore | None:
    """The rows before a resumed run, where it writes the same table and that table was never completed.

    Raises `BadRequest` where they do not fit together, for they would be lost.
    """
    point, record = ready.resumed, _record(ready, plan)
    if point is None or record is None or plan.file is None or resume is None:
        return None
    table, option_text = plan.path, f"{plan.option} {plan.file}"
    path = row_file.path_of(table)
    if checkpoint_file.table_of(pathlib.Path(resume), record.file) != table or not path.is_file():
        return None
    instead = f"give another file for the {plan.noun} after it alone"
    if record.step != plan.step:
        raise BadRequest(
            f"{option_text}: the run before wrote rows {record.step:.9g} apart into it, and this one {plan.step:.9g};"
            f" {instead}"
        )
    if record.has_event_rows != plan.has_event_rows:
        with_them, without = ("the run before", "this one")[:: 1 if record.has_event_rows else -1]
        raise BadRequest(
            f"{option_text}: {with_them} writes rows of --event-rows into it, and {without} none; {instead}"
        )
    state, end = point.run_state, ready.grid.end
    t_end, reached = state.origin + state.row, state.origin + state.t
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
    rows = _safe(record)
    try:
        with contextlib.closing(row_file.read(path, plan.names, rows)) as blocks:
            for _ in blocks:
                pass
    except row_file.UnfitRows as error:
        raise BadRequest(f"{option_text}: {error}; {instead}") from None
    except OSError as error:
        raise BadRequest(f"{option_text}: cannot read {path}: {error.strerror}") from None
    return RowsBefore(path, rows, t_end, plan.noun)


def require_saved_rows(ready: SimulationRun, resume: str | None, plan: TablePlan) -> None:
    """Refuse to replace the table of the run before by the rows after it alone. Raises `BadRequest`."""
    point, record = ready.resumed, _record(ready, plan)
    if point is None or record is None or plan.file is None or resume is None:
        return
    if plan.path.is_file() and checkpoint_file.table_of(pathlib.Path(resume), record.file) == plan.path:
        t = point.run_state.origin + point.run_state.row
        raise BadRequest(
            f"{plan.option} {plan.file}: that is the table of the run before, and a resumed run has only the"
            f" {plan.noun} after t = {t:.9g}: give another file, or move that one away"
        )


def unfinished(ready: SimulationRun, request: RunRequest, plans: Sequence[TablePlan]) -> str:
    """Return why the files of a run with nothing left to do are not known to be complete; empty where they are.

    A figure and an account are made as rows are computed.
    """
    resume = pathlib.Path(request.resume or "")
    if request.is_stdout_taken:
        return "rows that went to standard output are not there"
    if request.plot is not None:
        return f"--plot {request.plot}: `lagcli plot` draws a table"
    if request.as_json:
        return "--json: the account was printed by the run before"
    if request.checkpoint is not None and os.path.realpath(request.checkpoint) != os.path.realpath(resume):
        return f"--checkpoint {request.checkpoint}: {request.resume} is the checkpoint of the end"
    for plan in plans:
        if difference := _difference(ready, resume, plan):
            return f"{plan.option} {plan.file}: {difference}"
    if request.stats is not None and not _is_account(ready, pathlib.Path(request.stats)):
        return f"--stats {request.stats}: it is not the account of this run"
    return ""


def _is_account(ready: SimulationRun, path: pathlib.Path) -> bool:
    """True if a file is the account of a run to the same end. The step beyond the last row is in no checkpoint, so
    that the steps are not compared."""
    expected = ready.stats.as_json()
    try:
        found = json.loads(path.read_bytes())
    except (ValueError, RecursionError, OSError):
        return False
    return isinstance(found, dict) and all(
        found.get(key) == json.loads(json.dumps(expected[key]))
        for key in ("provenance", "stopped", "rows", "t_end", "impacts")
    )


def _difference(ready: SimulationRun, resume: pathlib.Path, plan: TablePlan) -> str:
    """Name the difference of a complete table from the one this run writes, whose rows the checkpoint counts."""
    point, record, table = ready.resumed, _record(ready, plan), plan.path
    if point is None or record is None or checkpoint_file.table_of(resume, record.file) != table:
        return "the run before did not write it"
    end, t_end = ready.grid.end, point.run_state.origin + point.run_state.row
    if t_end != end and not ready.grid.is_rounding(t_end - end, end):
        return f"the run before ended at t = {t_end:.9g}"
    if (record.step, record.has_event_rows) != (plan.step, plan.has_event_rows):
        return "the run before wrote other rows into it"
    try:
        found = table_format.opened(table)
        if found.columns != plan.names:
            return "it has other columns"
        # All else that rows depend on is in the checkpoint, with which the run agrees.
        if found.provenance is not None and found.provenance.get("sha256") != ready.model.sha256:
            return "its provenance is that of a different model file"
        texts = [found.words(name) for name in plan.texts]
        rows = found.take([name for name in plan.names if name not in plan.words])
    except (*table_format.UNREADABLE, OSError) as error:
        return str(error)
    is_known = all(set(cells) <= set(words) for cells, words in zip(texts, plan.words.values(), strict=True))
    if is_known and row_file.of_rows(plan.names, plan.numbers(rows, texts)) == _safe(record):
        return ""
    return "its rows are not those of the run before"


def elsewhere(ready: SimulationRun, resume: str | None, field: Literal["table", "events"]) -> str:
    """The location of the rows before a resumed run if their table was never completed, as a sentence, or nothing."""
    point = ready.resumed
    record = None if point is None else getattr(point, field)
    if point is None or record is None or resume is None:
        return ""
    table = checkpoint_file.table_of(pathlib.Path(resume), record.file)
    path = row_file.path_of(table)
    if not path.is_file():
        return ""
    t = point.run_state.origin + point.run_state.row
    option, noun = ("-o", "rows") if field == "table" else ("--events", "events")
    return (
        f"the {record.count} {noun} up to t = {t:.9g} of the run before are in {path}; `{option} {table}` writes one"
        " table of all"
    )


def late_marks(run: SimulationRun, path: str) -> str:
    """A sentence where the figure of a resumed run marks no incidents of the run before, which are in no file."""
    point = run.resumed
    if point is None or not point.run_state.reported.incidents:
        return ""
    t = max(point.run_state.origin + point.run_state.row, point.run_state.reported.last or -math.inf)
    return f"marks of incidents in {path} begin after t = {t:.9g}: those before are in no file that goes on"
