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
from lagcli.simulation import run_stop, step_again
from lagcli.simulation.contact_changes import ContactChanges
from lagcli.simulation.event import Event
from lagcli.simulation.incident import Incident
from lagcli.simulation.run_stop import StepFailure
from lagcli.simulation.state_ahead import Ahead
from lagcli.simulation.step_watch import StepWatch
from lagcli.simulation.stepper import Stepper
from lagcli.simulation.watch_functions import WatchFunctions
from lagcli.simulation.watch_kinds import WatchKinds
from lagcli.simulation.work_integral import COARSE

Floats = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

# Steps after an incident are at most so many times as long as the time from the one before it: what is watched in a
# step has the scale of these times.
LONGER = 16.0
# The state by which contacts are judged that are released lies by this part of a step behind the instant.
BEYOND = 1e-5
# Newton steps for the instant; rounding of a declared function, as a part of its values at the ends of a step.
REFINED, NOISE = 4, 64 * float(np.finfo(float).eps)


class ContactEvent(Event):
    """The zeros of the watched functions."""

    looks_ahead: bool = True

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        self._system = stepper.bound.held.integrals.system
        self._changes = ContactChanges(stepper)
        stepper.found.keeps_stages = True
        self._functions: dict[object, WatchFunctions] = {}
        self._kinds_of: dict[WatchFunctions, WatchKinds] = {}
        self._watch: StepWatch | None = None
        # Of the step that was found: functions that cross zero at its end, a state beyond it, events within it.
        self._hits: tuple[int, ...] = ()
        self._ahead: Ahead | None = None
        self._within: list[Incident] = []
        self._current()

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
        watch, at_zero = self._current(), ()
        kinds = self._kinds(watch)
        if kinds.has_events:
            at_zero = kinds.numbers[(watch.begin() == 0) & (kinds.numbers >= kinds.first_event)].tolist()
        run.contacts = dataclasses.replace(run.contacts, last=run.t, unarmed=tuple(at_zero))
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
        ending = run.contacts.ending
        limit = min(t for _, t in ending) if ending else math.inf
        if watch.is_clear() and not run.contacts.unarmed:
            if limit <= found.reached:
                self._end_series_at(limit)
            elif watch.deepest > run.contacts.deepest:
                run.contacts = dataclasses.replace(run.contacts, deepest=watch.deepest)
                run.account.largest_penetration = watch.deepest
            return
        run.make_dense()
        self._search(watch, (limit - run.t) / found.taken)
        if not self._hits and limit <= found.reached:
            self._end_series_at(limit)

    def _end_series_at(self, t: float) -> None:
        """End the step at a time at which rebounds of a contact come to their end."""
        step_again.up_to(self._stepper, t)
        self._stepper.found.is_jump, self._stepper.found.barrier = True, None

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

    def _kinds(self, watch: StepWatch) -> WatchKinds:
        functions = watch.functions
        if functions not in self._kinds_of:
            self._kinds_of[functions] = WatchKinds(self._system, functions.open_, functions.closed)
        return self._kinds_of[functions]

    def _search(self, watch: StepWatch, limit: float) -> None:
        """Find the first incident that ends the step, and the events before it that are recorded."""
        run, found, kinds = self._stepper, self._stepper.found, self._kinds(watch)
        places = watch.doubtful()
        noise = self._noise(watch, kinds)[places]
        numbers = kinds.numbers[places]
        limit = min(limit, found.barrier.part if found.barrier is not None else 1.0)
        if not places.size:
            return
        if kinds.has_events:
            begin, end = (np.abs(watch.inside(x)[0][places]) for x in (0.0, limit))
            is_event = numbers >= kinds.first_event
            noise[is_event] = NOISE * np.maximum(begin, end)[is_event]
        turned = kinds.direction[places] if kinds.has_events else zero_search.DOWN
        unarmed = run.contacts.unarmed
        armed: npt.NDArray[np.bool_] | bool = ~np.isin(numbers, unarmed) if unarmed else True
        x = 0.0
        while x < limit:
            crossing = self._crossing(watch, places, (x, limit), (noise, turned, armed))
            if crossing.x is None:
                return
            x += crossing.x * (limit - x)
            rows = list(crossing.rows)
            if not kinds.records[places[rows]].all():
                self._end_at(watch, x, places[rows], kinds)
                return
            armed = np.ones(places.size, dtype=bool)
            armed[rows] = False
            self._within += [self._event(x, kinds.names[place]) for place in places[rows].tolist()]

    def _crossing(
        self,
        watch: StepWatch,
        places: Places,
        span: tuple[float, float],
        asked: tuple[Floats, npt.ArrayLike, npt.ArrayLike],
    ) -> FirstCrossing:
        """The first of some functions to cross; asked: noise, direction and armed as `zero_search` takes them."""
        begin, width = span[0], span[1] - span[0]

        def values(u: float) -> tuple[Floats, Floats]:
            w, slope = watch.inside(begin + u * width)
            return w[places], slope[places] * width

        crossing = zero_search.first_crossing(values, *asked)
        if crossing.unresolved:
            raise StepFailure(self._changes.unresolved(), run_stop.CONTACT)
        return crossing

    def _noise(self, watch: StepWatch, kinds: WatchKinds) -> Floats:
        """Of gaps and multipliers that are watched, and room for that of events (W,)."""
        noise = np.zeros(kinds.numbers.size)
        if self._system.contacts.count:
            gaps, forces = self._changes.noises()
            functions = watch.functions
            noise[: len(functions.open_)] = gaps[functions.open_]
            if functions.closed:
                noise[len(functions.open_) :][: len(functions.closed)] = forces[functions.closed]
        return noise

    def _event(self, x: float, name: str) -> Incident:
        run, rows = self._stepper, self._stepper.rows
        t = float(run.origin + run.t + x * run.found.taken)
        rows.at[0], rows.x[0] = t, x
        rows.inside.trigger()
        line = self._changes.row_of(rows.line)
        return Incident(t, "event", name, np.zeros(len(self._system.multiplier_rows)), line, line)

    def _end_at(self, watch: StepWatch, x: float, rows: Places, kinds: WatchKinds) -> None:
        """End the step where watched functions cross zero."""
        run, found, bound = self._stepper, self._stepper.found, self._stepper.bound
        taken = found.taken
        slopes = watch.inside(x)[1][rows] / taken
        self._ahead = Ahead(run, min(1.0, x + BEYOND))
        self._hits = tuple(kinds.numbers[rows].tolist())
        found.barrier = None
        steepest = int(np.argmax(np.abs(slopes)))
        place, slope = int(rows[steepest]), float(slopes[steepest])
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
            step_again.up_to(run, reached)
            left = float(watch.end(reached)[place])
            if not abs(left) < best / 2 or slope == 0:
                break
            best = abs(left)
            correction = left / slope
            if abs(correction) <= 2 * math.ulp(reached) or abs(correction) > 0.1 * tau:
                break
            tau -= correction
        if bound.outcome[7] > COARSE and run.account.is_balanced:
            run.find_work(found.taken)
        found.is_jump = True
        found.proposed = min(found.proposed, LONGER * (found.reached - run.contacts.last))
