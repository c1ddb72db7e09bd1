"""Processes of a sweep that the system ends: no point is lost, and the account says what happened."""

import itertools
import multiprocessing
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import pytest

import lagcli
from lagcli.api import point_task, reductions, sweep_engines, sweep_points
from lagcli.output.sweeps import sweep_journal, sweep_table
from tests.helpers import in_process

PENDULUM = str(pathlib.Path(__file__).parents[2] / "models" / "pendulum.yaml")
COMMON = ("sweep", PENDULUM, "--over", "L=0.5:2:40", "--reduce", "peak=max(lambda.rod)", "--duration", "0.5")

pytestmark = pytest.mark.skipif(os.name != "posix", reason="there is no such signal")


class Deadly(float):
    """A number that ends the process that reads it."""

    def __reduce__(self) -> tuple[Callable[[int], object], tuple[int]]:
        return os._exit, (1,)


class PointsWith:
    """The points of a source, with numbers at some places that end a process."""

    def __init__(self, source: sweep_points.SweepPoints, deadly: tuple[int, ...]) -> None:
        self.names, self.count, self.digest = source.names, source.count, source.digest
        self._source, self._deadly = source, deadly

    def point(self, number: int) -> tuple[float, ...]:
        found = self._source.point(number)
        return tuple(map(Deadly, found)) if number in self._deadly else found


def plan(points: int) -> point_task.SweepPlan:
    model = lagcli.load(PENDULUM)
    over = [sweep_points.over(model, f"L=0.5:2:{points}")]
    kept = reductions.read(["peak=max(lambda.rod)"])
    return point_task.plan(model, over, kept, point_task.SweepSettings({"duration": 0.3, "samples": 4}, 10.0))


def test_a_worker_that_is_killed_takes_no_point_along(tmp_path: pathlib.Path) -> None:
    here, there = tmp_path / "here.csv", tmp_path / "there.csv"
    assert in_process.run(*COMMON, "-o", here)[2] == 0
    journal = sweep_journal.path_of(there)

    def kill() -> None:
        while not (journal.exists() and journal.read_bytes().count(b"\n") > 1):
            time.sleep(0.005)
        os.kill(multiprocessing.active_children()[0].pid or 0, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    _, told, code = in_process.run(*COMMON, "-o", there, "--jobs", "2")
    killer.join()
    assert code == 0
    assert there.read_bytes() == here.read_bytes()
    assert "workers were ended by the system once; what they were computing has been computed again" in told


def test_a_point_that_ends_its_process_is_a_row_and_the_rest_unharmed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = plan(12)
    monkeypatch.setattr(sweep_engines, "MOST_POOLS", 1)
    points = PointsWith(asked.points, (7,))
    with sweep_engines.local(2) as engine:
        found = [
            row for rows in sweep_engines.rows(engine, asked.task, points, asked.rows.numbers) for row in rows
        ]
    alone = [
        row
        for rows in sweep_engines.rows(sweep_engines.Engine(), asked.task, asked.points, asked.rows.numbers)
        for row in rows
    ]
    assert [row.number for row in found] == list(range(12))
    assert found[:7] + found[8:] == alone[:7] + alone[8:]
    assert (found[7].status, found[7].message) == (sweep_table.STOPPED, sweep_engines.ENDED)
    assert engine.lost == 2  # once among others, once alone


def test_workers_that_all_end_are_reported_and_nothing_is_made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = plan(6)
    monkeypatch.setattr(sweep_engines, "MOST_POOLS", 1)
    points = PointsWith(asked.points, tuple(range(6)))
    found: list[sweep_table.PointRow] = []
    with (
        sweep_engines.local(2) as engine,
        pytest.raises(sweep_engines.WorkersLost, match="the points from 0, 1, 2"),
    ):
        found.extend(
            itertools.chain.from_iterable(sweep_engines.rows(engine, asked.task, points, asked.rows.numbers))
        )
    assert found == []


def test_other_processes_of_the_caller_are_left_alone() -> None:
    asked = plan(2)
    other = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60,))
    other.start()
    try:
        with sweep_engines.local(2) as engine:
            assert (
                sum(map(len, sweep_engines.rows(engine, asked.task, asked.points, asked.rows.numbers))) == 2
            )
        workers = [one for one in multiprocessing.active_children() if one.pid != other.pid]
        # The pool's own thread waits for them too: for an instant neither of the two knows that a worker has ended.
        end = time.monotonic() + 60
        while any(worker.is_alive() for worker in workers) and time.monotonic() < end:
            time.sleep(0.01)
        assert not any(worker.is_alive() for worker in workers)
        assert other.is_alive()
    finally:
        other.kill()
        other.join()


def test_a_terminal_that_hangs_up_leaves_one_line(tmp_path: pathlib.Path) -> None:
    """The process that watches over the semaphores of workers gets the signal too, and outlives it."""
    target = tmp_path / "rows.csv"
    command = [sys.executable, "-m", "lagcli", *COMMON[:3], "L=0.5:2:4000", *COMMON[4:], "--jobs", "2"]
    process = subprocess.Popen(
        [*command, "-o", str(target)], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    journal = sweep_journal.path_of(target)
    while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") > 1):
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGHUP)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 129
    assert told.startswith("lagcli: interrupted; ")
    assert told.count("\n") == 1, told
