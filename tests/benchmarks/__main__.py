"""Measures, and writes docs/explanation/benchmarks.md, its figure, and results.json.

A run of some parts keeps what was measured of the others.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from . import cases, contest, environment, machine, models, page, steps

ROOT = Path(__file__).parents[2]
RESULTS = Path(__file__).with_name("results.json")
PAGE = ROOT / "docs" / "explanation" / "benchmarks.md"
FIGURE = ROOT / "docs" / "images" / "benchmarks.png"

MOTIONS = ("chain", "cloth", "disk", "nonholonomic", "axis")
ONLY = ("steps", "build", *MOTIONS, "whole")
# Size and target of read + count + compile, seconds.
BUILDS = (("chain", 1000, 1.0), ("chain", 10000, 10.0), ("cloth", 30, None), ("cloth", 100, None))


def _arguments(given: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser("python -m tests.benchmarks", description="Measures what lagcli costs.")
    parser.add_argument("--only", default=",".join(ONLY), help=f"parts to run, of {','.join(ONLY)}")
    parser.add_argument(
        "--largest", type=int, default=10000, help="links of the longest chain; side of the cloth"
    )
    parser.add_argument("--error", type=float, default=1e-9, help="the error all programs must reach")
    parser.add_argument("--peers", default=",".join(p.key for p in environment.ALL), help="the others to ask")
    parser.add_argument("--no-peers", action="store_true", help="lagcli and the yardstick alone")
    parser.add_argument(
        "--limit", type=float, default=120.0, help="seconds for a case of a peer, and for a build"
    )
    cache = Path.home() / ".cache" / "lagcli-benchmarks"
    parser.add_argument("--cache", type=Path, default=cache, help="folder of the environment of the peers")
    parser.add_argument("--rounds", type=int, default=9, help="alternating rounds; the best counts")
    parser.add_argument("--quick", action="store_true", help="3 links, one round, no peers, nothing written")
    parser.add_argument("--no-write", action="store_true", help="print only")
    chosen = parser.parse_args(given)
    chosen.only = frozenset(chosen.only.split(","))
    if chosen.only - set(ONLY):
        parser.error(f"there is no part {', '.join(sorted(chosen.only - set(ONLY)))}")
    chosen.peers = [peer for peer in environment.ALL if peer.key in chosen.peers.split(",")]
    if chosen.quick:
        chosen.largest, chosen.rounds, chosen.no_peers, chosen.no_write = 3, 1, True, True
        chosen.only &= {"steps", "chain", "nonholonomic"}
    if chosen.no_peers or not chosen.only & {*MOTIONS, "whole"}:
        chosen.peers = []
    return chosen


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _steps(chosen: argparse.Namespace) -> list[dict[str, Any]]:
    found = []
    for links in (size for size in steps.DURATIONS if size <= chosen.largest):
        for rod in models.RODS:
            _say(f"steps: {links} links, {rod}")
            found.append(steps.compare(links, rod, chosen.rounds).as_json())
    return found


def _build(chosen: argparse.Namespace) -> list[dict[str, Any]]:
    found = []
    for kind, size, target in BUILDS:
        if size > chosen.largest:
            continue
        _say(f"build: {kind} {size}")
        command = [sys.executable, "-m", "tests.benchmarks.building", kind, str(size)]
        began = time.perf_counter()
        line: dict[str, Any] = {"kind": kind, "size": size, "target": target}
        try:
            done = subprocess.run(
                command, cwd=ROOT, capture_output=True, text=True, timeout=chosen.limit, check=True
            )
            line |= json.loads(done.stdout) | {"process_seconds": time.perf_counter() - began}
        except subprocess.TimeoutExpired:
            line["reason"] = f"not within {chosen.limit:.0f} s"
        found.append(line)
    return found


def _contest(chosen: argparse.Namespace, place: environment.Environment | None) -> Iterator[dict[str, Any]]:
    share = 0.05 if chosen.quick else 1.0
    for case in cases.cases(chosen.only & frozenset(MOTIONS), chosen.largest, share):
        _say(f"contest: {case.name}")
        yield contest.measured(case, chosen.error, chosen.peers, place, chosen.limit)


def _merged(old: list[dict[str, Any]], new: dict[str, Any]) -> list[dict[str, Any]]:
    """The cases in their order, the new one in the place of an old one of the same name."""
    kept = {case["case"]: case for case in old} | {new["case"]: new}
    order = [case.name for case in cases.cases(frozenset(MOTIONS), 10**9)]
    return [kept[name] for name in order if name in kept]


def _measure(chosen: argparse.Namespace, results: dict[str, Any]) -> Iterator[None]:
    """Fill `results` with the chosen parts; yields where there is something new to keep."""
    place = environment.make(chosen.cache) if chosen.peers else None
    made = machine.description(place.versions() if place else {})
    made["command"] = " ".join(["python -m tests.benchmarks", *_shown(sys.argv[1:])])
    machines = results.setdefault("machines", {})
    for part, measure in (("steps", _steps), ("build", _build)):
        if part in chosen.only:
            results[part], machines[part] = measure(chosen), made
            yield
    for case in _contest(chosen, place):
        results["contest"], machines["contest"] = _merged(results.get("contest", []), case), made
        yield
    if "whole" in chosen.only and chosen.largest >= contest.WHOLE_LINKS:
        _say("whole processes")
        results["whole"], machines["whole"] = _whole(chosen, place, results.get("contest", [])), made
        yield


def _whole(
    chosen: argparse.Namespace, place: environment.Environment | None, known: list[dict[str, Any]]
) -> dict[str, Any]:
    """Whole processes, with the settings of the measured chain of so many links."""
    case = cases.chain(contest.WHOLE_LINKS)
    found = [motion for motion in known if motion["case"] == case.name]
    settings = found[0] if found else contest.measured(case, chosen.error, (), None, chosen.limit)
    return contest.whole(settings, chosen.peers, place, chosen.limit, min(chosen.rounds, 5))


def _shown(given: Sequence[str]) -> list[str]:
    """The command line without the folder of the cache, which is no one else's business."""
    return [
        word for word, before in zip(given, ["", *given], strict=False) if "--cache" not in (word, before)
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
