"""The step that a run has just found: the watched functions on it, and states within it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats, Indices
from lagcli.compiled import contact_kinds
from lagcli.compiled.bound_function import BoundFunction, cells
from lagcli.contact import zero_search
from lagcli.contact.zero_search import FirstCrossing
from lagcli.simulation.events.event import IncidentLog, InstantLines
from lagcli.simulation.events.watch_functions import DIRECTIONS, GapValues, WatchFunctions
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.run_state.statistics import Incident
from lagcli.simulation.scheme import collocation
from lagcli.simulation.scheme.bound_scheme import BoundStep
from lagcli.simulation.singularity.singularity_step import SingularStep
from lagcli.simulation.stepping import grid, interpolate_rows
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper

# Rounding of the state: of each of its numbers so many roundings, and of the size of the motion; of what it makes of a
# function, the largest of some random samples, as many times.
OF_EACH, OF_ALL, SAMPLES = 16.0, 4.0, 4
# Parts of the step before the instant, and of that behind it, at which multipliers are looked at: at the instant they
# have no values.
SINGULAR_PARTS = tuple((np.arange(1, 5) / 4).tolist())


class StepWatch:
    """w (W,) of `WatchFunctions` along a step of a run; is_open: of their `contacts`; are_gaps: the gaps of open ones
    among w (W,)."""

    def __init__(self, functions: WatchFunctions, run: Stepper) -> None:
        self.functions, self.run, self.bound = functions, run, run.bound
        numeric = run.bound.numeric
        lying, first = numeric.lying_rows, functions.kinds.first_contact
        self.is_open = ~np.isin(first + functions.contacts, np.array(lying, dtype=np.intp))
        self.are_gaps = np.zeros(functions.kinds.numbers.size, dtype=bool)
        self.are_gaps[: self.is_open.size] = self.is_open
        t, x = np.zeros(1), np.zeros(1)
        self._t, self._x, self._state = cells(t), cells(x), x
        _, h, y, k, _, p = run.bound.arguments
        self._arguments = [t, h, y, k, run.bound.new, run.bound.k_new, p]
        self._hull = None if functions.hull is None else BoundFunction(functions.hull, self._arguments)
        self._floor = None if self._hull is None else cells(self._hull.results[0])
        # Of each of many functions, above 0 where it has no zero in the step that was looked at.
        self._near: Floats | None = None
        self._of_near: tuple[Indices, GapValues, Floats] | None = None
        # The largest -g at the end of the step that was looked at.
        self.deepest, self._is_screened = 0.0, False

    @cached_property
    def _screen(self) -> BoundFunction:
        return BoundFunction(self.functions.screen, self._arguments)

    @cached_property
    def _inside(self) -> BoundFunction:
        t, h, y, _, _, _, p = self._arguments
        coefficients = self.run.trial.rows.dense.results[0].T
        return BoundFunction(self.functions.inside, [t, h, self._state, y, coefficients, p])

    def _near_inside(self, x: float) -> tuple[Floats, Floats]:
        if self._of_near is None:
            indices = self.doubtful()
            assert self.functions.gaps_inside is not None, "there are many gaps"
            values = self.functions.gaps_inside.of(self.functions.contacts[indices], self._arguments[-1])
            self._of_near = indices, values, np.full((2, self.are_gaps.size), np.nan)
        indices, values, (w, slope) = self._of_near
        t, h, self._x[0] = self.run.origin + self.run.t, float(self._arguments[1][0]), x
        self._path.trigger()
        w[indices], slope[indices] = values(t + x * h, h, *self._path.results)
        return w, slope

    @cached_property
    def _path(self) -> BoundFunction:
        assert self.functions.gaps_inside is not None, "there are many gaps"
        coefficients = self.run.trial.rows.dense.results[0].T
        arguments = [self._state, self._arguments[2], coefficients]
        return BoundFunction(self.functions.gaps_inside.path, arguments)

    @cached_property
    def _scratch(self) -> BoundFunction:
        arguments = [np.zeros(1), self.bound.y.copy(), self.bound.p]
        return BoundFunction(self.functions.watched, arguments)

    @cached_property
    def _sizes(self) -> BoundFunction:
        numeric = self.bound.numeric
        q, v = np.zeros(numeric.n), np.zeros(numeric.n)
        p = self.bound.enforced.p[: numeric.sizes.numel_in(3)].copy()
        return BoundFunction(numeric.sizes, [np.zeros(1), q, v, p])

    def is_clear(self) -> bool:
        """True if no function has a zero in the step, as far as its ends tell."""
        self._t[0] = self.run.origin + self.run.t
        self.deepest, self._is_screened, self._near, self._of_near = 0.0, False, None, None
        if self._hull is not None and self._floor is not None:
            self._hull.trigger()
            if self._floor[0] > 0.0:
                return True
            if len(self._floor) > contact_kinds.PARAMETERS.many:
                # Of so many few are near, and those are looked at one by one.
                self._near = self._hull.results[0][1:]
                return False
        clear, self.deepest = self._screened[:2].tolist()
        return bool(clear > 0.0)

    @property
    def _screened(self) -> Floats:
        """The results of the screening of the step, made when they are first asked for."""
        if not self._is_screened:
            self._t[0] = self.run.origin + self.run.t
            self._screen.trigger()
            self._is_screened = True
        return self._screen.results[0]

    def doubtful(self) -> Indices:
        """The functions that may have a zero in a step that was looked at."""
        numbers = self._screened[2:] if self._near is None else self._near
        return np.flatnonzero(~(numbers > 0.0))

    def inside(self, x: float) -> tuple[Floats, Floats]:
        """w and dw/dx at the fraction x of the dense output, in memory that the next call overwrites; of many gaps of
        those alone that are doubtful."""
        if self._near is not None and self.functions.gaps_inside is not None:
            return self._near_inside(x)
        self._t[0], self._x[0] = self.run.origin + self.run.t, x
        self._inside.trigger()
        w, slope = self._inside.results
        return w, slope

    def begin(self) -> Floats:
        """w where the run stands."""
        return self._watched(self.run.origin + self.run.t, self.bound.y).copy()

    def beside(self, t: float, offset: float) -> Floats:
        """w (2, W) on the tangents of the motion: before where the run stands, and after the end of a step at t."""
        run, bound, found = self.run, self.bound, []
        for sign, when, y, k in ((-1, run.t, bound.y, bound.k), (1, t, bound.new, bound.k_new)):
            found.append(self._watched(run.origin + when + sign * offset, y + sign * offset * k).copy())
        return np.array(found)

    def rounding(self, step: FoundStep) -> Floats:
        """Rounding of w (W,) by that of the state, in a step: the middle one of what it is at its
        ends and between them, for it may be nothing at one point and grow beyond all bounds at another."""
        run, bound, found = self.run, self.bound, []
        h, n = step.reached - run.t, bound.y.size // 2
        middle = (run.t + step.reached) / 2, (bound.y + bound.new) / 2
        for when, y in ((run.t, bound.y), middle, (step.reached, bound.new)):
            t = run.origin + when
            at, positions, velocities, _ = self._sizes.arguments
            at[0], positions[:], velocities[:] = t, y[:n], y[n : 2 * n]
            self._sizes.trigger()
            sizes = self._sizes.results[0]
            units, (q, v, a) = sizes[:n], sizes[n:].tolist()
            speed = max(v, h * a)
            room = doubles.EPS * OF_EACH * np.abs(y)
            room[:n] += doubles.EPS * OF_ALL * units * max(q, h * speed)
            room[n : 2 * n] += doubles.EPS * OF_ALL * units * speed
            here, most = self._watched(t, y).copy(), np.zeros(self.are_gaps.size)
            for signs in np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, y.size + 1)):
                beside = self._watched(t * (1.0 + doubles.EPS * OF_ALL * signs[-1]), y + room * signs[:-1])
                most = np.fmax(most, np.abs(beside - here))
            found.append(SAMPLES * most)
        return np.median(found, axis=0)

    def end(self, t: float) -> Floats:
        """w at the end of the step, which is at t."""
        return self._watched(self.run.origin + t, self.bound.new).copy()

    def _watched(self, t: float, y: Floats) -> Floats:
        """w at a time, not counted from `origin`, and a state, in memory that the next call overwrites."""
        at, state, _ = self._scratch.arguments
        at[0], state[:] = t, y
        self._scratch.trigger()
        return self._scratch.results[0]


class StateAhead(NamedTuple):
    """A state beyond an instant: the time, and y (2n + 1,); before: the line of the table at the instant itself, where
    the rows give none."""

    t: float
    y: Floats
    before: Floats | None = None


def ahead(run: Stepper, step: FoundStep, x: float) -> StateAhead:
    """The state at a fraction of the step that was found, on its dense output."""
    begin, coefficients = run.bound.y[:, None], run.trial.rows.dense.results[0][:, :, None]
    y = np.asarray(run.method.interpolated(begin, coefficients, np.array([x]))).ravel()
    return StateAhead(run.t + x * step.taken, y)


def pulls(names: list[str]) -> StepFailure:
    """The end of a run in which closed contacts of these names pull."""
    listed = ", ".join(f"`{name}`" for name in names)
    return StepFailure(f"the closed contacts {listed} would pull there", run_stop.CONTACT)


class SingularStepWatch:
    """w (W,) of `WatchFunctions` along the step that was found, which is singular at the fraction `instant` of it."""

    def __init__(self, functions: WatchFunctions, run: Stepper, singular_step: SingularStep) -> None:
        self._functions, self._run, self._step_across = functions, run, singular_step
        self.instant = (singular_step.instant - singular_step.step.t) / singular_step.step.h

    def inside(self, x: float) -> tuple[Floats, Floats]:
        """w and dw/dx at the fraction x of the step."""
        run, step = self._run, self._step_across.step
        t = run.origin + step.t + x * step.h
        w, slope = self._functions.moving(t, step.state(x), step.slope(x), run.bound.p)
        return np.array(w).ravel(), step.h * np.array(slope).ravel()

    def event(self, x: float, name: str, log: IncidentLog) -> Incident:
        """A declared event at the fraction x."""
        run, step = self._run, self._step_across.step
        t = step.t + x * step.h
        interpolate_rows.put_in_singular_step(run, self._step_across, t)
        line = run.trial.rows.line.copy()
        return log.incident(t, "event", name, InstantLines(line, line))

    def ended_at(self, found: FoundStep, x: float) -> FoundStep | None:
        """The step ended at the fraction x; None where the state there cannot be found on the constraints."""
        run, step = self._run, self._step_across.step
        reached, state = step.t + x * step.h, step.state(x)
        if collocation.projected(run.bound.scratch, reached, state) is None:
            return None
        run.trial.project_end(reached, state)
        return found._replace(reached=reached, taken=reached - run.t, is_jump=True)

    def ended_at_lift_off(self, found: FoundStep, lift_off: LiftOff) -> tuple[FoundStep, StateAhead]:
        """The step ended at a lift, and the state behind it. Raises `StepFailure` where there is no state on the
        constraints."""
        run, singular_step = self._run, self._step_across
        step, before = singular_step.step, None
        if lift_off.x == self.instant:
            # The rows have no projection there, and those that go on have one.
            interpolate_rows.put_in_singular_step(run, singular_step, singular_step.instant)
            run.trial.put_end(singular_step.middle, step.slope(self.instant))
            taken, before = singular_step.instant - run.t, run.trial.rows.line.copy()
            ended = found._replace(reached=singular_step.instant, taken=taken, is_jump=True)
        elif (at_lift := self.ended_at(found, lift_off.x)) is not None:
            ended = at_lift
        else:
            raise StepFailure("a contact opens where a singular configuration is passed", run_stop.CONTACT)
        x = lift_off.beyond
        return ended, StateAhead(step.t + x * step.h, step.state(x), before)


class LiftOff(NamedTuple):
    """x: the fraction of the step; indices: of the functions of contacts that open there; beyond: a fraction behind it
    at which they pull."""

    x: float
    indices: Indices
    beyond: float


def first_lift_off(curve: SingularStepWatch, indices: Indices, rounding: Floats) -> LiftOff | None:
    """The first lift of closed contacts, by their indices among the functions (W,) that are watched, whose rounding
    is given (W,)."""
    instant = curve.instant
    if not (indices.size and instant > 0):
        return None
    noise = rounding[indices]
    before = [0.0, *(part * instant for part in SINGULAR_PARTS[:-1])]
    behind = [instant + part * (1.0 - instant) for part in SINGULAR_PARTS]
    last = before[0]
    for x in (*before[1:], *behind):
        pulls = curve.inside(x)[0][indices] < -noise
        if pulls.any():
            if x == behind[0]:
                return LiftOff(instant, indices[pulls], x)
            crossing = first_crossing(curve, indices, (last, x), noise)
            if crossing.x is None:
                return LiftOff(x, indices[pulls], x)
            return LiftOff(last + crossing.x * (x - last), indices[list(crossing.rows)], x)
        last = x
    return None


def first_crossing(
    watch: StepWatch | SingularStepWatch,
    indices: Indices,
    span: tuple[float, float],
    noise: Floats,
    direction: npt.ArrayLike = zero_search.DOWN,
    armed: npt.ArrayLike = True,
) -> FirstCrossing:
    """The first of some functions to cross zero in a part of the step; noise, direction and armed as `zero_search`
    takes them."""
    begin, width = span[0], span[1] - span[0]

    def values(u: float) -> tuple[Floats, Floats]:
        w, slope = watch.inside(begin + u * width)
        return w[indices], slope[indices] * width

    return zero_search.first_crossing(values, noise, direction, armed)


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
    """The events that cross zero, of those that are at zero on both sides, and all these, by their numbers. The next
    step would see no more than on which side rounding has put them. sides: values (E,) before and after; jumped: as
    `EventValues.jumped`."""
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
    _, _, y, k, tolerance, p = bound.arguments
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
