"""`lagcli.simulate`: the whole run of a model as a table in memory."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Unpack

from lagcli import progress
from lagcli.api import prepare_run, run_settings
from lagcli.api.load import Path, as_model
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.output.files.write_guard import BadRequest
from lagcli.running import trajectory
from lagcli.running.trajectory import SimulationStopped, Trajectory
from lagcli.simulation.run_state import checkpoint

if TYPE_CHECKING:
    from lagcli.running.run_request import RunRequest
    from lagcli.running.written_run import WrittenRun


@progress.phase("simulating")
@run_settings.keywords()
def simulate(
    model: Model | Path,
    *,
    columns: str = "*",
    digits: bool = False,
    limit: float | None = None,
    checkpoint: Path | None = None,
    resume: Path | None = None,
    event_rows: bool = False,
    begin: Path | None = None,
    **settings: Unpack[RunSettings],
) -> Trajectory:
    """Integrate m a = F + sum lambda_i B_i (D.24) and return the table.

    What is None is as the model says. `samples` (both ends counted) or `output_step` say where the rows are; `max_step`
    is what no step is longer than; `assemble` moves the start to the nearest consistent state, without the coordinates
    in `keep`; `columns` takes patterns ("t,lambda.*"); `digits` adds columns `err.*` and `run.digits`, from a second
    run; `limit` is the seconds to find the first integrals that are enforced; `checkpoint` and `resume` are files to
    keep the state of the run in and to go on from: rows then begin after the last one of the run before, and
    `run.events` with the incidents after it; `event_rows` adds two rows at each instant of impacts, contacts, releases
    and events, before and after it; `begin` is a table, `FILE` or `FILE:ROW`, whose row, the last by default, is the
    start.
    Raises `ModelError` where the start is inconsistent, `ValueError` for bad options and for a checkpoint that belongs
    to a different run, `OSError`, `SimulationStopped` where the integration cannot go on.
    """
    model = as_model(model)
    if begin is not None:
        if resume is not None:
            raise ValueError("begin with resume: a run goes on from its checkpoint, and not from a row")
        model = run_settings.at_row(model, os.fspath(begin))
    began = time.perf_counter()
    run = prepare_run.prepare(model, run_settings.chosen(model, settings), resume, limit, digits)
    if event_rows:
        run.add_event_rows()
    return trajectory.in_memory(run, columns, checkpoint, began)


def as_far(model: Model, **settings: object) -> tuple[Trajectory, str]:
    """The table of a run as far as it goes, and why it stopped before its end, or nothing.

    settings: keywords of `simulate`, which raises all but `SimulationStopped`.
    """
    try:
        return simulate(model, **settings), ""  # type: ignore[arg-type]
    except SimulationStopped as stopped:
        return stopped.trajectory, stopped.reason


def to_files(
    model: Model, settings: Mapping[str, object], request: RunRequest, row: str | None = None
) -> WrittenRun:
    """Return a run that is ready to be written: from its start, from a checkpoint, or from a row of a table.

    settings: what is None is as the model says; row: `FILE` or `FILE:ROW`. Raises `BadRequest`, worded for the options
    of the command, `WriteError` for a file that another run or sweep is writing, and `diagnostics.ModelError`.
    """
    from lagcli.running.written_run import WrittenRun  # other runs go into no files

    if row is not None and request.resume is not None:
        raise BadRequest("--from with --resume: a run goes on from its checkpoint, and not from a row")
    model = run_settings.of_options(model, settings, row)
    with run_settings.reading("--resume", request.resume, checkpoint.CheckpointError):
        run = prepare_run.prepare(
            model, model.simulation, request.resume, request.limit, request.digits, may_be_over=True
        )
    return WrittenRun(run, request)
