"""The contacts of a run along its steps: what they may not do there, and when they are decided anew."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant
from lagcli.simulation.events import run_contacts
from lagcli.simulation.events.contact_decision import ContactDecision, Occasion, SwitchSide
from lagcli.simulation.events.declared_events import EventValues
from lagcli.simulation.events.event import IncidentLog
from lagcli.simulation.events.run_contacts import RunContacts
from lagcli.simulation.events.step_watch import StateAhead, StepWatch
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness import named_functions

Floats = npt.NDArray[np.float64]

# Changes without a step between them, after which a run stops.
MOST_AGAIN = 64
# An instant at which a gap is violated by so many times what counts as near is no zero of it: the gap jumps there.
PROJECTED = 1e4
NO_GAPS: Floats = np.zeros(0)


class ContactChanges:
    """The contacts of a run at its state."""

    def __init__(self, stepper: Stepper) -> None:
        self._run, self.log = stepper, IncidentLog(stepper)
        self.events = EventValues(stepper, self.log)
        self._contacts = contacts = RunContacts(stepper)
        self.decision = ContactDecision(contacts, self.log, self.events)
        self._rows, self._count, self._names = contacts.rows, contacts.count, contacts.names
        self._kinked = named_functions.switching_contacts(contacts.system.model)

    def noise(self, watch: StepWatch, step: FoundStep) -> tuple[Floats, Floats]:
        """The noise of gaps and multipliers in a step, in which terms that cancel may grow, with room for that of
        events (W,); and the extents of gaps at its begin, as `ContactInstant.lowest` (K,)."""
        noise, run = np.zeros(watch.functions.kinds.numbers.size), self._run
        if not self._count:
            return noise, NO_GAPS
        here, there = (
            self._contacts.here(step.taken),
            self._contacts.at(step.reached, run.bound.new, step.taken),
        )
        found = np.fmax(here.noise, there.noise)
        touching = list(run.contacts.touching)
        # Steps are held no closer than to their absolute tolerance.
        known = here.sizes_of_changes(np.full(here.state.q.size, float(run.tolerance[1])))
        found[touching] = (here.touching_gap + known)[touching]
        if run.contacts.again == 0:
            self._require_no_jump(here.deep(2.0))
        if lying := [*self._contacts.closed, *self._contacts.idle]:
            closed, own = np.array(lying, dtype=np.intp), slice(here.state.q.size, -1)
            sides = (here, run.bound.k), (there, run.bound.k_new)
            found[closed] = np.fmax(*(at.least_forces(closed, k[own]) for at, k in sides))
        noise[: watch.functions.contacts.size] = found[watch.functions.contacts]
        return noise, here.lowest

    def require_open(self, watch: StepWatch, step: FoundStep, w: Floats) -> None:
        """Raise `StepFailure` where open contacts are violated at a switch, by the watched values w (W,): their walls
        jump, and do not only move."""
        there = self._contacts.at(step.reached, self._run.bound.new, step.taken)
        least = -2 * (there.touching_gap + step.taken * np.abs(there.speeds))
        contacts = watch.functions.contacts
        opened = [(i, int(contacts[i])) for i in np.flatnonzero(watch.is_open)]
        self._require_no_jump([(float(-w[i]), j) for i, j in opened if w[i] < least[j]])

    def _require_no_jump(self, deep: list[tuple[float, int]]) -> None:
        """Raise `StepFailure` where gaps are violated, by depths and numbers of contacts: their walls jump there."""
        if not deep:
            return
        depth, contact = max(deep)
        name = self._names[contact]
        if run_contacts.is_near(self._run):
            raise run_contacts.stop(self._run, f"the gap of `{name}` is not known better than to {depth:.3g}")
        raise StepFailure(
            f"the wall of `{name}` jumps there, by {depth:.3g} onto the wrong side: an impact of which no law tells the"
            " impulse",
            run_stop.CONTACT,
        )

    def unresolved(self) -> str:
        """The reason to stop where the zeros of a gap, or of a declared event, cannot be told apart."""
        g = self._contacts.here(0.0).g if self._count else NO_GAPS
        ending = np.flatnonzero(~np.isfinite(g)).tolist()
        if ending:
            return f"{contact_change.NO_GRADIENT}: {', '.join(f'`{self._names[j]}`' for j in ending)}"
        return "a gap of an inequality, or a declared event, crosses zero so often that its zeros cannot be told apart"

    def sinking(self, span: float) -> tuple[int, ...]:
        """The rows of contacts that have to be closed where the run stands, for they creep in and would press."""
        run = self._run
        if not run.contacts.touching:
            return ()
        here = self._contacts.here(span)
        sunk = self._contacts.sunk(here)
        if not sunk.any():
            return ()
        level = sunk | here.at_rest
        closed = self._contacts.decided(lambda: contact_change.contact_forces(here, level, sunk)).closed
        return tuple(self._rows + j for j in closed if sunk[j])

    def begin(self) -> None:
        """Decide the contacts at the start; an impact there is an incident."""
        run = self._run
        # At a switch it stands on the other side of it.
        across = run.t - run.grid.start
        self.log.is_switched, here = True, self._contacts.here(across, across)
        if here.near.any():
            self._require_directions(here, np.flatnonzero(here.near).tolist())
            self.decision.decide(Occasion(here, is_start=True))

    def at_switch(self, side: SwitchSide, taken: float, events: list[int]) -> list[int]:
        """Decide the contacts anew where functions of t, or in closed contacts, have switched: forces, velocities of
        walls and their gradients may jump; of the events of the switch those that are left to be reported.

        At an edge only an impact asks for one gradient.
        """
        here, closed = self._contacts.here(taken, taken), list(self._contacts.closed)
        # A wall that is suddenly faster may be away from a contact that is closed, within the time across.
        if not (here.near.any() or self._contacts.lying):
            return events
        level, approaching = here.at_rest, here.near & (here.speeds < -here.slow)
        level[closed] = False
        are_on = here.near & ~(np.abs(here.speeds) > here.speed_roundoff)
        if closed and not (level | approaching).any() and are_on[closed].all():
            # Nothing is decided where all that are closed still press, and no other may.
            bound, contacts, n = self._run.bound, np.array(closed, dtype=np.intp), here.state.q.size
            rate, multipliers = bound.numeric.solved(here.state.t, bound.y, bound.p)
            forces = np.array(multipliers).ravel()[-here.g.size :][contacts]
            if (forces > here.least_forces(contacts, np.array(rate).ravel()[n : 2 * n])).all():
                return events
        if approaching.any():
            self._require_directions(here, np.flatnonzero(approaching).tolist())
        return [*side.crossing] if self.decision.decide(Occasion(here, switch=side)) else events

    def at(
        self, hits: tuple[int, ...], ahead: StateAhead | None, span: float, extents: Floats | None
    ) -> None:
        """Change what changes where watched functions cross zero, by the numbers of their rows; extents: of gaps at the
        begin of the step of this span, as `noise` tells them."""
        run = self._run
        if run.contacts.again > MOST_AGAIN:
            names = ", ".join(
                f"`{self._contacts.system.multiplier_rows[i].name}`"
                for i in hits
                if i < self._rows + self._count
            )
            raise StepFailure(
                f"the contacts {names} open and close without end at one instant", run_stop.CONTACT
            )
        first = self._rows + self._count
        events = [i - first for i in hits if i >= first]
        if events:
            self.events.report(events)
        if any(i < first for i in hits):
            here = self._contacts.here(span)
            self._require_directions(here, [i - self._rows for i in hits if self._rows <= i < first], extents)
            self._require_no_jump(here.deep(PROJECTED))
            if run.contacts.again > MOST_AGAIN / 2:
                # What closes again and again without a step approaches, however slowly.
                here.slow[:] = np.minimum(here.slow, here.speed_roundoff)
            self.decision.decide(Occasion(here, ahead, hits))
        else:
            run.contacts = dataclasses.replace(run.contacts, unarmed=hits, last=run.t)

    def _require_directions(
        self, here: ContactInstant, contacts: list[int], extents: Floats | None = None
    ) -> None:
        """Raise `StepFailure` where a contact that may have closed has no gradient to push along; extents: of gaps a
        step before, where these are known."""
        known = np.full(self._count, np.inf) if extents is None else extents
        fallen = contact_change.fallen(here, known, contacts)
        if fallen.any() or self._kinked.any():
            self._contacts.decided(lambda: contact_change.require_directions(here, fallen, self._kinked))
