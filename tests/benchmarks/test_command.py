"""The command that measures runs without other programs, and prints tables of the documented shape."""

import pathlib
import re
import subprocess
import sys

import numpy as np

from tests.benchmarks import cases, collisions

ROOT = pathlib.Path(__file__).parents[2]


def test_quick_run_prints_both_tiers_with_a_reached_error_and_a_step_of_each() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks", "--quick"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    tables = [
        [[cell.strip() for cell in line.split("|")[1:-1]] for line in part.splitlines() if line[:1] == "|"]
        for part in re.split(r"^### .*$", done.stdout, flags=re.MULTILINE)[1:]
    ]
    assert all(len({len(row) for row in table}) == 1 for table in tables)
    contest, roofline, steps = (table[2:] for table in tables)
    assert [row[1] for row in contest] == ["lagcli, plain", "lagcli, native"]
    # The same bits: the same setting reaches the same error.
    assert len({row[6].split()[0] for row in contest}) == 1
    assert float(contest[0][6].split()[0]) <= 1e-12
    assert [row[1] for row in roofline[:-1]] == ["plain", "native"]
    assert len({row[6] for row in roofline[:-1]}) == 1
    assert [row[:2] for row in steps] == [["3", "`dot`"], ["3", "`distance`"]]
    assert all(0.1 < float(row[4].split()[0]) < 20 for row in steps)


def test_the_reference_of_collisions_keeps_energy_and_comes_back() -> None:
    problem = cases.CASES["spheres"]().problem
    places, velocities = (np.array(problem[name]) for name in ("places", "velocities"))
    sizes, duration = (problem["diameter"], 1.0), problem["duration"]
    end, impacts = collisions.spheres(places, velocities, sizes, duration)
    assert impacts > 20
    # A little later the velocities are known, and back from there the start.
    later, more = collisions.spheres(places, velocities, sizes, duration + 1e-6)
    assert more == impacts
    v = (later - end) / 1e-6
    assert abs((v**2).sum() / (velocities**2).sum() - 1) < 1e-8
    back, again = collisions.spheres(end, -v, sizes, duration)
    assert again == impacts
    assert np.abs(back - places).max() < 1e-6
