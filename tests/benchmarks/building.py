"""What it takes to read, count and compile a large model: `python -m tests.benchmarks.building chain 1000`.

One model a process, since what is compiled is kept. Prints one JSON object.
"""

from __future__ import annotations

import itertools
import json
import pathlib
import sys
import time
from typing import Any

import lagcli
from lagcli.api import prepare_run, run_settings

from . import models

# Seconds of motion: a few steps, enough to know what a step costs.
DURATIONS = {"chain": 0.01, "cloth": 0.05}
TOLERANCE = 1e-7


def measure(kind: str, size: int) -> dict[str, Any]:
    """Seconds of the processor: of each stage, of a step, of all since the start of Python; and the peak of the memory
    in GB (None where the system does not say)."""
    text = models.chain(size, "distance") if kind == "chain" else models.cloth(size)
    clock = [time.process_time()]
    model = lagcli.loads(text)
    clock.append(time.process_time())
    counted = lagcli.dof(model)
    clock.append(time.process_time())
    wanted = {"duration": DURATIONS[kind], "samples": 2, "rtol": TOLERANCE, "atol": TOLERANCE}
    running = prepare_run.start(model, run_settings.chosen(model, wanted))
    clock.append(time.process_time())
    for _ in running.blocks():
        pass
    stats = running.stats
    clock.append(time.process_time())
    read, count, build, solve = (b - a for a, b in itertools.pairwise(clock))
    return {
        "kind": kind,
        "size": size,
        "freedoms": counted.configuration_dof,
        "read_seconds": read,
        "count_seconds": count,
        "compile_seconds": build,
        "total_seconds": read + count + build,
        "step_seconds": solve / (stats.steps + stats.rejected),
        "process_seconds": clock[-1],
        "peak_gigabytes": peak(),
    }


def peak() -> float | None:
    """The largest resident memory of this process so far, in GB."""
    status = pathlib.Path("/proc/self/status")
    if status.exists():  # what `getrusage` says there includes the process that started this one
        (line,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(line.split()[1]) * 1024 / 1e9
    try:
        import resource
    except ImportError:  # there is no such module on Windows
        return None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / (1e9 if sys.platform == "darwin" else 1e6)


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], int(sys.argv[2]))))
