"""lagcli beside the yardstick: the compiled step alone, in the interpreter.

Both run in turn in this process, and the best of the rounds counts, so that what else the machine does hits both.
"""

from __future__ import annotations

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
LINKS = (3, 10, 100, 1000, 10000)
STEP = 0.01  # seconds: what a step costs does not depend on it
TARGETS = {"square": 1.2, "distance": 1.6}


def _best(trigger: Callable[[], object], count: int) -> float:
    began = time.process_time()
    for _ in range(count):
        trigger()
    return (time.process_time() - began) / count


def _bound_step(model: Any) -> bound_function.BoundFunction:
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
        [t, np.array([STEP]), y, rate.results[0], allowed, p],
    )


def compare(links: int, rod: str, rounds: int) -> dict[str, Any]:
    """One line of the table: seconds of an attempted step of lagcli and of the yardstick; `rod` is a key of
    `models.RODS`."""
    start = np.concatenate([networks.chain(links).points[1:].ravel(), np.zeros(3 * links)])
    other = yardstick.Stepper(yardstick.step(links, TOLERANCE))
    bound = _bound_step(lagcli.loads(models.chain(links, rod)))
    count = max(1, math.ceil(0.02 / _best(bound.trigger, 1)))
    step, other_step = [], []
    gc.disable()
    for _ in range(rounds):
        other.y[:], other.h[0] = start, STEP
        other_step.append(_best(other.trigger, count))
        step.append(_best(bound.trigger, count))
    gc.enable()
    least, other_least = min(step), min(other_step)
    return {
        "links": links,
        "rod": rod,
        "step": least,
        "yardstick_step": other_least,
        "step_ratio": least / other_least,
        "step_target": TARGETS[rod],
    }
