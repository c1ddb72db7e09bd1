"""`python -m tests.fuzz.stationary_products --problems 200 --mechanisms 100`: what `stationary` and `equilibrium` find.

Problems are products of circles, spheres and planes, of which all solutions are known: told are the part of them that
is found, points that are none, and proofs that are wrong; with `--inexact` no proof is possible and the search is on
its own. Mechanisms are brought to rest, and lambda and R held against `simulate` started there.
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np

import lagcli
from lagcli.statics.static_report import StaticPoint
from tests.helpers import statics_models

NEAR, RESIDUAL, SAME = 1e-9, 1e-11, 1e-8


@dataclasses.dataclass
class Tally:
    wanted: int = 0
    found: int = 0
    false: int = 0
    proved: int = 0
    wrong_proofs: int = 0
    problems: int = 0


def judge(seed: int, tally: Tally, inexact: bool = False, starts: int = 32) -> None:
    """One problem."""
    problem = statics_models.problem(seed, inexact)
    found = lagcli.stationary(lagcli.loads(problem.text), problem.of, starts=starts)
    names = list(statics_models.names(len(problem.solutions[0])))
    hit = [
        any(statics_models.apart(p.at, names, place) <= NEAR for p in found) for place in problem.solutions
    ]
    false = [
        p
        for p in found
        if not any(statics_models.apart(p.at, names, place) <= NEAR for place in problem.solutions)
    ]
    tally.problems += 1
    tally.wanted += len(hit)
    tally.found += sum(hit)
    tally.false += len(false)
    tally.proved += found.complete
    tally.wrong_proofs += found.complete and (not all(hit) or bool(false))
    if not all(hit) or false:
        print(
            f"problem {seed}: {sum(hit)} of {len(hit)} found, {len(false)} false, complete {found.complete}",
            flush=True,
        )


def judge_mechanism(seed: int) -> list[str]:
    """What is wrong with the points of rest of one mechanism."""
    model = lagcli.loads(statics_models.mechanism(seed))
    found = lagcli.equilibrium(model, starts=3)
    faults = [] if len(found) else ["nothing found"]
    for point in list(found)[:3]:
        if point.residual > RESIDUAL * (1 + max(map(abs, point.multipliers.values()), default=0.0)) * 100:
            faults.append(f"residual {point.residual:.1e}")
        faults += held_against_a_run(model, point)
    return faults


def held_against_a_run(model: lagcli.Model, point: StaticPoint) -> list[str]:
    """lambda and R of a run that starts at a point, at its first row, against those of the point."""
    from lagcli.equations import system

    q = np.array([point.at[name] for name in model.coordinate_names])
    there = system.started_at(model, q, np.zeros(q.size))
    try:
        run = lagcli.simulate(there, duration=1e-3, samples=2, assemble=False)
    except lagcli.SimulationStopped as stopped:  # the first row is there all the same
        run = stopped.trajectory
    pairs = {f"lambda.{name}": value for name, value in point.multipliers.items()} | dict(point.reactions)
    size = max([1.0, *map(abs, pairs.values())])
    return [
        f"{name}: {value!r} at rest, {run[name][0]!r} in a run"
        for name, value in pairs.items()
        if abs(run[name][0] - value) > SAME * size
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--mechanisms", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--inexact", action="store_true")
    chosen = parser.parse_args()
    tally = Tally()
    for seed in range(chosen.first, chosen.first + chosen.problems):
        judge(seed, tally, chosen.inexact)
    if tally.problems:
        print(f"{tally}: {tally.found / tally.wanted:.4f} found")
    faulty = 0
    for seed in range(chosen.first, chosen.first + chosen.mechanisms):
        faults = judge_mechanism(seed)
        faulty += bool(faults)
        for fault in faults:
            print(f"mechanism {seed}: {fault}", flush=True)
    print(f"{chosen.mechanisms} mechanisms, {faulty} faulty")


if __name__ == "__main__":
    main()
