"""A sweep on a Dask cluster of two workers, one of which is killed: no point is lost, and the rows are equal."""

import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest

from lagcli.api.sweeps import sweep_journal

distributed = pytest.importorskip("distributed")
PENDULUM = str(pathlib.Path(__file__).parents[2] / "models" / "pendulum.yaml")


def command(*options: str) -> list[str]:
    common = ("--over", "L=0.5:2:240", "--reduce", "peak=max(lambda.rod)", "--duration", "1", "-q")
    return [sys.executable, "-m", "lagcli", "sweep", PENDULUM, *common, *options]


@pytest.mark.skipif(os.name != "posix", reason="there is no such signal")
def test_a_worker_that_is_killed_takes_no_point_along(tmp_path: pathlib.Path) -> None:
    here, there = tmp_path / "here.csv", tmp_path / "there.csv"
    subprocess.run(command("-o", str(here)), check=True)
    options = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(n_workers=2, **options) as cluster:
        process = subprocess.Popen(command("-o", str(there), "--scheduler", cluster.scheduler_address))
        journal = sweep_journal.path_of(there)
        while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") > 1):
            time.sleep(0.05)
        os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
        assert process.wait(timeout=300) == 0
    assert there.read_bytes() == here.read_bytes()


def test_an_address_where_nobody_answers_is_told(tmp_path: pathlib.Path) -> None:
    done = subprocess.run(command("--scheduler", "nowhere"), capture_output=True, text=True)
    assert done.returncode == 2
    assert "--scheduler: no Dask scheduler answers at nowhere" in done.stderr
