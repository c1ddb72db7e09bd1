"""A sweep on a Dask cluster of two workers, one of which is killed: no point is lost, and the rows are equal."""

import os
import pathlib
import signal
import threading
import time

import pytest

from lagcli.api.sweeps import dask_engine, sweep_journal
from tests.helpers import in_process

distributed = pytest.importorskip("distributed")
PENDULUM = str(pathlib.Path(__file__).parents[2] / "models" / "pendulum.yaml")
COMMON = ("sweep", PENDULUM, "--over", "L=0.5:2:60", "--reduce", "peak=max(lambda.rod)", "--duration", "0.5")


@pytest.mark.skipif(os.name != "posix", reason="there is no such signal")
def test_a_worker_that_is_killed_takes_no_point_along(tmp_path: pathlib.Path) -> None:
    here, there = tmp_path / "here.csv", tmp_path / "there.csv"
    assert in_process.run(*COMMON, "-o", here)[2] == 0
    options = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(n_workers=2, **options) as cluster:
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


def test_an_address_where_nobody_answers_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_engine, "PATIENCE", 0.2)
    _, told, code = in_process.run(*COMMON, "--scheduler", "tcp://127.0.0.1:1")
    assert code == 2
    assert "--scheduler: no Dask scheduler answers at tcp://127.0.0.1:1" in told
