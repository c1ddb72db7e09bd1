"""Contacts decided at an instant: the impacts there, the rows that act beyond them, and what is told of both."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np

from lagcli.compiled.selection import Selection
from lagcli.frozen import frozen
from lagcli.simulation.closed_contacts import contact_change, contact_mode, impact_series
from lagcli.simulation.closed_contacts.contact_change import ImpactResult
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant, Flags, Floats
from lagcli.simulation.closed_contacts.contact_mode import ContactMode
from lagcli.simulation.closed_contacts.contact_series import ContactOrders
from lagcli.simulation.events import crowded_impacts, run_contacts
from lagcli.simulation.events.declared_events import EventValues
from lagcli.simulation.events.event import IncidentLog, InstantLines
from lagcli.simulation.events.run_contacts import RunContacts
from lagcli.simulation.events.step_watch import StateAhead
from lagcli.simulation.run_state.between_steps import ContactState
from lagcli.simulation.run_state.incident import Kind
from lagcli.simulation.scheme import method
from lagcli.simulation.stepping.stepper import Stepper


@frozen
class SwitchSide:
    """The line of the table, and values of events (E,), on this side of a switch; crossing: events that go through zero
    there without a jump."""

    line: Floats
    events: Floats
    crossing: tuple[int, ...]


@frozen
class Occasion:
    """Why contacts are decided where the run stands.

    here: they there; ahead: a state beyond, by which those are judged that are released; hits: numbers of rows, and of
    declared events after all rows, of which the functions cross zero there; switch: the near side of the switch that
    the run stands behind; is_start: it begins.
    """

    here: ContactInstant
    ahead: StateAhead | None = None
    hits: tuple[int, ...] = ()
    switch: SwitchSide | None = None
    is_start: bool = False


@frozen
class _Struck:
    """The last of the impacts at an instant, which follow each other at once: the contacts before it, and behind it
    without the rebounds that are left out; the line before it; None where none approaches.

    is_apart: all contacts part behind it, or approach, so that none is closed.
    """

    here: ContactInstant
    after: ContactInstant
    line: Floats
    impact: ImpactResult | None
    is_apart: bool


@frozen
class _Side:
    """The line of the table, and values of events (E,), where the run stands."""

    line: Floats
    events: Floats


class ContactDecision:
    """The contacts of a run, decided."""

    def __init__(self, contacts: RunContacts, log: IncidentLog, events: EventValues) -> None:
        self._contacts, self._run, self._log, self._events = contacts, contacts.run, log, events
        self._restitution = contacts.system.model.restitution

    def decide(self, why: Occasion) -> bool:
        """Decide the contacts where the run stands, and go on from there; False where nothing has changed across a
        switch."""
        run, rows, lying = self._run, self._contacts.rows, self._contacts.lying
        own = _Side(self._log.line(), self._events.now() if why.switch is None else why.switch.events)
        struck = self._struck(why, own.line, lying)
        level = self._level(why, struck, lying)
        mode = self._mode(why, struck, level, lying)
        beyond = {*mode.closed, *(dependency[0] - rows for dependency in mode.selection.idle)}
        touching = tuple(j for j in np.flatnonzero(level).tolist() if j not in mode.closed)
        if why.switch is not None and struck.impact is None and self._stays(struck.here, mode, lying):
            run.contacts = with_touching(run.contacts, touching, None)
            return False
        rebound = self._rebound(struck, mode)
        line = self._go_beyond(struck, mode.selection)
        fresh, ending, cut = endings(run, struck.impact, beyond)
        unarmed = tuple(i for i in why.hits if i >= rows and i - rows in beyond & lying)
        shared = _shared(run.contacts.shared, mode.selection.indeterminate, struck.impact)
        run.contacts = with_touching(
            dataclasses.replace(
                run.contacts, unarmed=unarmed, last=run.t, size=struck.here.size, ending=ending, shared=shared
            ),
            touching,
            struck.impact,
        )
        events = self._jumped(why, own, rebound, is_postponed=bool(fresh))
        before = struck.line
        if why.switch is not None and before is own.line:
            before = why.switch.line
        shown = line if rebound is None else rebound.line
        closed = beyond - (fresh & lying)
        self._report(ContactReport(before, shown, struck.impact, lying, closed, events, cut), why.is_start)
        self.end_series()
        return True

    def end_series(self) -> None:
        """Tell of series of rebounds that end at the state where the run stands."""
        self._events.report(end_series(self._run, self._log, self._contacts.names))

    def _struck(self, why: Occasion, line: Floats, lying: set[int]) -> _Struck:
        """Go on behind all impacts at an instant but the last one. lying: contacts that were closed before."""
        run, contacts, here = self._run, self._contacts, why.here
        if why.ahead is not None and why.ahead.before is not None:
            line = why.ahead.before
        before_it = crowded_impacts.before(run, lying, contacts.count)
        series = contacts.decided(lambda: impact_series.impacts(here, self._restitution, before_it))
        for one in series[:-1]:
            here, line = self._strike(here, line, one)
        crowded_impacts.count(run, [one.impacting for one in series], self._restitution, contacts.names)
        if not series:
            return _Struck(here, here, line, None, False)
        is_apart = here.parts(series[-1].onward)
        after = here if is_apart else here.moved(series[-1].onward)
        return _Struck(here, after, line, series[-1], is_apart)

    def _strike(
        self, here: ContactInstant, before: Floats, impact: ImpactResult
    ) -> tuple[ContactInstant, Floats]:
        """Go on behind an impact that another one follows at once; the contacts and the line there."""
        run = self._run
        self._go_on(self._contacts.open_, impact.v)
        run_contacts.require_projected(run, impact.v, here.state.v)
        after = self._log.line()
        run.bound.y[-1] += after[method.JACOBI] - before[method.JACOBI]
        self._report(ContactReport(before, after, impact, set(), set(), [], set()), False)
        run.contacts = dataclasses.replace(run.contacts, shared=_shared(run.contacts.shared, (), impact))
        return here.moved(impact.v), after

    def _level(self, why: Occasion, struck: _Struck, lying: set[int]) -> Flags:
        """The contacts that may press beyond an instant (K,)."""
        level = np.zeros(self._contacts.count, dtype=bool) if struck.is_apart else struck.after.at_rest
        if struck.impact is not None:
            return np.asarray(level | struck.impact.accumulated)
        if why.ahead is not None:
            level[list(lying)] = True
        return level

    def _judged_at(self, why: Occasion, struck: _Struck, level: Flags) -> ContactInstant:
        """The instant by which forces are judged.

        Where it has no values itself a state beyond it decides, and who shares a load of which rows that depend on each
        other.
        """
        after, contacts, ahead = struck.after, self._contacts, why.ahead
        if struck.impact is not None or ahead is None:
            return after
        among = np.flatnonzero(level).tolist()
        is_open = ahead.before is not None or contacts.idle
        if is_open or not contact_mode.are_independent(contacts.open_, after, among):
            return contacts.at(ahead.t, ahead.y, why.here.span)
        return after

    def _mode(self, why: Occasion, struck: _Struck, level: Flags, lying: set[int]) -> ContactMode:
        """The rows beyond an instant, of contacts (K,) that may press there."""
        contacts, after = self._contacts, struck.after
        look = self._judged_at(why, struck, level)
        if not level.any():
            return ContactMode(contacts.open_, ())
        sunk = contacts.sunk(struck.here) if why.switch is None else None
        numbers = np.flatnonzero(level)
        forces = contacts.decided(lambda: contact_change.contact_forces(look, level, sunk))
        if look is after:
            # Those whose multipliers are zero there; the start is known exactly, other states to the tolerance.
            crossing = np.zeros(contacts.count, dtype=bool)
            crossing[[i - contacts.rows for i in why.hits if i - contacts.rows in lying]] = True
            known = 0.0 if why.is_start else float(self._run.tolerance[0])
            forces = ContactOrders(contacts.series, after, known).decided(forces, numbers, crossing)
        return contacts.decided(
            lambda: contact_mode.mode(contacts.open_, after, forces, numbers.tolist(), contacts.rows)
        )

    def _stays(self, here: ContactInstant, mode: ContactMode, lying: set[int]) -> bool:
        """True where the run stands with these rows already, and on those of the contacts that lie closed."""
        is_on = (np.abs(here.speeds) <= here.speed_roundoff)[sorted(lying)].all()
        return bool(is_on) and mode.selection == self._run.bound.enforced.selection

    def _rebound(self, struck: _Struck, mode: ContactMode) -> _Side | None:
        """Behind an impact as it is, with rebounds that are left out from here on; None where none are."""
        contacts, impact = self._contacts, struck.impact
        if impact is None or not impact.ended.any():
            return None
        bouncing = sorted(set(mode.closed) - set(np.flatnonzero(impact.ended).tolist()))
        selection = contacts.decided(
            lambda: contact_mode.selection(contacts.open_, struck.after, bouncing, contacts.rows)
        )
        self._go_on(selection, impact.v)
        return _Side(self._log.line(), self._events.now())

    def _go_beyond(self, struck: _Struck, selection: Selection) -> Floats:
        """Go on with the rows beyond an instant; the line there."""
        run, here, impact = self._run, struck.here, struck.impact
        if impact is None:
            self._go_on(selection, here.state.v)
            return self._log.line()
        if impact.way is not None:
            run.bound.y[: impact.way.size] += impact.way
        self._go_on(selection, impact.onward)
        line = self._log.line()
        run_contacts.require_projected(run, impact.onward, here.state.v)
        # What the impact takes away is work done there: the balance of the energy goes on.
        run.bound.y[-1] += line[method.JACOBI] - struck.line[method.JACOBI]
        return line

    def _jumped(self, why: Occasion, own: _Side, rebound: _Side | None, is_postponed: bool) -> list[int]:
        """The declared events that jump over zero at an instant, but for those that cross it there.

        A multiplier jumps where the rebounds that are left out are at their end: what jumps by that is_postponed.
        """
        run, contacts = self._run, self._contacts
        crossed = {i - contacts.rows - contacts.count for i in why.hits}
        crossed |= set(why.switch.crossing if why.switch else ())
        jumped = [] if rebound is None else self._events.jumped(own.events, rebound.events)
        closing = self._events.jumped((rebound or own).events, self._events.now())
        if is_postponed:
            run.contacts, closing = postponed(run.contacts, set(closing) - crossed), []
        return [] if why.is_start else sorted({*jumped, *closing} - crossed)

    def _go_on(self, selection: Selection, v: Floats) -> None:
        """Go on with these rows, from velocities v (n,)."""
        run = self._run
        now = run.bound.enforced.selection
        if (selection.inactive, selection.idle) != (now.inactive, now.idle):
            run.bind(run.bound.enforced.keeping(selection))
        run.bound.y[v.size : 2 * v.size] = v
        run.bound.put_on_constraints()
        run.count(1)
        run_contacts.predict(run)

    def _report(self, reported: ContactReport, is_start: bool) -> None:
        run, contacts = self._run, self._contacts
        lines = reported.lines(contacts.rows, contacts.count)
        is_told = not is_start and run.statistics.steps > 0
        for kind, numbers in reported.kinds({j for j, _ in run.contacts.ending}, is_told):
            for j in numbers:
                self._log.report(kind, contacts.names[j], lines)
        self._events.report(reported.events, lines)


def _shared(known: Iterable[int], others: Iterable[int], impact: ImpactResult | None) -> tuple[int, ...]:
    """The rows whose multipliers or impulses were not unique at some time, with those of an impact."""
    return tuple(sorted({*known, *others, *(impact.shared if impact else ())}))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ContactReport:
    """Lines before and after a change, the impact, and contacts that were enforced as closed and are, declared events
    that jump over zero, and contacts whose rebounds are cut off."""

    before: Floats
    after: Floats
    impact: ImpactResult | None
    enforced_before: set[int]
    enforced: set[int]
    events: list[int]
    cut: set[int]

    def lines(self, rows: int, contacts: int) -> InstantLines:
        """The lines with the impulses of all rows (C + K,)."""
        impulses, impact = np.zeros(rows + contacts), self.impact
        if impact is not None:
            impulses[:rows], impulses[rows:] = impact.of_equalities, impact.of_contacts
        return InstantLines(self.before, self.after, impulses)

    def kinds(self, ending: set[int], is_told: bool) -> list[tuple[Kind, Iterable[int]]]:
        """The incidents of contacts, in their order; is_told: of a change without an impact too."""
        found: list[tuple[Kind, Iterable[int]]] = [
            ("accumulation", sorted(self.cut)),
            ("contact", sorted(self.cut)),
        ]
        if self.impact is not None:
            found.append(("impact", np.flatnonzero(self.impact.impacting).tolist()))
            found.append(("accumulation", np.flatnonzero(self.impact.accumulated).tolist()))
        if self.impact is not None or is_told:
            found.append(("contact", sorted(self.enforced - self.enforced_before - ending)))
            found.append(("release", sorted(self.enforced_before - self.enforced)))
        return found


def endings(
    run: Stepper, impact: ImpactResult | None, lying: set[int]
) -> tuple[set[int], tuple[tuple[int, float], ...], set[int]]:
    """Contacts among those that lie closed whose rebounds are left out from an impact on; all that are, with the times
    at which they end; and those whose rebounds something else cuts off."""
    fresh = set() if impact is None else set(np.flatnonzero(impact.ended).tolist()) & lying
    ending = [each for each in run.contacts.ending if each[0] in lying - fresh]
    cut = {j for j, _ in run.contacts.ending} - {j for j, _ in ending}
    ending += [(j, run.t + float(impact.lasting[j])) for j in sorted(fresh) if impact is not None]
    return fresh, tuple(ending), cut


def with_touching(
    contacts: ContactState, touching: tuple[int, ...], impact: ImpactResult | None
) -> ContactState:
    """With contacts that touch, of which those are apart that were, or rebound."""
    opened = {*contacts.apart} if impact is None else {*np.flatnonzero(impact.apart).tolist()}
    apart = tuple(j for j in touching if j in opened)
    return dataclasses.replace(contacts, touching=touching, apart=apart)


def end_series(run: Stepper, log: IncidentLog, names: Sequence[str]) -> list[int]:
    """Tell of series of rebounds that end at the state where the run stands; the events that are due with them."""
    due = [j for j, t in run.contacts.ending if t <= run.t]
    events = [number for number, t in run.contacts.postponed if t <= run.t or not run.contacts.ending]
    if not (due or events):
        return []
    line = log.line()
    kinds: tuple[Kind, ...] = ("accumulation", "contact")
    for kind in kinds:
        for j in due:
            log.report(kind, names[j], InstantLines(line, line))
    left = tuple(each for each in run.contacts.ending if each[0] not in due)
    later = tuple(each for each in run.contacts.postponed if each[0] not in events)
    last = run.t if due else run.contacts.last
    run.contacts = dataclasses.replace(run.contacts, ending=left, postponed=later, last=last)
    return events


def postponed(contacts: ContactState, events: set[int]) -> ContactState:
    """With events that are reported where the series of rebounds end."""
    until = max(t for _, t in contacts.ending)
    postponed = dict(contacts.postponed) | dict.fromkeys(events, until)
    return dataclasses.replace(contacts, postponed=tuple(sorted(postponed.items())))


def unresolved(g: Floats, names: Sequence[str]) -> str:
    """The reason to stop where the zeros of one of these gaps (K,) cannot be told apart."""
    ending = np.flatnonzero(~np.isfinite(g)).tolist()
    if ending:
        return f"{contact_change.NO_GRADIENT}: {', '.join(f'`{names[j]}`' for j in ending)}"
    return "a gap of an inequality, or a declared event, crosses zero so often that its zeros cannot be told apart"
