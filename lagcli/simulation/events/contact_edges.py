"""Edges of closed contacts: where `min`, `max` or `abs` in a condition switches in the motion, its gradient jumps."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli.equations import kinks, named_functions
from lagcli.simulation.events import switch_event
from lagcli.simulation.events.event import Event
from lagcli.simulation.scheme.step_end import Compiled
from lagcli.simulation.stepping import timetable
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]

# A step towards an edge leaves this part of the time to it, by the speed towards it.
BEFORE = 2.0**-10


class EdgeEvent(Event):
    """An edge of a contact that is closed.

    A motion with the contact closed has no step across: velocities would have to jump. Steps end before it, and from
    the other side, which is a few roundings of the time away, contacts decide.
    """

    def __init__(self, stepper: Stepper) -> None:
        self._run = stepper
        self._system = stepper.bound.enforced.system
        self._kinked = named_functions.switching_contacts(self._system.model)
        # The step that was wished before those towards an edge.
        self._wished = 0.0

    @cached_property
    def _switches(self) -> tuple[npt.NDArray[np.intp], Compiled]:
        """See `kinks.of_contacts`."""
        system = self._system
        contacts, function = kinks.of_contacts(system.symbols, system.p, system.contacts)
        return np.array(contacts, dtype=np.intp), function

    def passes(self) -> bool:
        """See `Event`; a step that comes close to an edge is shortened."""
        run, first = self._run, len(self._system.rows.rows)
        numeric = run.bound.numeric
        closed = np.zeros(self._kinked.size, dtype=bool)
        closed[[i - first for i in (*numeric.closed_rows, *numeric.idle_rows)]] = True
        if not (closed & self._kinked).any():
            return False
        time = self._time_to_edge(closed)
        if not time <= run.control.step:
            return False
        nearest = timetable.PARAMETERS.still * math.ulp(max(abs(run.origin + run.t), time))
        if time > nearest:
            self._wished = max(self._wished, run.control.step)
            run.control.step = time * (1.0 - BEFORE)
            return False
        self._cross(2 * max(time, math.ulp(run.t)))
        return True

    def _time_to_edge(self, closed: npt.NDArray[np.bool_]) -> float:
        contacts, function = self._switches
        state = self._run.state_at(self._run.t, self._run.bound.y)
        u, rates = (np.array(each).ravel() for each in function(state.t, state.q, state.v, state.p))
        with np.errstate(divide="ignore", invalid="ignore"):
            times = np.where(closed[contacts] & (u * rates < 0), -u / rates, np.inf)
        return float(times.min(initial=np.inf))

    def _cross(self, dt: float) -> None:
        run, bound, found = self._run, self._run.bound, self._run.found
        found.reached = run.t + dt
        bound.new[:], bound.k_new[:] = switch_event.opened(run, found.reached, bound.y + dt * bound.k)
        found.is_open = found.is_still = True
        found.taken, found.proposed = dt, max(self._wished, run.control.step)
        self._wished = 0.0
