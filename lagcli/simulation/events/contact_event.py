"""One-sided constraints and declared events as an `Event`: a step ends where a contact closes or would have to pull.

The functions that are watched are the gaps of open contacts, the multipliers of closed ones and `when` of declared
events. Where one crosses zero the step is taken again up to there, so that the instant has the accuracy of a step.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.contact import zero_search
from lagcli.contact.zero_search import FirstCrossing
from lagcli.simulation.closed_contacts.contact_instant import PARAMETERS
from lagcli.simulation.events import declared_events, singular_step_watch, step_watch
from lagcli.simulation.events.contact_changes import ContactChanges, SwitchSide
from lagcli.simulation.events.event import Event
from lagcli.simulation.events.incident_log import InstantLines
from lagcli.simulation.events.singular_step_watch import SingularStepWatch
from lagcli.simulation.events.step_watch import Ahead, StateAhead, StepWatch
from lagcli.simulation.events.watch_functions import WatchFunctions
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.incident import Incident
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme.step_tolerance import COARSE_WORK
from lagcli.simulation.singularity.singularity_step import SingularStep
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

# Steps after an incident are at most so many times as long as the time from the one before it: what is watched in a
# step has the scale of these times.
LONGER = 16.0
# The state by which contacts are judged that are released lies by this part of a step behind the instant; farther by
# this factor each time that it does not decide.
BEYOND, FARTHER = 1e-5, 4.0
# Rounding of a declared function, as a part of its values at the ends of a step; of a gap, of what it changes by.
NOISE = 64 * float(np.finfo(float).eps)
# A step is shortened to this part at the least. One in which a contact lets go soon is, to `FARTHER` of that time:
# what is no force beside those at the end of so long a step may be much there.
LEAST = 1e-3


class ContactEvent(Event):
    """The zeros of the watched functions."""

    looks_ahead: bool = True

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        self._system = stepper.bound.enforced.system
        self._changes = ContactChanges(stepper)
        stepper.found.keeps_stages = True
        self._functions: dict[NumericSystem, WatchFunctions] = {}
        self._watch: StepWatch | None = None
        # Of the step that was found: functions that cross zero at its end, a state beyond it.
        self._hits: tuple[int, ...] = ()
        self._ahead: StateAhead | None = None
        # Declared events at its end, where no search ends it, and those at zero at a switch, where they are decided.
        self._at_end, self._touched = list[int](), list[int]()
        # The near side of a switch of functions of t, beyond which the contacts are decided anew.
        self._before: SwitchSide | None = None
        # Declared events that cross zero in the step, with the rounding of their values.
        self._crossed: dict[int, float] = {}
        self._current()

    def begin(self) -> None:
        """See `Event`."""
        run = self._stepper
        if self._system.contacts.count:
            self._changes.begin()
        watch, at_zero = self._current(), ()
        kinds = watch.functions.kinds
        if kinds.has_events:
            at_zero = kinds.numbers[(watch.begin() == 0) & (kinds.numbers >= kinds.first_event)].tolist()
        run.contacts = dataclasses.replace(run.contacts, last=run.t, unarmed=tuple(at_zero))
        run.settle()

    def cut(self) -> None:
        """See `Event`."""
        run, found = self._stepper, self._stepper.found
        self._hits, self._ahead, self._at_end, self._crossed = (), None, [], {}
        self._before = None
        if not found.is_open:
            return
        if found.is_still:
            self._switch()
            return
        if found.singular_step is not None:
            self._cross(found.singular_step)
            return
        watch = self._current()
        ending = run.contacts.ending
        limit = min(t for _, t in ending) if ending else math.inf
        # What arrives at zero at the end of the run to rounding may look clear.
        is_last = found.reached == run.grid.end and bool(self._system.model.events)
        if watch.is_clear() and not run.contacts.unarmed and not is_last:
            if limit <= found.reached:
                self._end_series_at(limit)
            elif watch.deepest > run.contacts.deepest:
                run.contacts = dataclasses.replace(run.contacts, deepest=watch.deepest)
            return
        run.make_dense()
        self._hits = self._changes.sinking()
        if self._hits:
            self._ahead = Ahead(run, BEYOND * FARTHER**run.contacts.again)
            self._act_here()
            return
        self._search(watch, (limit - run.t) / found.taken)
        if not self._hits and limit <= found.reached:
            self._end_series_at(limit)

    def _switch(self) -> None:
        """Look at what functions of t make jump at a switch: declared events, and walls, which may not.

        Forces, and velocities of walls, may: which contacts press is decided beyond it.
        """
        run, watch = self._stepper, self._current()
        before, after, crossed = watch.begin(), watch.end(run.found.reached), list[int]()
        if E := self._system.event_values.numel():
            sides = before[-E:], after[-E:]
            crossed, touched = declared_events.at_switch(watch, sides, self._changes.events.jumped)
            self._at_end = sorted({*self._changes.events.jumped(*sides), *crossed})
            self._touched = [watch.functions.kinds.first_event + number for number in touched]
        if self._system.contacts.count:
            self._changes.require_open(watch, after)
            self._before = SwitchSide(
                self._changes.log.line(), before[before.size - E :].copy(), tuple(crossed)
            )
            run.found.is_jump = True

    def _end_series_at(self, t: float) -> None:
        """End the step at a time at which rebounds of a contact come to their end."""
        step_watch.take_again(self._stepper, t)
        self._stepper.found.is_jump, self._stepper.found.barrier = True, None

    def end(self) -> None:
        """See `Event`."""
        at_end, self._at_end = self._at_end, []
        if at_end:
            self._changes.events.report(at_end)

    def act(self) -> None:
        """See `Event`."""
        run = self._stepper
        self._changes.log.is_switched = self._before is not None
        if self._before is not None:
            self._at_end = self._changes.at_switch(self._before, self._at_end)
            run.settle()
        self.end()
        hits, self._hits = self._hits, ()
        crossed, self._crossed = self._crossed, {}
        if hits:
            self._changes.at(hits, self._ahead)
        elif run.contacts.ending and min(t for _, t in run.contacts.ending) <= run.t:
            self._changes.end_series()
        elif run.contacts.again or run.contacts.unarmed or self._touched:
            run.contacts = dataclasses.replace(run.contacts, again=0, unarmed=tuple(self._touched))
            self._touched = []
        elif not crossed:
            return
        if crossed:
            watch = self._current()
            unarmed = {*run.contacts.unarmed, *declared_events.still(watch, crossed)}
            run.contacts = dataclasses.replace(run.contacts, unarmed=tuple(sorted(unarmed)))
        run.settle()

    def _cross(self, singular_step: SingularStep) -> None:
        """Look at the step across a singular configuration: it ends where a contact closes, or a stop event is."""
        run, found, watch = self._stepper, self._stepper.found, self._current()
        kinds, curve = watch.functions.kinds, SingularStepWatch(watch.functions, run, singular_step)
        # Multipliers may have a pole at the instant: contacts that are released are looked for beside it.
        are_watched = kinds.is_event.copy()
        are_watched[: watch.is_open.size] = watch.is_open
        indices = np.flatnonzero(are_watched)
        rounding = self._changes.noise(watch)
        lift_off = singular_step_watch.first_lift_off(curve, np.flatnonzero(~watch.is_open), rounding)
        noise = rounding[indices]
        sizes = np.minimum(*(np.abs(curve.inside(x)[0]) for x in (0.0, 1.0)))
        rounding = np.maximum(NOISE * sizes, watch.rounding())[indices]
        noise[kinds.is_event[indices]] = rounding[kinds.is_event[indices]]
        x, armed = 0.0, ~np.isin(kinds.numbers[indices], run.contacts.unarmed)
        limit = 1.0 if lift_off is None else lift_off.x
        while x < limit and indices.size:
            crossing = self._crossing(curve, indices, (x, limit), (noise, kinds.direction[indices], armed))
            if crossing.x is None:
                break
            x += crossing.x * (limit - x)
            rows = indices[list(crossing.rows)]
            if not kinds.records[rows].all():
                self._hits, self._ahead = tuple(kinds.numbers[rows].tolist()), None
                if not curve.end_at(x):
                    raise StepFailure(
                        "a contact closes where a singular configuration is passed", run_stop.CONTACT
                    )
                return
            armed = np.ones(indices.size, dtype=bool)
            armed[list(crossing.rows)] = False
            for index in rows.tolist():
                found.within.append(curve.event(x, kinds.names[index], self._changes.log))
        if lift_off is not None:
            self._hits, self._ahead = (
                tuple(kinds.numbers[lift_off.indices].tolist()),
                singular_step_watch.end_at_lift_off(curve, lift_off),
            )

    def _current(self) -> StepWatch:
        run = self._stepper
        if self._watch is None or not self._watch.is_of(run):
            numeric = run.bound.numeric
            if numeric.stepped not in self._functions:
                self._functions[numeric.stepped] = WatchFunctions(numeric, run.method, self._system)
            self._watch = StepWatch(self._functions[numeric.stepped], run)
        return self._watch

    def _search(self, watch: StepWatch, limit: float) -> None:
        """Find the first incident that ends the step, and the events before it that are recorded."""
        run, found, kinds = self._stepper, self._stepper.found, watch.functions.kinds
        indices = watch.doubtful()
        is_last = found.reached == run.grid.end
        if is_last and kinds.has_events:
            indices = np.union1d(indices, np.flatnonzero(kinds.is_event))
        noise = self._changes.noise(watch)[indices]
        numbers = kinds.numbers[indices]
        limit = min(limit, found.barrier.part if found.barrier is not None else 1.0)
        if not indices.size:
            return
        begin, end = (watch.inside(x)[0].copy() for x in (0.0, limit))
        step_watch.require_pushes(watch, indices[begin[indices] < -PARAMETERS.clearly * noise])
        # The dense output has the rounding of what changes in the step, be there no size and no speed at its begin.
        gaps = watch.are_gaps[indices]
        moved = NOISE * np.abs(end - begin)[indices]
        noise[gaps] = np.maximum(noise, np.where(np.isfinite(moved), moved, 0.0))[gaps]
        if kinds.is_event[indices].any():
            begin, end = np.abs(begin), np.abs(end)
            sizes, is_event = np.maximum(begin, end), kinds.is_event[indices]
            # A function may grow beyond all bounds within the step, whose rounding says nothing of its zeros.
            rounding = np.maximum(NOISE * np.minimum(begin, end), watch.rounding())
            noise[is_event] = rounding[indices][is_event]
            reported = self._changes.events
            reported.sizes, reported.rounding = sizes[kinds.is_event], rounding[kinds.is_event]
        turned = kinds.direction[indices] if kinds.has_events else zero_search.DOWN
        unarmed = run.contacts.unarmed
        armed: npt.NDArray[np.bool_] | bool = ~np.isin(numbers, unarmed) if unarmed else True
        x = 0.0
        while x < limit:
            crossing = self._crossing(watch, indices, (x, limit), (noise, turned, armed))
            if crossing.unresolved:
                self._shorten(x + crossing.clear * (limit - x))
                return
            if crossing.x is None:
                if limit == 1.0 and is_last:
                    self._at_end = declared_events.arriving(watch)
                return
            x += crossing.x * (limit - x)
            rows = list(crossing.rows)
            self._crossed |= declared_events.crossed(watch, x, (indices[rows], noise[rows]))
            if not kinds.records[indices[rows]].all():
                self._end_at(watch, x, indices[rows])
                return
            if run.t + x * found.taken > run.grid.end + declared_events.AT_END * math.ulp(run.grid.end):
                # Of a look beyond the end: what is recorded there is nothing to this run, however much it is.
                return
            armed = np.ones(indices.size, dtype=bool)
            armed[rows] = False
            found.within += [
                self._event(watch, x, index, kinds.names[index]) for index in indices[rows].tolist()
            ]

    def _crossing(
        self,
        watch: StepWatch | SingularStepWatch,
        indices: Indices,
        span: tuple[float, float],
        asked: tuple[Floats, npt.ArrayLike, npt.ArrayLike],
    ) -> FirstCrossing:
        """The first of some functions to cross; asked: noise, direction and armed as `zero_search` takes them."""
        begin, width = span[0], span[1] - span[0]

        def values(u: float) -> tuple[Floats, Floats]:
            w, slope = watch.inside(begin + u * width)
            return w[indices], slope[indices] * width

        return zero_search.first_crossing(values, *asked)

    def _shorten(self, x: float) -> None:
        """End the step before what cannot be told apart in it."""
        run, found = self._stepper, self._stepper.found
        if x < LEAST:
            raise StepFailure(self._changes.unresolved(), run_stop.CONTACT)
        step_watch.take_again(run, run.t + x * found.taken)
        found.barrier, found.proposed = None, min(found.proposed, found.taken)

    def _event(self, watch: StepWatch, x: float, index: int, name: str) -> Incident:
        t, state = declared_events.within(watch, x, index)
        line = self._changes.log.line_of(t, state)
        return self._changes.log.incident(t, "event", name, InstantLines(line, line))

    def _act_here(self) -> None:
        """Give up the step, for what it meets is where the run stands."""
        run = self._stepper
        run.found.is_open = False
        run.statistics.steps -= 1
        run.contacts = dataclasses.replace(run.contacts, again=run.contacts.again + 1)
        self.act()

    def _end_at(self, watch: StepWatch, x: float, rows: Indices) -> None:
        """End the step where watched functions cross zero."""
        run, found, bound = self._stepper, self._stepper.found, self._stepper.bound
        if LEAST < x < 0.5 / FARTHER and (~watch.are_gaps & ~watch.functions.kinds.is_event)[rows].any():
            self._shorten(FARTHER * x)
            run.make_dense()
            self._search(watch, 1.0)
            return
        taken, found.barrier = found.taken, None
        slopes = watch.inside(x)[1][rows] / taken
        self._ahead = Ahead(run, min(1.0, x + BEYOND * FARTHER**run.contacts.again))
        self._hits = tuple(watch.functions.kinds.numbers[rows].tolist())
        steepest = int(np.argmax(np.abs(slopes)))
        index, slope = int(rows[steepest]), float(slopes[steepest])
        tau, best = float(x) * taken, math.inf
        for _ in range(declared_events.REFINED):
            reached = run.t + tau
            if not reached > run.t:
                self._act_here()
                return
            step_watch.take_again(run, reached)
            left = float(watch.end(reached)[index])
            if not abs(left) < best / 2 or slope == 0:
                break
            best = abs(left)
            correction = left / slope
            if abs(correction) <= 2 * math.ulp(reached) or abs(correction) > 0.1 * tau:
                break
            tau -= correction
        end = run.grid.end
        if found.reached != end and abs(found.reached - end) <= declared_events.AT_END * math.ulp(end):
            # It is at the end of the run, to rounding.
            step_watch.take_again(run, end)
        if bound.status[7] > COARSE_WORK and run.statistics.is_balanced:
            run.find_work(found.taken)
        found.is_jump = True
        found.proposed = min(found.proposed, LONGER * (found.reached - run.contacts.last))
