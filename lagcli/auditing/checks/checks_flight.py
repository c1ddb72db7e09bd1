"""The motion from an incident to the next row or incident.

Around incidents rows stand too far apart for differences, and the states of the incidents have no reactions. Where
the rows that are equations and those of contacts that rest are independent, accelerations follow from positions and
velocities: with a_F = F/m and W the matrix of B m^(-1/2), m^(1/2) (a - a_F) = -W^+ (d/dt (B v + b) along a_F), (D.24).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.auditing.checks import checks_contact, checks_impact
from lagcli.auditing.checks.audit_report import Check, Law, judge, merged
from lagcli.auditing.checks.checks_contact import ContactStates
from lagcli.auditing.checks.checks_impact import ImpactEvidence
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import BESIDE, CAUTION, WIDE, WIDTHS, of_particles, weights_at_zero
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.row_spacing import RowSpacing
from lagcli.auditing.evidence.table_input import Record
from lagcli.auditing.evidence.tolerances import COST, RESOLVED, SAFETY, Evidence
from lagcli.auditing.evidence.virtual_space import VirtualSpace

FLIGHTS = Law("flights", "D.23, D.24", "r and m v from an incident to the next row or incident")
# Rows between two incidents that are examined by differences; fewer are, one by one, as flights. At 4
# `test_rows_between_impacts_are_judged_however_few_they_are` of `tests/physics/test_audit_tables.py` fails.
FEWEST_ROWS = 8
MOST_SETS = 60  # sets of contacts that rest, those with most flights
LEAST, STATES = 24, 4  # flights that are looked at in any case; states of a flight at which B is taken apart


class Flights(NamedTuple):
    """P flights: states at both ends, contacts that rest meanwhile (P, K) and whether it is known which, (P,); rebounds
    that are no longer recorded, (P,), with the most that these change rates, (P, n)."""

    begin: Record
    end: Record
    closed: Array
    is_known: Array
    has_rebounds: Array
    left: Array

    def part(self, k: Array) -> Flights:
        return Flights(self.begin.part(k), self.end.part(k), *(part[k] for part in self[2:]))


def _flights(e: Evidence, states: ContactStates, impact: ImpactEvidence) -> Flights:
    """From each incident to the next row or incident, from rows to incidents, and from row to row where there are too
    few for differences."""
    incidents, r = impact.incidents, e.record
    # At one instant one thing may follow another: rebounds end, and what comes next is an impact.
    first, last = incidents.first, incidents.last
    before, after = incidents.before.part(first), incidents.after.part(last)
    same = np.isin(r.t, before.t)
    rows = np.flatnonzero(~same)
    row = r.part(rows)
    # Each state once: rows, and the states before and after each instant.
    ends = _joined(row, before)
    begins = _joined(row, after)
    order = np.argsort(ends.t, kind="stable")
    is_instant = np.arange(len(ends.t)) >= len(rows)
    pairs = np.stack([order[:-1], order[1:]], axis=1)
    stretch = np.cumsum(is_instant[order])
    is_short = np.bincount(stretch)[stretch] <= FEWEST_ROWS
    pairs = pairs[is_instant[pairs].any(axis=1) | is_short[:-1]]
    # Contacts that are closed before and after each incident, (E, K)
    at, atol = impact.contacts, impact.tolerance.atol
    is_near = np.abs(impact.before.values.f[:, at]) <= impact.before.noise("f")[:, at] + atol
    resting = (np.abs(side.values.w) <= side.noise("w") + atol for side in (impact.before, impact.after))
    before_it, after_it = (is_near & rests[:, at] for rests in resting)
    # By some impacts nothing approaches faster than its limit: whether what it strikes rests or rebounds is not known
    slow = impact.before.values.w >= -(impact.before.noise("w") + atol)
    is_weak = (incidents.kinds == "impact") & slow[:, at].all(axis=1)
    at_begin = np.concatenate([states.is_closed[rows], after_it[last]])
    at_end = np.concatenate([states.is_closed[rows], before_it[first]])
    begin, end = begins.part(pairs[:, 0]), ends.part(pairs[:, 1])
    long = end.t - begin.t > doubles.SUM * np.abs(r.t).max()
    closed = at_begin[pairs[:, 0]]
    weak = np.concatenate([np.zeros(len(rows), dtype=bool), is_weak[first]])
    known = (closed == at_end[pairs[:, 1]]).all(axis=1) & long & ~weak[pairs].any(axis=1)
    rebounds = np.zeros(len(end.t), dtype=bool)
    left = np.zeros(end.q.shape)
    for _, since, until, change in impact.unrecorded_rebounds:
        within = (end.t > since) & (end.t <= until)
        rebounds |= within
        left[within] += change
    return Flights(begin, end, closed, known, rebounds, left)


def _joined(first: Record, second: Record) -> Record:
    return Record(*map(np.concatenate, zip(first, second, strict=True)))


def flights(e: Evidence) -> list[Check]:
    """Momenta and positions over each flight; positions alone where there are generalized coordinates, dependent
    particles or a `lagrangian`."""
    impact, laws = e.once(checks_impact.impact_evidence), e.laws
    if impact is None or not len(impact.incidents.t):
        return []
    if laws.index.dependent.size or laws.index.coordinates.names or laws.model.lagrangian:
        return [_kinematics(e, impact)]
    every_flight = _flights(e, e.once(checks_contact.contact_states), impact)
    names = (*e.names.q, *e.names.v)
    every = np.arange(len(every_flight.closed))
    sets, which = np.unique(every_flight.closed, axis=0, return_inverse=True)
    groups = [every[(which.ravel() == number) & every_flight.is_known] for number in range(len(sets))]
    longest = sorted((k for k in zip(sets, groups, strict=True) if k[1].size), key=lambda k: -k[1].size)
    parts, count = [], 0
    for closed, numbers in longest[:MOST_SETS]:
        motion = _FreeMotion(e, np.flatnonzero(closed).tolist())
        # As many as the size of B allows, evenly chosen
        size = STATES * 4 * motion.laws.C**2 * motion.laws.index.n
        most, k = max(LEAST, int(COST / max(1, size))), numbers
        if most < len(numbers):
            k = numbers[np.unique(np.linspace(0, len(numbers) - 1, most).astype(np.int64))]
        parts.append((every_flight.end.t[k], *_flown(e, impact, motion, every_flight.part(k))))
        count += len(k)
    if not parts:
        return [FLIGHTS.unjudged("contacts open or close all along", len(every) * len(names))]
    t, residual, limit, judged = (np.concatenate(each) for each in zip(*parts, strict=True))
    order = np.argsort(t, kind="stable")
    check = judge(FLIGHTS, names, t[order], residual[order], limit[order], judged[order])
    left = (len(every) - count) * len(names)
    return [merged([check], left) if left else check]


def _kinematics(e: Evidence, impact: ImpactEvidence) -> Check:
    """Coordinates at an incident and at the row next to it against the integral of the rates of rows. The states of
    incidents take no part in the integral: one that is wrong would hide itself in its bound."""
    incidents, n, names = impact.incidents, e.n, e.names.q[: e.n]
    r = e.record._replace(q=e.record.q[:, :n], v=e.record.v[:, :n])
    first, last = incidents.first, incidents.last
    # The stretches of rows before, between and after the instants; some have rebounds that are not recorded
    at = incidents.t[first]
    since, until = np.append(-np.inf, at), np.append(at, np.inf)
    begin, end = np.searchsorted(r.t, since, "right"), np.searchsorted(r.t, until, "left")
    rebounds = np.zeros(len(since), dtype=bool)
    for _, start, stop, _ in impact.unrecorded_rebounds:
        rebounds |= (since < stop) & (until > start)
    # Both sides of each instant, before and after, less one before the first row and one after the last: the state
    # there, the row next to it, the rows up to the next instant
    state = _joined(incidents.before.part(first), incidents.after.part(last))
    state = state._replace(q=state.q[:, :n], v=state.v[:, :n])
    ahead, count = np.repeat([-1, 1], len(at)), end - begin
    k = np.flatnonzero(np.where(ahead < 0, state.t > r.t[0], state.t < r.t[-1]))
    state, ahead = state.part(k), ahead[k]
    row, count = np.append(end[:-1] - 1, begin[1:])[k], np.append(count[:-1], count[1:])[k]
    rebounds = np.append(rebounds[:-1], rebounds[1:])[k]
    if not len(k):
        return judge(FLIGHTS, names, state.t, state.q, state.q)
    h = np.abs(r.t[np.clip(row, 0, len(r.t) - 1)] - state.t)[:, None]
    residual, best = np.zeros(state.q.shape), np.full(state.q.shape, np.inf)
    off_q, off_v, clock = impact.off_q[:n], impact.off_v[:n], impact.clock
    off = 2 * SAFETY * (off_q + h * off_v) + clock * np.abs(state.v)
    before: Array | None = None
    nodes, shares = np.polynomial.legendre.leggauss(BESIDE)
    for width in WIDTHS:
        k = np.flatnonzero(count >= width)
        rows = row[k, None] + ahead[k, None] * np.arange(width)
        # The integral from the state to the first row of the polynomials through the rates of rows, their values at
        # the state, and the sums of the sizes of the weights of the mean
        t, times, rates = state.t[k], r.t[rows], r.v[rows]
        way, mean = times[:, 0] - t, np.zeros(times.shape)
        for node, share in zip(nodes, shares, strict=True):
            mean += share / 2 * weights_at_zero(times - (t + way * (1 + node) / 2)[:, None])[0]
        integral = way[:, None] * np.einsum("ms,msn->mn", mean, rates)
        rate = np.einsum("ms,msn->mn", weights_at_zero(times - t[:, None])[0], rates)
        spread = np.abs(mean).sum(axis=1)
        apart = np.zeros(state.q.shape)
        apart[k] = r.q[rows[:, 0]] - state.q[k] - integral
        if before is not None:
            unknown = CAUTION * np.abs(apart - before)[k] + h[k] * np.abs(state.v[k] - rate)
            unknown = unknown + spread[:, None] * h[k] * SAFETY * off_v
            better = unknown < best[k]
            residual[k] = np.where(better, apart[k], residual[k])
            best[k] = np.where(better, unknown, best[k])
        before = apart
    close = best <= np.maximum(RESOLVED * h * np.abs(r.v).max(axis=0, initial=0.0), off)
    judged = (close | (np.abs(residual) > best + off)) & ~e.once(RowSpacing).is_coarse[:n]
    judged &= ~rebounds[:, None]
    order = np.argsort(state.t, kind="stable")
    return judge(FLIGHTS, names, state.t[order], residual[order], (best + off)[order], judged[order])


def _flown(
    e: Evidence, impact: ImpactEvidence, motion: _FreeMotion, flown: Flights
) -> tuple[Array, Array, Array]:
    """Residuals, their limits, and which are judged, of flights, (P, 2 n) each: integrals by Boole's formula on the
    quintic curve of Hermite through both ends, their errors by Simpson's formula and that of the trapezium."""
    begin, end = flown.begin, flown.end
    h = (end.t - begin.t)[:, None]
    off_q, off_v, clock = impact.off_q, impact.off_v, impact.clock
    rtol = max(e.tolerance.rtol, impact.tolerance.rtol)
    ends = motion.accelerations(begin), motion.accelerations(end)
    inner = [_between(begin, end, ends, u) for u in (0.25, 0.5, 0.75)]
    a = np.stack([ends[0], *map(motion.accelerations, inner), ends[1]])
    boole = h / 90 * (7 * (a[0] + a[4]) + 32 * (a[1] + a[3]) + 12 * a[2])
    simpson = h / 6 * (a[0] + 4 * a[2] + a[4])
    # The integrals of (h/2 - s) a(s) ds.
    bend = h * h / 90 * (3.5 * (a[0] - a[4]) + 8 * (a[1] - a[3]))
    plain = h * h / 12 * (a[0] - a[4])
    second, fourth = np.abs(np.diff(a, n=2, axis=0)).max(axis=0), np.abs(np.diff(a, n=4, axis=0))[0]
    # Such fourth differences are of no smooth acceleration: it bends or jumps.
    rough = WIDE * fourth >= second
    unknown_v = WIDE * np.abs(boole - simpson)
    unknown_v += np.where(rough, np.abs(simpson - h / 2 * (a[0] + a[4])), 0.0)
    unknown_v = unknown_v + np.abs(boole) * SAFETY * rtol
    unknown_q = WIDE * np.abs(bend - plain) + np.where(rough, np.abs(plain), 0.0)
    size_v = np.abs(e.record.v).max(axis=0, initial=0.0)
    size_q = np.maximum(np.abs(e.record.q).max(axis=0, initial=0.0), np.abs(h * begin.v))
    if motion.laws.C:  # known as the rows are, and of a vector that turns one component may tell nothing
        unknown_v = of_particles(np.abs(unknown_v + h * SAFETY * motion.spread(inner[1], a[2])))
        unknown_q, size_v, size_q = (of_particles(np.abs(y)) for y in (unknown_q, size_v[None], size_q))
    rebounds = flown.has_rebounds[:, None]
    unknown_v = np.where(rebounds, np.maximum(unknown_v, RESOLVED * size_v) + flown.left, unknown_v)
    unknown_q = unknown_q + np.where(rebounds, 0.0, h * unknown_v)
    unknown_q = np.where(rebounds, np.maximum(unknown_q, RESOLVED * size_q) + h * flown.left, unknown_q)
    # Times that are rounded are the length of the flight.
    if e.tolerance.written.time or impact.tolerance.written.time:
        unknown_v = unknown_v + clock * np.abs(a[2])
        unknown_q = unknown_q + clock * np.maximum(np.abs(begin.v), np.abs(end.v))
    residuals = end.q - begin.q - h / 2 * (begin.v + end.v) - bend, end.v - begin.v - boole
    limits = 2 * SAFETY * (off_q + h * off_v) + unknown_q, 2 * SAFETY * off_v + unknown_v
    judged_q = unknown_q <= np.maximum(RESOLVED * size_q, 2 * SAFETY * off_q)
    judged_v = unknown_v <= np.maximum(RESOLVED * size_v, 2 * SAFETY * off_v)
    both = residuals, limits, (judged_q, judged_v)
    residual, limit, judged = (np.concatenate(parts, axis=1) for parts in both)
    return residual, limit, judged


