"""The motion from an incident to the next row or incident, and the energy of a whole run with what impacts take.

Around incidents rows stand too far apart for differences, and the states of the incidents have no reactions. Where
no row acts and no contact rests, none are needed: momenta change by the forces alone.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.auditing.audit_report import Check, CheckedLaw, judge
from lagcli.auditing.autodiff import Array
from lagcli.auditing.checks_impact import ImpactEvidence, kinetic
from lagcli.auditing.laws import LawValues
from lagcli.auditing.stretches import ContactStates
from lagcli.auditing.table_input import Record
from lagcli.auditing.tolerances import RESOLVED, SAFETY, Evidence

FLIGHTS = CheckedLaw(
    "flights", "D.23, D.24", "r and m v from an incident to the next row or incident, where nothing touches"
)
BALANCE = CheckedLaw("balance", "D.10, D.35", "E(t) - E(0) = sum of T(+) - T(-) of the impacts so far")
FEW = 1e-13  # of the length of a flight: what is shorter is none


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Flights:
    """P flights: states at their beginning and end, whether nothing touches meanwhile, and whether rebounds end there
    that are no longer told, (P,)."""

    begin: Record
    end: Record
    is_free: Array
    ends_rebounds: Array


def flights(e: Evidence, states: ContactStates, impact: ImpactEvidence) -> Flights:
    """From each incident to the next row or incident, and from rows to incidents."""
    incidents, r = impact.incidents, e.record
    first = np.flatnonzero(incidents.is_first)
    before, after = incidents.before.part(first), incidents.after.part(first)
    same = np.isin(r.t, before.t)
    rows = np.flatnonzero(~same)
    row = r.part(rows)
    # Each state once: rows, and the states before and after each instant.
    ends = _joined(row, before)
    begins = _joined(row, after)
    order = np.argsort(ends.t, kind="stable")
    is_instant = np.arange(len(ends.t)) >= len(rows)
    pairs = np.stack([order[:-1], order[1:]], axis=1)
    pairs = pairs[is_instant[pairs].any(axis=1)]
    rests = np.zeros(len(ends.t), dtype=bool)
    rests[: len(rows)] = states.is_closed[rows].any(axis=1)
    rests[len(rows) :] = _rests(impact)[first]
    begin, end = begins.part(pairs[:, 0]), ends.part(pairs[:, 1])
    long = end.t - begin.t > FEW * np.abs(r.t).max()
    free = ~rests[pairs[:, 0]] & long & (len(e.laws.contacts) == e.laws.C)
    ended = [
        t for t, kind in zip(incidents.t.tolist(), incidents.kinds, strict=True) if kind == "accumulation"
    ]
    return Flights(begin, end, free, np.isin(end.t, ended))


def _rests(impact: ImpactEvidence) -> Array:
    """True where a contact stays closed after an incident, (E,)."""
    at = impact.contacts
    g, rate = impact.before.values.f[:, at], impact.after.values.w[:, at]
    g_limit, limit = impact.before.noise("f")[:, at], impact.after.noise("w")[:, at]
    atol = impact.tolerance.atol
    return np.asarray(((np.abs(g) <= g_limit + atol) & (np.abs(rate) <= limit + atol)).any(axis=1))


def _joined(one: Record, other: Record) -> Record:
    fields = (f.name for f in dataclasses.fields(Record))
    return Record(**{name: np.concatenate([getattr(one, name), getattr(other, name)]) for name in fields})


def flown(e: Evidence, found: Flights) -> Check:
    """Momenta and places over each flight, of models in Cartesian coordinates."""
    k = np.flatnonzero(found.is_free)
    names = (*e.names.q, *e.names.v)
    if not k.size:
        note = "rows or contacts act all along"
        count = len(found.is_free) * len(names)
        return Check(
            FLIGHTS.name, FLIGHTS.law, FLIGHTS.equation, "not judged", None, entries=count, note=note
        )
    one, other = found.begin.part(k), found.end.part(k)
    h = (other.t - one.t)[:, None]
    middle = dataclasses.replace(
        one,
        t=(one.t + other.t) / 2,
        q=(one.q + other.q) / 2 + h / 8 * (one.v - other.v),
        v=1.5 * (other.q - one.q) / h - (one.v + other.v) / 4,
    )
    a, b, c = (_accelerations(e, r) for r in (one, middle, other))
    ways = h / 6 * (a + 4 * b + c)
    unknown_v = np.abs(ways - h / 2 * (a + c)) + np.abs(ways) * SAFETY * e.tolerance.rtol
    residual_v = other.v - one.v - ways
    bend = h * h / 12 * (a - c)
    residual_q = other.q - one.q - h / 2 * (one.v + other.v) - bend
    size_v = np.abs(e.record.v).max(axis=0, initial=0.0)
    size_q = np.maximum(np.abs(e.record.q).max(axis=0, initial=0.0), np.abs(h * one.v))
    rebounds = found.ends_rebounds[k][:, None]
    unknown_v = np.where(rebounds, np.maximum(unknown_v, RESOLVED * size_v), unknown_v)
    unknown_q = np.abs(bend) + np.where(rebounds, 0.0, h * unknown_v)
    unknown_q = np.where(rebounds, np.maximum(unknown_q, RESOLVED * size_q), unknown_q)
    limit_v, limit_q = 2 * SAFETY * e.off_v + unknown_v, 2 * SAFETY * (e.off_q + h * e.off_v) + unknown_q
    judged_v = unknown_v <= np.maximum(RESOLVED * size_v, 2 * SAFETY * e.off_v)
    judged_q = unknown_q <= np.maximum(RESOLVED * size_q, 2 * SAFETY * e.off_q)
    check = judge(
        FLIGHTS,
        names,
        other.t,
        np.concatenate([residual_q, residual_v], axis=1),
        np.concatenate([limit_q, limit_v], axis=1),
        np.concatenate([judged_q, judged_v], axis=1),
    )
    left = (len(found.is_free) - len(k)) * len(names)
    entries = check.entries + left
    if not left:
        return check
    note = f"{entries - check.judged} of {entries} entries cannot be judged"
    verdict = check.verdict if check.verdict != "nothing" else "not judged"
    if verdict == "pass" and check.judged < 0.9 * entries:
        verdict = "partly judged"
    return dataclasses.replace(check, verdict=verdict, entries=entries, note=note)


def _accelerations(e: Evidence, r: Record) -> Array:
    """F/m (P, n) of Cartesian particles where nothing constrains them."""
    values = e.laws.values(r.t, r.q, r.v, np.zeros((len(r.t), e.laws.C)))
    F = values.F.reshape(len(r.t), -1) - values.V_q
    return np.asarray(F / e.masses)


def is_conservative(e: Evidence, values: LawValues) -> bool:
    """True if nothing but impacts changes T + V."""
    parts = (values.F, values.Q, values.V_t, values.L_t, values.b, values.x_t)
    return not any(np.any(part) for part in parts)


def balance(e: Evidence, E: Array, impact: ImpactEvidence) -> Check:
    """The energy of all rows, E (T,), with what impacts take; of models in which nothing else changes it."""
    first = np.flatnonzero(impact.incidents.is_first)
    one, other = impact.before.record.part(first), impact.after.record.part(first)
    change = np.cumsum(kinetic(e, other) - kinetic(e, one))
    count = np.searchsorted(one.t, e.record.t, "right")
    total = np.concatenate([[0.0], change])[count]
    q, v = e.moved
    moved = kinetic(e, dataclasses.replace(e.record, q=q, v=v, u=e.moved_values.u)) + e.moved_values.V
    noise = e.spread(E[:, None], moved[:, None])[:, 0].max(initial=0.0)
    limit = noise * (1 + (np.arange(len(E)) + count) / SAFETY) + e.tolerance.atol
    apart = (E - E[0] - total)[:, None]
    judged = np.concatenate(
        [np.diff(e.record.t) > 0, [True]]
    )  # of rows at one time the last, which is after it
    return judge(BALANCE, ("the whole system",), e.record.t, apart, limit[:, None], judged[:, None])
