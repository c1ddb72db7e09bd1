"""Declared events: their values where a run stands, which of them jump over zero and what is reported of them; their
zeros within a step, at a switch of a function of t, at the end of the run, and where something else ends the step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction
from lagcli.contact import zero_search
from lagcli.simulation.events.event import IncidentLog, InstantLines
from lagcli.simulation.events.step_watch import StepWatch
from lagcli.simulation.events.watch_functions import DIRECTIONS
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.stepping import grid
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper

Indices = npt.NDArray[np.intp]

# So many times its rounding from zero, or that of the time, a declared function is at zero; whether it crosses at a
# switch, values tell by this part of a step farther off.
TOUCHED, BESIDE = 4.0, 1e-5
# Newton steps for an instant.
REFINED = 4


class EventSizes(NamedTuple):
    """Sizes and rounding of the values of events (E,) in a step."""

    sizes: Floats
    rounding: Floats


class EventValues:
    """All E events of a run; known: of their values in the last step that was taken and looked at, None before."""

    def __init__(self, run: Stepper, log: IncidentLog) -> None:
        self._run, self._log = run, log
        self._events = run.bound.enforced.system.model.events
        self.known: EventSizes | None = None
        self._t = np.zeros(1)
        self._values: tuple[BoundStep, BoundFunction] | None = None

    def now(self) -> Floats:
        """`when` (E,) where the run stands."""
        run, bound = self._run, self._run.bound
        if not self._events:
            return np.zeros(0)
        if self._values is None or self._values[0] is not bound:
            self._values = bound, BoundFunction(bound.numeric.events_at, [self._t, bound.y, bound.p])
        values = self._values[1]
        self._t[0] = run.origin + run.t
        values.trigger()
        return values.results[0].copy()

    def jumped(self, before: Floats, after: Floats) -> list[int]:
        """The events that jump over zero in their direction, by their values before and after (E,)."""
        least = doubles.VALUE * np.maximum(np.abs(before), np.abs(after))
        if self.known is not None:
            least = np.maximum(least, np.maximum(doubles.VALUE * self.known.sizes, self.known.rounding))
        ways = np.where((before < -least) & (after > least), 1, 0) - ((before > least) & (after < -least))
        wanted = [DIRECTIONS[event.direction] for event in self._events]
        return [i for i, (way, one) in enumerate(zip(ways, wanted, strict=True)) if way and one in (0, way)]

    def report(self, numbers: Iterable[int], lines: InstantLines | None = None) -> None:
        """Tell of events where the run stands, with its own lines where there are no others; one that stops ends it."""
        for number in numbers:
            if lines is None:
                line = self._log.line()
                lines = InstantLines(line, line)
            event = self._events[number]
            self._log.report("event", event.name, lines)
            if event.action == "stop":
                self._run.statistics.ended_by = event.name


def at_switch(
    watch: StepWatch,
    step: FoundStep,
    sides: tuple[Floats, Floats],
    jumped: Callable[[Floats, Floats], list[int]],
) -> tuple[list[int], list[int]]:
    """The events that cross zero, of those that are at zero on both sides, and all these, by their numbers.

    The next step would see no more than on which side rounding has put them. sides: values (E,) before and after;
    jumped: as `EventValues.jumped`.
    """
    run, (before, after) = watch.run, sides
    E = before.size
    rounding, values = watch.rounding(step)[-E:], np.maximum(np.abs(before), np.abs(after))
    at_zero = np.flatnonzero(values <= TOUCHED * rounding)
    if not at_zero.size:
        return [], []
    offset = BESIDE * min(run.control.step, run.grid.end - run.grid.start)
    beside = watch.beside(step.reached, offset)[:, -E:]
    # At a pole there is nothing but rounding, and it shrinks with the distance.
    found = at_zero[(values <= np.abs(beside).max(axis=0))[at_zero]].tolist()
    crosses = jumped(*np.where(np.abs(beside) <= TOUCHED * rounding, 0.0, beside))
    return [number for number in crosses if number in found], found


def arriving(watch: StepWatch, found: FoundStep) -> list[int]:
    """The events, by their numbers, that go through zero at the end of the last step, to rounding of its time."""
    run, kinds = watch.run, watch.functions.kinds
    begin = watch.inside(0.0)[0].copy()
    end, slope = watch.inside(1.0)
    room = np.abs(slope) / found.taken * grid.AT_END * math.ulp(found.reached)
    arrives = (np.abs(end) <= room) & (begin * slope < 0) & (np.abs(begin) > room)
    arrives &= (kinds.direction == zero_search.BOTH) | (np.sign(slope) == kinds.direction)
    last = run.origin + found.reached - grid.AT_END * math.ulp(found.reached)
    reported = {incident.name for incident in found.within if incident.t >= last}
    indices = np.flatnonzero(arrives & kinds.is_event).tolist()
    return [int(kinds.numbers[i]) - kinds.first_event for i in indices if kinds.names[i] not in reported]


def within(watch: StepWatch, found: FoundStep, x: float, index: int) -> tuple[float, Floats]:
    """The time of a zero of a watched function within a step, by its index among them, and the state there: from the
    part x of the step on, by a step of its own up to there."""
    run, bound = watch.run, watch.run.bound
    step = bound.enforced.functions.scheme(run.method).step
    _, _, y, k, tolerance, p = bound.step.arguments
    slope = float(watch.inside(x)[1][index]) / found.taken
    tau, best = x * found.taken, math.inf
    for _ in range(REFINED):
        state = np.array(step(run.t, tau, y, k, tolerance, p)[0]).ravel()
        run.count(run.method.evaluations)
        values = watch.functions.watched(run.origin + run.t + tau, state, p)
        left = float(np.array(values).ravel()[index])
        if not abs(left) < best / 2 or slope == 0:
            break
        best = abs(left)
        correction = left / slope
        if abs(correction) <= 2 * math.ulp(run.t + tau) or not 0 < tau - correction < found.taken:
            break
        tau -= correction
    return run.t + tau, state


def crossed(
    watch: StepWatch, step: FoundStep, x: float, crossing: tuple[Indices, Floats]
) -> dict[int, float]:
    """The declared events, by their numbers, among functions that cross zero at the part x of a step, with what their
    values there may be: their noise, and what the rounding of the time makes. crossing: indices and noise (k,)."""
    run, kinds, (indices, noise) = watch.run, watch.functions.kinds, crossing
    chosen = kinds.is_event[indices]
    if not chosen.any():
        return {}
    slopes = np.abs(watch.inside(x)[1][indices]) / step.taken
    known = noise + TOUCHED * math.ulp(run.t + step.taken) * slopes
    return dict(zip(kinds.numbers[indices[chosen]].tolist(), known[chosen].tolist(), strict=True))
