"""One-sided constraints and declared events as an `Event`: a step ends where a contact closes or would have to pull.

The functions that are watched are the gaps of open contacts, the multipliers of closed ones and `when` of declared
events. Where one crosses zero the step is taken again up to there, so that the instant has the accuracy of a step.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats, Indices
from lagcli.compiled import NumericSystem
from lagcli.contact import zero_search
from lagcli.simulation.closed_contacts.contact_instant import PARAMETERS
from lagcli.simulation.events import step_watch
from lagcli.simulation.events.contact_decision import ContactChanges, SwitchSide
from lagcli.simulation.events.event import Event, InstantLines, Screen
from lagcli.simulation.events.step_watch import EventSizes, SingularStepWatch, StateAhead, StepWatch
from lagcli.simulation.events.watch_functions import WatchFunctions
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme.step_tolerance import COARSE_WORK
from lagcli.simulation.stepping.found_step import Cut, FoundStep
from lagcli.simulation.stepping.grid import AT_END
from lagcli.simulation.stepping.stepper import Stepper

# Steps after an incident are at most so many times as long as the time from the one before it: what is watched in a
# step has the scale of these times.
LONGER = 16.0
# The state by which contacts are judged that are released lies behind the instant, by `step_watch.BESIDE` of a
# step; farther by this factor each time that it does not decide.
FARTHER = 4.0
# Rounding of a declared function, as a part of its values at the ends of a step; of a gap, of what it changes by.
NOISE = doubles.SUM
# A step is shortened to this part at the least. One in which a contact lets go soon is, to `FARTHER` of that time:
# what is no force beside those at the end of so long a step may be much there.
LEAST = 1e-3


class Met(NamedTuple):
    """What the watched functions meet in a step that was found.

    step: it, as it ends there; hits: numbers of rows, and of declared events after all rows, whose functions cross zero
    at its end, and ahead: a state beyond it, by which contacts are judged; extents: of gaps at its begin, as
    `ContactInstant.lowest` (K,), where they were looked at; sizes: of declared events in it, likewise.
    at_end: declared events at its end, where no search ends it; touched: those at zero at a switch, where they are
    decided; before: the near side of a switch of functions of t, beyond which the contacts are decided anew; crossed:
    declared events that cross zero in the step, with the rounding of their values.
    """

    step: FoundStep
    hits: tuple[int, ...] = ()
    ahead: StateAhead | None = None
    extents: Floats | None = None
    sizes: EventSizes | None = None
    at_end: tuple[int, ...] = ()
    touched: tuple[int, ...] = ()
    before: SwitchSide | None = None
    crossed: Mapping[int, float] = MappingProxyType({})


class ContactEvent(Event):
    """The zeros of the watched functions."""

    looks_ahead: bool = True
    keeps_stages: bool = True

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        self._system = stepper.bound.enforced.system
        self._changes = ContactChanges(stepper)
        self._functions: dict[NumericSystem, WatchFunctions] = {}
        self._watch: StepWatch | None = None
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
        run.note(last=run.t, unarmed=tuple(at_zero))
        run.settle()

    def screen(self) -> Screen | None:
        """See `Event`."""
        run = self._stepper

        def holds() -> bool:
            contacts = run.contacts
            return not (contacts.unarmed or contacts.again or contacts.ending)

        return Screen(self._current().functions.clear, holds)

    def found(self, step: FoundStep) -> Cut | None:
        """See `Event`."""
        run = self._stepper
        if step.is_still or step.singular_step is not None:
            return self._cut(self._met_at_switch(step) if step.is_still else self._met_across(step))
        watch, contacts = self._current(), run.contacts
        limit = min(t for _, t in contacts.ending) if contacts.ending else math.inf
        # What arrives at zero at the end of the run to rounding may look clear.
        is_last = step.reached == run.grid.end and bool(self._system.model.events)
        if watch.is_clear() and not contacts.unarmed and not is_last:
            if limit <= step.reached:
                return self._cut(Met(run.trial.again(step, limit)._replace(is_jump=True)))
            deeper = step._replace(deepest=watch.deepest) if watch.deepest > contacts.deepest else step
            return self._cut(Met(deeper)) if contacts.again else None if deeper is step else Cut(deeper)
        run.trial.make_dense()
        if hits := self._changes.sinking(step.taken):
            ahead = step_watch.ahead(run, step, step_watch.BESIDE * FARTHER**contacts.again)
            return self._cut(Met(step, hits, ahead), is_here=True)
        met = self._search(watch, step, (limit - run.t) / step.taken)
        if isinstance(met, Cut):
            return met
        if not met.hits and limit <= met.step.reached:
            # Rebounds of a contact come to their end.
            met = met._replace(step=run.trial.again(met.step, limit)._replace(is_jump=True))
        return self._cut(met)

    def _cut(self, met: Met, is_here: bool = False) -> Cut:
        """The step that ends at what is met, with what is to be done there; is_here: it is given up, for that is where
        the run stands."""
        if is_here:
            return Cut(None, partial(self._act, met, is_here))
        return Cut(met.step, partial(self._act, met), partial(self._changes.events.report, met.at_end))

    def _met_at_switch(self, step: FoundStep) -> Met:
        """What functions of t make jump at a switch: declared events, and walls, which may not. Forces, and velocities
        of walls, may: which contacts press is decided beyond it."""
        watch, met = self._current(), Met(step)
        before, after, crossed = watch.begin(), watch.end(step.reached), list[int]()
        if E := self._system.event_values.numel():
            sides, jumped = (before[-E:], after[-E:]), self._changes.events.jumped
            crossed, touched = step_watch.at_switch(watch, step, sides, jumped)
            first = watch.functions.kinds.first_event
            at_end, known = sorted({*jumped(*sides), *crossed}), (first + number for number in touched)
            met = met._replace(at_end=tuple(at_end), touched=tuple(known))
        if not self._system.contacts.count:
            return met
        self._changes.require_open(watch, step, after)
        events = before[before.size - E :].copy()
        side = SwitchSide(self._changes.log.line(), events, tuple(crossed))
        return met._replace(step=step._replace(is_jump=True), before=side)

    def _act(self, met: Met, is_here: bool = False) -> None:
        """Act where the run stands, at the end of a step or where one was given up."""
        run, changes, at_end = self._stepper, self._changes, met.at_end
        if is_here:
            run.note(again=run.contacts.again + 1)
        changes.log.is_switched = met.before is not None
        changes.events.known = met.sizes or changes.events.known
        if met.before is not None:
            at_end = tuple(changes.at_switch(met.before, met.step.taken, list(at_end)))
            run.settle()
        changes.events.report(at_end)
        if met.hits:
            changes.at(met.hits, met.ahead, met.step.taken, met.extents)
        elif run.contacts.ending and min(t for _, t in run.contacts.ending) <= run.t:
            changes.decision.end_series()
        elif run.contacts.again or run.contacts.unarmed or met.touched:
            run.note(again=0, unarmed=met.touched)
        elif not met.crossed:
            return
        if met.crossed:
            # Events that are at zero still, as where an impact follows at once, do not cross there again.
            watch = self._current()
            numbers, sizes = watch.functions.kinds.numbers.tolist(), np.abs(watch.begin()).tolist()
            values = dict(zip(numbers, sizes, strict=True))
            still = {number for number, noise in met.crossed.items() if values[number] <= noise}
            run.note(unarmed=tuple(sorted({*run.contacts.unarmed, *still})))
        run.settle()

    def _met_across(self, step: FoundStep) -> Met:
        """What a step across a singular configuration meets: it ends where a contact closes, or a stop event is."""
        run, watch, singular_step = self._stepper, self._current(), step.singular_step
        assert singular_step is not None, "there is a step across"
        kinds, curve = watch.functions.kinds, SingularStepWatch(watch.functions, run, singular_step)
        # Multipliers may have a pole at the instant: contacts that are released are looked for beside it.
        are_watched = kinds.is_event.copy()
        are_watched[: watch.is_open.size] = watch.is_open
        indices = np.flatnonzero(are_watched)
        rounding, extents = self._changes.noise(watch, step, np.arange(kinds.numbers.size))
        lift_off = step_watch.first_lift_off(curve, np.flatnonzero(~watch.is_open), rounding)
        noise = rounding[indices]
        sizes = np.minimum(*(np.abs(curve.inside(x)[0]) for x in (0.0, 1.0)))
        rounding = np.maximum(NOISE * sizes, watch.rounding(step))[indices]
        noise[kinds.is_event[indices]] = rounding[kinds.is_event[indices]]
        x, armed = 0.0, ~np.isin(kinds.numbers[indices], run.contacts.unarmed)
        limit = 1.0 if lift_off is None else lift_off.x
        while x < limit and indices.size:
            direction = kinds.direction[indices]
            crossing = step_watch.first_crossing(curve, indices, (x, limit), noise, direction, armed)
            if crossing.x is None:
                break
            x += crossing.x * (limit - x)
            rows = indices[list(crossing.rows)]
            if not kinds.records[rows].all():
                ended = curve.ended_at(step, x)
                if ended is None:
                    what = "a contact closes where a singular configuration is passed"
                    raise StepFailure(what, run_stop.CONTACT)
                return Met(ended, tuple(kinds.numbers[rows].tolist()), None, extents)
            armed = np.ones(indices.size, dtype=bool)
            armed[list(crossing.rows)] = False
            events = (curve.event(x, kinds.names[index], self._changes.log) for index in rows.tolist())
            step = step._replace(within=(*step.within, *events))
        if lift_off is None:
            return Met(step)
        hits = tuple(kinds.numbers[lift_off.indices].tolist())
        ended, ahead = curve.ended_at_lift_off(step, lift_off)
        return Met(ended, hits, ahead, extents)

    def _current(self) -> StepWatch:
        run = self._stepper
        if self._watch is None or self._watch.bound is not run.bound:
            numeric = run.bound.numeric
            if numeric.stepped not in self._functions:
                self._functions[numeric.stepped] = WatchFunctions(numeric, run.method, self._system)
            self._watch = StepWatch(self._functions[numeric.stepped], run)
        return self._watch

    def _search(self, watch: StepWatch, step: FoundStep, limit: float) -> Met | Cut:
        """The first incident that ends a step, up to a part of it, with the events before it that are recorded."""
        run, kinds = self._stepper, watch.functions.kinds
        indices = watch.doubtful()
        is_last = step.reached == run.grid.end
        if is_last and kinds.has_events:
            indices = np.union1d(indices, np.flatnonzero(kinds.is_event))
        noise, extents = self._changes.noise(watch, step, indices)
        if not indices.size:
            return Met(step)
        limit = min(limit, step.barrier.part if step.barrier is not None else 1.0)
        numbers = kinds.numbers[indices]
        noise, sizes = self._rounded(watch, step, limit, (indices, noise[indices]))
        met = Met(step, extents=extents, sizes=sizes)
        turned = kinds.direction[indices] if kinds.has_events else zero_search.DOWN
        unarmed = run.contacts.unarmed
        armed: npt.NDArray[np.bool_] | bool = ~np.isin(numbers, unarmed) if unarmed else True
        x = 0.0
        while x < limit:
            crossing = step_watch.first_crossing(watch, indices, (x, limit), noise, turned, armed)
            if crossing.unresolved:
                return met._replace(step=self._shortened(met.step, x + crossing.clear * (limit - x)))
            if crossing.x is None:
                if limit == 1.0 and is_last:
                    met = met._replace(at_end=tuple(step_watch.arriving(watch, met.step)))
                return met
            x += crossing.x * (limit - x)
            rows = list(crossing.rows)
            crossed = step_watch.crossed(watch, step, x, (indices[rows], noise[rows]))
            met = met._replace(crossed={**met.crossed, **crossed})
            if not kinds.records[indices[rows]].all():
                if LEAST < x < 0.5 / FARTHER and (~watch.are_gaps & ~kinds.is_event)[indices[rows]].any():
                    # What was met before a contact that soon lets go is met again in the shorter step.
                    shorter = self._shortened(step, FARTHER * x)
                    run.trial.make_dense()
                    return self._search(watch, shorter, 1.0)
                return self._met_at(watch, met, x, indices[rows])
            if run.t + x * step.taken > run.grid.end + AT_END * math.ulp(run.grid.end):
                # Of a look beyond the end: what is recorded there is nothing to this run, however much it is.
                return met
            armed = np.ones(indices.size, dtype=bool)
            armed[rows] = False
            log, events = self._changes.log, []
            for index in indices[rows].tolist():
                t, state = step_watch.within(watch, step, x, index)
                line = log.line_of(t, state)
                events.append(log.incident(t, "event", kinds.names[index], InstantLines(line, line)))
            met = met._replace(step=met.step._replace(within=(*met.step.within, *events)))
        return met

    def _rounded(
        self, watch: StepWatch, step: FoundStep, limit: float, asked: tuple[Indices, Floats]
    ) -> tuple[Floats, EventSizes | None]:
        """The noise of some functions, by their indices (k,) and the noise of what they are made of, in a step up to a
        part of it; and the sizes of declared events, if any is among them. Raises `StepFailure` where a closed contact
        pulls at its begin."""
        kinds, (indices, noise) = watch.functions.kinds, asked
        begin, end = (watch.inside(x)[0].copy() for x in (0.0, limit))
        bound = self._stepper.bound
        pulling = kinds.numbers[indices[begin[indices] < -PARAMETERS.clearly * noise]].tolist()
        rows, closed = self._system.multiplier_rows, set(bound.numeric.closed_rows)
        if names := [rows[number].name for number in pulling if number in closed]:
            # No row is made of that, whatever has closed it.
            raise step_watch.pulls(names)
        # The dense output has the rounding of what changes in the step, be there no size and no speed at its begin.
        gaps = watch.are_gaps[indices]
        moved = NOISE * np.abs(end - begin)[indices]
        noise[gaps] = np.maximum(noise, np.where(np.isfinite(moved), moved, 0.0))[gaps]
        is_event = kinds.is_event[indices]
        if not is_event.any():
            return noise, None
        begin, end = np.abs(begin), np.abs(end)
        # A function may grow beyond all bounds within the step, whose rounding says nothing of its zeros.
        rounding = np.maximum(NOISE * np.minimum(begin, end), watch.rounding(step))
        noise[is_event] = rounding[indices][is_event]
        return noise, EventSizes(np.maximum(begin, end)[kinds.is_event], rounding[kinds.is_event])

    def _shortened(self, step: FoundStep, x: float) -> FoundStep:
        """The step ended before what cannot be told apart in it."""
        run = self._stepper
        if x < LEAST:
            raise StepFailure(self._changes.unresolved(), run_stop.CONTACT)
        shorter = run.trial.again(step, run.t + x * step.taken)
        return shorter._replace(proposed=min(step.proposed, shorter.taken))

    def _met_at(self, watch: StepWatch, met: Met, x: float, rows: Indices) -> Met | Cut:
        """The step ended where watched functions cross zero."""
        run, step, bound = self._stepper, met.step, self._stepper.bound
        slopes = watch.inside(x)[1][rows] / step.taken
        beyond = min(1.0, x + step_watch.BESIDE * FARTHER**run.contacts.again)
        hits = tuple(watch.functions.kinds.numbers[rows].tolist())
        met = met._replace(ahead=step_watch.ahead(run, step, beyond), hits=hits)
        steepest = int(np.argmax(np.abs(slopes)))
        index, slope = int(rows[steepest]), float(slopes[steepest])
        tau, best = float(x) * step.taken, math.inf
        for _ in range(step_watch.REFINED):
            reached = run.t + tau
            if not reached > run.t:
                return self._cut(met, is_here=True)
            step = run.trial.again(step, reached)
            left = float(watch.end(reached)[index])
            if not abs(left) < best / 2 or slope == 0:
                break
            best = abs(left)
            correction = left / slope
            if abs(correction) <= 2 * math.ulp(reached) or abs(correction) > 0.1 * tau:
                break
            tau -= correction
        end = run.grid.end
        if step.reached != end and abs(step.reached - end) <= AT_END * math.ulp(end):
            # It is at the end of the run, to rounding.
            step = run.trial.again(step, end)
        if bound.status[7] > COARSE_WORK:
            step = run.trial.with_work(step)
        proposed = min(step.proposed, LONGER * (step.reached - run.contacts.last))
        return met._replace(step=step._replace(is_jump=True, proposed=proposed))
