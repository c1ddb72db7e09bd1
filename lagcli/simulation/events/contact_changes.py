"""Impacts and changes of closed contacts at an incident of a run, reported with their impulses."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lagcli.compiled.selection import Selection
from lagcli.equations import named_functions
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
from lagcli.simulation.events import contact_crossings, crowded_impacts
from lagcli.simulation.events.declared_events import EventValues
from lagcli.simulation.events.incident_log import IncidentLog, InstantLines
from lagcli.simulation.events.step_watch import StateAhead
from lagcli.simulation.events.watch_functions import WatchFunctions
from lagcli.simulation.run_state import run_stop
from lagcli.simulation.run_state.incident import Kind
from lagcli.simulation.run_state.run_stop import StepFailure
from lagcli.simulation.scheme import line_functions
from lagcli.simulation.stepping.stepper import Stepper

Floats = npt.NDArray[np.float64]
Found = TypeVar("Found")

# Changes without a step between them, after which a run stops.
MOST_AGAIN = 64
# An instant at which a gap is violated by so many times what counts as near is no zero of it: the gap jumps there.
PROJECTED = 1e4


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

    def here(self) -> ContactInstant:
        """The contacts where the run stands."""
        return self._instant(self._run.t, self._run.bound.y)

    def _instant(self, t: float, y: Floats) -> ContactInstant:
        run = self._run
        chosen = ContactParameters(float(run.tolerance[0]), run.found.taken, run.contacts.size)
        return ContactInstant(self._values, run.state_at(t, y.copy()), chosen)

    def noise(self, functions: WatchFunctions, count: int) -> Floats:
        """The noise of gaps and multipliers that are watched, and room for that of events (W,)."""
        noise = np.zeros(count)
        if self._count:
            gaps, forces = self.noises()
            first = len(functions.open_)
            noise[:first] = gaps[functions.open_]
            noise[first : first + len(functions.enforced)] = forces[functions.enforced]
        return noise

    def noises(self) -> tuple[Floats, Floats]:
        """The noise of gaps and of multipliers (K,) at the state: what is zero there."""
        here = self.here()
        gaps, self._lowest = here.noise.copy(), here.lowest
        touching = list(self._run.contacts.touching)
        gaps[touching] = here.touching_gap[touching]
        if self._run.contacts.again == 0:
            self._require_apart(here, 2.0)
        forces = np.zeros(self._count)
        if self.closed:
            closed = np.array([*self.closed, *self.idle], dtype=np.intp)
            n = here.state.q.size
            forces[closed] = here.least_forces(closed, self._run.bound.k[n : 2 * n])
        return gaps, forces

    def _require_apart(self, here: ContactInstant, room: float) -> None:
        deep = np.flatnonzero(here.g < -room * here.touching_gap).tolist()
        if deep:
            raise self._jump(*max((float(-here.g[j]), j) for j in deep))

    def require_open(self, contacts: list[int], g: Floats) -> None:
        """Raise `StepFailure` where open contacts are violated at a switch, with watched values g beginning with
        their gaps: their walls jump."""
        here = self.here()
        deep = [(float(-g[i]), j) for i, j in enumerate(contacts) if g[i] < -2 * here.touching_gap[j]]
        if deep:
            raise self._jump(*max(deep))

    def _jump(self, depth: float, contact: int) -> StepFailure:
        name = self._names[contact]
        if contact_crossings.is_near(self._run):
            return contact_crossings.stop(
                self._run, f"the gap of `{name}` is not known better than to {depth:.3g}"
            )
        return StepFailure(
            f"the wall of `{name}` jumps there, by {depth:.3g} onto the wrong side: an impact of which no law tells the"
            " impulse",
            run_stop.CONTACT,
        )

    def unresolved(self) -> str:
        """The reason to stop where the zeros of a gap cannot be told apart."""
        return "a gap of an inequality, or a declared event, crosses zero so often that its zeros cannot be told apart"

    def _sunk(self, here: ContactInstant) -> Flags:
        """Contacts that touch without a push worth mentioning and creep in all the same, (K,): as slowly as something
        that falls over."""
        sunk = (here.g < -here.touching_gap) & (here.speeds < 0.0)
        touching = np.zeros(self._count, dtype=bool)
        touching[list(self._run.contacts.touching)] = True
        return np.asarray(sunk & touching)

    def sinking(self) -> tuple[int, ...]:
        """The rows of contacts that have to be closed where the run stands, for they creep in and would press."""
        touching = list(self._run.contacts.touching)
        if not touching:
            return ()
        here = self.here()
        sunk = self._sunk(here)
        if not sunk.any():
            return ()
        level = sunk | here.at_rest
        closed = self._decided(lambda: contact_change.contact_forces(here, level, sunk)).closed
        return tuple(self._rows + j for j in closed if sunk[j])

    def begin(self) -> None:
        """Decide the contacts at the start; an impact there is an incident."""
        here = self.here()
        if here.near.any():
            self._require_directions(here, np.flatnonzero(here.near).tolist())
            self._change(here, None, is_start=True)

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
    ) -> None:
        run, when, closed_before = self._run, self.events.now(), set(self.closed)
        before = self.log.line() if ahead is None or ahead.before is None else ahead.before
        lying_before = closed_before | set(self.idle)
        here, before, impact = self._impact(here, before, lying_before)
        is_apart = impact is not None and here.parts(impact.onward)
        after = here if impact is None or is_apart else here.moved(impact.onward)
        level = np.zeros(self._count, dtype=bool) if is_apart else after.at_rest
        if impact is not None:
            level |= impact.accumulated
        look = after
        if impact is None and ahead is not None:
            level[list(lying_before)] = True
            look = self._instant(ahead.t, ahead.y)
        mode = ContactMode(self._open, ())
        if level.any():
            numbers = np.flatnonzero(level).tolist()
            sunk = self._sunk(here)
            forces = self._decided(lambda: contact_change.contact_forces(look, level, sunk))
            mode = self._decided(lambda: contact_mode.mode(self._open, after, forces, numbers, self._rows))
        closed = set(mode.closed)
        lying = closed | {dependency[0] - self._rows for dependency in mode.selection.idle}
        touching = tuple(j for j in np.flatnonzero(level).tolist() if j not in closed)
        line, crossed = None, {i - self._rows - self._count for i in hits}
        jumped: list[int] = []
        if impact is not None and impact.ended.any():
            # The impact is reported as it is, with rebounds that are left out from here on.
            bouncing = sorted(closed - set(np.flatnonzero(impact.ended).tolist()))
            self._go_on(contact_mode.selection(self._open, after, bouncing, self._rows), impact.v)
            line, bounced = self.log.line(), self.events.now()
            jumped, when = self.events.jumped(when, bounced), bounced
        self._go_on(mode.selection, here.state.v if impact is None else impact.onward)
        if impact is not None:
            contact_crossings.require_projected(run, impact.onward, here.state.v)
        now = self.log.line()
        line = now if line is None else line
        if impact is not None:
            # What the impact takes away is work done there: the balance of the energy goes on.
            run.bound.y[-1] += now[line_functions.JACOBI] - before[line_functions.JACOBI]
        unarmed = tuple(i for i in hits if i >= self._rows and i - self._rows in lying & lying_before)
        fresh = set() if impact is None else set(np.flatnonzero(impact.ended).tolist()) & lying
        ending = [each for each in run.contacts.ending if each[0] in lying - fresh]
        # Rebounds that something else cuts off are at their end here.
        cut = {j for j, _ in run.contacts.ending} - {j for j, _ in ending}
        if impact is not None:
            ending += [(j, run.t + float(impact.lasting[j])) for j in sorted(fresh)]
        shared = {*run.contacts.shared, *mode.selection.indeterminate, *(impact.shared if impact else ())}
        run.contacts = dataclasses.replace(
            run.contacts,
            touching=touching,
            unarmed=unarmed,
            last=run.t,
            size=here.size,
            ending=tuple(ending),
            shared=tuple(sorted(shared)),
        )
        jumped += self.events.jumped(when, self.events.now())
        events = [] if is_start else sorted(set(jumped) - crossed)
        stay = lying - (fresh & lying_before)
        self._report(_ContactReport(before, line, impact, lying_before, stay, events, cut), is_start)
        self.end_series()

    def _impact(
        self, here: ContactInstant, before: Floats, lying: set[int]
    ) -> tuple[ContactInstant, Floats, ImpactResult | None]:
        """The last of the impacts that follow each other at once, with the contacts and the line before it."""
        run, together = self._run, np.zeros(self._count, dtype=bool)
        together[[*lying, *run.contacts.touching]] = True
        away = impact_series.apart(here, together, crowded_impacts.last(run, self._count))
        series = self._decided(lambda: impact_series.impacts(here, self._restitution, away))
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
        self._report(_ContactReport(before, after, impact, set(), set(), [], set()), False)
        shared = {*run.contacts.shared, *impact.shared}
        run.contacts = dataclasses.replace(run.contacts, shared=tuple(sorted(shared)))
        return here.moved(impact.v), after

    def end_series(self) -> None:
        """Tell of series of rebounds that end at the state where the run stands."""
        run = self._run
        due = [j for j, t in run.contacts.ending if t <= run.t]
        if not due:
            return
        line = self.log.line()
        kinds: tuple[Kind, ...] = ("accumulation", "contact")
        for kind in kinds:
            for j in due:
                self.log.report(kind, self._names[j], InstantLines(line, line))
        left = tuple(each for each in run.contacts.ending if each[0] not in due)
        run.contacts = dataclasses.replace(run.contacts, ending=left, last=run.t)

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

    def _report(self, reported: _ContactReport, is_start: bool) -> None:
        run, impact = self._run, reported.impact
        impulses = np.zeros(self._rows + self._count)
        kinds: list[tuple[Kind, Iterable[int]]] = [
            ("accumulation", sorted(reported.cut)),
            ("contact", sorted(reported.cut)),
        ]
        if impact is not None:
            impulses[: self._rows] = impact.of_equalities
            impulses[self._rows :] = impact.of_contacts
            kinds.append(("impact", np.flatnonzero(impact.impacting).tolist()))
            kinds.append(("accumulation", np.flatnonzero(impact.accumulated).tolist()))
        if impact is not None or not (is_start or run.t == run.grid.start):
            ending = {j for j, _ in run.contacts.ending}
            kinds.append(("contact", sorted(reported.enforced - reported.enforced_before - ending)))
            kinds.append(("release", sorted(reported.enforced_before - reported.enforced)))
        lines = InstantLines(reported.before, reported.after, impulses)
        for kind, contacts in kinds:
            for j in contacts:
                self.log.report(kind, self._names[j], lines)
        self.events.report(reported.events, lines)

    def _decided(self, law: Callable[[], Found]) -> Found:
        try:
            return law()
        except ContactsUndecided as error:
            names = ", ".join(f"`{self._names[j]}`" for j in error.contacts)
            raise StepFailure(f"{error}: {names}", run_stop.CONTACT) from None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _ContactReport:
    """Lines before and after a change, the impact, and contacts that were enforced as closed and are, declared events
    that jump over zero, and contacts whose rebounds are cut off."""

    before: Floats
    after: Floats
    impact: ImpactResult | None
    enforced_before: set[int]
    enforced: set[int]
    events: list[int]
    cut: set[int]
