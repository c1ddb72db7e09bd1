"""`lagcli.simulate`: the whole run of a model as a table in memory."""

from __future__ import annotations

import dataclasses
import itertools
import os
import time
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.api.models.load import Path, as_model
from lagcli.api.runs import prepare_run, run_settings
from lagcli.api.runs.simulation_run import SimulationRun
from lagcli.model.model import Model
from lagcli.output import checkpoint_file
from lagcli.output.figures import decimate
from lagcli.output.tables import incident_table
from lagcli.output.trajectory import SimulationStopped, Trajectory
from lagcli.simulation.run_state import run_stop

Floats = npt.NDArray[np.float64]


@progress.phase("simulating")
def simulate(
    model: Model | Path,
    *,
    start: float | None = None,
    duration: float | None = None,
    samples: int | None = None,
    output_step: float | None = None,
    method: str | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    max_step: float | None = None,
    assemble: bool | None = None,
    keep: Sequence[str] | None = None,
    columns: str = "*",
    digits: bool = False,
    limit: float | None = None,
    checkpoint: Path | None = None,
    resume: Path | None = None,
    event_rows: bool = False,
    begin: Path | None = None,
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
    changes = {
        "start": start, "duration": duration, "samples": samples, "output_step": output_step, "method": method,
        "rtol": rtol, "atol": atol, "max_step": max_step, "assemble": assemble,
        "keep": None if keep is None else tuple(keep),
    }  # fmt: skip
    run = prepare_run.prepare(model, run_settings.chosen(model, changes), resume, limit, digits)
    if event_rows:
        run.add_event_rows()
    table = _GatheredTable(run, columns)
    keeper = checkpoint_file.Keeper(checkpoint) if checkpoint is not None else None
    stop: run_stop.Stop | None = None
    try:
        for block in run.blocks():
            table.add(block)
            if keeper is not None:
                keeper.take(run.checkpoint())
    except run_stop.RunStop as stopped:
        stop = stopped.stop
    finally:
        if keeper is not None:
            keeper.write()
    result = table.trajectory(began)
    if stop is not None:
        raise SimulationStopped(stop.reason, stop.t, result)
    return result


class _GatheredTable:
    """The rows and the incidents of a run, in the order in which they come."""

    def __init__(self, run: SimulationRun, columns: str) -> None:
        # The command chooses its columns by itself.
        from lagcli.output.tables import column_choice

        self._run = run
        self._picked = column_choice.select(run.columns, columns, run.by_name)
        self._blocks = [np.zeros((0, len(self._picked)))]
        self._incidents = [run.incident_columns.table([])]
        # What is zero to rounding is known from all columns.
        self._is_whole = self._picked[: len(run.columns)] == list(range(len(run.columns)))
        self._thinned = decimate.DecimatedRows()

    def add(self, block: Floats) -> None:
        """A block of rows, and the incidents that came with it."""
        run = self._run
        self._blocks.append(run.taken(block, self._picked))
        if not self._is_whole:
            self._thinned.add(block)
        if run.incidents:
            self._incidents.append(run.incident_columns.table(run.incidents))

    def trajectory(self, began: float) -> Trajectory:
        """The table of all, made since the time `began`."""
        run = self._run
        everything = (*run.columns, *run.by_name)
        rows = np.concatenate(self._blocks)
        self._blocks.clear()  # freeing memory takes its time too
        # What is left of the wall time went into the rows: taken together, chosen, kept.
        stats = run.stats
        seconds = time.perf_counter() - began - stats.compile_seconds
        stats = dataclasses.replace(stats, solve_seconds=seconds)
        names = tuple(everything[i] for i in self._picked)
        floors, looked_at = (
            run.floors(),
            rows[:, : len(run.columns)] if self._is_whole else self._thinned.rows(),
        )

        def zeros() -> frozenset[str]:
            floors.take(looked_at)
            return frozenset(itertools.compress(run.columns, floors.zeros()))

        return Trajectory(names, rows, stats, run.notes, incident_table.joined(self._incidents), zeros)
