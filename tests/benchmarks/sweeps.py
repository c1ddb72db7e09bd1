"""What a point of a sweep costs: `python -m tests.benchmarks.sweeps [PART ...]`.

Parts: `point` (a closed chain of five links: a process a point beside points of one sweep, on one core), `cores` (the
same sweep with one process and with two, in turns), `many` (1e4 points of the chain), `flat` (1e5 points of the
pendulum: memory, and rows as they come).

Times are those of the processor, of the command and the processes it starts, the least of several; wall times, which
depend on who else uses the machine, are given for the two of `cores`, in turns.
"""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import NamedTuple

TURNS = 5
FEW, SOME, MANY, FLAT = 10, 400, 10_000, 100_000  # points

# A hexagon, one side of which is the ground: it is closed for every L.
CHAIN = """lagcli: 1
title: a closed chain of five links
parameters: {L: 1, m: 1, g: 9.81, h: sqrt(3)/2*L}
particles:
  a: {mass: m, position: [-L/2, 0, -h]}
  b: {mass: m, position: [0, 0, -2*h]}
  c: {mass: 2*m, position: [L, 0, -2*h]}
  d: {mass: m, position: [3*L/2, 0, -h]}
forces: {gravity: {to: [a, b, c, d], force: [0, 0, -m*g]}}
holonomic:
  l1: L = distance(a, [0, 0, 0])
  l2: L = distance(a, b)
  l3: L = distance(b, c)
  l4: L = distance(c, d)
  l5: L = distance(d, [L, 0, 0])
  pa: a.y = 0
  pb: b.y = 0
  pc: c.y = 0
  pd: d.y = 0
simulation: {duration: 1}
"""
PENDULUM = str(pathlib.Path(__file__).parents[2] / "models" / "pendulum.yaml")


class Cost(NamedTuple):
    """Seconds of the processor and of the wall, and MB of the largest process at its largest."""

    processor: float
    wall: float
    largest: float


def cost(*arguments: str) -> Cost:
    """The cost of a command of lagcli, in a process of its own, and of the processes it starts.

    Raises `subprocess.CalledProcessError` where it does not exit with 0.
    """
    code = (
        "import resource, subprocess, sys\n"
        "done = subprocess.run([sys.executable, '-m', 'lagcli', *sys.argv[1:]])\n"
        "spent = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(spent.ru_utime + spent.ru_stime, spent.ru_maxrss)\n"
        "sys.exit(done.returncode)"
    )
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, check=True)
    wall = time.perf_counter() - began
    processor, largest = map(float, done.stdout.split()[-2:])
    return Cost(processor, wall, largest / (2**20 if sys.platform == "darwin" else 2**10))


# What is kept of a run of the chain: the last row of all columns, for which no other row is made; and what takes
# them all.
LAST_ROW, PEAK = (), ("--reduce", "peak=max(abs(lambda.l1))")


def sweep(model: str, folder: pathlib.Path, points: int, *more: str) -> Cost:
    """The cost of so many points."""
    grid = ("--over", f"L=1:2:{points}", "-o", str(folder / "rows.csv"), "-q", *more)
    return cost("sweep", model, *grid)


def point(model: str, folder: pathlib.Path) -> None:
    """A process a point beside a point of a sweep."""
    alone = min(
        cost("simulate", model, "--set", f"L={1 + k / 10}", "-o", str(folder / "a.csv"), "-q").processor
        for k in range(TURNS)
    )
    print(f"a process a point                   {1e3 * alone:8.1f} ms")
    for kept, reduce in (("last row kept", LAST_ROW), ("peak of all rows", PEAK)):
        few = min(sweep(model, folder, FEW, *reduce).processor for _ in range(TURNS))
        some = min(sweep(model, folder, SOME, *reduce).processor for _ in range(TURNS))
        each = (some - few) / (SOME - FEW)
        whole = few + (MANY - FEW) * each
        begun = f"begun in {1e3 * (few - FEW * each):.0f} ms"
        print(f"a point of a sweep, {kept:16s}{1e3 * each:8.2f} ms, {begun};", end=" ")
        print(f"{MANY} points {whole:.1f} s, {MANY * alone / whole:.1f} times faster")


def cores(model: str, folder: pathlib.Path) -> None:
    """One process and two in turns."""
    print("  one: processor  wall   two: processor  wall   faster by the wall, by the processor")
    for _ in range(TURNS):
        one, two = (sweep(model, folder, 5 * SOME, *PEAK, "--jobs", jobs) for jobs in ("1", "2"))
        told = f"{one.processor:15.2f} {one.wall:5.2f} {two.processor:16.2f} {two.wall:5.2f}"
        # Two that are never kept waiting take half of what they have spent.
        print(f"{told} {one.wall / two.wall:18.2f} {2 * one.processor / two.processor:18.2f}")


def many(model: str, folder: pathlib.Path) -> None:
    """Many points of the chain."""
    found = sweep(model, folder, MANY, *PEAK)
    print(f"{MANY} points: {found.processor:.1f} s of the processor, {found.largest:.0f} MB")


def flat(model: str, folder: pathlib.Path) -> None:
    """Memory of ever more points of the pendulum."""
    for points in (FLAT // 100, FLAT // 10, FLAT):
        short = ("--duration", "1", "--samples", "11", "--reduce", "end=last(energy)")
        found = sweep(PENDULUM, folder, points, *short)
        print(f"{points:7d} points: {found.processor:7.1f} s of the processor, {found.largest:.0f} MB")


PARTS: dict[str, Callable[[str, pathlib.Path], None]] = {
    "point": point, "cores": cores, "many": many, "flat": flat,
}  # fmt: skip


def main(asked: list[str]) -> None:
    """Measure these parts, or the first two."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        model = folder / "chain.yaml"
        model.write_text(CHAIN, encoding="utf-8")
        for part in asked or ["point", "cores"]:
            print(f"{part}:")
            PARTS[part](str(model), folder)


if __name__ == "__main__":
    main(sys.argv[1:])