class _FreeMotion:
    """Accelerations of Cartesian particles from positions and velocities while these contacts rest."""

    def __init__(self, e: Evidence, closed: Sequence[int]) -> None:
        self._e = e
        self.laws = ModelLaws(e.laws.model, e.tolerance.jumps, closed)
        self._roots = np.sqrt(e.masses)
        self._random = np.random.default_rng(6)

    def accelerations(self, r: Record) -> Array:
        """a (P, n); no numbers where rows depend on each other, or almost, and multipliers need not tell the motion."""
        e, laws = self._e, self.laws
        values = e.laws.values(r.t, r.q, r.v, np.zeros((len(r.t), e.laws.C)))
        a: Array = values.force() / e.masses
        if not laws.C:
            return a
        demanded = laws.demanded(r.t, r.q, r.v, a)
        W = laws.matrix(r.t, r.q, r.v) / self._roots
        usable = np.isfinite(W).all(axis=(1, 2)) & (W != 0).any(axis=2).all(axis=1)
        usable &= np.isfinite(demanded).all(axis=1) & (W.shape[1] <= W.shape[2])
        constrained = np.full(a.shape, np.nan)
        if not usable.any():
            return constrained
        space = VirtualSpace(W[usable])
        pulled = space.step(demanded[usable]) / self._roots
        constrained[usable] = np.where(space.are_apart[:, None], a[usable] - pulled, np.nan)
        return constrained

    def spread(self, r: Record, a: Array) -> Array:
        """By how much a (P, n) at states changes as these are moved by parts of their tolerance."""
        e = self._e
        signs = self._random.choice((-1.0, 1.0), size=(2, *r.q.shape))
        q, v = r.q + signs[0] * e.off_q, r.v + signs[1] * e.off_v
        return np.asarray(np.abs(self.accelerations(r._replace(q=q, v=v)) - a))


def _powers(u: float) -> Array:
    """The powers of u up to the fifth, their slopes and their curvatures, (3, 6)."""
    k = np.arange(6)
    return np.stack([u**k, k * u ** np.maximum(k - 1, 0), k * (k - 1) * u ** np.maximum(k - 2, 0)])


# Coefficients of the quintic curve of Hermite that begins at 0, by its rate and curvature there and by those and its
# value at 1, (6, 5)
CURVE = np.linalg.inv(np.concatenate([_powers(0), _powers(1)]))[:, 1:]


def _between(begin: Record, end: Record, ends: tuple[Array, Array], u: float) -> Record:
    """The states at the part u of the way, on the quintic curve."""
    h = (end.t - begin.t)[:, None]
    given = h * begin.v, h * h * ends[0], end.q - begin.q, h * end.v, h * h * ends[1]
    rise, rate = np.einsum("wg,gpn->wpn", _powers(u)[:2] @ CURVE, np.stack(given))
    return begin._replace(t=begin.t + u * (end.t - begin.t), q=begin.q + rise, v=rate / h)
