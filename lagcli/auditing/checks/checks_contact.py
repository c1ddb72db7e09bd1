"""Contacts at the rows of a table: their states, and g >= 0, lambda >= 0, lambda g = 0, none of them pressed in."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from lagcli.auditing.checks.audit_report import Check, Law, judge
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import widest
from lagcli.auditing.evidence.tolerances import SAFETY, Evidence

GAPS = Law("gaps", "", "g_j >= 0")
PUSHES = Law("pushes", "", "lambda_j >= 0")
COMPLEMENTARY = Law("complementarity", "", "lambda_j g_j = 0")
PRESSED = Law("contacts", "", "d2g_j/dt2 >= 0 where g_j, dg_j/dt and lambda_j are 0")
MISSED = Law("missed", "", "no contact opens or closes between rows without an incident")
BEND = 3.0  # times the change of a rate of g over a step, the usual one or that beside: what smooth forces may add


@dataclasses.dataclass(frozen=True, eq=False)
class ContactStates:
    """The states of K contacts at T rows: g and its rate with their limits, lambda with its limit, (T, K) each."""

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

    @functools.cached_property
    def is_closed(self) -> Array:
        """True where it pushes; and where it touches between rows at which it does."""
        pushes = self.lam != 0
        closed = pushes.copy()
        for k in range(1, len(closed)):
            closed[k] |= closed[k - 1] & self.rests[k]
        later = pushes[-1:]
        back = np.concatenate([closed[:-1], later]) if len(closed) else closed
        for k in range(len(closed) - 2, -1, -1):
            back[k] = closed[k] & (pushes[k] | back[k + 1])
        return np.asarray(back)


def contact_states(e: Evidence) -> ContactStates:
    """The states of contacts at the rows of a record; e, here and below: of laws with all inequalities closed."""
    last, atol = e.laws.of_contacts, e.tolerance.atol
    g, rate, lam = (part[:, last] for part in (e.values.f, e.values.w, e.record.lam))
    g_limit, rate_limit = (e.noise(name)[:, last] + atol for name in ("f", "w"))
    largest = np.nan_to_num(np.abs(e.record.lam)).max(initial=0.0)
    return ContactStates(g, g_limit, rate, rate_limit, lam, float(e.recorded(largest)) + atol)


def may_hold_impact(t: Array, states: ContactStates) -> Array:
    """True for the steps (T - 1,) within which some contact could be reached, as seen from both ends."""
    if not states.g.shape[1] or len(t) < 2:
        return np.zeros(max(0, len(t) - 1), dtype=bool)
    h = np.diff(t)[:, None]
    # Of a contact that rests the rates are rounding: they tell nothing of how others change.
    changes = np.abs(np.diff(states.rate, axis=0)) / np.where(h > 0, h, 1.0)
    is_open = ~(states.rests[1:] | states.rests[:-1])
    pairs = zip(changes.T, is_open.T, strict=True)
    usual = np.array([np.median(own[k]) if k.any() else 0.0 for own, k in pairs])
    beside = np.zeros((len(h) + 2, changes.shape[1]))
    beside[1:-1] = changes
    usual = np.maximum(usual, np.maximum(beside[:-2], beside[2:]))
    slack = BEND * h * h * usual + np.maximum(states.g_limit[1:], states.g_limit[:-1])
    ahead = states.g[:-1] + h * np.minimum(states.rate[:-1], 0.0) <= slack
    behind = states.g[1:] - h * np.maximum(states.rate[1:], 0.0) <= slack
    stays = states.is_closed[1:] & states.is_closed[:-1]
    return np.asarray((ahead & ~stays).any(axis=1) & (behind & ~stays).any(axis=1))


def contacts(e: Evidence) -> list[Check]:
    """The conditions of every row."""
    names, t, s = e.laws.contacts, e.record.t, e.once(contact_states)
    checks = [
        judge(GAPS, names, t, np.minimum(s.g, 0.0), s.g_limit),
        judge(PUSHES, names, t, np.minimum(np.nan_to_num(s.lam), 0.0), np.full((1, 1), s.lam_limit)),
        judge(COMPLEMENTARY, names, t, s.lam * s.g, (np.abs(s.lam) + s.lam_limit) * s.g_limit),
    ]
    if not len(e.laws.index.coordinates) and e.laws.model.lagrangian is None:
        checks.append(_pressed(e, s))
    return checks


def _pressed(e: Evidence, s: ContactStates) -> Check:
    """d2g/dt2 of contacts that touch without a push, of models in Cartesian coordinates alone."""
    laws = e.laws
    touches = s.rests & (s.lam == 0)
    if e.run is not None and e.run.incidents is not None:
        # A row at an incident is that after it, where walls and forces may have jumped.
        touches &= ~np.isin(e.record.t, e.run.incidents.t)[:, None]
    at = np.flatnonzero(touches.any(axis=1))
    residual, limit, judged = np.zeros(s.g.shape), np.ones(s.g.shape), np.ones(s.g.shape, dtype=bool)
    if at.size:
        r, n = e.record.part(at), e.n
        total = e.total_force[at, :n]
        noise = e.force_noise[at, :n] + e.recorded(r.R[:, :n])

        def second(q: Array, v: Array, force: Array, later: float = 0.0) -> Array:
            return laws.demanded(r.t + later, q, v, force / e.masses[:n])[:, laws.of_contacts]

        # A wall that bends at the time itself lets go of what rests on it.
        rates = np.maximum.reduce([second(r.q, r.v, total, side * e.clock) for side in (-1, 0, 1)])
        moved = second(e.moved[0][at], e.moved[1][at], total + noise)
        residual[at] = np.where(touches[at], np.minimum(rates, 0.0), 0.0)
        # True for what does not rebound there, at a speed within the limit of its rate: it pushes in the row before,
        # or touches for longer than such rebounds last
        numbers = np.arange(len(touches))[:, None]
        begin = np.maximum.accumulate(np.where(touches, 0, numbers + 1), axis=0)
        end = np.minimum.accumulate(np.where(touches, len(touches) - 1, numbers - 1)[::-1], axis=0)[::-1]
        pushed = np.take_along_axis(s.lam, np.maximum(begin - 1, 0), axis=0) != 0
        since = e.record.t[np.minimum(begin, len(touches) - 1)]
        lasts = (e.record.t[np.maximum(end, 0)] - since)[at]
        slowing = np.abs(rates) * (1 - laws.model.restitution)
        judged[at] = pushed[at] | (lasts * slowing > 2 * s.rate_limit[at]) | (s.rate[at] == 0)
        size = SAFETY * e.tolerance.rtol * np.abs(rates).max(initial=0.0)
        limit[at] = widest(e.spread(rates, moved)) + size + e.tolerance.atol
    return judge(PRESSED, laws.contacts, e.record.t, residual, limit, judged)


def missed(e: Evidence) -> list[Check]:
    """Contacts that open or close between two rows without an incident of theirs; rows that tell neither are passed.
    Nothing where the incidents are not known."""
    if e.run is None or e.run.incidents is None:
        return []
    t, s, incidents = e.record.t, e.once(contact_states), e.run.incidents
    is_missed = np.zeros(s.g.shape)
    kinds, hits = incidents.kinds, incidents.kinds == "impact"
    off = (np.abs(s.g) > s.g_limit) | (np.abs(s.rate) > s.rate_limit)
    on = s.lam > s.lam_limit
    for j in range(s.g.shape[1]):
        known = np.flatnonzero(off[:, j] | on[:, j])
        before, after = known[:-1], known[1:]
        own = incidents.contact == j
        opens = on[before, j] & off[after, j]
        closes = off[before, j] & on[after, j]
        # An impact of another contact may open this one.
        for changes, times in (
            (opens, incidents.t[(own & (kinds == "release")) | hits]),
            (closes, incidents.t[own & (kinds == "contact")]),
        ):
            since, until = before[changes], after[changes]
            recorded = np.searchsorted(times, t[until], "right") > np.searchsorted(times, t[since], "left")
            is_missed[until[~recorded], j] = 1.0
    return [judge(MISSED, e.laws.contacts, t, is_missed, np.full((1, 1), 0.5))]
