"""Measures, and writes docs/explanation/benchmarks.md, its figure, and results.json.

A run of some parts keeps what was measured of the others.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from . import programs

os.environ.update(programs.THREADS)  # before NumPy is loaded

from . import cases, contest, machine, models, page, roofline, steps

ROOT = Path(__file__).parents[2]
RESULTS = Path(__file__).with_name("results.json")
PAGE = ROOT / "docs" / "explanation" / "benchmarks.md"
FIGURE = ROOT / "docs" / "images" / "benchmarks.png"

ONLY = (*cases.CASES, "whole", "roofline", "steps", "build")
ROOFLINE = ("pendulum", "chain-3", "chain-30", "four-bar")
# Size and target of read + count + compile, seconds.
BUILDS = (("chain", 1000, 1.0), ("chain", 10000, 10.0), ("cloth", 30, None), ("cloth", 100, None))


def _arguments(given: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser("python -m tests.benchmarks", description="Measures what lagcli costs.")
    parser.add_argument("--only", default=",".join(ONLY), help=f"parts to run, of {','.join(ONLY)}")
    parser.add_argument(
        "--largest", type=int, default=10000, help="links of the longest chain; side of the cloth"
    )
    parser.add_argument("--programs", default=",".join(programs.ALL), help="of " + ",".join(programs.ALL))
    parser.add_argument("--python", default=sys.executable, help="a Python that has the extra `bench`")
    parser.add_argument(
        "--limit", type=float, default=0.2, help="seconds of a solution, after which no finer is tried"
    )
    parser.add_argument("--rounds", type=int, default=5, help="alternating rounds; the best counts")
    parser.add_argument(
        "--quick", action="store_true", help="small parts, one round, lagcli alone, nothing written"
    )
    parser.add_argument("--no-write", action="store_true", help="print only")
    parser.add_argument("--draw", action="store_true", help="page and figure of results.json again")
    chosen = parser.parse_args(given)
    chosen.only = frozenset() if chosen.draw else frozenset(chosen.only.split(","))
    if chosen.only - set(ONLY):
        parser.error(f"there is no part {', '.join(sorted(chosen.only - set(ONLY)))}")
    keys = chosen.programs.split(",")
    if chosen.quick:
        chosen.largest, chosen.rounds, chosen.no_write, chosen.limit = 3, 1, True, 0.01
        keys, chosen.only = ["plain", "native"], frozenset({"pendulum", "roofline", "steps"})
    chosen.programs = {key: programs.ALL[key] for key in programs.ALL if key in keys}
    return chosen


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _steps(chosen: argparse.Namespace) -> list[dict[str, Any]]:
    found = []
    for links in (size for size in steps.LINKS if size <= chosen.largest):
        for rod in models.RODS:
            _say(f"steps: {links} links, {rod}")
            found.append(steps.compare(links, rod, chosen.rounds))
    return found


def _build(chosen: argparse.Namespace) -> list[dict[str, Any]]:
    found = []
    for kind, size, target in BUILDS:
        if size > chosen.largest:
            continue
        _say(f"build: {kind} {size}")
        command = [sys.executable, "-m", "tests.benchmarks.building", kind, str(size)]
        line: dict[str, Any] = {"kind": kind, "size": size, "target": target}
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        found.append(line | json.loads(done.stdout))
    return found


def _roofline(chosen: argparse.Namespace, known: dict[str, Any]) -> dict[str, Any]:
    """Steps alone, with the tolerance that reaches the error `page.STEPS_WANTED` in the measured motions."""
    lines = []
    for name in (name for name in ROOFLINE if name in known):
        _say(f"roofline: {name}")
        attempt = contest.reached(known[name]["answers"]["plain"]["attempts"], page.STEPS_WANTED)
        if attempt is not None:
            lines.append(roofline.measured(cases.CASES[name](), float(attempt["setting"]), chosen.rounds))
    return {"scalar": roofline.scalar_peak(), "matrix": roofline.matrix_peak(), "cases": lines}


def _measure(chosen: argparse.Namespace, results: dict[str, Any]) -> Iterator[None]:
    """Fill `results` with the chosen parts; yields where there is something new to keep."""
    installed = programs.versions(chosen.python)
    asked = {
        key: each
        for key, each in chosen.programs.items()
        if each.package in programs.HERE or each.package in installed
    }
    missing = sorted({each.package for key, each in chosen.programs.items() if key not in asked})
    if missing and chosen.only:
        _say(f"left out, since not installed: {', '.join(missing)}")
    made = machine.description(installed) | {"missing": missing}
    made["command"] = " ".join(["python -m tests.benchmarks", *_shown(sys.argv[1:])])
    machines = results.setdefault("machines", {})
    for name in (name for name in cases.CASES if name in chosen.only):
        _say(f"contest: {name}")
        known = results.setdefault("contest", {})
        known[name] = contest.measured(cases.CASES[name](), asked, chosen.python, chosen.limit, chosen.rounds)
        results["contest"] = {key: known[key] for key in cases.CASES if key in known}
        machines["contest"] = made
        yield
    if "whole" in chosen.only:
        _say("whole processes")
        results["whole"] = contest.whole(asked, chosen.python, results.get("contest", {}))
        machines["whole"] = made
        yield
    if "roofline" in chosen.only:
        results["roofline"] = _roofline(chosen, results.get("contest", {}))
        machines["roofline"] = made
        yield
    for part, measure in (("steps", _steps), ("build", _build)):
        if part in chosen.only:
            results[part], machines[part] = measure(chosen), made
            yield


def _shown(given: Sequence[str]) -> list[str]:
    """The command line without the path of a Python, which is no one else's business."""
    return [
        word for word, before in zip(given, ["", *given], strict=False) if "--python" not in (word, before)
    ]


def main() -> None:
    """Measure, print, write."""
    chosen = _arguments(sys.argv[1:])
    is_kept = not chosen.no_write and RESULTS.exists()
    results: dict[str, Any] = json.loads(RESULTS.read_text(encoding="utf-8")) if is_kept else {}
    for _ in _measure(chosen, results):
        if not chosen.no_write:
            RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    print("\n\n".join(page.sections(results)))
    if not chosen.no_write:
        page.write(PAGE, results)
        from . import figure  # matplotlib is loaded where there is something to draw

        figure.write(FIGURE, results)


if __name__ == "__main__":
    main()
