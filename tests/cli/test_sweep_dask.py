"""A sweep on a Dask cluster of two workers, which are killed: no point is lost, and the rows are equal."""

import os
import pathlib
import signal
import threading
import time
from collections.abc import Callable, Iterator

import pytest

import lagcli
from lagcli.api import point_task, reductions, sweep_engines, sweep_points
from lagcli.output.sweeps import sweep_journal, sweep_table
from tests.helpers import in_process

dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")
PENDULUM = str(pathlib.Path(__file__).parents[2] / "models" / "pendulum.yaml")
COMMON = ("sweep", PENDULUM, "--over", "L=0.5:2:60", "--reduce", "peak=max(lambda.rod)", "--duration", "0.5")


@pytest.fixture(scope="module")
def cluster() -> Iterator[object]:
    """Two workers, which take seconds to begin, and to begin again: one cluster serves all tests, and a second death
    over a task is its last."""
    options = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
    deaths = {"distributed.scheduler.allowed-failures": 1}
    with dask.config.set(deaths), distributed.LocalCluster(n_workers=2, **options) as found:
        yield found


class Deadly(float):
    """A number that ends the process that reads it, unless that is the one which wrote it, where the scheduler is."""

    def __reduce__(self) -> tuple[Callable[[int, float], float], tuple[int, float]]:
        return read_in, (os.getpid(), float(self))


def read_in(home: int, value: float) -> Deadly:
    if os.getpid() != home:
        os._exit(1)
    return Deadly(value)


@pytest.mark.skipif(os.name != "posix", reason="there is no such signal")
def test_a_worker_that_is_killed_takes_no_point_along(tmp_path: pathlib.Path, cluster) -> None:
    here, there = tmp_path / "here.csv", tmp_path / "there.csv"
    assert in_process.run(*COMMON, "-o", here)[2] == 0
    journal = sweep_journal.path_of(there)

    def kill() -> None:
        while not (journal.exists() and journal.read_bytes().count(b"\n") > 1):
            time.sleep(0.005)
        os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    _, told, code = in_process.run(*COMMON, "-o", there, "--scheduler", cluster.scheduler_address)
    killer.join()
    assert code == 0
    assert "60 points: 60 done" in told
    assert there.read_bytes() == here.read_bytes()


def test_a_point_that_kills_its_workers_is_a_row_and_the_others_are_unharmed(
    cluster,
) -> None:
    model = lagcli.load(PENDULUM)
    points = sweep_points.over(model, "L=0.5:2:6")
    chosen = point_task.SweepSettings({"duration": 0.3, "samples": 4}, 10.0)
    asked = point_task.plan(model, [points], reductions.read(["peak=max(lambda.rod)"]), chosen)

    class PointsWith:
        names, count, digest = points.names, points.count, points.digest

        def point(self, number: int) -> tuple[float, ...]:
            found = points.point(number)
            return tuple(map(Deadly, found)) if number == 3 else found

    with sweep_engines.cluster(cluster.scheduler_address) as engine:
        found = [
            row
            for rows in sweep_engines.rows(engine, asked.task, PointsWith(), asked.rows.numbers)
            for row in rows
        ]
    alone = sweep_engines.rows(sweep_engines.Engine(), asked.task, asked.points, asked.rows.numbers)
    expected = [row for rows in alone for row in rows]
    assert [row.number for row in found] == list(range(6))
    assert found[:3] + found[4:] == expected[:3] + expected[4:]
    assert (found[3].status, found[3].message) == (sweep_table.STOPPED, sweep_engines.ENDED)
    # Once alone, and before among others: those that stood behind it on the same worker may be told of too.
    assert engine.lost >= 2


def test_an_address_where_nobody_answers_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_engines, "PATIENCE", 0.2)
    _, told, code = in_process.run(*COMMON, "--scheduler", "tcp://127.0.0.1:1")
    assert code == 2
    assert "--scheduler: no Dask scheduler answers at tcp://127.0.0.1:1" in told
