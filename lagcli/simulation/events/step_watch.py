"""The step that a run has just found: the watched functions on it, and states within it."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled.bound_function import BoundFunction, cells
from lagcli.contact import zero_search
from lagcli.simulation.events.event import IncidentLog, InstantLines
from lagcli.simulation.events.watch_functions import WatchFunctions
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.incident import Incident
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme import collocation
from lagcli.simulation.singularity.singularity_step import SingularStep
from lagcli.simulation.stepping import interpolate_rows
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.intp]

# Of more functions than these no look is taken at all where some come near.
MANY = 256
# Rounding of the state: of each of its numbers so many roundings, and of the size of the motion; of what it makes of a
# function, the largest of some random samples, as many times.
OF_EACH, OF_ALL, SAMPLES, TIMES = 16.0, 4.0, 4, 4.0


class StepWatch:
    """w (W,) of `WatchFunctions` along a step of a run; is_open: of their `contacts`; are_gaps: the gaps of open ones
    among w (W,)."""

    def __init__(self, functions: WatchFunctions, run: Stepper) -> None:
        self.functions, self.run, self._bound = functions, run, run.bound
        numeric = run.bound.numeric
        lying, first = [*numeric.closed_rows, *numeric.idle_rows], functions.kinds.first_contact
        self.is_open = ~np.isin(first + functions.contacts, np.array(lying, dtype=np.intp))
        self.are_gaps = np.zeros(functions.kinds.numbers.size, dtype=bool)
        self.are_gaps[: self.is_open.size] = self.is_open
        t, x = np.zeros(1), np.zeros(1)
        self._at, self._state = t, x
        self._t, self._x = cells(t), cells(x)
        self._hull = None if functions.hull is None else BoundFunction(functions.hull, self._arguments)
        self._floor = None if self._hull is None else cells(self._hull.results[0])
        # Of each of many functions, above 0 where it has no zero in the step that was looked at.
        self._near: Floats | None = None
        # The largest -g at the end of the step that was looked at.
        self.deepest, self._is_screened = 0.0, False

    @property
    def _arguments(self) -> list[Floats]:
        bound = self.run.bound
        _, h, y, k, _, _ = bound.step.arguments
        return [self._at, h, y, k, bound.new, bound.k_new, bound.p]

    @cached_property
    def _screen(self) -> BoundFunction:
        return BoundFunction(self.functions.screen, self._arguments)

    @cached_property
    def _inside(self) -> BoundFunction:
        t, h, y, _, _, _, p = self._arguments
        coefficients = self.run.trial.rows.dense.results[0].T
        return BoundFunction(self.functions.inside, [t, h, self._state, y, coefficients, p])

    @cached_property
    def _begin(self) -> BoundFunction:
        return BoundFunction(self.functions.watched, [self._at, self._bound.y, self._bound.p])

    @cached_property
    def _end(self) -> BoundFunction:
        return BoundFunction(self.functions.watched, [self._at, self._bound.new, self._bound.p])

    @cached_property
    def _scratch(self) -> BoundFunction:
        arguments = [np.zeros(1), self._bound.y.copy(), self._bound.p]
        return BoundFunction(self.functions.watched, arguments)

    @cached_property
    def _sizes(self) -> BoundFunction:
        numeric = self._bound.numeric
        q, v = np.zeros(numeric.n), np.zeros(numeric.n)
        p = self._bound.enforced.p[: numeric.sizes.numel_in(3)].copy()
        return BoundFunction(numeric.sizes, [np.zeros(1), q, v, p])

    def is_of(self, run: Stepper) -> bool:
        """True as long as the run steps with the functions it did."""
        return run.bound is self._bound

    def is_clear(self) -> bool:
        """True if no function has a zero in the step, as far as its ends tell."""
        self._t[0] = self.run.origin + self.run.t
        self.deepest, self._is_screened, self._near = 0.0, False, None
        if self._hull is not None and self._floor is not None:
            self._hull.trigger()
            if self._floor[0] > 0.0:
                return True
            if len(self._floor) > MANY:
                # Of so many few are near, and those are looked at one by one.
                self._near = self._hull.results[0][1:]
                return False
        clear, self.deepest = self._screened[:2].tolist()
        return bool(clear > 0.0)

    def doubtful(self) -> Numbers:
        """The functions that may have a zero in a step that was looked at."""
        numbers = self._screened[2:] if self._near is None else self._near
        return np.flatnonzero(~(numbers > 0.0))

    @property
    def _screened(self) -> Floats:
        """The results of the screening of the step, made when they are first asked for."""
        if not self._is_screened:
            self._t[0] = self.run.origin + self.run.t
            self._screen.trigger()
            self._is_screened = True
        return self._screen.results[0]

    def inside(self, x: float) -> tuple[Floats, Floats]:
        """w and dw/dx at the fraction x of the dense output, in memory that the next call overwrites."""
        self._t[0], self._x[0] = self.run.origin + self.run.t, x
        self._inside.trigger()
        w, slope = self._inside.results
        return w, slope

    def begin(self) -> Floats:
        """w where the run stands."""
        self._t[0] = self.run.origin + self.run.t
        self._begin.trigger()
        return self._begin.results[0].copy()

    def beside(self, t: float, offset: float) -> Floats:
        """w (2, W) on the tangents of the motion: before where the run stands, and after the end of a step at t."""
        run, bound, at = self.run, self._bound, self._scratch
        found = []
        for sign, when, y, k in ((-1, run.t, bound.y, bound.k), (1, t, bound.new, bound.k_new)):
            at.arguments[0][0], at.arguments[1][:] = run.origin + when + sign * offset, y + sign * offset * k
            at.trigger()
            found.append(at.results[0].copy())
        return np.array(found)

    def rounding(self, step: FoundStep) -> Floats:
        """Rounding of w (W,) by that of the state, in a step: the middle one of what it is at its
        ends and between them, for it may be nothing at one point and grow beyond all bounds at another."""
        run, bound = self.run, self._bound
        begin, end = (run.t, bound.y), (step.reached, bound.new)
        middle = (run.t + step.reached) / 2, (bound.y + bound.new) / 2
        h = step.reached - run.t
        return np.median([self._rounding_at(*state, h) for state in (begin, middle, end)], axis=0)

    def _rounding_at(self, when: float, y: Floats, h: float) -> Floats:
        n, t = (y.size - 1) // 2, self.run.origin + when
        at, q, velocity, _ = self._sizes.arguments
        at[0], q[:], velocity[:] = t, y[:n], y[n : 2 * n]
        self._sizes.trigger()
        sizes = self._sizes.results[0]
        units, (q, v, a) = sizes[:n], sizes[n:].tolist()
        speed = max(v, h * a)
        room = doubles.EPS * OF_EACH * np.abs(y)
        room[:n] += doubles.EPS * OF_ALL * units * max(q, h * speed)
        room[n : 2 * n] += doubles.EPS * OF_ALL * units * speed
        at, state, _ = self._scratch.arguments
        state[:], at[0] = y, t
        self._scratch.trigger()
        here, found = self._scratch.results[0].copy(), np.zeros(self._scratch.results[0].size)
        for signs in np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, y.size + 1)):
            at[0], state[:] = t * (1.0 + doubles.EPS * OF_ALL * signs[-1]), y + room * signs[:-1]
            self._scratch.trigger()
            found = np.fmax(found, np.abs(self._scratch.results[0] - here))
        return TIMES * found

    def end(self, t: float) -> Floats:
        """w at the end of the step, which is at t, in memory that the next call overwrites."""
        self._t[0] = self.run.origin + t
        self._end.trigger()
        return self._end.results[0]


class FixedAhead(NamedTuple):
    """A state that is known: the time, and y (2n + 1,); before: the line of the table at the instant itself, where the
    rows give none."""

    t: float
    y: Floats
    before: Floats | None = None


class Ahead:
    """The state at a fraction of the step that was found, kept though the step is taken again."""

    before: Floats | None = None

    def __init__(self, run: Stepper, step: FoundStep, x: float) -> None:
        self._method, self._x, self.t = run.method, x, run.t + x * step.taken
        self._begin, self._coefficients = run.bound.y.copy(), run.trial.rows.dense.results[0].copy()

    @property
    def y(self) -> Floats:
        """The state, (2n + 1,)."""
        begin, coefficients = self._begin[:, None], self._coefficients[:, :, None]
        return np.asarray(self._method.interpolated(begin, coefficients, np.array([self._x]))).ravel()


StateAhead = Ahead | FixedAhead


def require_pushes(watch: StepWatch, pulling: Numbers) -> None:
    """Raise `StepFailure` where a contact that is closed is among functions that are clearly below zero at the begin of
    a step: no row is made of that, whatever has closed it."""
    bound, numbers = watch.run.bound, watch.functions.kinds.numbers[pulling].tolist()
    rows, closed = bound.enforced.system.multiplier_rows, set(bound.numeric.closed_rows)
    if names := [rows[number].name for number in numbers if number in closed]:
        raise pulls(names)


def pulls(names: list[str]) -> StepFailure:
    """The end of a run in which closed contacts of these names pull."""
    listed = ", ".join(f"`{name}`" for name in names)
    return StepFailure(f"the closed contacts {listed} would pull there", run_stop.CONTACT)


Indices = npt.NDArray[np.intp]

# Parts of the step before the instant, and of that behind it, at which multipliers are looked at: at the instant they
# have no values.
SINGULAR_PARTS = (0.25, 0.5, 0.75, 1.0)


class SingularStepWatch:
    """w (W,) of `WatchFunctions` along the step that was found."""

    def __init__(self, functions: WatchFunctions, run: Stepper, singular_step: SingularStep) -> None:
        self._functions, self._run, self._step_across = functions, run, singular_step

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

    @property
    def instant(self) -> float:
        """The fraction of the step at which it is singular."""
        return (self._step_across.instant - self._step_across.step.t) / self._step_across.step.h

    def ahead(self, x: float, before: Floats | None) -> FixedAhead:
        """The state at the fraction x."""
        step = self._step_across.step
        return FixedAhead(step.t + x * step.h, step.state(x), before)

    def ended_at_instant(self, found: FoundStep) -> tuple[FoundStep, Floats]:
        """The step ended there, and the line of the table: the rows have no projection there, and those that go on have
        one."""
        run, singular_step = self._run, self._step_across
        interpolate_rows.put_in_singular_step(run, singular_step, singular_step.instant)
        run.trial.put_end(singular_step.middle, singular_step.step.slope(self.instant))
        return self._ended(found, singular_step.instant), run.trial.rows.line.copy()

    def ended_at(self, found: FoundStep, x: float) -> FoundStep | None:
        """The step ended at the fraction x; None where the state there cannot be found on the constraints."""
        run, step = self._run, self._step_across.step
        reached, state = step.t + x * step.h, step.state(x)
        if collocation.projected(run.bound.scratch, reached, state) is None:
            return None
        run.trial.project_end(reached, state)
        return self._ended(found, reached)

    def _ended(self, found: FoundStep, reached: float) -> FoundStep:
        return found._replace(reached=reached, taken=reached - self._run.t, is_jump=True)


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
            return _between(curve, indices, noise, (last, x)) or LiftOff(x, indices[pulls], x)
        last = x
    return None


def ended_at_lift_off(
    curve: SingularStepWatch, found: FoundStep, lift_off: LiftOff
) -> tuple[FoundStep, FixedAhead]:
    """The step ended at a lift, and the state behind it. Raises `StepFailure` where there is no state on the
    constraints."""
    if lift_off.x == curve.instant:
        step, before = curve.ended_at_instant(found)
        return step, curve.ahead(lift_off.beyond, before)
    ended = curve.ended_at(found, lift_off.x)
    if ended is None:
        raise StepFailure("a contact opens where a singular configuration is passed", run_stop.CONTACT)
    return ended, curve.ahead(lift_off.beyond, None)


def _between(
    curve: SingularStepWatch, indices: Indices, noise: Floats, span: tuple[float, float]
) -> LiftOff | None:
    begin, width = span[0], span[1] - span[0]

    def values(u: float) -> tuple[Floats, Floats]:
        w, slope = curve.inside(begin + u * width)
        return w[indices], slope[indices] * width

    crossing = zero_search.first_crossing(values, noise)
    if crossing.x is None:
        return None
    return LiftOff(begin + crossing.x * width, indices[list(crossing.rows)], span[1])
