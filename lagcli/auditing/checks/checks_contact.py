"""Checks of inequalities at the rows of a table: g >= 0, lambda >= 0, lambda g = 0, and no contact is pressed in."""

from __future__ import annotations

import numpy as np

from lagcli.auditing.checks.audit_report import Check, CheckedLaw, judge
from lagcli.auditing.checks.stretches import ContactStates
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import widest
from lagcli.auditing.evidence.incident_record import Incidents
from lagcli.auditing.evidence.tolerances import SAFETY, Evidence

GAPS = CheckedLaw("gaps", "", "g_j >= 0")
PUSHES = CheckedLaw("pushes", "", "lambda_j >= 0")
COMPLEMENTARY = CheckedLaw("complementarity", "", "lambda_j g_j = 0")
PRESSED = CheckedLaw("contacts", "", "d2g_j/dt2 >= 0 where g_j, dg_j/dt and lambda_j are 0")
MISSED = CheckedLaw("missed", "", "no contact opens or closes between rows without an incident")
TINY = 1e-100  # a complex step: its square is nothing


def rows(e: Evidence, s: ContactStates) -> list[Check]:
    """The conditions of every row; e: of laws with all inequalities closed."""
    names, t = e.laws.contacts, e.record.t
    found = [
        judge(GAPS, names, t, np.minimum(s.g, 0.0), s.g_limit),
        judge(PUSHES, names, t, np.minimum(np.nan_to_num(s.lam), 0.0), np.full((1, 1), s.lam_limit)),
        judge(COMPLEMENTARY, names, t, s.lam * s.g, (np.abs(s.lam) + s.lam_limit) * s.g_limit),
    ]
    if not len(e.laws.cast.coordinates) and e.laws.model.lagrangian is None:
        found.append(_pressed(e, s))
    return found


def _pressed(e: Evidence, s: ContactStates) -> Check:
    """d2g/dt2 of contacts that touch without a push, of models in Cartesian coordinates alone."""
    laws, own = e.laws, len(e.laws.contacts)
    touches = s.rests & (s.lam == 0)
    at = np.flatnonzero(touches.any(axis=1))
    residual, limit = np.zeros(s.g.shape), np.ones(s.g.shape)
    if at.size:
        r = e.record.part(at)
        total = e.particle_forces[at].reshape(len(at), -1) + r.R_q
        noise = e.particle_noise[at].reshape(len(at), -1) + SAFETY * e.tolerance.rtol * np.abs(r.R_q)

        def second(q: Array, v: Array, force: Array) -> Array:
            step = 1j * TINY
            _, w = laws.residuals(r.t + step, q + step * v, v + step * force / e.masses)
            return np.asarray(w.imag[:, laws.s - own : laws.s] / TINY)

        found = second(r.q, r.v, total)
        moved = second(e.moved[0][at], e.moved[1][at], total + noise)
        residual[at] = np.where(touches[at], np.minimum(found, 0.0), 0.0)
        size = SAFETY * e.tolerance.rtol * np.abs(found).max(initial=0.0)
        limit[at] = widest(e.spread(found, moved)) + size + e.tolerance.atol
    return judge(PRESSED, laws.contacts, e.record.t, residual, limit)


def missed(e: Evidence, s: ContactStates, incidents: Incidents) -> Check:
    """Contacts that open or close between two rows without an incident of theirs; rows that tell neither are passed."""
    t = e.record.t
    found = np.zeros(s.g.shape)
    kinds = np.array(incidents.kinds, dtype=np.str_)
    hits = kinds == "impact"
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
            one, other = before[changes], after[changes]
            told = np.searchsorted(times, t[other], "right") > np.searchsorted(times, t[one], "left")
            found[other[~told], j] = 1.0
    return judge(MISSED, e.laws.contacts, t, found, np.full((1, 1), 0.5))
