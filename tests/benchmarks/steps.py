"""lagcli beside the yardstick: the compiled step alone, and a run with all that belongs to it.

Both run in turn in this process, and the best of the rounds counts, so that what else the machine does hits both.
"""

from __future__ import annotations

import dataclasses
import gc
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import lagcli
from lagcli.api import cache
from lagcli.compiled import bound_function
from lagcli.model.settings import Simulation
from lagcli.simulation.scheme import method, step_tolerance
from lagcli.start import initial

from . import models, networks, yardstick

TOLERANCE = 1e-9
# lagcli holds a step to a hundredth of what is asked for: this asks for the steps of the yardstick.
ASKED = 100 * TOLERANCE
# A run takes hundreds of steps where the chain is short, and some dozens where it is long.
DURATIONS = {3: 20.0, 10: 10.0, 100: 2.0, 1000: 0.1, 10000: 0.02}
STEPS_PER_ROW = 10
TARGETS = {"square": 1.2, "distance": 1.6}


@dataclasses.dataclass(frozen=True, slots=True)
class Comparison:
    """Seconds of an attempted step of lagcli and of the yardstick.

    `step` is the compiled function alone, `bare_run` a run with two rows, `run` one with `rows` rows.
    """

    links: int
    rod: str
    step: float
    yardstick_step: float
    bare_run: float
    run: float
    yardstick_run: float
    rows: int
    step_target: float
    run_target: float

    @property
    def step_ratio(self) -> float:
        return self.step / self.yardstick_step

    @property
    def bare_ratio(self) -> float:
        return self.bare_run / self.yardstick_run

    @property
    def run_ratio(self) -> float:
        return self.run / self.yardstick_run

    def as_json(self) -> dict[str, Any]:
        names = ("step_ratio", "bare_ratio", "run_ratio")
        ratios = {name: getattr(self, name) for name in names}
        return {**dataclasses.asdict(self), **ratios}


def _best(trigger: Callable[[], object], count: int) -> float:
    began = time.perf_counter()
    for _ in range(count):
        trigger()
    return (time.perf_counter() - began) / count


def _bound_step(model: Any, h: float) -> bound_function.BoundFunction:
    """The compiled step of lagcli at the start, bound as its driver binds it."""
    ready = cache.compiled(model)
    start = initial.declared(ready.system)
    t, y = np.zeros(1), np.concatenate([start.q, start.v, [0.0]])
    p = np.ascontiguousarray(start.p, dtype=float)
    rate = bound_function.BoundFunction(ready.numeric.rhs, [t, y, p])
    rate.trigger()
    settings = Simulation(rtol=ASKED, atol=ASKED)
    allowed = step_tolerance.of_steps(settings)
    return bound_function.BoundFunction(
        ready.cached.plain.scheme(method.of(settings)).step,
        [t, np.array([h]), y, rate.results[0], allowed, p],
    )


class _Pair:
    """A model and the yardstick of the same chain."""

    def __init__(self, links: int, rod: str) -> None:
        self.duration = DURATIONS[links]
        self.start = np.concatenate([networks.chain(links).points[1:].ravel(), np.zeros(3 * links)])
        self.yardstick = yardstick.Stepper(yardstick.step(links, TOLERANCE))
        self.model = lagcli.loads(models.chain(links, rod))

    def attempts(self) -> int:
        """Attempted steps of a run of lagcli."""
        made = lagcli.simulate(
            self.model, duration=self.duration, samples=2, rtol=ASKED, atol=ASKED, columns="t"
        ).stats
        return made.steps + made.rejected

    def run(self, rows: int) -> float:
        """Seconds an attempted step of a run of lagcli."""
        made = lagcli.simulate(
            self.model,
            duration=self.duration,
            samples=rows,
            rtol=ASKED,
            atol=ASKED,
            columns="t",
        ).stats
        return made.solve_seconds / (made.steps + made.rejected)

    def yardstick_run(self) -> float:
        """Seconds an attempted step of a run of the yardstick."""
        motion = self.yardstick.run(self.start, self.duration)
        return motion.seconds / motion.attempts


def compare(links: int, rod: str, rounds: int) -> Comparison:
    """One line of the table; `rod` is a key of `models.RODS`."""
    pair = _Pair(links, rod)
    attempts = pair.attempts()
    rows, h = 2 + attempts // STEPS_PER_ROW, pair.duration / attempts
    bound, other = _bound_step(pair.model, h), pair.yardstick
    count = max(1, math.ceil(0.02 / _best(bound.trigger, 1)))
    step, other_step, bare, run, other_run = [], [], [], [], []
    gc.disable()
    for _ in range(rounds):
        other.y[:], other.h[0] = pair.start, h
        other_step.append(_best(other.trigger, count))
        step.append(_best(bound.trigger, count))
        other_run.append(pair.yardstick_run())
        bare.append(pair.run(2))
        run.append(pair.run(rows))
    gc.enable()
    return Comparison(
        links=links,
        rod=rod,
        step=min(step),
        yardstick_step=min(other_step),
        bare_run=min(bare),
        run=min(run),
        yardstick_run=min(other_run),
        rows=rows,
        step_target=TARGETS[rod],
        run_target=1.5 if links <= 10 else 1.2,
    )
