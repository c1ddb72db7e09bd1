"""The audit of a record with inequalities: each stretch as a smooth motion, and what joins them by the incidents."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from lagcli.auditing.checks import (
    checks_contact,
    checks_flight,
    checks_impact,
    checks_motion,
    checks_outputs,
    checks_pointwise,
    checks_steps,
    hamilton,
    momenta,
    stretches,
    uniqueness_text,
)
from lagcli.auditing.checks.audit_report import Check
from lagcli.auditing.checks.stretches import ContactStates
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.incident_record import Incidents
from lagcli.auditing.evidence.tolerances import Evidence

MOST = 60  # stretches, the longest ones, that are examined by differences
MOST_MODES = 60  # sets of closed contacts, those with most rows
TOLD = 3  # sets of closed contacts of which it is told what is determined

Found = tuple[list[Check], tuple[str, ...], tuple[tuple[str, float], ...], tuple[str, ...]]


class OneSidedAudit:
    """The checks of one record. e: of laws with all inequalities closed."""

    def __init__(self, e: Evidence, incidents: Incidents | None) -> None:
        self._e, self._incidents = e, incidents
        self._states: ContactStates = stretches.contact_states(e)
        self._closed = self._states.is_closed
        t = e.record.t
        if incidents is not None:
            self._cut = stretches.holds_incident(t, incidents)
        else:
            self._cut = stretches.may_hold_impact(t, self._states)
        self._stretches = stretches.split(t, self._closed, self._cut)
        self._steps = int((np.diff(t) > 0).sum())
        longest = sorted((k for k in self._stretches if len(k) >= stretches.LEAST), key=len, reverse=True)
        self._looked_at = sorted(longest[:MOST], key=lambda k: int(k[0]))

    def examined(self, columns: Sequence[str], rows: Array) -> Found:
        """Checks, sentences, figures and notes."""
        e, incidents = self._e, self._incidents
        checks = checks_contact.rows(e, self._states)
        impact = None
        if incidents is not None:
            checks.append(checks_contact.missed(e, self._states, incidents))
            impact = checks_impact.ImpactEvidence(e, incidents)
            checks += impact.checks()
        pointwise, sentences, virtual = self._by_modes()
        checks += pointwise
        checks += self._by_stretches()
        energies = checks_motion.energies(e)
        if impact is not None and len(incidents.t if incidents else ()):
            if not (e.record.x.size or e.laws.cast.coordinates.names or e.laws.model.lagrangian):
                checks.append(checks_flight.flown(e, checks_flight.flights(e, self._states, impact)))
            if checks_flight.is_conservative(e, self._states, impact):
                checks.append(checks_flight.balance(e, energies.E, impact))
        checks.append(checks_outputs.columns(e, columns, rows, (energies.E, energies.E_moved)))
        figures = [
            ("virtual_work", virtual),
            ("work_of_constraints", np.nan),
            ("work_of_all_that_changes_the_energy", np.nan),
            ("energy_gained", float(energies.E[-1] - energies.E[0])),
        ]
        if impact is not None:
            figures.append(("energy_lost_in_impacts", impact.lost))
        return checks, sentences, tuple(figures), self._notes()

    def _notes(self) -> tuple[str, ...]:
        steps = self._steps
        looked = sum(len(k) - 1 for k in self._looked_at)
        if looked == steps:
            return ()
        held = int(self._cut.sum())
        if self._incidents is None and held:
            return (
                f"{held} of {steps} steps between rows may hold an impact: they are not judged without --events"
                f" ({steps - looked} steps are left out of what is judged by differences)",
            )
        return (
            f"{held} of {steps} steps between rows hold incidents; {steps - looked} stand in stretches too short for"
            " differences, or between them",
        )

    def _by_modes(self) -> tuple[list[Check], tuple[str, ...], float]:
        """Checks of rows by themselves, by the set of contacts that are closed at them."""
        e = self._e
        parts: list[tuple[int, list[Check]]] = []
        sentences: list[str] = []
        virtual = 0.0
        modes = sorted(stretches.modes(self._closed), key=lambda mode: -len(mode[1]))
        for number, (closed, rows) in enumerate(modes[:MOST_MODES]):
            own = stretches.evidence(e, rows, closed)
            found = [*checks_pointwise.constraints(own), *checks_pointwise.reactions(own)]
            found += [*checks_pointwise.demand(own), *checks_pointwise.ideal(own)]
            parts.append((len(rows), found))
            d = own.displacements
            along = np.abs(d.virtual(own.record.R_q[own.looked_at]))[~d.is_singular]
            virtual = max(virtual, float(along.max(initial=0.0)))
            if number < TOLD:
                sentences += [f"{self._while(closed)}{said}" for said in uniqueness_text.sentences(own)]
        skipped = sum(len(rows) for _, rows in modes[MOST_MODES:])
        return _merged(parts, skipped), tuple(sentences), virtual

    def _while(self, closed: tuple[int, ...]) -> str:
        names = [self._e.laws.contacts[j] for j in closed]
        shown = ", ".join(names[:TOLD]) + (" ..." if len(names) > TOLD else "")
        if not names:
            return "with all contacts open, "
        return f"while {shown} {'is' if len(names) == 1 else 'are'} closed, "

    def _by_stretches(self) -> list[Check]:
        """Checks of the motion along each stretch."""
        parts: list[tuple[int, list[Check]]] = []
        for rows in self._looked_at:
            closed = np.flatnonzero(self._closed[rows[0]]).tolist()
            own = stretches.evidence(self._e, rows, closed)
            stepped = checks_steps.steps(own)  # the first: what it finds hidden, no sum of rows holds
            moved, windows = checks_motion.RecordedMotion(own), hamilton.windows(own)
            found = [
                stepped,
                checks_motion.rates(own),
                checks_motion.path(own),
                moved.newton(),
                checks_motion.impulse(own),
                *checks_pointwise.carried(own),
                moved.dalembert(),
                checks_motion.energy(own, checks_motion.energies(own)),
                hamilton.hamilton(own, windows),
                dataclasses.replace(momenta.momenta(own), note=""),
            ]
            parts.append((len(rows), found))
        if not parts:
            laws = (checks_steps.STEPS, checks_motion.RATES, checks_motion.NEWTON, checks_motion.ENERGY)
            note = "cannot be judged at this spacing of rows"
            return [
                Check(law.name, law.law, law.equation, "not judged", None, entries=1, note=note)
                for law in laws
            ]
        looked = sum(len(k) for k in self._looked_at)
        merged = _merged(parts, len(self._e.record.t) - looked)
        of_steps = [part[0] for _, part in parts]
        columns = sum(check.entries for check in of_steps) // (looked - len(parts))
        merged[0] = stretches.merged(of_steps, (self._steps - looked + len(parts)) * columns)
        return merged


def _merged(parts: list[tuple[int, list[Check]]], skipped: int) -> list[Check]:
    """The checks of all parts by name, each part with its number of rows; `skipped` rows were in none of them."""
    by_name: dict[str, list[Check]] = {}
    at_a_row: dict[str, int] = {}
    for rows, part in parts:
        for check in part:
            by_name.setdefault(check.name, []).append(check)
            at_a_row[check.name] = max(at_a_row.get(check.name, 0), check.entries // rows)
    return [stretches.merged(checks, skipped * at_a_row[name]) for name, checks in by_name.items()]
