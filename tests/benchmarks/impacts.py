"""What impacts and one-sided constraints cost: `python -m tests.benchmarks.impacts [PART ...]`.

Parts: `long` (1e5 impacts in a box, the energy after them, and memory), `rate` (impacts a second of small models),
`open` (the same model with inequalities that stay open and without, in turns), `spheres` (a hundred hard spheres in a
box, a thousand collisions: cost of a step and of an impact).

Times are those of the processor, the least of several: what a run costs beyond a short one of the same model.
"""

from __future__ import annotations

import math
import resource
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import lagcli

TURNS = 5
SPAN, SHORT = 1.8, 0.02  # seconds of motion of the spheres; the part of a run that a short one is

BOX = """lagcli: 1
parameters: {X: 1, Y: 1.3, Z: 0.7, e: 1}
particles:
  a: {mass: 1, position: [0.2, 0.31, 0.47], velocity: [1.37, -0.83, 0.59]}
inequality:
  left: {condition: a.x >= 0, restitution: e}
  right: {condition: a.x <= X, restitution: e}
  front: {condition: a.y >= 0, restitution: e}
  back: {condition: a.y <= Y, restitution: e}
  bottom: {condition: a.z >= 0, restitution: e}
  top: {condition: a.z <= Z, restitution: e}
"""
RATE = 1141 / 400  # impacts a second of motion in this box
SINAI = BOX + "  disk: {condition: 'norm([a.x - 0.5, a.y - 0.6, 0]) >= 0.25', restitution: e}\n"
BALL = """lagcli: 1
particles:
  a: {mass: 1, position: [0, 0, 1]}
forces:
  weight: {to: a, force: [0, 0, -9.81]}
inequality:
  floor: {condition: a.z >= 0, restitution: 1}
"""
SPHERES = """lagcli: 1
parameters: {N: 100, D: 0.1, X: 1, e: 1}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "PLACE", velocity: "[sin(129*i), sin(782*i), sin(251*i + 2)]"}
inequality:
  left[i]: {for: "i = 1..N", condition: "p[i].x >= D/2", restitution: e}
  right[i]: {for: "i = 1..N", condition: "p[i].x <= X - D/2", restitution: e}
  front[i]: {for: "i = 1..N", condition: "p[i].y >= D/2", restitution: e}
  back[i]: {for: "i = 1..N", condition: "p[i].y <= X - D/2", restitution: e}
  bottom[i]: {for: "i = 1..N", condition: "p[i].z >= D/2", restitution: e}
  top[i]: {for: "i = 1..N", condition: "p[i].z <= X - D/2", restitution: e}
  hit[i][j]: {for: ["i = 1..N", "j = i+1..N"], condition: "distance(p[i], p[j]) >= D", restitution: e}
"""
WALLS = """
inequality:
  left[i]: {for: "i = 1..N", condition: "p[i].x >= -100"}
  right[i]: {for: "i = 1..N", condition: "p[i].x <= 100"}
  floor[i]: {for: "i = 1..N", condition: "p[i].z >= -100"}
"""
CHAIN = """lagcli: 1
parameters: {{N: {}, g: 9.81}}
particles:
  p[i]: {{for: "i = 1..N", mass: 1, position: "[i, 0, 0]"}}
forces: {{weight: {{to: p, force: [0, 0, -m*g]}}}}
holonomic:
  hook: distance(p[1], [0, 0, 0]) = 1
  rod[i]: {{for: "i = 2..N", equation: "distance(p[i], p[i-1]) = 1"}}
simulation: {{duration: 3, samples: 31}}
"""


def modulo(k: str, n: int) -> str:
    """k modulo n for an expression of integers, of functions that a model file has."""
    angle = f"2*pi*({k} - {n // 2})/{n}"
    return f"({n // 2} + {n}/(2*pi)*atan2(sin({angle}), cos({angle})))"


