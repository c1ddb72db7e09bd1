"""`lagcli.simulate`: the whole run of a model as a table in memory."""

from __future__ import annotations

import os
import time
from typing import Unpack

from lagcli import progress
from lagcli.api.models.load import Path, as_model
from lagcli.api.runs import prepare_run, run_settings
from lagcli.model.model import Model
from lagcli.model.settings import RunSettings
from lagcli.running import run_in_memory
from lagcli.running.trajectory import SimulationStopped, Trajectory


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
        # Other runs read no tables.
        from lagcli.api.runs import start_row

        if resume is not None:
            raise ValueError("begin with resume: a run goes on from its checkpoint, and not from a row")
        model = start_row.at(model, os.fspath(begin))
    began = time.perf_counter()
    run = prepare_run.prepare(model, run_settings.chosen(model, settings), resume, limit, digits)
    if event_rows:
        run.add_event_rows()
    return run_in_memory.in_memory(run, columns, checkpoint, began)


def as_far(model: Model, **settings: object) -> tuple[Trajectory, str]:
    """The table of a run as far as it goes, and why it stopped before its end, or nothing.

    settings: keywords of `simulate`, which raises all but `SimulationStopped`.
    """
    try:
        return simulate(model, **settings), ""  # type: ignore[arg-type]
    except SimulationStopped as stopped:
        return stopped.trajectory, stopped.reason
