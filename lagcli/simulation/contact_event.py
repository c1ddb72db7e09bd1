"""One-sided constraints and declared events as an `Event`: a step ends where a contact closes or would have to pull.

The functions that are watched are the gaps of open contacts, the multipliers of closed ones and `when` of declared
events. Where one crosses zero the step is taken again up to there, so that the instant has the accuracy of a step.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Self

import numpy as np
import numpy.typing as npt

from lagcli.contact import zero_search
from lagcli.contact.zero_search import FirstCrossing
from lagcli.simulation import run_stop
from lagcli.simulation.contact_changes import ContactChanges
from lagcli.simulation.event import Event
from lagcli.simulation.incident import Incident
from lagcli.simulation.run_stop import StepFailure
from lagcli.simulation.step_watch import StepWatch
from lagcli.simulation.stepper import Stepper
from lagcli.simulation.watch_functions import WatchFunctions
from lagcli.simulation.work_integral import COARSE

Floats = npt.NDArray[np.float64]

# Steps after an incident are at most so many times as long as the time from the one before it: what is watched in a
# step has the scale of these times.
LONGER = 16.0
# The state by which contacts are judged that are released lies by this part of a step behind the instant.
BEYOND = 1e-5
# Newton steps for the instant; rounding of a declared function, as a part of its values at the ends of a step.
REFINED, NOISE = 4, 64 * float(np.finfo(float).eps)
DIRECTIONS = {"up": zero_search.UP, "down": zero_search.DOWN, "both": zero_search.BOTH}


class ContactEvent(Event):
    """The zeros of the watched functions."""

    looks_ahead: bool = True

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        self._system = stepper.bound.held.integrals.system
        self._changes = ContactChanges(stepper)
        self._functions: dict[object, WatchFunctions] = {}
        self._watch: StepWatch | None = None
        # Of the step that was found: functions that cross zero at its end, a state beyond it, events within it.
        self._hits: tuple[int, ...] = ()
        self._ahead: tuple[float, Floats] | None = None
        self._within: list[Incident] = []

    @classmethod
    def of(cls, stepper: Stepper) -> Self | None:
        """See `Event`."""
        system = stepper.bound.held.integrals.system
        return cls(stepper) if system.contacts.count or system.event_values.numel() else None

    def begin(self) -> None:
        """See `Event`."""
        run = self._stepper
        if self._system.contacts.count:
            self._changes.begin()
        w = self._current().begin()
        events = self._system.event_values.numel()
        first = len(self._system.multiplier_rows)
        at_zero = np.flatnonzero(w[w.size - events :] == 0) if events else ()
        run.contacts = dataclasses.replace(
            run.contacts, last=run.t, unarmed=tuple(first + int(e) for e in at_zero)
        )
        run.settle()

    def cut(self) -> None:
        """See `Event`."""
        run, found = self._stepper, self._stepper.found
        self._hits, self._ahead, self._within = (), None, []
        if found.is_still or not found.is_open:
            return
        if found.passage is not None:
            self._changes.require_clear(found.passage)
            return
        watch = self._current()
        limit = min((t for _, t in run.contacts.ending), default=math.inf)
        if watch.is_clear() and not run.contacts.unarmed:
            if limit <= found.reached:
                self._end_series_at(limit)
            elif watch.deepest > run.contacts.deepest:
                run.contacts = dataclasses.replace(run.contacts, deepest=watch.deepest)
                run.account.largest_penetration = watch.deepest
            return
        if not found.has_dense:
            run.bound.staged.trigger()
            run.account.evaluations += run.method.evaluations
            run.make_dense()
        self._search(watch, (limit - run.t) / found.taken)
        if not self._hits and limit <= found.reached:
            self._end_series_at(limit)

    def _end_series_at(self, t: float) -> None:
        """End the step at a time at which rebounds of a contact come to their end."""
        run, found = self._stepper, self._stepper.found
        found.reached, found.taken, found.has_dense, found.work = t, t - run.t, False, None
        run.bound.h[0] = found.taken
        run.bound.staged.trigger()
        run.account.evaluations += run.method.evaluations
        found.is_jump, found.barrier = True, None

    def act(self) -> None:
        """See `Event`."""
        run = self._stepper
        for incident in self._within:
            run.account.add(incident)
        hits, self._hits, self._within = self._hits, (), []
        if hits:
            self._changes.at(hits, self._ahead)
        elif run.contacts.ending and min(t for _, t in run.contacts.ending) <= run.t:
            self._changes.end_series()
        elif run.contacts.again or run.contacts.unarmed:
            run.contacts = dataclasses.replace(run.contacts, again=0, unarmed=())
        else:
            return
        run.settle()

    def _current(self) -> StepWatch:
        run = self._stepper
        if self._watch is None or not self._watch.is_of(run):
            selection = run.bound.held.integrals.selection, run.bound.held.levels
            if selection not in self._functions:
                count = len(self._system.rows.rows), self._system.contacts.count
                self._functions[selection] = WatchFunctions(run.bound.numeric, run.method, count)
            self._watch = StepWatch(self._functions[selection], run)
        return self._watch

    def _numbers(self, watch: StepWatch) -> list[int]:
        """The numbers of the watched functions: of their rows, and of events after all rows."""
        C, functions = len(self._system.rows.rows), watch.functions
        first = C + self._system.contacts.count
        events = range(first, first + self._system.event_values.numel())
        return [*(C + j for j in functions.open_), *(C + j for j in functions.closed), *events]

    def _search(self, watch: StepWatch, limit: float) -> None:
        """Find the first incident that ends the step, and the events before it that are recorded."""
        run, found = self._stepper, self._stepper.found
        numbers = np.array(self._numbers(watch))
        first = len(self._system.multiplier_rows)
        events = self._system.model.events
        direction = np.full(numbers.size, zero_search.DOWN)
        records = np.zeros(numbers.size, dtype=bool)
        for place in np.flatnonzero(numbers >= first):
            event = events[int(numbers[place]) - first]
            direction[place] = DIRECTIONS[event.direction]
            records[place] = event.action == "record"
        armed = ~np.isin(numbers, run.contacts.unarmed)
        limit = min(limit, found.barrier.part if found.barrier is not None else 1.0)
        begin, end = watch.inside(0.0)[0], watch.inside(limit)[0]
        noise = self._noise(watch, numbers, np.maximum(np.abs(begin), np.abs(end)))
        x = 0.0
        while x < limit:
            crossing = self._crossing(watch, (x, limit), noise, direction, armed)
            if crossing.x is None:
                return
            x += crossing.x * (limit - x)
            rows = list(crossing.rows)
            armed = np.ones(numbers.size, dtype=bool)
            armed[rows] = False
            if not records[rows].all():
                self._end_at(watch, x, rows, numbers)
                return
            self._within += [self._event(watch, x, events[int(numbers[i]) - first].name) for i in rows]

    def _crossing(
        self,
        watch: StepWatch,
        span: tuple[float, float],
        noise: Floats,
        direction: npt.ArrayLike,
        armed: npt.ArrayLike,
    ) -> FirstCrossing:
        begin, width = span[0], span[1] - span[0]

        def values(u: float) -> tuple[Floats, Floats]:
            w, slope = watch.inside(begin + u * width)
            return w, slope * width

        crossing = zero_search.first_crossing(values, noise, direction, armed)
        if crossing.unresolved:
            raise StepFailure(self._changes.unresolved(), run_stop.CONTACT)
        return crossing

    def _noise(self, watch: StepWatch, numbers: npt.NDArray[np.int_], largest: Floats) -> Floats:
        C, K = len(self._system.rows.rows), self._system.contacts.count
        noise = NOISE * largest
        contacts = numbers < C + K
        if K:
            is_closed = np.isin(numbers - C, watch.functions.closed) & contacts
            gaps, forces = self._changes.noises()
            noise[contacts] = np.where(is_closed, forces[(numbers - C) % K], gaps[(numbers - C) % K])[
                contacts
            ]
        return noise

    def _event(self, watch: StepWatch, x: float, name: str) -> Incident:
        run, rows = self._stepper, self._stepper.rows
        t = float(run.origin + run.t + x * run.found.taken)
        rows.at[0], rows.x[0] = t, x
        rows.inside.trigger()
        line = self._changes.row_of(rows.line)
        return Incident(t, "event", name, np.zeros(len(self._system.multiplier_rows)), line, line)

    def _end_at(self, watch: StepWatch, x: float, rows: list[int], numbers: npt.NDArray[np.int_]) -> None:
        """End the step where watched functions cross zero."""
        run, found, bound = self._stepper, self._stepper.found, self._stepper.bound
        taken, beyond = found.taken, min(1.0, x + BEYOND)
        slope = watch.inside(x)[1] / taken
        begin, coefficients = bound.y[:, None], run.rows.dense.results[0][:, :, None]
        ahead = np.asarray(run.method.interpolated(begin, coefficients, np.array([beyond]))).ravel()
        self._ahead = run.t + beyond * taken, ahead
        self._hits = tuple(int(n) for n in numbers[rows])
        found.barrier = None
        place = rows[int(np.argmax(np.abs(slope[rows])))]
        tau, best = float(x) * taken, math.inf
        for _ in range(REFINED):
            reached = run.t + tau
            if not reached > run.t:
                # It is here: the step is given up.
                found.is_open = False
                run.account.steps -= 1
                run.contacts = dataclasses.replace(run.contacts, again=run.contacts.again + 1)
                self.act()
                return
            bound.h[0] = found.taken = reached - run.t
            found.reached, found.has_dense, found.work = reached, False, None
            bound.staged.trigger()
            run.account.evaluations += run.method.evaluations
            left = float(watch.end(reached)[place])
            if not abs(left) < best / 2 or slope[place] == 0:
                break
            best = abs(left)
            correction = left / float(slope[place])
            if abs(correction) <= 2 * math.ulp(reached) or abs(correction) > 0.1 * tau:
                break
            tau -= correction
        if bound.outcome[7] > COARSE and run.account.is_balanced:
            run.find_work(found.taken)
        found.is_jump = True
        found.proposed = min(found.proposed, LONGER * (found.reached - run.contacts.last))
