"""Random one-sided models against the judges: the command that looks at many of them.

    python -m tests.fuzz.one_sided --models 1000 --first 0 --limit 20
    python -m tests.fuzz.one_sided --chains --models 300
    python -m tests.fuzz.one_sided --switches --models 1000

Every model is judged leg by leg (`helpers/motion_legs.py`), those of free masses also as a whole by closed forms
(`helpers/free_flight.py`). Chains of rods between walls that move (`helpers/chain_models.py`) are judged by
`lagcli audit` too, from their tables. Systems whose forces and walls switch, and clusters of contacts
(`helpers/switched_scenes.py`), stand beside their exact motion (`helpers/exact_motion.py`). A process of its own does
the work; where it takes longer than the limit for a model, or dies, the model is reported and another one goes on.
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import lagcli
from lagcli.simulation.run_state import run_stop
from tests.helpers import (
    chain_models,
    free_flight,
    motion_legs,
    one_sided_models,
    recorded_runs,
    switched_judge,
    switched_scenes,
)
from tests.helpers.one_sided_models import Floats, Scene

ROOT = Path(__file__).parents[2]
OPTIONS = {"rtol": 1e-10, "atol": 1e-12}
ROWS = 201  # of a run that is audited
NUDGE, LARGEST = 1e-9, 1e4  # a disturbance, and how much it may have grown where answers are still compared


@dataclasses.dataclass(frozen=True, slots=True)
class Verdict:
    """faults: what is wrong; outcome: `done`, `refused: CODE`, `stopped: REASON`; compared: impacts, closed form."""

    faults: list[str]
    outcome: str
    impacts: int = 0
    compared: int = 0


def judged(scene: Scene) -> Verdict:
    """A run of a scene and what is to say against it."""
    try:
        run = recorded_runs.recorded(scene, **OPTIONS)
    except lagcli.ModelError as error:
        return Verdict([], f"refused: {error.diagnostics[0].code}")
    except run_stop.RunStop as stopped:
        return Verdict([], f"stopped: {stopped.stop.reason}")
    impacts = [at for at in run.instants if at.names("impact")]
    found = motion_legs.faults(scene, run)
    if run.t[-1] != scene.duration:
        found.append(f"ends at {run.t[-1]!r}")
    compared = 0
    if not scene.rods:
        more, compared = against_closed_form(scene, run)
        found += more
    return Verdict(found, "done", len(impacts), compared)


def audited(scene: Scene) -> list[str]:
    """What the own audit of a run says against it, from its tables."""
    model = lagcli.loads(scene.text())
    run = lagcli.simulate(model, samples=ROWS)
    checks = lagcli.audit(model, run, events=run.events).checks
    return [f"{check.name} fails: {check.worst}" for check in checks if check.verdict == "fail"]


def chain_verdict(seed: int) -> Verdict:
    """Both judgements of a chain."""
    scene = chain_models.chain(seed)
    verdict = judged(scene)
    if verdict.outcome != "done":
        return verdict
    return dataclasses.replace(verdict, faults=[*verdict.faults, *audited(scene)])


def switched_verdict(seed: int) -> Verdict:
    """A run of a system with switches beside its exact motion; compared: rows."""
    scene = switched_scenes.scene(seed)
    try:
        columns, rows, incidents, stop = recorded_runs.run_to_stop(scene.text(), **OPTIONS)
    except lagcli.ModelError as error:
        return Verdict([f"refused: {error.diagnostics[0].code}"], "refused")
    stopped = stop.stop.reason.partition("): ")[2] if stop else ""
    found, compared = switched_judge.faults(
        scene, switched_judge.table(scene, columns, rows, incidents), stopped
    )
    impacts = sum(each.kind == "impact" for each in incidents)
    return Verdict(found, f"stopped: {stopped}" if stopped else "done", impacts, compared)


def against_closed_form(scene: Scene, run: motion_legs.Recorded) -> tuple[list[str], int]:
    """Faults of a run beside the closed form, and the number of impacts that were compared.

    A twin that starts a little elsewhere tells how much a disturbance grows; what has grown too much is not compared.
    """
    random = np.random.default_rng(1)
    answer = free_flight.solve(scene)
    other = free_flight.solve(
        dataclasses.replace(scene, v=scene.v + NUDGE * _mask(scene) * random.normal(size=scene.v.shape))
    )
    impacts = [at for at in run.instants if at.names("impact")]
    faults: list[str] = []
    compared, grown = 0, NUDGE
    for k, (blow, twin) in enumerate(zip(answer.blows, other.blows, strict=False)):
        near = max(blow.impulses.values(), default=0.0) < 100 * free_flight.SMALL
        grown = max(grown, abs(twin.t - blow.t))
        if twin.impulses.keys() != blow.impulses.keys() or grown > NUDGE * LARGEST or near:
            return faults, compared
        if k >= len(impacts):
            return [*faults, f"impact {k + 1} at t = {blow.t!r} is missed"], compared
        at = impacts[k]
        off = abs(at.t - blow.t)
        for name, P in blow.impulses.items():
            off = max(off, abs(at.impulses[name] - P) / (1 + abs(P)))
        if off > 10 * grown + 1e-8:
            return [*faults, f"impact {k + 1} at t = {blow.t!r} is off by {off:.1e}"], compared
        compared += 1
    if len(answer.blows) == len(other.blows) and answer.why == other.why == "" and not answer.rests:
        if len(impacts) != len(answer.blows):
            faults.append(f"{len(impacts)} impacts in place of {len(answer.blows)}")
        x, v = answer.at(scene.duration)
        off = max(np.abs(run.x[-1] - x).max(), np.abs(run.v[-1] - v).max())
        twin_x, twin_v = other.at(scene.duration)
        grown = max(grown, np.abs(twin_x - x).max(), np.abs(twin_v - v).max())
        if grown < NUDGE * LARGEST and off > 10 * grown + 1e-8:
            faults.append(f"the end is off by {off:.1e}")
    return faults, compared


def _mask(scene: Scene) -> Floats:
    """1 where the motion of a scene goes on, 0 across its plane."""
    return np.where(np.abs(scene.x).max(axis=0) > 0, 1.0, 0.0)


def work(kind: str) -> None:
    """Judge the numbers that come in, one a line."""
    for line in sys.stdin:
        print(json.dumps(dataclasses.asdict(FAMILIES[kind].judge(int(line)))), flush=True)


@dataclasses.dataclass(frozen=True, slots=True)
class Family:
    """A family of models by number: how one is made, with its `kind` and `text()`, and how it is judged."""

    make: Callable[[int], Any]
    judge: Callable[[int], Verdict]


FAMILIES = {
    "scenes": Family(one_sided_models.scene, lambda seed: judged(one_sided_models.scene(seed))),
    "chains": Family(chain_models.chain, chain_verdict),
    "switches": Family(switched_scenes.scene, switched_verdict),
}


class Worker:
    """The process that judges; started anew after it was ended."""

    def __init__(self, kind: str) -> None:
        self._command = [sys.executable, "-m", "tests.fuzz.one_sided", "--work"]
        if kind != "scenes":
            self._command.append(f"--{kind}")
        self.process: subprocess.Popen[str] | None = None

    def ask(self, seed: int, limit: float) -> dict[str, object]:
        fresh = self.process is None
        if self.process is None:
            self.process = subprocess.Popen(
                self._command,
                cwd=ROOT,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        process = self.process
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdin.write(f"{seed}\n")
        process.stdin.flush()
        timer = threading.Timer(limit + 20 * fresh, process.kill)
        timer.start()
        answer = process.stdout.readline()
        timer.cancel()
        if answer:
            return dict(json.loads(answer))
        self.process = None
        said = process.stderr.read().strip().splitlines()
        died = process.wait() != -9
        return {
            "outcome": "crash" if died else "hang",
            "faults": [said[-1] if died and said else f"no answer in {limit} s"],
        }

    def end(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()


def main() -> int:
    """Judge many models and print the faults and the figures; 1 where there are faults."""
    parser = argparse.ArgumentParser(
        "python -m tests.fuzz.one_sided", description="Attacks one-sided constraints."
    )
    parser.add_argument("--models", type=int, default=1000, help="how many")
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    family = parser.add_mutually_exclusive_group()
    family.add_argument(
        "--chains", action="store_true", help="chains of rods between walls that move, audited"
    )
    family.add_argument("--switches", action="store_true", help="forces and walls that switch, and clusters")
    parser.add_argument("--limit", type=float, default=20.0, help="seconds for a model")
    parser.add_argument("--show", type=int, help="print the text of this model, and end")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    kind = "chains" if chosen.chains else "switches" if chosen.switches else "scenes"
    if chosen.work:
        work(kind)
        return 0
    scene = FAMILIES[kind].make
    if chosen.show is not None:
        print(scene(chosen.show).text(), end="")
        return 0
    outcomes: collections.Counter[str] = collections.Counter()
    figures: collections.Counter[str] = collections.Counter()
    bad, worker = 0, Worker(kind)
    for seed in range(chosen.first, chosen.first + chosen.models):
        answer = worker.ask(seed, chosen.limit)
        outcomes[str(answer["outcome"])] += 1
        for key in ("impacts", "compared"):
            figures[key] += int(str(answer.get(key, 0)))
        faults = answer["faults"]
        assert isinstance(faults, list)
        if faults:
            bad += 1
            print(
                f"{seed} {scene(seed).kind}: {len(faults)} faults; {'; '.join(map(str, faults[:2]))}",
                flush=True,
            )
        elif answer["outcome"] != "done":
            print(f"{seed} {scene(seed).kind}: {answer['outcome']}", flush=True)
    worker.end()
    print(json.dumps({"models": chosen.models, "faulty": bad, **figures, "outcomes": outcomes}))
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
