"""The parts of a record with contacts: rows of one set of closed contacts, and stretches of them without an incident.

Within a stretch closed contacts are rows like others, and every check of a smooth motion holds as it is. What jumps
between two stretches is judged by the incidents.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from lagcli.auditing import audit_lines
from lagcli.auditing.checks import checks_contact, checks_flight, checks_motion, checks_steps
from lagcli.auditing.checks.audit_report import FAR_APART, Check, merged
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.tolerances import Evidence

MOST = 60  # stretches, the longest ones, that are examined by differences
MOST_MODES = 60  # sets of closed contacts, those with most rows
MOST_DESCRIBED = 3  # sets of closed contacts of which it is reported what is determined

Findings = Callable[[Evidence], Sequence[Check]]


class OneSidedParts:
    """The parts of one record, and what their checks find. e: of laws with all inequalities closed.

    sentences: what is determined while some contacts are closed; virtual_work: the largest of R, with the rows that
    were looked at in `by_sets`.
    """

    def __init__(self, e: Evidence) -> None:
        self._e = e
        states = e.once(checks_contact.contact_states)
        self._closed = states.is_closed
        t, incidents = e.record.t, e.run.incidents if e.run else None
        self._has_incidents = incidents is not None
        if incidents is None:
            self._cut = checks_contact.may_hold_impact(t, states)
        else:  # the steps with t_k < t <= t_k+1 for an incident that changes forces or velocities
            times = incidents.t[incidents.cuts]
            before = np.concatenate([t[1:-1] == t[2:], [False]])[
                : len(t) - 1
            ]  # of rows at one time the first
            up_to = np.searchsorted(times, t[1:], "right")
            up_to = np.where(before, np.searchsorted(times, t[1:], "left"), up_to)
            self._cut = up_to > np.searchsorted(times, t[:-1], "right")
        # Between the two rows of an instant there is no step.
        is_step = np.diff(t) > 0
        self._steps, self._cut_steps = int(is_step.sum()), int((self._cut & is_step).sum())
        # Stretches of rows between cuts, with one set of closed contacts
        ends = self._cut | ~is_step | (self._closed[1:] != self._closed[:-1]).any(axis=1)
        stretches = np.split(np.arange(len(t)), np.flatnonzero(ends) + 1)
        long = [k for k in stretches if len(k) >= checks_flight.FEWEST_ROWS]
        longest = sorted(long, key=len, reverse=True)[:MOST]
        self._looked_at = sorted(longest, key=lambda k: int(k[0]))
        self.sentences: tuple[str, ...] = ()
        self.virtual_work = 0.0
        self.are_reported = False

    @property
    def notes(self) -> tuple[str, ...]:
        """Steps that no difference looks at."""
        steps = self._steps
        looked = sum(len(k) - 1 for k in self._looked_at)
        if looked == steps:
            return ()
        if not self._has_incidents and self._cut_steps:
            return (
                f"{self._cut_steps} of {steps} steps between rows may hold an impact: they are not judged without"
                f" --events ({steps - looked} steps are left out of what is judged by differences)",
            )
        return (
            f"{self._cut_steps} of {steps} steps between rows hold incidents; {steps - looked} stand in stretches too"
            " short for differences, or between them",
        )

    def by_sets(self, checks: Sequence[Findings]) -> list[Check]:
        """Checks of rows by themselves, by the set of contacts that are closed at them."""
        self.are_reported = True
        parts: list[tuple[int, list[Check]]] = []
        # The sets of closed contacts that occur, each with its rows
        every = np.arange(len(self._closed))
        modes = [(self._closed[0], every)] if len(every) and not self._closed.shape[1] else []
        if self._closed.shape[1]:
            kinds, which = np.unique(self._closed, axis=0, return_inverse=True)
            modes = [(kind, every[which.ravel() == number]) for number, kind in enumerate(kinds)]
        modes.sort(key=lambda mode: -len(mode[1]))
        for number, (is_closed, rows) in enumerate(modes[:MOST_MODES]):
            closed = np.flatnonzero(is_closed).tolist()
            own = self._evidence(rows, closed)
            parts.append((len(rows), [found for findings in checks for found in findings(own)]))
            self.virtual_work = max(self.virtual_work, own.virtual_work)
            if number < MOST_DESCRIBED:
                names = [self._e.laws.contacts[j] for j in closed]
                shown = ", ".join(names[:MOST_DESCRIBED]) + (" ..." if len(names) > MOST_DESCRIBED else "")
                while_ = (
                    f"while {shown} {'is' if len(names) == 1 else 'are'} closed"
                    if names
                    else "with all contacts open"
                )
                self.sentences += tuple(f"{while_}, {sentence}" for sentence in audit_lines.uniqueness(own))
        return _merged_by_name(parts, sum(len(rows) for _, rows in modes[MOST_MODES:]))

    def by_stretches(self, checks: Sequence[Findings]) -> list[Check]:
        """Checks of the motion along each stretch."""
        parts: list[tuple[int, list[Check]]] = []
        for rows in self._looked_at:
            own = self._evidence(rows, np.flatnonzero(self._closed[rows[0]]).tolist())
            parts.append((len(rows), [found for findings in checks for found in findings(own)]))
        if not parts:
            laws = (checks_steps.STEPS, checks_motion.RATES, checks_motion.NEWTON, checks_motion.ENERGY)
            return [law.unjudged(FAR_APART) for law in laws]
        looked = sum(len(k) for k in self._looked_at)
        checks_of_rows = _merged_by_name(parts, len(self._e.record.t) - looked)
        # Entries of `steps` are steps and not rows, and one stands between two stretches.
        name = checks_steps.STEPS.name
        of_steps = [check for _, part in parts for check in part if check.name == name]
        columns = sum(check.entries for check in of_steps) // (looked - len(parts))
        steps = merged(of_steps, (self._steps - looked + len(parts)) * columns)
        return [steps if check.name == name else check for check in checks_of_rows]

    def _evidence(self, rows: Array, closed: Sequence[int]) -> Evidence:
        """The evidence of some rows, at which these contacts are closed."""
        e = self._e
        laws = ModelLaws(e.laws.model, e.tolerance.jumps, closed)
        index = {name: k for k, name in enumerate(e.laws.rows)}
        part = e.record.part(rows)
        part = dataclasses.replace(part, lam=part.lam[:, [index[name] for name in laws.rows]])
        return Evidence(laws, part, e.tolerance, e.record)


def _merged_by_name(parts: list[tuple[int, list[Check]]], skipped: int) -> list[Check]:
    """The checks of all parts by name, each part with its number of rows; `skipped` rows were in none of them."""
    by_name: dict[str, list[Check]] = {}
    at_a_row: dict[str, int] = {}
    for rows, part in parts:
        for check in part:
            by_name.setdefault(check.name, []).append(check)
            at_a_row[check.name] = max(at_a_row.get(check.name, 0), check.entries // rows)
    return [merged(checks, skipped * at_a_row[name]) for name, checks in by_name.items()]
