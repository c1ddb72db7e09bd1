"""Impacts and changes of closed contacts at an incident of a run, reported with their impulses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lagcli.compiled.selection import Selection
from lagcli.frozen import frozen
from lagcli.simulation.closed_contacts import (
    contact_change,
    contact_gradient,
    contact_mode,
    impact_series,
)
from lagcli.simulation.closed_contacts.contact_change import ContactsUndecided, ImpactResult
from lagcli.simulation.closed_contacts.contact_instant import (
    ContactInstant,
    ContactParameters,
    ContactRowValues,
    Flags,
)
from lagcli.simulation.closed_contacts.contact_mode import ContactMode
from lagcli.simulation.closed_contacts.contact_series import ContactOrders, MotionSeries
from lagcli.simulation.events import contact_crossings, contact_report, crowded_impacts
from lagcli.simulation.events.contact_report import ContactReport
from lagcli.simulation.events.declared_events import EventValues
from lagcli.simulation.events.incident_log import IncidentLog
from lagcli.simulation.events.step_watch import StateAhead, StepWatch
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme import line_functions
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness import named_functions

Floats = npt.NDArray[np.float64]
Found = TypeVar("Found")

# Changes without a step between them, after which a run stops.
MOST_AGAIN = 64
# An instant at which a gap is violated by so many times what counts as near is no zero of it: the gap jumps there.
PROJECTED = 1e4


@frozen
class SwitchSide:
    """The line of the table, and values of events (E,), on this side of a switch; crossing: events that go through zero
    there without a jump."""

    line: Floats
    events: Floats
    crossing: tuple[int, ...]


class ContactChanges:
    """The contacts of a run at its state."""

    def __init__(self, stepper: Stepper) -> None:
        self._run, self.log = stepper, IncidentLog(stepper)
        self._system = system = stepper.bound.enforced.system
        self._rows, self._count = len(system.rows.rows), system.contacts.count
        self._open = stepper.bound.enforced.selection.opened(self._rows)
        plain = stepper.bound.enforced.plain.functions.numeric
        # A run that is resumed may stand with contacts closed.
        self._base = plain if plain.selection == self._open else plain.keeping(self._open)
        self._values = ContactRowValues(self._base, self._rows)
        self._series = MotionSeries(self._base)
        self.events = EventValues(stepper, self.log)
        self._restitution, self._names = system.model.restitution, system.model.contact_names
        self._kinked = named_functions.switching_contacts(system.model)
        # Extents of gaps, as `ContactInstant.lowest`, in the step behind (K,).
        self._lowest = np.full(self._count, np.inf)

    @property
    def closed(self) -> tuple[int, ...]:
        """The contacts that press."""
        return contact_mode.closed_in(self._run.bound.numeric, self._rows)

    @property
    def idle(self) -> tuple[int, ...]:
        """The contacts that lie closed on others and carry nothing."""
        return tuple(i - self._rows for i in self._run.bound.numeric.idle_rows)

    def here(self, across: float = 0.0) -> ContactInstant:
        """The contacts where the run stands, a time across behind a switch."""
        return self._instant(self._run.t, self._run.bound.y, across)

    def _instant(self, t: float, y: Floats, across: float = 0.0) -> ContactInstant:
        run = self._run
        given = float(run.tolerance[0]), run.found.taken, run.contacts.size
        times = {"across": max(across, run.timetable.least), "ahead": run.control.step}
        chosen = ContactParameters(*given, since=t - run.grid.start, **times)
        return ContactInstant(self._values, run.state_at(t, y.copy()), chosen)

    def noise(self, watch: StepWatch) -> Floats:
        """The noise of gaps and multipliers in the step that was found, in which terms that cancel may grow, and room
        for that of events (W,)."""
        noise, run = np.zeros(watch.functions.kinds.numbers.size), self._run
        if not self._count:
            return noise
        here, there = self.here(), self._instant(run.found.reached, run.bound.new)
        found, self._lowest = np.fmax(here.noise, there.noise), here.lowest
        touching = list(run.contacts.touching)
        # Steps are held no closer than to their absolute tolerance.
        known = here.sizes_of_changes(np.full(here.state.q.size, float(run.tolerance[1])))
        found[touching] = (here.touching_gap + known)[touching]
        if run.contacts.again == 0:
            self._require_apart(here, 2.0)
        if self.closed:
            closed, own = np.array([*self.closed, *self.idle], dtype=np.intp), slice(here.state.q.size, -1)
            sides = (here, run.bound.k), (there, run.bound.k_new)
            found[closed] = np.fmax(*(at.least_forces(closed, k[own]) for at, k in sides))
        noise[: watch.functions.contacts.size] = found[watch.functions.contacts]
        return noise

    def _require_apart(self, here: ContactInstant, room: float) -> None:
        deep = np.flatnonzero(here.g < -room * here.touching_gap).tolist()
        if deep:
            depth, contact = max((float(-here.g[j]), j) for j in deep)
            raise _jump(self._run, self._names[contact], depth)

    def require_open(self, watch: StepWatch, w: Floats) -> None:
        """Raise `StepFailure` where open contacts are violated at a switch, by the watched values w (W,): their walls
        jump, and do not only move."""
        run = self._run
        there = self._instant(run.found.reached, run.bound.new)
        least = -2 * (there.touching_gap + run.found.taken * np.abs(there.speeds))
        contacts = watch.functions.contacts
        opened = [(i, int(contacts[i])) for i in np.flatnonzero(watch.is_open)]
        deep = [(float(-w[i]), j) for i, j in opened if w[i] < least[j]]
        if deep:
            depth, contact = max(deep)
            raise _jump(run, self._names[contact], depth)

    def unresolved(self) -> str:
        """The reason to stop where the zeros of a gap cannot be told apart."""
        return contact_report.unresolved(self.here().g if self._count else np.zeros(0), self._names)

    def sinking(self) -> tuple[int, ...]:
        """The rows of contacts that have to be closed where the run stands, for they creep in and would press."""
        run = self._run
        if not run.contacts.touching:
            return ()
        here = self.here()
        sunk = _sunk(run, here)
        if not sunk.any():
            return ()
        level = sunk | here.at_rest
        closed = self._decided(lambda: contact_change.contact_forces(here, level, sunk)).closed
        return tuple(self._rows + j for j in closed if sunk[j])

    def begin(self) -> None:
        """Decide the contacts at the start; an impact there is an incident."""
        self.log.is_switched, here = True, self.here(self._run.found.taken)
        if here.near.any():
            self._require_directions(here, np.flatnonzero(here.near).tolist())
            self._change(here, None, is_start=True)

    def at_switch(self, side: SwitchSide, events: list[int]) -> list[int]:
        """Decide the contacts anew where functions of t, or in closed contacts, have switched: forces, velocities of
        walls and their gradients may jump; of the events of the switch those that are left to be reported.

        At an edge only an impact asks for one gradient.
        """
        here = self.here(self._run.found.taken)
        # A wall that is suddenly faster may be away from a contact that is closed, within the time across.
        if not (here.near.any() or self.closed or self.idle) or _press_on(self._run, here, self.closed):
            return events
        approaching = here.near & (here.speeds < -here.slow)
        if approaching.any():
            self._require_directions(here, np.flatnonzero(approaching).tolist())
        return [*side.crossing] if self._change(here, None, switch=side) else events

    def at(self, hits: tuple[int, ...], ahead: StateAhead | None) -> None:
        """Change what changes where watched functions cross zero, by the numbers of their rows."""
        run = self._run
        if run.contacts.again > MOST_AGAIN:
            names = ", ".join(
                f"`{self._system.multiplier_rows[i].name}`" for i in hits if i < self._rows + self._count
            )
            raise StepFailure(
                f"the contacts {names} open and close without end at one instant", run_stop.CONTACT
            )
        first = self._rows + self._count
        events = [i - first for i in hits if i >= first]
        if events:
            self.events.report(events)
        if any(i < first for i in hits):
            here = self.here()
            self._require_directions(here, [i - self._rows for i in hits if self._rows <= i < first])
            self._require_apart(here, PROJECTED)
            if run.contacts.again > MOST_AGAIN / 2:
                # What closes again and again without a step approaches, however slowly.
                here.slow[:] = np.minimum(here.slow, here.speed_roundoff)
            self._change(here, ahead, hits=hits)
        else:
            run.contacts = dataclasses.replace(run.contacts, unarmed=hits, last=run.t)

    def _require_directions(self, here: ContactInstant, contacts: list[int]) -> None:
        """Raise `StepFailure` where a contact that may have closed has no gradient to push along."""
        fallen = contact_gradient.fallen(here, self._lowest, contacts)
        if fallen.any() or self._kinked.any():
            self._decided(lambda: contact_gradient.require(here, fallen, self._kinked))

    def _change(
        self,
        here: ContactInstant,
        ahead: StateAhead | None,
        is_start: bool = False,
        hits: tuple[int, ...] = (),
        switch: SwitchSide | None = None,
    ) -> bool:
        """Decide the contacts at an instant; False where nothing has changed across a switch."""
        run, lying_before = self._run, {*self.closed, *self.idle}
        line, own, when = None, self.log.line(), self.events.now() if switch is None else switch.events
        before, jumped = own if ahead is None or ahead.before is None else ahead.before, list[int]()
        here, before, impact = self._impact(here, before, lying_before)
        is_apart = impact is not None and here.parts(impact.onward)
        after = here if impact is None or is_apart else here.moved(impact.onward)
        level = np.zeros(self._count, dtype=bool) if is_apart else after.at_rest
        if impact is not None:
            level |= impact.accumulated
        look = after
        if impact is None and ahead is not None:
            level[list(lying_before)] = True
            # Where the instant itself has no values a state beyond it decides, and who shares a load of which rows that
            # depend on each other.
            among = np.flatnonzero(level).tolist()
            if (
                ahead.before is not None
                or self.idle
                or not contact_mode.are_independent(self._open, after, among)
            ):
                look = self._instant(ahead.t, ahead.y)
        sunk = _sunk(run, here) if switch is None else None
        crossing = np.zeros(self._count, dtype=bool)
        crossing[[i - self._rows for i in hits if i - self._rows in lying_before]] = True
        mode = self._mode((after, look), level, (sunk, crossing), is_start)
        closed = set(mode.closed)
        lying = closed | {dependency[0] - self._rows for dependency in mode.selection.idle}
        touching = tuple(j for j in np.flatnonzero(level).tolist() if j not in closed)
        if switch is not None and impact is None and _stays(run, here, mode.selection, lying_before):
            run.contacts = contact_report.touching(run.contacts, touching, impact)
            return False
        crossed = {i - self._rows - self._count for i in hits} | set(switch.crossing if switch else ())
        if impact is not None and impact.ended.any():
            # The impact is reported as it is, with rebounds that are left out from here on.
            bouncing = sorted(closed - set(np.flatnonzero(impact.ended).tolist()))
            selection = contact_mode.selection
            self._go_on(self._decided(lambda: selection(self._open, after, bouncing, self._rows)), impact.v)
            line, bounced = self.log.line(), self.events.now()
            jumped, when = self.events.jumped(when, bounced), bounced
        if impact is not None and impact.way is not None:
            run.bound.y[: impact.way.size] += impact.way
        self._go_on(mode.selection, here.state.v if impact is None else impact.onward)
        now = self.log.line()
        line = now if line is None else line
        if impact is not None:
            contact_crossings.require_projected(run, impact.onward, here.state.v)
            # What the impact takes away is work done there: the balance of the energy goes on.
            run.bound.y[-1] += now[line_functions.JACOBI] - before[line_functions.JACOBI]
        unarmed = tuple(i for i in hits if i >= self._rows and i - self._rows in lying & lying_before)
        fresh, ending, cut = contact_report.endings(run, impact, lying)
        shared = {*run.contacts.shared, *mode.selection.indeterminate, *(impact.shared if impact else ())}
        decided = dataclasses.replace(run.contacts, unarmed=unarmed, last=run.t, size=here.size)
        decided = dataclasses.replace(decided, ending=ending, shared=tuple(sorted(shared)))
        run.contacts = contact_report.touching(decided, touching, impact)
        closing = self.events.jumped(when, self.events.now())
        # A multiplier jumps where the rebounds that are left out are at their end.
        if fresh:
            run.contacts, closing = contact_report.postponed(run.contacts, set(closing) - crossed), []
        events = [] if is_start else sorted({*jumped, *closing} - crossed)
        stay = lying - (fresh & lying_before)
        before = switch.line if switch is not None and before is own else before
        self._report(ContactReport(before, line, impact, lying_before, stay, events, cut), is_start)
        self.end_series()
        return True

    def _mode(
        self,
        sides: tuple[ContactInstant, ContactInstant],
        level: Flags,
        at_zero: tuple[Flags | None, Flags],
        is_start: bool,
    ) -> ContactMode:
        """The rows beyond an instant; sides: the instant, and the one by which forces are judged; level: contacts that
        may press there; at_zero: those that creep in, and those whose multipliers are zero there."""
        (after, look), (sunk, crossing) = sides, at_zero
        if not level.any():
            return ContactMode(self._open, ())
        numbers = np.flatnonzero(level)
        forces = self._decided(lambda: contact_change.contact_forces(look, level, sunk))
        if look is after:
            # The start is known exactly, other states to the tolerance.
            known = 0.0 if is_start else float(self._run.tolerance[0])
            forces = ContactOrders(self._series, after, known).decided(forces, numbers, crossing)
        return self._decided(
            lambda: contact_mode.mode(self._open, after, forces, numbers.tolist(), self._rows)
        )

    def _impact(
        self, here: ContactInstant, before: Floats, lying: set[int]
    ) -> tuple[ContactInstant, Floats, ImpactResult | None]:
        """The last of the impacts that follow each other at once, with the contacts and the line before it."""
        run = self._run
        before_it = crowded_impacts.before(run, lying, self._count)
        series = self._decided(lambda: impact_series.impacts(here, self._restitution, before_it))
        for one in series[:-1]:
            here, before = self._strike(here, before, one)
        crowded_impacts.count(run, [one.impacting for one in series], self._restitution, self._names)
        return here, before, series[-1] if series else None

    def _strike(
        self, here: ContactInstant, before: Floats, impact: ImpactResult
    ) -> tuple[ContactInstant, Floats]:
        """Go on behind an impact that another one follows at once; the contacts and the line there."""
        run = self._run
        self._go_on(self._open, impact.v)
        contact_crossings.require_projected(run, impact.v, here.state.v)
        after = self.log.line()
        run.bound.y[-1] += after[line_functions.JACOBI] - before[line_functions.JACOBI]
        self._report(ContactReport(before, after, impact, set(), set(), [], set()), False)
        shared = {*run.contacts.shared, *impact.shared}
        run.contacts = dataclasses.replace(run.contacts, shared=tuple(sorted(shared)))
        return here.moved(impact.v), after

    def end_series(self) -> None:
        """Tell of series of rebounds that end at the state where the run stands."""
        self.events.report(contact_report.end_series(self._run, self.log, self._names))

    def _go_on(self, selection: Selection, v: Floats) -> None:
        """Go on with these rows, from velocities v (n,)."""
        run = self._run
        now = run.bound.enforced.selection
        if (selection.inactive, selection.idle) != (now.inactive, now.idle):
            run.bind(run.bound.enforced.keeping(selection))
        bound, n = run.bound, v.size
        bound.y[n : 2 * n] = v
        bound.project.trigger()
        bound.y[:], bound.k[:], *_ = bound.project.results
        run.statistics.evaluations += 1
        contact_crossings.predict(run)

    def _report(self, reported: ContactReport, is_start: bool) -> None:
        run = self._run
        lines = reported.lines(self._rows, self._count)
        is_told = not is_start and run.statistics.steps > 0
        for kind, contacts in reported.kinds({j for j, _ in run.contacts.ending}, is_told):
            for j in contacts:
                self.log.report(kind, self._names[j], lines)
        self.events.report(reported.events, lines)

    def _decided(self, law: Callable[[], Found]) -> Found:
        try:
            return law()
        except ContactsUndecided as error:
            names = ", ".join(f"`{self._names[j]}`" for j in error.contacts)
            raise StepFailure(f"{error}: {names}", run_stop.CONTACT) from None


def _jump(run: Stepper, name: str, depth: float) -> StepFailure:
    if contact_crossings.is_near(run):
        return contact_crossings.stop(run, f"the gap of `{name}` is not known better than to {depth:.3g}")
    return StepFailure(
        f"the wall of `{name}` jumps there, by {depth:.3g} onto the wrong side: an impact of which no law tells the"
        " impulse",
        run_stop.CONTACT,
    )


def _sunk(run: Stepper, here: ContactInstant) -> Flags:
    """Contacts that touch without a push worth mentioning and creep in all the same, (K,): as slowly as something that
    falls over."""
    touching = np.zeros(here.g.size, dtype=bool)
    touching[list(run.contacts.touching)] = True
    return np.asarray(touching & (here.g < -here.touching_gap) & (here.speeds < 0.0))


def _stays(run: Stepper, here: ContactInstant, selection: Selection, lying: set[int]) -> bool:
    """True where the run stands with these rows already, and on those of the contacts that lie closed."""
    is_on = (np.abs(here.speeds) <= here.speed_roundoff)[sorted(lying)].all()
    return bool(is_on) and selection == run.bound.enforced.selection


def _press_on(run: Stepper, here: ContactInstant, closed: tuple[int, ...]) -> bool:
    """True where the contacts that are closed still press, all of them, and no other may: then nothing is decided."""
    level = here.at_rest
    level[list(closed)] = False
    approaching = here.near & (here.speeds < -here.slow)
    if not closed or level.any() or approaching.any() or not here.near[list(closed)].all():
        return False
    if (np.abs(here.speeds) > here.speed_roundoff)[list(closed)].any():
        return False
    bound, contacts, n = run.bound, np.array(closed, dtype=np.intp), here.state.q.size
    rate, multipliers = bound.numeric.solved(here.state.t, bound.y, bound.p)
    forces = np.array(multipliers).ravel()[-here.g.size :][contacts]
    return bool((forces > here.least_forces(contacts, np.array(rate).ravel()[n : 2 * n])).all())
