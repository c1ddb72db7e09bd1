"""Contacts decided at an instant: the impacts there, the rows that act beyond them, and what is told of both."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Set as AbstractSet

import numpy as np

from lagcli.arrays import Flags, Floats, Indices
from lagcli.compiled.selection import Selection
from lagcli.frozen import frozen
from lagcli.simulation.closed_contacts import contact_change, contact_mode, impact_series
from lagcli.simulation.closed_contacts.contact_change import ImpactResult
from lagcli.simulation.closed_contacts.contact_instant import ContactInstant
from lagcli.simulation.closed_contacts.contact_mode import ContactMode, ContactOrders
from lagcli.simulation.events import run_contacts
from lagcli.simulation.events.event import IncidentLog, InstantLines
from lagcli.simulation.events.run_contacts import RunContacts
from lagcli.simulation.events.step_watch import EventValues, StateAhead, StepWatch
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.run_state.statistics import Kind
from lagcli.simulation.scheme import method
from lagcli.simulation.stepping.found_step import FoundStep
from lagcli.simulation.stepping.stepper import Stepper
from lagcli.smoothness import named_functions


@frozen
class SwitchSide:
    """The line of the table, and values of events (E,), on this side of a switch; crossing: events that go through zero
    there without a jump."""

    line: Floats
    events: Floats
    crossing: tuple[int, ...]


@frozen
class Occasion:
    """Why contacts are decided where the run stands. here: they there; ahead: a state beyond, by which those are judged
    that are released; hits: numbers of rows, and of declared events after all rows, of which the functions cross zero
    there; switch: the near side of the switch that the run stands behind; is_start: it begins."""

    here: ContactInstant
    ahead: StateAhead | None = None
    hits: tuple[int, ...] = ()
    switch: SwitchSide | None = None
    is_start: bool = False


@frozen
class _Struck:
    """The last of the impacts at an instant, which follow each other at once: the contacts before it, and behind it
    without the rebounds that are left out; the line before it; None where none approaches. is_apart: all contacts part
    behind it, or approach, so that none is closed."""

    here: ContactInstant
    after: ContactInstant
    line: Floats
    impact: ImpactResult | None
    is_apart: bool


class ContactDecision:
    """The contacts of a run, decided."""

    def __init__(self, contacts: RunContacts, log: IncidentLog, events: EventValues) -> None:
        self._contacts, self._run, self._log, self._events = contacts, contacts.run, log, events
        self._restitution = contacts.system.model.restitution

    def decide(self, why: Occasion) -> bool:
        """Decide the contacts where the run stands, and go on from there; False where nothing has changed across a
        switch."""
        run, contacts, log = self._run, self._contacts, self._log
        rows, lying, line, switch = contacts.rows, contacts.lying, log.line(), why.switch
        events = self._events.now() if switch is None else switch.events
        struck = self._struck(why, line, lying)
        here, impact = struck.here, struck.impact
        mode, level = self._mode(why, struck, lying)
        beyond = {*mode.closed, *(dependency[0] - rows for dependency in mode.selection.idle)}
        touching = tuple(j for j in np.flatnonzero(level).tolist() if j not in mode.closed)
        # Those of them are apart that were, or rebound.
        opened = {*run.contacts.apart} if impact is None else {*np.flatnonzero(impact.apart).tolist()}
        apart = tuple(j for j in touching if j in opened)
        is_on = (np.abs(here.speeds) <= here.speed_roundoff)[sorted(lying)].all()
        if switch and not impact and is_on and mode.selection == run.bound.enforced.selection:
            run.note(touching=touching, apart=apart)
            return False

        ended = set() if impact is None else set(np.flatnonzero(impact.ended).tolist())
        shown = None
        jumped: list[int] = []
        if impact is not None and ended:
            # Behind the impact as it is, with rebounds that are left out from here on.
            bouncing = sorted(set(mode.closed) - ended)
            choice = contact_mode.ModeChoice(contacts.open_, struck.after, rows)
            selection = contacts.decided(lambda: choice.of(bouncing))
            self._go_on(selection, impact.v)
            shown, behind = log.line(), self._events.now()
            jumped, events = self._events.jumped(events, behind), behind
        if impact is not None and impact.way is not None:
            run.bound.y[: impact.way.size] += impact.way
        self._go_on(mode.selection, here.state.v if impact is None else impact.onward)
        after = log.line()
        if impact is not None:
            run_contacts.require_projected(run, impact.onward, here.state.v)
            # What the impact takes away is work done there: the balance of the energy goes on.
            run.bound.y[-1] += after[method.JACOBI] - struck.line[method.JACOBI]

        # Rebounds that are left out from here on, and those that something else cuts off.
        fresh = ended & beyond
        ending = [each for each in run.contacts.ending if each[0] in beyond - fresh]
        cut = {j for j, _ in run.contacts.ending} - {j for j, _ in ending}
        if impact is not None:
            ending += [(j, run.t + float(impact.lasting[j])) for j in sorted(fresh)]
        run.note(
            unarmed=tuple(i for i in why.hits if i >= rows and i - rows in beyond & lying),
            last=run.t,
            size=here.size,
            ending=tuple(ending),
            shared=_shared(run, impact, mode.selection.indeterminate),
            touching=touching,
            apart=apart,
        )
        # Events that jump over zero, but for those that cross it there. A multiplier jumps where the rebounds that are
        # left out are at their end: what jumps by that is reported there.
        crossed = {i - rows - contacts.count for i in why.hits} | set(switch.crossing if switch else ())
        closing = set(self._events.jumped(events, self._events.now()))
        if fresh:
            until = max(t for _, t in run.contacts.ending)
            postponed = dict(run.contacts.postponed) | dict.fromkeys(closing - crossed, until)
            run.note(postponed=tuple(sorted(postponed.items())))
            closing = set()
        before = switch.line if switch and struck.line is line else struck.line
        is_told = not why.is_start and run.statistics.steps > 0
        sides = before, after if shown is None else shown
        lines = self._report(sides, impact, (lying, beyond - (fresh & lying)), cut, is_told)
        self._events.report([] if why.is_start else sorted({*jumped, *closing} - crossed), lines)
        self.end_series()
        return True

    def end_series(self) -> None:
        """Tell of series of rebounds that end at the state where the run stands, and of the events due with them."""
        run = self._run
        due = [j for j, t in run.contacts.ending if t <= run.t]
        events = [number for number, t in run.contacts.postponed if t <= run.t or not run.contacts.ending]
        if not (due or events):
            return
        line = self._log.line()
        kinds: tuple[Kind, ...] = ("accumulation", "contact")
        for kind in kinds:
            for j in due:
                self._log.report(kind, self._contacts.names[j], InstantLines(line, line))
        left = tuple(each for each in run.contacts.ending if each[0] not in due)
        later = tuple(each for each in run.contacts.postponed if each[0] not in events)
        last = run.t if due else run.contacts.last
        run.note(ending=left, postponed=later, last=last)
        self._events.report(events)

    def _struck(self, why: Occasion, line: Floats, lying: set[int]) -> _Struck:
        """Go on behind all impacts at an instant but the last one. lying: contacts that were closed before."""
        run, contacts, here = self._run, self._contacts, why.here
        if why.ahead is not None and why.ahead.before is not None:
            line = why.ahead.before
        before_it = run_contacts.before(run, lying, contacts.count)
        series = contacts.decided(lambda: impact_series.impacts(here, self._restitution, before_it))
        for one in series[:-1]:
            self._go_on(contacts.open_, one.v)
            run_contacts.require_projected(run, one.v, here.state.v)
            after = self._log.line()
            run.bound.y[-1] += after[method.JACOBI] - line[method.JACOBI]
            self._report((line, after), one)
            run.note(shared=_shared(run, one))
            here, line = here.moved(one.v), after
        run_contacts.count(run, [one.impacting for one in series], self._restitution, contacts.names)
        if not series:
            return _Struck(here, here, line, None, False)
        is_apart = here.parts(series[-1].onward)
        return _Struck(here, here if is_apart else here.moved(series[-1].onward), line, series[-1], is_apart)

    def _mode(self, why: Occasion, struck: _Struck, lying: set[int]) -> tuple[ContactMode, Flags]:
        """The rows beyond an instant, and the contacts that may press there (K,)."""
        contacts, after, ahead = self._contacts, struck.after, why.ahead
        level = np.zeros(contacts.count, dtype=bool) if struck.is_apart else after.at_rest
        look = after
        if struck.impact is not None:
            level = np.asarray(level | struck.impact.accumulated)
        elif ahead is not None:
            level[list(lying)] = True
            # Where the instant has no values itself a state beyond it decides, and who shares a load of which rows that
            # depend on each other.
            among = np.flatnonzero(level).tolist()
            is_open = ahead.before is not None or contacts.idle
            if is_open or not contact_mode.are_independent(contacts.open_, after, among):
                look = contacts.at(ahead.t, ahead.y, why.here.chosen.span, asked=among)
        if not level.any():
            return ContactMode(contacts.open_, ()), level
        sunk = contacts.sunk(struck.here) if why.switch is None else None
        numbers = np.flatnonzero(level)
        forces = contacts.decided(lambda: contact_change.contact_forces(look, level, sunk))
        if look is after:
            # Those whose multipliers are zero there; the start is known exactly, other states to the tolerance.
            crossing = np.zeros(contacts.count, dtype=bool)
            crossing[[i - contacts.rows for i in why.hits if i - contacts.rows in lying]] = True
            known = 0.0 if why.is_start else float(self._run.tolerance[0])
            forces = ContactOrders(contacts.series(numbers.tolist()), after, known).decided(
                forces, numbers, crossing
            )
        among = numbers.tolist()
        law = contact_mode.mode
        return contacts.decided(lambda: law(contacts.open_, after, forces, among, contacts.rows)), level

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

    def _report(
        self,
        sides: tuple[Floats, Floats],
        impact: ImpactResult | None,
        closed: tuple[AbstractSet[int], AbstractSet[int]] = (frozenset(), frozenset()),
        cut: AbstractSet[int] = frozenset(),
        is_told: bool = True,
    ) -> InstantLines:
        """Tell of the incidents of contacts in their order, between the lines before and after. closed: those that were
        enforced as closed before and after; cut: whose rebounds are cut off; is_told: of a change without an impact
        too. The result: the lines with the impulses of all rows (C + K,)."""
        run, contacts, (before, after) = self._run, self._contacts, closed
        impulses = np.zeros(contacts.rows + contacts.count)
        found: list[tuple[Kind, list[int]]] = [("accumulation", sorted(cut)), ("contact", sorted(cut))]
        if impact is not None:
            impulses[: contacts.rows], impulses[contacts.rows :] = impact.of_equalities, impact.of_contacts
            found.append(("impact", np.flatnonzero(impact.impacting).tolist()))
            found.append(("accumulation", np.flatnonzero(impact.accumulated).tolist()))
        if impact is not None or is_told:
            found.append(("contact", sorted(after - before - {j for j, _ in run.contacts.ending})))
            found.append(("release", sorted(before - after)))
        lines = InstantLines(*sides, impulses)
        for kind, numbers in found:
            for j in numbers:
                self._log.report(kind, contacts.names[j], lines)
        return lines


def _shared(run: Stepper, impact: ImpactResult | None, others: Iterable[int] = ()) -> tuple[int, ...]:
    """The rows whose multipliers or impulses were not unique at some time, with others and those of an impact."""
    return tuple(sorted({*run.contacts.shared, *others, *(impact.shared if impact else ())}))


# Changes without a step between them, after which a run stops.
MOST_AGAIN = 64
# An instant at which a gap is violated by so many times what counts as near is no zero of it: the gap jumps there.
PROJECTED = 1e4


class ContactChanges:
    """The contacts of a run at its state."""

    def __init__(self, stepper: Stepper) -> None:
        self._run, self.log = stepper, IncidentLog(stepper)
        self.events = EventValues(stepper, self.log)
        self._contacts = contacts = RunContacts(stepper)
        self.decision = ContactDecision(contacts, self.log, self.events)
        self._rows, self._count, self._names = contacts.rows, contacts.count, contacts.names
        self._kinked = named_functions.switching_contacts(contacts.system.model)

    def noise(self, watch: StepWatch, step: FoundStep, indices: Indices) -> tuple[Floats, Floats]:
        """The noise of gaps and multipliers in a step, in which terms that cancel may grow, with room for that of
        events (W,), and the extents of gaps at its begin, as `ContactInstant.lowest` (K,): of the functions at some
        indices."""
        noise, run = np.zeros(watch.functions.kinds.numbers.size), self._run
        if not self._count:
            return noise, np.zeros(0)
        asked = watch.functions.contacts[indices[indices < watch.functions.contacts.size]].tolist()
        ends = (run.t, run.bound.y), (step.reached, run.bound.new)
        here, there = (self._contacts.at(*end, step.taken, asked=asked, is_near=False) for end in ends)
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
        g = self._contacts.here(0.0).g if self._count else np.zeros(0)
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
        walls and their gradients may jump; of the events of the switch those that are left to be reported. At an edge
        only an impact asks for one gradient."""
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
        run, first = self._run, self._rows + self._count
        if run.contacts.again > MOST_AGAIN:
            rows = self._contacts.system.multiplier_rows
            names = ", ".join(f"`{rows[i].name}`" for i in hits if i < first)
            raise StepFailure(
                f"the contacts {names} open and close without end at one instant", run_stop.CONTACT
            )
        events = [i - first for i in hits if i >= first]
        if events:
            self.events.report(events)
        if any(i < first for i in hits):
            closing = [i - self._rows for i in hits if self._rows <= i < first]
            here = self._contacts.here(span, asked=closing)
            self._require_directions(here, closing, extents)
            self._require_no_jump(here.deep(PROJECTED))
            if run.contacts.again > MOST_AGAIN / 2:
                # What closes again and again without a step approaches, however slowly.
                here.slow[:] = np.minimum(here.slow, here.speed_roundoff)
            self.decision.decide(Occasion(here, ahead, hits))
        else:
            run.note(unarmed=hits, last=run.t)

    def _require_directions(
        self, here: ContactInstant, contacts: list[int], extents: Floats | None = None
    ) -> None:
        """Raise `StepFailure` where a contact that may have closed has no gradient to push along; extents: of gaps a
        step before, where these are known."""
        known = np.full(self._count, np.inf) if extents is None else extents
        fallen = contact_change.fallen(here, known, contacts)
        if fallen.any() or self._kinked.any():
            self._contacts.decided(lambda: contact_change.require_directions(here, fallen, self._kinked))
