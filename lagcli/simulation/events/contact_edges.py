"""Edges of closed contacts, where `min`, `max` or `abs` in a condition switches in the motion and its gradient jumps;
and switches of forces in the motion while contacts are closed or touch."""

from __future__ import annotations

import itertools
import math
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.compiled import force_switches
from lagcli.compiled.contact_values import ROUNDINGS
from lagcli.simulation.events import switch_event
from lagcli.simulation.events.event import Event, Screen
from lagcli.simulation.events.impulse_event import FEW
from lagcli.simulation.run_state.run_stop import STICKS, StepFailure
from lagcli.simulation.scheme.step_end import Compiled
from lagcli.simulation.stepping import stop_diagnosis, timetable
from lagcli.simulation.stepping.found_step import Cut, FoundStep
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness import named_functions, sides

# A step towards an edge leaves this part of the time to it, by the speed towards it.
BEFORE = 2.0**-10
# Roundings by which a number is moved to the side of a switch to which a motion at rest on it is led.
FEW_ROUNDINGS = tuple(2**power for power in range(12))


class EdgeEvent(Event):
    """An edge of a contact that is closed, or a switch of a force. A motion with the contact closed has no step across
    an edge: velocities would have to jump. Steps end before it, and from the other side, which is a few roundings of
    the time away, contacts decide. So they do where a force switches."""

    def __init__(self, stepper: Stepper) -> None:
        self._run = stepper
        self._system = system = stepper.bound.enforced.system
        forces = named_functions.have_switching_forces(system.model)
        # Of contacts, and of the forces (K + 1,).
        self._kinked = np.append(named_functions.switching_contacts(system.model), forces)

    @cached_property
    def _switches(self) -> tuple[npt.NDArray[np.intp], Compiled]:
        """The contact of each switch (U,), those of forces behind the last one; see `force_switches.at_contacts`."""
        contacts, function = force_switches.at_contacts(self._system)
        return np.array(contacts, dtype=np.intp), function

    @property
    def _of_forces(self) -> Flags:
        """The switches (U,) that are those of forces."""
        return np.asarray(self._switches[0] == self._kinked.size - 1)

    def screen(self) -> Screen | None:
        """See `Event`."""
        return Screen(holds=lambda: not self._watched().any())

    def passes(self) -> FoundStep | None:
        """See `Event`; a step that comes close to an edge is shortened."""
        run, watched = self._run, self._watched()
        if not watched.any():
            return None
        # The times to the switches by their rates, and those that forces need for the rounding of their terms.
        u, rates, sizes = self._at(run.t, run.bound.y, run.bound.k)
        of_forces, are_watched = self._of_forces, watched[self._switches[0]]
        is_on = of_forces & (u == 0) & (rates != 0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            times = np.where(are_watched & ((u * rates < 0) | is_on), np.abs(u / rates), np.inf)
            blurred = np.where(of_forces & are_watched, np.abs(doubles.EPS * sizes / rates), 0.0)
        blurred = np.where(np.isfinite(times), blurred, 0.0)
        time = float(times.min(initial=np.inf))
        if not time <= run.control.step:
            return None
        is_near = times <= np.maximum(self._nearest(time), blurred)
        if not is_near.any():
            run.longest = time * (1.0 - BEFORE)
            return None
        return self._crosses(2 * max(float(times[is_near].max()), math.ulp(run.t)), is_near)

    def leaves(self) -> FoundStep | None:
        """See `Event`: a start on a switch of a force, at rest there or not, goes to the side to which it is led."""
        run, watched = self._run, self._watched()
        if not watched[-1]:
            return None
        bound, numeric, n = run.bound, run.bound.numeric, run.bound.y.size // 2
        u, rates, sizes = self._at(run.t, bound.y, bound.k)
        is_on = self._of_forces & (np.abs(u) <= doubles.EPS * sizes)
        if not is_on.any():
            return None
        moving = is_on & (rates != 0.0)
        if moving.any() and (step := self._crosses(2 * math.ulp(run.t), moving)):
            return step

        def rate(t: float, y: Floats) -> Floats:
            run.count(1)
            return np.array(numeric.rhs(t, y, bound.p)).ravel()

        # The first time at which positions are told apart from those on the switch, by accelerations soon after it that
        # are more than the rounding of forces.
        dt = math.ulp(run.t + run.grid.step)
        while dt < run.grid.step / 2:
            soon = bound.y + dt * bound.k
            y, k = bound.y.copy(), rate(run.t + dt, soon)
            s = run.state_at(run.t + dt, soon)
            h, _ = numeric.force_roundings(s.t, s.q, s.v, s.p)
            inertia = np.diag(np.array(numeric.inertia(s.t, s.q, s.v, s.p)))
            rounding = ROUNDINGS * doubles.EPS * np.array(h).ravel() / inertia
            k[n : 2 * n][np.abs(k[n : 2 * n]) <= rounding] = 0.0
            y[:n] += dt * y[n : 2 * n] + dt * dt / 2 * k[n : 2 * n]
            y[n : 2 * n] += dt * k[n : 2 * n]
            beside, _, sizes = self._at(run.t + dt, y, bound.k)
            led = is_on & (np.abs(beside) > 16 * doubles.EPS * sizes)
            if not led.any():
                dt *= 2
                continue
            # Where both sides of a switch push a motion that is at rest on it back, it sticks.
            returns = led.copy()
            for side in (y, 2 * bound.y - y):
                k = rate(run.t + dt, side)
                u, before, _ = self._at(run.t + dt, side, k)
                after = self._at(run.t + 2 * dt, side + dt * k, k)[1]
                returns &= u * (after - before) < 0.0
            if returns.any():
                raise StepFailure(stop_diagnosis.at_rest(self._system, bound.y), STICKS)
            # No time is lost in which forces are not those of the side.
            return self._steps_to(2 * math.ulp(run.t), led, self._beside(y, np.where(led, beside, 0.0)))
        return None

    def _beside(self, ahead: Floats, sides: Floats) -> Floats:
        """The state with some of its numbers moved by a few roundings to the sides (U,) of switches, 0 of those that do
        not matter; the state ahead (2n + 1,) where these move none of them there."""
        run, y, decided = self._run, self._run.bound.y.copy(), np.zeros(sides.size, dtype=bool)
        n, t, moved = y.size // 2, run.t + 2 * math.ulp(run.t), np.abs(ahead - run.bound.y)
        extents = np.maximum(np.abs(y), moved)
        # The numbers among (q, v) that stand in each of the switches.
        numbers: list[list[int]] = [[] for _ in self._switches[0]]
        for kind in (0, 1):
            pattern = self._switches[1].jac_sparsity(0, 1 + kind)
            for switch, number in zip(*pattern.get_triplet(), strict=True):
                numbers[switch].append(kind * pattern.shape[1] + number)
        for switch in np.flatnonzero(sides).tolist():
            decided[switch] = True
            # What is led itself first: another one may be held.
            own = sorted(numbers[switch], key=lambda i: -moved[n + i % n])
            for way, i, sign in itertools.product(FEW_ROUNDINGS, own, (1.0, -1.0)):
                z = y.copy()
                z[i] += sign * way * doubles.EPS * extents[i]
                u, _, sizes = self._at(t, z, run.bound.k)
                if (u * np.sign(sides) > 16 * doubles.EPS * sizes)[decided].all():
                    y = z
                    break
            else:
                return ahead
        return y

    def found(self, step: FoundStep) -> Cut | None:
        """See `Event`: a step in which a force switches unforeseen ends before it."""
        run, found = self._run, step
        if not self._kinked[-1] or not step.is_ordinary:
            return None
        are_watched = self._watched()[self._switches[0]] & self._of_forces
        if not are_watched.any():
            return None
        begin, rates, sizes = self._at(run.t, run.bound.y, run.bound.k)
        are_watched &= (np.abs(begin) > doubles.EPS * sizes) | (begin * rates > 0)
        begin, part = np.where(are_watched, begin, 0.0), 1.0

        def is_before(x: Floats | float) -> bool:
            return not self._has_left(found, begin, float(x))

        while found.taken > self._nearest(found.taken):
            # The part of the step at which a switch leaves its side.
            spans = itertools.pairwise([0.0, *FEW[1:].tolist()])
            span = next((span for span in spans if not is_before(span[1])), None)
            if span is None:
                break
            crossed = float(sides.bracket(is_before, *span, narrow=BEFORE)[1])
            if found.barrier is not None and found.barrier.part < crossed:
                break
            found = run.trial.again(found, run.t + part * crossed * (1.0 - BEFORE) * found.taken)
            part /= 2
        if found is step:
            return None
        return Cut(found._replace(proposed=max(found.proposed, run.control.step)))

    def _has_left(self, step: FoundStep, begin: Floats, x: float) -> bool:
        """True where a switch has left the side of its value at the begin (U,) at a part of the step that was found: on
        the cubic through its ends, and on its dense output, which knows motions of higher powers of the time."""
        run = self._run
        bound, h = run.bound, step.taken
        ahead = bound.new - bound.y
        bends = h * ((1 - x) * bound.k - x * bound.k_new) + (2 * x - 1) * ahead
        left = self._at(run.t + x * h, bound.y + x * ahead + x * (1 - x) * bends, bound.k)[0] * begin < 0.0
        if not left.any():
            return False
        run.trial.make_dense()
        coefficients: Floats = run.trial.rows.dense.results[0]
        y = run.method.interpolated(bound.y, coefficients, np.array(x))
        return bool((left & (self._at(run.t + x * h, y, bound.k)[0] * begin < 0.0)).any())

    def _watched(self) -> Flags:
        """The contacts that are closed, and the forces where some are or touch, as far as they switch (K + 1,)."""
        run, first = self._run, len(self._system.rows.rows)
        numeric = run.bound.numeric
        closed = np.zeros(self._kinked.size, dtype=bool)
        closed[[i - first for i in numeric.lying_rows]] = True
        closed[-1] = closed.any() or bool(run.contacts.touching)
        return np.asarray(closed & self._kinked)

    def _at(self, t: float, y: Floats, k: Floats) -> tuple[Floats, Floats, Floats]:
        """The switches, their rates and the sizes of their terms (U,) at a state with its rate."""
        state = self._run.state_at(t, y)
        n = state.q.size
        u, rates, sizes = self._switches[1](state.t, state.q, state.v, k[n : 2 * n], state.p)
        return np.array(u).ravel(), np.array(rates).ravel(), np.array(sizes).ravel()

    def _nearest(self, time: float) -> float:
        """A time that is no more than the rounding of the time of the run."""
        run = self._run
        return timetable.PARAMETERS.still * math.ulp(max(abs(run.origin + run.t), time))

    def _crosses(self, dt: float, which: Flags) -> FoundStep | None:
        """The step across some of the switches (U,); None where the motion turns round at one of a force."""
        run, bound = self._run, self._run.bound
        if (which & self._of_forces).any():
            switches = bound.enforced.plain.functions.numeric.force_switches
            if switches is not None:
                bound.h[0] = 2 * dt
                stop_diagnosis.require_not_stuck(bound, switches, run.origin + run.t)
            # The time in which positions and velocities are told apart from those on the switches.
            rates = self._at(run.t, bound.y, bound.k)[1]
            while dt < run.control.step:
                if (self._at(run.t + dt, self._ahead(dt), bound.k)[0] * rates > 0)[which].all():
                    break
                dt *= 2
            if dt >= run.control.step:
                return None
        return self._steps_to(dt, which, self._ahead(dt))

    def _steps_to(self, dt: float, which: Flags, y: Floats) -> FoundStep:
        """The step of a time to a state (2n + 1,) beyond some of the switches (U,), or beside them."""
        run, reached = self._run, self._run.t + dt
        if self._of_forces[which].all():
            new, rate, *_ = run.bound.projected_at(reached, y)
        else:
            new, rate = switch_event.opened(run, reached, y)
        return run.still(reached, new, rate)

    def _ahead(self, dt: float) -> Floats:
        """The state on a parabola of the time."""
        bound, n = self._run.bound, self._run.bound.y.size // 2
        y = bound.y + dt * bound.k
        y[:n] += dt * dt / 2 * bound.k[n : 2 * n]
        return np.asarray(y)
