"""A whole run in memory."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import os
import pathlib
import time

import numpy as np
import numpy.typing as npt

from lagcli.output.figures.decimate import DecimatedRows
from lagcli.output.files import file_lock
from lagcli.output.tables import incident_table
from lagcli.running.checkpoint_file import CheckpointWriter
from lagcli.running.simulation_run import SimulationRun
from lagcli.running.trajectory import SimulationStopped, Trajectory
from lagcli.simulation.run_state import run_stop

Floats = npt.NDArray[np.float64]


def in_memory(
    run: SimulationRun, columns: str, checkpoint: str | os.PathLike[str] | None, began: float
) -> Trajectory:
    """The table of a run, made since the time `began` of `time.perf_counter`.

    columns: patterns; checkpoint: a file to keep the state of the run in. Raises `SimulationStopped` with the table so
    far where the integration cannot go on, `column_choice.UnknownColumn`, OSError, where another run keeps its state in
    that file too.
    """
    with contextlib.ExitStack() as stack:
        if checkpoint is not None:
            stack.enter_context(file_lock.FileLock(pathlib.Path(checkpoint)))
        return _in_memory(run, columns, checkpoint, began)


def _in_memory(
    run: SimulationRun, columns: str, checkpoint: str | os.PathLike[str] | None, began: float
) -> Trajectory:
    table = _TableInMemory(run, columns)
    keeper = CheckpointWriter(checkpoint) if checkpoint is not None else None
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


class _TableInMemory:
    """The rows and the incidents of a run, in the order in which they come."""

    def __init__(self, run: SimulationRun, columns: str) -> None:
        # The command chooses its columns by itself.
        from lagcli.output.tables import column_choice

        self._run = run
        self._picked = column_choice.select(run.columns, columns, run.by_name)
        self._blocks = [np.zeros((0, len(self._picked)))]
        self._incidents = [run.incident_columns.table([])]
        # What is zero to rounding is known from all columns.
        self._has_all_columns = self._picked[: len(run.columns)] == list(range(len(run.columns)))
        self._decimated = DecimatedRows()

    def add(self, block: Floats) -> None:
        """A block of rows, and the incidents that came with it."""
        run = self._run
        self._blocks.append(run.taken(block, self._picked))
        if not self._has_all_columns:
            self._decimated.add(block)
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
            rows[:, : len(run.columns)] if self._has_all_columns else self._decimated.rows(),
        )

        def zeros() -> frozenset[str]:
            floors.take(looked_at)
            return frozenset(itertools.compress(run.columns, floors.zeros()))

        return Trajectory(names, rows, stats, run.notes, incident_table.joined(self._incidents), zeros)
