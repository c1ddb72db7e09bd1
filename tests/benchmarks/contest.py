"""lagcli beside other programs: for each motion the time of the solution at the wanted error.

Every program, lagcli too, gets the loosest setting with which it reaches the error, in half decades of the
tolerance or, with constant steps, by the number of steps; then the best of several runs counts.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import lagcli

from . import cases, environment

ROOT = Path(__file__).parents[2]
REPEATS = 5
WHOLE_LINKS, WHOLE_ROWS = 30, 101
WHOLE_LIMITS = 5  # a process that runs once may take so many limits
# The class of SymPy is asked only where it has a chance.
LAGRANGES_METHOD_LINKS = 10


def measured(
    case: cases.Case,
    wanted: float,
    peers: Sequence[environment.Peer],
    place: environment.Environment | None,
    limit: float,
) -> dict[str, Any]:
    """One case with an answer for each program."""
    began = time.perf_counter()
    reference = case.reference()
    reference_seconds = time.perf_counter() - began
    question = {"problem": case.problem, "reference": reference.tolist(), "wanted": wanted}
    answers = {"lagcli": _lagcli(case, reference, wanted)}
    for peer in peers:
        # The peers have no equations of the gallery's nonholonomic models.
        if place is None or case.part == "nonholonomic":
            continue
        if peer.key == "lagranges-method" and not (
            case.part == "chain" and case.links <= LAGRANGES_METHOD_LINKS
        ):
            continue
        answers[peer.key] = place.ask(peer, question, limit)
    return {
        "part": case.part,
        "case": case.name,
        "links": case.links,
        "duration": case.duration,
        "wanted": wanted,
        "reference": case.source,
        "reference_seconds": reference_seconds,
        "answers": answers,
    }


def _error(found: Any, reference: Any) -> float:
    return float(np.max(np.abs(found - reference) / np.maximum(1.0, np.abs(reference))))


def _lagcli(case: cases.Case, reference: Any, wanted: float) -> dict[str, Any]:
    began = time.perf_counter()
    model = lagcli.loads(case.model)
    error = np.inf
    answer: dict[str, Any] = {}
    build = None
    for half_decades in range(6, 27):
        rtol = 10 ** (-half_decades / 2)
        run = lagcli.simulate(model, duration=case.duration, samples=2, rtol=rtol, atol=rtol / 100)
        build = build or time.perf_counter() - began - run.stats.solve_seconds
        error = _error(case.end(run), reference)
        answer = {"setting": f"rtol {rtol:.0e}", "rtol": rtol, "error": error, "build_seconds": build}
        if error <= wanted:
            break
    seconds = [run.stats.solve_seconds]
    for _ in range(REPEATS):
        again = lagcli.simulate(
            model, duration=case.duration, samples=2, rtol=answer["rtol"], atol=answer["rtol"] / 100
        )
        seconds.append(again.stats.solve_seconds)
    reached = error <= wanted
    return {
        **answer,
        "solve_seconds": min(seconds),
        "reached": reached,
        "reason": None if reached else "floor",
    }


def whole(
    found: dict[str, Any],
    peers: Sequence[environment.Peer],
    place: environment.Environment | None,
    limit: float,
    rounds: int,
) -> dict[str, Any]:
    """Whole processes, from the start of Python to the file written, for a chain of `WHOLE_LINKS` links.

    `found` is the measured case of that chain: its settings reach the wanted error.
    """
    case = cases.chain(WHOLE_LINKS)
    answers = found["answers"]
    result: dict[str, Any] = {
        "links": WHOLE_LINKS,
        "rows": WHOLE_ROWS,
        "limit": WHOLE_LIMITS * limit,
        "seconds": {},
    }
    with tempfile.TemporaryDirectory() as folder:
        times = [_process(case, answers["lagcli"]["rtol"], Path(folder)) for _ in range(rounds)]
        result["seconds"]["lagcli"] = min(times)
        for peer in peers:
            if place is None or peer.script != "sympy_scipy.py":
                continue
            # Both derivations solve the same equations; the tolerance of the first serves the other.
            setting = answers["sympy"]["setting"] if "sympy" in answers else "tolerances 1e-09"
            table = {
                "tolerance": float(setting.split()[-1]),
                "rows": WHOLE_ROWS,
                "file": str(Path(folder) / "peer.csv"),
            }
            question = {"problem": case.problem, "whole": table}
            result["seconds"][peer.key] = place.whole(peer, question, result["limit"])
    return result


def _process(case: cases.Case, rtol: float, folder: Path) -> float:
    model = folder / "chain.yaml"
    model.write_text(case.model, encoding="utf-8")
    numbers = ["--duration", str(case.duration), "--samples", str(WHOLE_ROWS)]
    accuracy = ["--rtol", str(rtol), "--atol", str(rtol / 100)]
    command = [sys.executable, "-m", "lagcli", "simulate", str(model), *numbers, *accuracy]
    began = time.perf_counter()
    subprocess.run(
        [*command, "-o", str(folder / "chain.csv"), "--quiet"],
        check=True,
        cwd=ROOT,
        env={**os.environ, **environment.THREADS},
        stdout=subprocess.DEVNULL,
    )
    return time.perf_counter() - began
