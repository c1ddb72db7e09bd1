"""A whole run in memory."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import os
import pathlib
import time

import numpy as np

from lagcli.output.figures.chart import DecimatedRows
from lagcli.output.files import file_lock
from lagcli.output.tables import incident_table
from lagcli.running.checkpoint_file import CheckpointWriter
from lagcli.running.simulation_run import SimulationRun
from lagcli.running.trajectory import SimulationStopped, Trajectory
from lagcli.simulation.run_state import run_stop


def in_memory(
    run: SimulationRun, columns: str, checkpoint: str | os.PathLike[str] | None, began: float
) -> Trajectory:
    """The table of a run, made since the time `began` of `time.perf_counter`.

    columns: patterns; checkpoint: a file to keep the state of the run in. Raises `SimulationStopped` with the table so
    far where the integration cannot go on, `table_format.UnknownColumn`, OSError, where another run keeps its state in
    that file too.
    """
    # The command chooses its columns by itself.
    from lagcli.output.tables import table_format

    everything = (*run.columns, *run.by_name)
    picked = table_format.select(run.columns, columns, run.by_name)
    # What is zero to rounding is known from all columns.
    has_all_columns = picked[: len(run.columns)] == list(range(len(run.columns)))
    blocks, looked_at = [np.zeros((0, len(picked)))], DecimatedRows()
    incidents = [run.incident_columns.table([])]
    stop: run_stop.Stop | None = None
    with contextlib.ExitStack() as stack:
        keeper: CheckpointWriter | None = None
        if checkpoint is not None:
            stack.enter_context(file_lock.FileLock(pathlib.Path(checkpoint)))
            keeper = CheckpointWriter(checkpoint)
            stack.callback(keeper.write)
        try:
            for block in run.blocks():
                blocks.append(run.taken(block, picked))
                if not has_all_columns:
                    looked_at.add(block)
                if run.incidents:
                    incidents.append(run.incident_columns.table(run.incidents))
                if keeper is not None:
                    keeper.take(run.checkpoint())
        except run_stop.RunStop as stopped:
            stop = stopped.stop
    rows = np.concatenate(blocks)
    blocks.clear()  # freeing memory takes its time too
    # What is left of the wall time went into the rows: taken together, chosen, kept.
    stats = run.stats
    seconds = time.perf_counter() - began - stats.compile_seconds
    stats = dataclasses.replace(stats, solve_seconds=seconds)
    floors = run.floors()

    def zeros() -> frozenset[str]:
        floors.take(rows[:, : len(run.columns)] if has_all_columns else looked_at.rows())
        return frozenset(itertools.compress(run.columns, floors.zeros()))

    names = tuple(everything[i] for i in picked)
    result = Trajectory(names, rows, stats, run.notes, incident_table.joined(incidents), zeros)
    if stop is not None:
        raise SimulationStopped(stop.reason, stop.t, result)
    return result
