"""lagcli beside other programs: for each motion the error that each setting reaches, and its time.

All programs are asked in turns for the settings that tables show, round after round, so that what else the machine
does hits all; the least time of a setting counts.
"""

from __future__ import annotations

import contextlib
import json
import statistics
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from . import cases, programs
from .programs import Process, Program

WANTED = (1e-6, 1e-9, 1e-12)
ENOUGH = 1e-13  # no program is asked for less
WORSE = 3  # so many settings in a row that come no nearer are the end of what a program can do
NO_STEPS = "no steps"  # of `peers/lagcli_tiers.py`
WHOLE = ("chain-3", "chain-30")
WHOLE_WANTED, WHOLE_ROUNDS, LONG = 1e-9, 3, 8.0  # a process that takes so many seconds is run once


def measured(
    case: cases.Case, found: Mapping[str, Program], python: str, limit: float, rounds: int
) -> dict[str, Any]:
    """Each program with its attempts: setting, error, seconds and their spread; and what went before them."""
    reference = np.ravel(case.reference())
    answers: dict[str, Any] = {}
    with contextlib.ExitStack() as stack:
        cache = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        processes, shown = {}, {}
        for key, program in found.items():
            if not program.solves(case.problem["kind"]):
                continue
            process = processes[key] = stack.enter_context(Process(program, python, cache, case.problem))
            attempts = _walk(process, reference, case.patience * limit)
            answers[key] = {"equations": process.seconds, "attempts": attempts}
            shown[key] = [each for each in attempts if each in map(partial(reached, attempts), WANTED)]
            if program.is_own:
                answers[key]["call"] = [process.ask(NO_STEPS)["seconds"]]
        for _ in range(rounds - 1):
            for key, process in processes.items():
                for attempt in shown[key]:
                    attempt["times"].append(process.ask(attempt["setting"])["seconds"])
                if found[key].is_own:
                    answers[key]["call"].append(process.ask(NO_STEPS)["seconds"])
    for answer in answers.values():
        for attempt in answer.get("attempts", ()):
            times = attempt.pop("times")
            attempt["seconds"], attempt["spread"] = min(times), statistics.median(times) / min(times) - 1
        if "call" in answer:
            answer["call"] = min(answer["call"])
    return {"case": case.name, "duration": case.problem["duration"], "answers": answers}


def _walk(process: Process, reference: Any, limit: float) -> list[dict[str, Any]]:
    """The settings from loose to fine, as long as they come nearer and take no longer than the limit, in seconds."""
    attempts: list[dict[str, Any]] = []
    for setting in process.settings:
        answer = process.ask(setting)
        found = np.ravel(np.array(answer["q"], dtype=float))
        error = float(np.max(np.abs(found - reference) / np.maximum(1.0, np.abs(reference))))
        compiled = max(answer["first"] - answer["seconds"], 0.0)
        attempts.append(
            {
                "setting": setting,
                "error": error if np.isfinite(error) else None,
                "compile": compiled,
                "times": [answer["seconds"]],
            }
        )
        errors = [attempt["error"] or np.inf for attempt in attempts]
        is_floor = len(errors) - int(np.argmin(errors)) > WORSE and min(errors) < WANTED[0]
        # The next setting takes longer, and as long once more to be compiled.
        if error <= ENOUGH or is_floor or answer["seconds"] > limit:
            break
    return attempts


def reached(attempts: Sequence[dict[str, Any]], wanted: float) -> dict[str, Any] | None:
    """The fastest attempt with at most an error."""
    good = [each for each in attempts if each["error"] is not None and each["error"] <= wanted]
    return min(good, key=lambda each: float(each.get("seconds") or each["times"][0]), default=None)


def whole(found: Mapping[str, Program], python: str, known: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Whole processes, from the start of Python to the first result, with the settings of the measured motions.

    cold: nothing is kept of a run before; warm: what a program keeps by itself is there.
    """
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        for name in (name for name in WHOLE if name in known):
            case = cases.CASES[name]()
            line: dict[str, Any] = {"case": case.name, "programs": {}}
            commands = {"Python with NumPy": ([sys.executable, "-c", "import numpy"], "")}
            for key, program in found.items():
                attempt = reached(known[name]["answers"].get(key, {}).get("attempts", ()), WHOLE_WANTED)
                if attempt is not None:
                    commands[key] = _process(program, python, case, attempt["setting"], Path(folder))
            for turn in range(WHOLE_ROUNDS):
                for key, (arguments, asked) in commands.items():
                    times = line["programs"].setdefault(key, {"cold": [], "warm": []})
                    if turn and max(times["cold"]) > LONG:
                        continue
                    cache = Path(tempfile.mkdtemp(dir=folder))
                    for kind in times:
                        times[kind].append(programs.cost(arguments, cache, asked).processor)
            for times in line["programs"].values():
                times |= {kind: min(each) for kind, each in times.items()}
            lines.append(line)
    return lines


def _process(
    program: Program, python: str, case: cases.Case, setting: str, folder: Path
) -> tuple[list[str], str]:
    """The command that solves a case once, and what it reads."""
    if not program.is_own:
        return programs.command(program, python), json.dumps({**case.problem, "once": setting}) + "\n"
    model = folder / f"{case.name.replace(' ', '-').replace(',', '')}.yaml"
    model.write_text(case.problem["model"], encoding="utf-8")
    accuracy = ["--rtol", setting, "--atol", str(float(setting) / 100), "--compile", program.argument]
    length = ["--duration", str(case.problem["duration"]), "--samples", "2"]
    return [
        sys.executable,
        "-m",
        "lagcli",
        "simulate",
        str(model),
        *length,
        *accuracy,
        "-o",
        "table.csv",
        "-q",
    ], ""