def spheres() -> str:
    """A hundred spheres in layers of 5 x 5, with velocities of no order."""
    column, layer = modulo("i - 1", 5), modulo("i - 1", 25)
    place = f"[0.1 + 0.2*{column}, 0.1 + 0.04*({layer} - {column}), 0.1 + 0.008*(i - 1 - {layer})]"
    return SPHERES.replace("PLACE", place)


class Cost(NamedTuple):
    """Seconds, impacts and steps of a run beyond a short one."""

    seconds: float
    impacts: int
    steps: int


def run_of(text: str, duration: float) -> tuple[float, lagcli.Trajectory]:
    """Seconds of the processor, and the run."""
    model = lagcli.loads(text)
    began = time.process_time()
    run = lagcli.simulate(model, duration=duration, samples=2, columns="t,energy")
    return time.process_time() - began, run


def costs(texts: Sequence[str], duration: float, turns: int = TURNS) -> list[Cost]:
    """The costs of models, whose runs take turns."""
    least = [[math.inf, math.inf] for _ in texts]
    stats = [[(0, 0), (0, 0)] for _ in texts]
    for _ in range(turns):
        for model, text in enumerate(texts):
            for kind, part in enumerate((SHORT, 1.0)):
                took, run = run_of(text, part * duration)
                least[model][kind] = min(least[model][kind], took)
                stats[model][kind] = run.stats.impacts, run.stats.steps
    return [
        Cost(long - short, many[0] - few[0], many[1] - few[1])
        for (short, long), (few, many) in zip(least, stats, strict=True)
    ]


def long() -> Iterator[str]:
    """1e5 impacts."""
    took, run = run_of(BOX, 1e5 / RATE)
    energy = run["energy"]
    yield (
        f"{run.stats.impacts} impacts in {took:.1f} s: {run.stats.impacts / took:.0f} a second; "
        f"energy off by {abs(energy[-1] / energy[0] - 1):.1e}, {run.stats.steps} steps, "
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB with all that is told of them"
    )


def rate() -> Iterator[str]:
    """Impacts a second."""
    cases = {"box": (BOX, 300.0), "Sinai billiard": (SINAI, 300.0), "ball": (BALL, 500.0)}
    for name, (text, duration) in cases.items():
        (cost,) = costs([text], duration)
        yield (
            f"{name:16} {cost.impacts:5} impacts, {cost.steps:5} steps in {cost.seconds:.3f} s: "
            f"{cost.impacts / cost.seconds:6.0f} impacts a second, {1e6 * cost.seconds / cost.impacts:.0f} us each"
        )


def untouched() -> Iterator[str]:
    """With inequalities that stay open and without, in turns."""
    for links in (1, 3, 10, 30):
        plain = CHAIN.format(links)
        one, other = (cost.seconds / cost.steps for cost in costs([plain + WALLS, plain], 300.0 / links))
        yield (
            f"{links:2} links, {3 * links:2} open: {1e6 * one:.1f} us a step for {1e6 * other:.1f}, "
            f"{one / other:.3f} times"
        )


def gathering() -> Iterator[str]:
    """A hundred spheres."""
    text = spheres()
    before, _ = run_of(text, 1e-6)
    (cost,) = costs([text], SPAN, 1)
    _, run = run_of(text, SPAN / 10)
    energy = run["energy"]
    off = abs(energy[-1] / energy[0] - 1)
    yield f"4 950 pairs, 600 walls: {before:.1f} s to the first step; energy off by {off:.1e}"
    yield (
        f"{cost.impacts} impacts, {cost.steps} steps in {cost.seconds:.1f} s: "
        f"{1e3 * cost.seconds / cost.impacts:.2f} ms an impact, {1e3 * cost.seconds / cost.steps:.2f} ms a step"
    )


PARTS: dict[str, Callable[[], Iterator[str]]] = {
    "long": long,
    "rate": rate,
    "open": untouched,
    "spheres": gathering,
}


def main() -> None:
    """Print the lines of the parts."""
    for part in sys.argv[1:] or PARTS:
        for line in PARTS[part]():
            print(f"{part:8} {line}", flush=True)


if __name__ == "__main__":
    main()
