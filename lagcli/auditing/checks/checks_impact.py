"""The law of impact at every recorded incident: momenta, rows, restitution, and the energy that is lost.

M (v+ - v-) = B^T Lambda + G^T Lambda_G,  B v+ + b = 0,  0 <= Lambda_j  _|_  dg_j+ + e_j min(dg_j-, 0) >= 0

With H = q' . p - L of the whole system, quadratic in q', and B_i . q' = df_i/dt - b_i, b_i the rate where only t moves,
the jump p(+) - p(-) = sum_i impulse_i B_i at one configuration gives exactly

    H(+) - H(-) + sum_i impulse_i b_i = 1/2 sum_i impulse_i (df_i/dt(+) + df_i/dt(-))

A row that moves does the work -impulse_i b_i. T + V = H + sum_k m_k u_k . dx_k/dt without what is in `lagrangian`:
dependent particles whose positions move with t do the work m_k (u_k(+) - u_k(-)) . dx_k/dt on T.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np

from lagcli import doubles
from lagcli.auditing.checks import checks_contact, checks_motion, checks_pointwise
from lagcli.auditing.checks.audit_report import Check, Law, judge, judge_parts
from lagcli.auditing.checks.checks_motion import energy_of_motion
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import TWICE
from lagcli.auditing.evidence.laws import LawValues
from lagcli.auditing.evidence.table_input import Incidents
from lagcli.auditing.evidence.tolerances import RESOLVED, SAFETY, Evidence

JUMPS = Law("jumps", "", "p(+) - p(-) = sum_i impulse_i B_i over all rows and contacts")
ROWS_AFTER = Law(
    "kept", "D.2, D.6, D.27", "f = 0, B v(+) + b = 0, r_k = x_k(q, t) and v_k = dx_k/dt at every incident"
)
IMPACTS = Law("impacts", "", "0 <= impulse_j, dg_j(+) + e_j min(dg_j(-), 0) >= 0, one of them 0")
TOUCHED = Law("touched", "", "g_j = 0 where an incident names it, and where it has an impulse; g_j >= 0")
RECORDED = Law(
    "recorded",
    "",
    "one row of a kind and a name at an instant; of an impact where impulse_j > 0, and only there",
)
LOSSES = Law("losses", "", "T(+) - T(-) - work of moving rows = 1/2 sum of impulse . (dg(+) + dg(-)) <= 0")
BALANCE = Law("balance", "D.10, D.35", "E(t) - E(0) = sum of T(+) - T(-) of the impacts so far")
CLOSING = ("impact", "accumulation", "contact")
MERGED = (
    1 / RESOLVED
)  # times the limit of g: contacts within the accuracy of event times belong to one impact


class ImpactEvidence:
    """The states before and after every incident beside what the model says there; e: of the whole record."""

    def __init__(self, e: Evidence, incidents: Incidents) -> None:
        self.laws, self.incidents = e.laws, incidents
        self.tolerance = e.run.of_incidents if e.run else e.tolerance
        self.before = Evidence(e.laws, incidents.before, self.tolerance, e.record)
        self.after = Evidence(e.laws, incidents.after, self.tolerance, e.record)
        self.contacts = e.laws.of_contacts
        self.rows = np.delete(np.arange(e.laws.C), self.contacts)
        # By how much coordinates and rates (n,) and times of rows and of incidents may be off, which are two tables
        self.off_q = np.maximum(e.off_q, self.before.off_q)
        self.off_v = np.maximum(e.off_v, self.before.off_v)
        self.clock = max(e.clock, self.before.clock)
        largest = np.abs(incidents.impulses).max(initial=0.0)
        self.impulse_limit = float(self.before.recorded(largest)) + self.tolerance.atol
        self.gaps = self.before.values.f[:, self.contacts]
        self.gap_limit = self.before.noise("f")[:, self.contacts] + self.tolerance.atol  # (E, K)

    def jumps(self) -> Check:
        """The jump of the momenta of all coordinates. The states before and after are off together: what lies between
        them is known to a part of itself."""
        one, other, n = self.before, self.after, self.before.n
        r, s = one.record, other.record
        jump = momenta(other, s.q, s.v, other.values) - momenta(one, r.q, r.v, one.values)
        own = momenta(other, s.q, _with_model(s.v, other.values), other.values)
        of_model = momenta(one, r.q, _with_model(r.v, one.values), one.values)
        q, v = one.moved
        after, off_v, masses = other.moved[1], one.off_v[:n], one.masses[:n]
        if not self.tolerance.written.is_short:
            apart = s.v[:, :n] - r.v[:, :n]
            after = s.v[:, :n] + (v - r.v[:, :n]) * (1 + self.tolerance.rtol * np.abs(apart) / off_v)
            off_v = self.tolerance.rtol * np.abs(apart)
        values = one.laws.values(s.t, q, after, s.lam)
        moved = momenta(other, q, _with_model(after, values), values)
        moved = moved - momenta(one, q, one.moved_rates, one.moved_values)
        pull, pull_moved = one.values.pull, one.moved_values.pull
        own = own - of_model
        # The tolerance of a strong impact is not that of a weak one.
        sizes = (np.abs(part).max(axis=1, initial=0.0, keepdims=True) for part in (own, pull, one.record.lam))
        size = np.maximum.reduce(list(sizes))
        size = np.where(size > 0, size, 1.0)
        limit = size * (one.spread(own / size, moved / size) + one.spread(pull / size, pull_moved / size))
        limit = limit + SAFETY * masses * off_v + 2 * doubles.SUM * np.abs(of_model)
        names = [f"p({name})" for name in one.names.q[:n]]
        # Impulses on both sides of a body may cancel.
        limit = limit + SAFETY * self.tolerance.rtol * size + self.tolerance.atol
        return judge(JUMPS, names, self.incidents.t, jump - pull, limit)

    def kept(self) -> Check:
        """The rows that are equations, and the dependent particles, before and after."""
        laws, t, one, other = self.laws, self.incidents.t, self.before, self.after
        own = [i for i in self.rows if i < laws.s]
        after = other.values.w[:, self.rows], other.noise("w")[:, self.rows]
        of_sides = map(checks_pointwise.dependent, (one, other))
        held = (one.values.f[:, own], one.noise("f")[:, own]), after, *of_sides
        particles = (*one.names.q[one.n :], *one.names.v[one.n :])
        of_particles = [f"{name} {side}" for side in ("before", "after") for name in particles]
        names = [*(laws.rows[i] for i in own), *(f"rate of {laws.rows[i]}" for i in self.rows), *of_particles]
        atol = self.tolerance.atol
        return judge_parts(ROWS_AFTER, names, t, *((residual, limit + atol) for residual, limit in held))

    def touched(self) -> Check:
        """Contacts that an incident names, or that push, are closed; none is passed through."""
        g, incidents = self.gaps, self.incidents
        named = np.zeros(g.shape, dtype=bool)
        marked = np.flatnonzero(incidents.cuts)
        named[marked, incidents.contact[marked]] = True
        acts = named | (np.abs(incidents.impulses[:, self.contacts]) > self.impulse_limit)
        # A wall may jump away from a contact, which lets go with what it was before.
        record, freed = self.before.record, incidents.kinds == "release"
        earlier = self.laws.values(record.t - 2 * self.before.clock, record.q, record.v, record.lam)
        was = earlier.f[:, self.contacts]
        g = np.where(freed[:, None] & (np.abs(was) < np.abs(g)), was, g)
        residual = np.where(acts, g, np.minimum(g, 0.0))
        return judge(TOUCHED, self.laws.contacts, incidents.t, residual, MERGED * self.gap_limit)

    def recorded(self) -> Check:
        """Each incident is there once, and as what it is: an impulse is of an impact, or ends a series of rebounds.
        Rows of one impact share the jump; several impacts at one instant each have their own."""
        incidents, names = self.incidents, self.laws.contacts
        is_wrong = np.zeros((len(incidents.t), len(names)))
        impulses = incidents.impulses[:, self.contacts]
        pushes = impulses > self.impulse_limit
        kinds = incidents.kinds
        for begin, end in zip(incidents.first, incidents.last + 1, strict=True):
            at, contact = slice(begin, end), incidents.contact[begin:end]
            for j in {*contact[contact >= 0].tolist(), *np.flatnonzero(pushes[at].any(axis=0)).tolist()}:
                rows = begin + np.flatnonzero(contact == j)
                own = set(kinds[rows].tolist())
                # A contact at rest that the impact of another one touches by little is not named.
                is_large = pushes[at, j] & (impulses[at, j] > RESOLVED * impulses[at].max(axis=1))
                is_missing = is_large.any() and not {"impact", "accumulation"} & own
                is_idle = "impact" in own and not (impulses[at, j] > -self.tolerance.written.unit).any()
                jumps = {(kinds[k], incidents.impulses[k].tobytes()) for k in rows.tolist()}
                is_wrong[begin, j] = is_missing or is_idle or len(jumps) < rows.size
        return judge(RECORDED, names, incidents.t, is_wrong, np.full((1, 1), 0.5))

    @cached_property
    def unrecorded_rebounds(self) -> tuple[tuple[int, float, float, float], ...]:
        """The contacts whose rebounds end in an accumulation: the times from which they are no longer recorded, of its
        last impact or release, and of the accumulation, and the most by which rebounds between change a rate."""
        incidents, rebounds = self.incidents, []
        for k in np.flatnonzero(incidents.kinds == "accumulation").tolist():
            j = int(incidents.contact[k])
            leaves = np.isin(incidents.kinds, ("impact", "release")) & (incidents.contact == j)
            end = float(incidents.t[k])
            since = float(incidents.t[leaves & (incidents.t < end)].max(initial=-np.inf))
            # Each rebound gives e of the one before.
            e, rows, left = float(self.laws.model.restitution[j]), np.flatnonzero(incidents.t == since), 0.0
            if rows.size and e < 1:
                jump = np.abs(self.after.record.v[rows[-1]] - self.before.record.v[rows[0]])[: self.before.n]
                left = float(jump.max(initial=0.0)) * e / (1 - e)
            rebounds.append((j, since, end, left))
        return tuple(rebounds)

    @property
    def _limits_of_series(self) -> Array:
        """True for contacts (E, K) that accumulate by an impact, the limit of infinitely many: they were struck before
        and had no time to leave, or one of them was, and others are struck first within it."""
        incidents, limit = self.incidents, self.gap_limit
        kinds, is_limit = incidents.kinds, np.zeros(limit.shape, dtype=bool)
        pushed = (np.abs(incidents.impulses) > self.impulse_limit).any(axis=1)
        is_other = (np.diff(incidents.t) > 0) | (np.diff(incidents.impulses, axis=0) != 0).any(axis=1)
        group = np.concatenate([[0], np.cumsum(is_other)])[: len(kinds)]
        before, after = (e.values.w[:, self.contacts] for e in (self.before, self.after))
        limits = np.flatnonzero((kinds == "accumulation") & pushed)
        for number in np.unique(group[limits]).tolist():
            own, is_series = limits[group[limits] == number], False
            for k, j in zip(own.tolist(), incidents.contact[own].tolist(), strict=True):
                struck = np.flatnonzero((kinds[:k] == "impact") & (incidents.contact[:k] == j))
                last = int(struck[-1]) if struck.size else k
                way = abs(after[last, j]) * (incidents.t[k] - incidents.t[last])
                is_limit[group == number, j] = way <= MERGED * limit[k, j] and (last < k or before[k, j] < 0)
                is_series |= last < k
            is_limit[group == number] &= is_series
        return is_limit

    def impacts(self) -> Check:
        """Complementarity of impulses and rates after, of the contacts with g = 0; others have no impulse."""
        g, limit_g = self.gaps, self.gap_limit
        impulse = self.incidents.impulses[:, self.contacts]
        before, after = (e.values.w[:, self.contacts] for e in (self.before, self.after))
        e = np.where(self._limits_of_series, 0.0, self.laws.model.restitution)
        rebound = after + e * np.minimum(before, 0.0)
        limit = self.after.noise("w")[:, self.contacts] + self.before.noise("w")[:, self.contacts]
        # Contacts that have rebounds which are no longer recorded, with both ends of that
        t, ends_rebounds = self.incidents.t, np.zeros(before.shape, dtype=bool)
        for j, begin, end, _ in self.unrecorded_rebounds:
            ends_rebounds[(t >= begin) & (t <= end), j] = True
        unrecorded = np.where(ends_rebounds, np.abs(e * before), 0.0)
        limit = limit + self.tolerance.atol + unrecorded.clip(max=RESOLVED * np.abs(before).max(initial=0.0))
        pushes = impulse > self.impulse_limit
        wrong = np.where(pushes, rebound, np.minimum(rebound, 0.0))
        wrong = np.where(np.abs(g) <= np.where(pushes, MERGED, 1.0) * limit_g, wrong, 0.0)
        # Within the limit it may be open all the same: then it parts, or is struck as soon as it comes.
        is_open = (after >= 0) & (np.abs(g) > doubles.ROOT * limit_g)
        closing = np.isin(self.incidents.kinds, CLOSING)
        for j in range(after.shape[1]):
            rows = np.flatnonzero(closing & (self.incidents.contact == j))
            following = np.searchsorted(rows, np.arange(len(after)), "right")
            k = np.flatnonzero((following < len(rows)) & (after[:, j] < 0))
            way = -after[k, j] * (t[rows[following[k]]] - t[k])
            is_open[k, j] |= way <= TWICE * (g + limit_g)[k, j]
        wrong = np.where(~pushes & is_open, 0.0, wrong)
        sign = np.minimum(impulse, 0.0), np.full(impulse.shape, self.impulse_limit)
        names = [*self.laws.contacts, *(f"impulse.{name}" for name in self.laws.contacts)]
        return judge_parts(IMPACTS, names, t, (wrong, limit), sign)

    def losses(self) -> Check:
        """The energy lost, by velocities and by impulses, beside the work of rows and positions that move with t; no
        more than rounding is gained."""
        one, other = self.before, self.after
        impulses, b = self.incidents.impulses, one.values.b
        (H, off), (H_after, off_after) = _hamiltonian(one), _hamiltonian(other)
        rates = (one.values.w + other.values.w) / 2
        change = H_after - H + (impulses * b).sum(axis=1)
        known = np.abs(impulses) * (one.noise("w") + other.noise("w") + one.noise("b"))
        limit = off + off_after + known.sum(axis=1) + self.tolerance.atol
        size = (np.abs(impulses) * (np.abs(rates) + np.abs(b))).sum(axis=1)
        limit = limit + self.tolerance.rtol * SAFETY * size
        residual = np.stack([change - (impulses * rates).sum(axis=1), np.maximum(change, 0.0)], axis=1)
        names = ("impulses and velocities", "energy created")
        # Momenta must be linear in the rates between the states: those of the particles are, those of a `lagrangian` at
        # the mean rates are compared with the mean momenta.
        judged = np.ones((len(self.incidents.t), 1), dtype=bool)
        if self.laws.model.lagrangian is not None:

            def own_momenta(q: Array, v: Array, values: LawValues) -> Array:
                """The part of p that is of the `lagrangian`, (E, n)."""
                return self.laws.on_coordinates(self.incidents.t, q, v, values.L_v)

            of_sides = []
            for e in (one, other):
                p = own_momenta(e.record.q, e.record.v, e.values)
                off_p = e.spread(p, own_momenta(*e.moved, e.moved_values)) + e.tolerance.atol
                of_sides.append((p, off_p))
            r, mean = one.record, (one.record.v + other.record.v) / 2
            middle = own_momenta(r.q, mean, self.laws.values(r.t, r.q, mean, r.lam))
            (p, off_p), (p_after, off_after) = of_sides
            linear = np.abs(middle - (p + p_after) / 2) <= off_p + off_after
            judged = np.asarray(linear.all(axis=1, keepdims=True))
        check = judge(LOSSES, names, self.incidents.t, residual, np.stack([limit, limit], axis=1), judged)
        if judged.all():
            return check
        note = f"momenta are not linear in the rates at {int((~judged).sum())} of {len(judged)} incidents"
        return dataclasses.replace(check, note=note)

    @property
    def lost(self) -> float:
        """The energy that all incidents took; what moves with t may have given some."""
        before, after = (energy_of_motion(e, e.record.v, e.values) for e in (self.before, self.after))
        return float(before[self.incidents.first].sum() - after[self.incidents.last].sum())


def _with_model(v: Array, values: LawValues) -> Array:
    """Rates with those of dependent particles by the model."""
    n = values.pull.shape[1]
    return np.concatenate([v[:, :n], values.u], axis=1)


def _hamiltonian(e: Evidence) -> tuple[Array, Array]:
    """H - V (E,) at the states of a record, and by how much it may be off."""

    def at(v: Array, values: LawValues) -> Array:
        given = (e.masses[e.n :] * v[:, e.n :] * values.x_t).sum(axis=1)
        return np.asarray(energy_of_motion(e, v, values) - given)

    # The recorded u is what is judged: the limit is made of that of the model alone.
    own, moved = at(_with_model(e.record.v, e.values), e.values), at(e.moved_rates, e.moved_values)
    return at(e.record.v, e.values), e.spread(own[:, None], moved[:, None])[:, 0]


def impact_evidence(e: Evidence) -> ImpactEvidence | None:
    """The evidence on the impacts of a whole run; None where the incidents are not known."""
    return None if e.run is None or e.run.incidents is None else ImpactEvidence(e, e.run.incidents)


def impacts(e: Evidence) -> list[Check]:
    """All checks of incidents by themselves; nothing where they are not known."""
    impact = e.once(impact_evidence)
    if impact is None:
        return []
    checks = [impact.recorded(), impact.jumps(), impact.touched(), impact.impacts()]
    if impact.rows.size or impact.before.values.x.size:
        checks.append(impact.kept())
    return [*checks, impact.losses()]


def balance(e: Evidence) -> list[Check]:
    """The energy of all rows with what impacts take; of models in which nothing else changes it."""
    impact, values = e.once(impact_evidence), e.values
    if impact is None or not len(impact.incidents.t):
        return []
    if any(np.any(part) for part in (values.F, values.V_t, values.L_t, values.x_t)):
        return []
    incidents, of_rows = impact.incidents, e.once(checks_motion.energies)
    E = of_rows.E
    # Nothing but impacts may change T + V: contacts that move may be struck, but never rest
    moves = (values.b != 0).any(axis=0)
    rests = np.asarray(e.once(checks_contact.contact_states).is_closed.any(axis=0))
    rests[incidents.contact[incidents.cuts & (incidents.kinds != "impact")]] = True
    if moves[impact.rows].any() or (moves[impact.contacts] & rests).any():
        return []
    energies = []  # of motion, and by how much they may be off
    for side in (impact.before, impact.after):
        T = energy_of_motion(side, side.record.v, side.values)
        T_moved = energy_of_motion(side, side.moved_rates, side.moved_values)
        energies.append((T, side.spread(T[:, None], T_moved[:, None])[:, 0].max(initial=0.0)))
    before, after = energies[0][0][incidents.first], energies[1][0][incidents.last]
    t = incidents.t[incidents.first]
    count = np.searchsorted(t, e.record.t, "right")
    total = np.concatenate([[0.0], np.cumsum(after - before)])[count]
    noise = e.spread(E[:, None], of_rows.E_moved[:, None])[:, 0].max(initial=0.0)
    of_impacts = max(off for _, off in energies)
    limit = noise * (1 + np.arange(len(E)) / SAFETY) + e.tolerance.atol
    limit = limit + of_impacts * np.where(count > 0, 1 + count / SAFETY, 0.0)
    # Of rows at one time the last, which is after the impacts then: at the first time too.
    first = np.searchsorted(e.record.t, e.record.t[0], "right") - 1
    apart = (E - E[first] - (total - total[first]))[:, None]
    judged = np.concatenate([np.diff(e.record.t) > 0, [True]])
    return [judge(BALANCE, ("the whole system",), e.record.t, apart, limit[:, None], judged[:, None])]


def momenta(e: Evidence, q: Array, v: Array, values: LawValues) -> Array:
    """p = dL/dv (E, n) of all coordinates at states of a record, v of all columns."""
    return e.laws.on_coordinates(e.record.t, q, v, e.masses * v + values.L_v)
