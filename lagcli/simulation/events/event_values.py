"""The declared events where a run stands: their values, which of them jump over zero, and what is told of them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from lagcli.compiled.bound_function import BoundFunction
from lagcli.simulation.events.incident_log import IncidentLog, InstantLines
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]

# A function jumps over zero where it is this part of its size away from it on both sides.
JUMPED = 1e-12
DIRECTIONS = {"up": 1, "down": -1, "both": 0}


class EventValues:
    """All E events of a run; sizes, rounding (E,): of their values in the step behind, where it was looked at."""

    def __init__(self, run: Stepper, log: IncidentLog) -> None:
        self._run, self._log = run, log
        self._events = run.bound.held.integrals.system.model.events
        self.sizes = self.rounding = np.zeros(0)
        self._t = np.zeros(1)
        self._known: tuple[BoundStep, BoundFunction] | None = None

    def now(self) -> Floats:
        """`when` (E,) where the run stands."""
        run, bound = self._run, self._run.bound
        if not self._events:
            return np.zeros(0)
        if self._known is None or self._known[0] is not bound:
            self._known = bound, BoundFunction(bound.numeric.events_at, [self._t, bound.y, bound.p])
        values = self._known[1]
        self._t[0] = run.origin + run.t
        values.trigger()
        return values.results[0].copy()

    def jumped(self, before: Floats, after: Floats) -> list[int]:
        """The events that jump over zero in their direction, by their values before and after (E,)."""
        least = JUMPED * np.maximum(np.abs(before), np.abs(after))
        if self.sizes.size:
            least = np.maximum(least, np.maximum(JUMPED * self.sizes, self.rounding))
        ways = np.where((before < -least) & (after > least), 1, 0) - ((before > least) & (after < -least))
        wanted = [DIRECTIONS[event.direction] for event in self._events]
        return [i for i, (way, one) in enumerate(zip(ways, wanted, strict=True)) if way and one in (0, way)]

    def tell(self, numbers: Iterable[int], lines: InstantLines | None = None) -> None:
        """Tell of events where the run stands, with its own lines where there are no others; one that stops ends it."""
        for number in numbers:
            if lines is None:
                line = self._log.line()
                lines = InstantLines(line, line)
            event = self._events[number]
            self._log.tell("event", event.name, lines)
            if event.action == "stop":
                self._run.account.ended_by = event.name
