"""The command that measures runs, and prints tables of the documented shape."""

import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).parents[2]


def test_quick_run_prints_a_line_for_each_way_to_write_a_rod_and_a_reached_error() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks", "--quick"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    steps, contest = re.split(r"^### .*$", done.stdout, flags=re.MULTILINE)[1:]
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in steps.splitlines() if line[:1] == "|"
    ]
    assert {len(row) for row in rows} == {10}
    assert [row[:2] for row in rows[2:]] == [["3", "`dot`"], ["3", "`distance`"]]
    ratios = [float(row[4].split()[0]) for row in rows[2:]]
    assert all(0.1 < ratio < 20 for ratio in ratios)
    (answer,) = [line for line in contest.splitlines() if line.startswith("| chain, 3 links")]
    assert "| lagcli |" in answer
    assert float(answer.split("|")[5]) <= 1e-9
    for name in ("knife edge", "two wheel axle", "crossed integrators"):
        (answer,) = [line for line in contest.splitlines() if line.startswith(f"| {name}")]
        assert float(answer.split("|")[5]) <= 1e-9
