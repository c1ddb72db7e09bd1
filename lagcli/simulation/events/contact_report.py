"""The incidents of contacts: what an impact or a change of them is reported as, and where series of rebounds end."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np

from lagcli.simulation.closed_contacts import contact_change
from lagcli.simulation.closed_contacts.contact_change import ImpactResult
from lagcli.simulation.closed_contacts.contact_instant import Floats
from lagcli.simulation.events.incident_log import IncidentLog, InstantLines
from lagcli.simulation.run_state.between_steps import ContactState
from lagcli.simulation.run_state.incident import Kind
from lagcli.simulation.stepping.stepper import Stepper


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


def touching(contacts: ContactState, touching: tuple[int, ...], impact: ImpactResult | None) -> ContactState:
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
