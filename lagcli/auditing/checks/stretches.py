"""A record with contacts in parts: rows of one set of closed contacts, and stretches of them without an incident.

Within a stretch closed contacts are rows like others, and every check of a smooth motion holds as it is. What jumps
between two stretches is judged by the incidents.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from lagcli.auditing.checks.audit_report import NAMED, NEARLY_ALL, Check, TableLocation, Verdict
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.incident_record import Incidents
from lagcli.auditing.evidence.table_input import Record
from lagcli.auditing.evidence.tolerances import SAFETY, Evidence

LEAST = 8  # rows of a stretch that is examined by differences
BEND = 3.0  # times the usual change of a rate of g over a step: what smooth forces may add to it


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ContactStates:
    """Of K contacts at T rows: g and its rate with their limits, lambda with its limit, (T, K) each."""

    g: Array
    g_limit: Array
    rate: Array
    rate_limit: Array
    lam: Array
    lam_limit: float

    @property
    def rests(self) -> Array:
        """True where a contact touches and does not move off or on."""
        return np.asarray((np.abs(self.g) <= self.g_limit) & (np.abs(self.rate) <= self.rate_limit))

    @property
    def is_closed(self) -> Array:
        """True where it pushes; and where it touches between rows at which it does."""
        pushes = self.lam != 0
        found = pushes.copy()
        for k in range(1, len(found)):
            found[k] |= found[k - 1] & self.rests[k]
        later = pushes[-1:]
        back = np.concatenate([found[:-1], later]) if len(found) else found
        for k in range(len(found) - 2, -1, -1):
            back[k] = found[k] & (pushes[k] | back[k + 1])
        return np.asarray(back)


def contact_states(e: Evidence) -> ContactStates:
    """Those at the rows of a record; e: of laws with all inequalities closed."""
    count = len(e.laws.contacts)
    last = slice(e.laws.s - count, e.laws.s)
    atol = e.tolerance.atol
    lam = e.record.lam[:, last]
    largest = float(np.nan_to_num(np.abs(e.record.lam)).max(initial=0.0))
    return ContactStates(
        e.values.f[:, last],
        e.noise("f")[:, last] + atol,
        e.values.w[:, last],
        e.noise("w")[:, last] + atol,
        lam,
        SAFETY * e.tolerance.rtol * largest + atol,
    )


def modes(closed: Array) -> Iterator[tuple[tuple[int, ...], Array]]:
    """The sets of closed contacts that occur, each with its rows."""
    if not closed.shape[1]:
        yield (), np.arange(len(closed))
        return
    kinds, which = np.unique(closed, axis=0, return_inverse=True)
    for number, kind in enumerate(kinds):
        yield tuple(np.flatnonzero(kind).tolist()), np.flatnonzero(which.ravel() == number)


def holds_incident(t: Array, incidents: Incidents) -> Array:
    """True for the steps (T - 1,) with t_k < t <= t_k+1 for an incident that changes forces or velocities."""
    times = incidents.t[incidents.cuts]
    up_to = np.searchsorted(times, t[1:], "right")
    before = np.concatenate([t[1:-1] == t[2:], [False]])[: len(up_to)]  # of rows at one time the first
    up_to = np.where(before, np.searchsorted(times, t[1:], "left"), up_to)
    return np.asarray(up_to > np.searchsorted(times, t[:-1], "right"))


def may_hold_impact(t: Array, states: ContactStates) -> Array:
    """True for the steps (T - 1,) within which some contact could be reached, as seen from both ends."""
    if not states.g.shape[1] or len(t) < 2:
        return np.zeros(max(0, len(t) - 1), dtype=bool)
    h = np.diff(t)[:, None]
    usual = np.median(np.abs(np.diff(states.rate, axis=0)) / np.where(h > 0, h, 1.0), axis=0)
    slack = BEND * h * h * usual + np.maximum(states.g_limit[1:], states.g_limit[:-1])
    ahead = states.g[:-1] + h * np.minimum(states.rate[:-1], 0.0) <= slack
    behind = states.g[1:] - h * np.maximum(states.rate[1:], 0.0) <= slack
    stays = states.is_closed[1:] & states.is_closed[:-1]
    return np.asarray((ahead & ~stays).any(axis=1) & (behind & ~stays).any(axis=1))


def split(t: Array, closed: Array, cut: Array) -> list[Array]:
    """The stretches: rows between cuts (T - 1,), with one set of closed contacts."""
    if not len(t):
        return []
    ends = cut | (np.diff(t) == 0) | (closed[1:] != closed[:-1]).any(axis=1)
    return np.split(np.arange(len(t)), np.flatnonzero(ends) + 1)


def evidence(e: Evidence, rows: Array, closed: Sequence[int]) -> Evidence:
    """The evidence of some rows, at which these contacts are closed; e: of all rows and all contacts."""
    from lagcli.auditing.evidence.laws import ModelLaws

    laws = ModelLaws(e.laws.model, e.tolerance.jumps, closed)
    place = {name: k for k, name in enumerate(e.laws.rows)}
    part: Record = e.record.part(rows)
    part = dataclasses.replace(part, lam=part.lam[:, [place[name] for name in laws.rows]])
    return Evidence(laws, part, e.tolerance, e.record)


def merged(parts: Sequence[Check], left_out: int = 0) -> Check:
    """One check of several of the same name; `left_out`: entries that none of them has looked at."""
    first = parts[0]
    told = [check for check in parts if check.verdict != "nothing"]
    entries, judged = sum(check.entries for check in told) + left_out, sum(check.judged for check in told)
    if not entries:
        return first
    failing = sorted((place for check in told for place in check.failing), key=_ratio, reverse=True)
    names = dict.fromkeys(place.name for place in failing)
    worst = max((check.worst for check in told if check.worst is not None), key=_ratio, default=None)
    verdict: Verdict = "fail" if names else "not judged" if not judged else "partly judged"
    if not names and judged >= NEARLY_ALL * entries:
        verdict = "pass"
    shown = {place.name: place for place in reversed(failing)}
    note = f"{entries - judged} of {entries} entries cannot be judged" if judged < entries else ""
    return dataclasses.replace(
        first,
        verdict=verdict,
        worst=worst,
        failing=tuple(shown[name] for name in names)[:NAMED],
        failures=len(names),
        judged=judged,
        entries=entries,
        note=note,
        curve=tuple(sorted(place for check in told for place in check.curve)),
    )


def _ratio(place: TableLocation) -> float:
    if place.limit == 0:
        return np.inf if place.value else 0.0
    return place.value / place.limit
