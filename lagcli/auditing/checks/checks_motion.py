"""Checks that need the recorded motion differentiated or integrated: rates, Newton, d'Alembert, energy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lagcli.auditing.checks.audit_report import Check, Law, judge
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import Estimate, of_particles, with_truncation
from lagcli.auditing.evidence.laws import LawValues
from lagcli.auditing.evidence.row_spacing import RowSpacing
from lagcli.auditing.evidence.tolerances import RESOLVED, SAFETY, Evidence

RATES = Law("rates", "D.24", "dr_k/dt = v_k")
PATH = Law("path", "D.24", "r_k(t) - r_k(0) = integral of v_k dt")
IMPULSE = Law("impulse", "D.23", "m_k v_k(t) - m_k v_k(0) = integral of F_k + R_k dt")
NEWTON = Law("newton", "D.23, D.53", "m_k a_k = F_k + R_k")
DALEMBERT = Law("dalembert", "D.26", "sum_k (m_k a_k - F_k) . dr_k = 0 over virtual displacements")
ENERGY = Law("energy", "D.10, D.35", "d(T + V)/dt = F_nc . v + Q_nc . q' + dV/dt - dL/dt + R . v")


def rates(e: Evidence) -> list[Check]:
    """The recorded rates against differences of the recorded positions."""
    q, v, off_q, off_v = (y[..., : e.n] for y in (e.record.q, e.record.v, e.off_q, e.off_v))
    slope = e.grid.derivative(q, SAFETY * off_q)
    truncation = slope.truncation + e.grid.roughness(q, v)
    residual = Estimate(slope.value - v, slope.noise + SAFETY * off_v, truncation)
    size = _grouped(np.abs(v).max(axis=0), e)
    return _held(e, RATES, e.names.v[: e.n], residual, size, e.once(RowSpacing).is_resolved[:, : e.n])


def _held(
    e: Evidence, law: Law, names: tuple[str, ...], residual: Estimate, size: Array, judged: Array
) -> list[Check]:
    """Residuals within their bounds, judged where truncation leaves little of a size open or less than noise."""
    judged = judged & (residual.truncation <= np.maximum(RESOLVED * size, residual.noise))
    limit = with_truncation(residual.noise, residual.truncation)
    judged = e.once(RowSpacing).unaliased(residual.value, limit, judged)
    return [judge(law, names, e.record.t, residual.value, limit, judged)]


def path(e: Evidence) -> list[Check]:
    """The recorded positions against the integrals of the recorded rates: a slow drift adds up."""
    return _integrated(e, PATH, e.names.q, (e.record.q, e.record.v), SAFETY * e.off_q, np.zeros(1))


def impulse(e: Evidence) -> list[Check]:
    """Momenta against the integrals of forces and reactions; of coordinates that carry no dependent particles."""
    p = e.masses * e.record.v
    p[:, : e.n] += e.values.L_v[:, : e.n]
    off = SAFETY * e.masses * e.off_v + e.noise("L_v").max(axis=0, initial=0.0)
    columns = np.arange(p.shape[1])
    if e.n < len(columns):  # the inertia of dependent particles belongs to the generalized coordinates
        columns = np.delete(columns, np.s_[e.own : e.n])
    names = tuple(e.names.R[k] for k in columns)
    moving = p[:, columns], e.total_force[:, columns]
    return _integrated(e, IMPULSE, names, moving, off[columns], e.force_rounding[0][columns])


def _integrated(
    e: Evidence,
    law: Law,
    names: tuple[str, ...],
    moving: tuple[Array, Array],
    off: Array,
    rounded: Array,
) -> list[Check]:
    """y(t) - y(0) against the integral of its rate; moving: y and its rate, dependent particles last; off: by how much
    y of coordinates may be off; rounded: the rounding of the rates."""
    rows, (y, rate) = len(e.record.t), moving
    first = y.shape[1] - (e.record.q.shape[1] - e.n)  # of dependent particles
    size_x = np.abs(y[:, first:]).max(initial=0.0)
    off_x = SAFETY * (e.tolerance.rtol * size_x + e.tolerance.atol * (1 + e.masses[e.n :]))
    largest = np.abs(rate).max(axis=0, initial=0.0)
    for part in (largest[: e.own], largest[first:]):  # the components of a particle have one size
        part[:] = of_particles(part)
    small = e.recorded(largest) + e.tolerance.atol + rounded
    total = e.grid.integral(rate, small)
    span = np.abs(e.record.t - e.record.t[0])[:, None]
    limit = np.concatenate([off[:first], off_x]) * (1 + np.arange(rows) / SAFETY)[:, None] + small * span
    size = np.maximum(np.abs(y - y[0]).max(axis=0), np.abs(total.value).max(axis=0))
    residual = Estimate(y - y[0] - total.value, limit + total.noise, total.truncation)
    judged = e.is_seen & (e.once(RowSpacing).is_slow and rows > 2)
    return _held(e, law, names, residual, size, judged)


def _grouped(size: Array, e: Evidence) -> Array:
    """The largest of the three components of each particle, others as they are."""
    parts = of_particles(size[: e.own]), size[e.own : e.n], of_particles(size[e.n :])
    return np.concatenate(parts)


def force_balance(e: Evidence) -> tuple[Array, Array, Array]:
    """m a - F from the recorded velocities, of generalized coordinates d/dt dL/dq' - dL/dq - Q (D.34), (T, n + 3 Nd),
    with its limits and what can be judged."""
    r, values, m, n, rate = e.record, e.values, e.masses, e.n, e.momentum_rate
    off = np.repeat(SAFETY * e.off_v[None], len(r.t), axis=0)
    off[:, n:] += e.noise("u")
    a, force, p = e.grid.derivative(r.v, off), values.force(), m * r.v
    inertia, limit = m * a.value - force, m * a.noise + e.total_noise
    truncation = np.where(m > 0, m * a.truncation, 0.0)
    inertia[:, :n] += rate.value[:, :n]
    limit[:, :n] += rate.noise[:, :n]
    p[:, :n] += values.L_v[:, :n]
    truncation[:, :n] += np.where(np.abs(values.L_v).max(axis=0) > 0, rate.truncation, 0.0)[:, :n]
    truncation += e.grid.roughness(p, force + r.R)
    size = np.maximum(np.abs(m * a.value), np.abs(force))
    if n < r.q.shape[1]:  # dependent particles are carried by the coordinates
        inner = inertia[:, n:] - (values.L_q - rate.value)[:, n:]
        inertia[:, :n] += e.pushed(inner)
        limit[:, :n] += e.pushed_limit(limit[:, n:] + (e.noise("L_q") + rate.noise)[:, n:])
        limit[:, :n] += e.spread(e.pushed(inner), e.laws.pushed(r.t, *e.moved, inner))
        open_ = e.pushed_limit(truncation[:, n:])
        open_[~np.isfinite(truncation[:, n:]).all(axis=1)] = np.inf
        truncation[:, :n] += open_
        size[:, :n] = np.maximum(size[:, :n], e.pushed_limit(size[:, n:]))
    largest = _grouped(np.maximum(size, np.abs(r.R)).max(axis=0), e)
    limit += e.tolerance.atol + e.recorded(r.R) + e.force_rounding[0]
    slow = e.once(RowSpacing).is_resolved
    judged = slow & (truncation <= np.maximum(RESOLVED * largest, limit))
    judged[:, e.own : n] &= np.all(slow[:, n:], axis=1, keepdims=True)  # generalized ones carry particles
    return inertia, with_truncation(limit, truncation), judged


def newton(e: Evidence) -> list[Check]:
    """m a = F + R of every coordinate and of every dependent particle."""
    inertia, limit, judged = e.once(force_balance)
    judged = e.once(RowSpacing).unaliased(inertia - e.record.R, limit, judged)
    return [judge(NEWTON, e.names.R, e.record.t, inertia - e.record.R, limit, judged)]


def dalembert(e: Evidence) -> list[Check]:
    """The part of m a - F along virtual displacements."""
    d, rows = e.displacements, e.looked_at
    w, limit, judged = (part[rows, : e.n] for part in e.once(force_balance))
    limit = np.sqrt((limit**2).sum(axis=1))[:, None]
    limit = limit + 1e-14 * d.condition[:, None] * np.linalg.norm(w, axis=1)[:, None]
    judged = (judged.all(axis=1) & ~d.is_singular)[:, None]
    along = d.virtual(w)
    if e.once(RowSpacing).is_fast[rows].any():
        judged = judged & ~(np.abs(along) > limit)
    return [judge(DALEMBERT, e.names.q[: e.n], e.record.t[rows], along, limit, judged)]


class Energies(NamedTuple):
    """E (T,) = T + V + (q' dL/dq' - L), and at moved states; work (T, 3): of all that changes E, of the constraints,
    and the sizes of its parts; the limit (T,) of E - E(0) - work, and where it can be judged."""

    E: Array
    E_moved: Array
    work: Estimate
    limit: Array
    judged: Array


def energy_of_motion(e: Evidence, v: Array, values: LawValues) -> Array:
    """T (T,) of the particles with q' . dL/dq' - L of the `lagrangian`, at the rates v of all columns: the energy less
    the declared potentials."""
    of_coordinates = np.concatenate([v[:, : e.n], v[:, e.n :] - values.x_t], axis=1)
    T = (e.masses * v**2).sum(axis=1) / 2
    return np.asarray(T + (of_coordinates * values.L_v).sum(axis=1) - values.L)


def energies(e: Evidence) -> Energies:
    """Energy and work along the motion, by the recorded v and R."""
    r, values = e.record, e.values
    E = energy_of_motion(e, r.v, values) + values.V
    E_moved = energy_of_motion(e, e.moved_rates, e.moved_values) + e.moved_values.V
    rows = len(r.t)
    # Of positions that move with t reactions do the work of this alone.
    given = r.R * np.concatenate([r.v[:, : e.n], values.x_t], axis=1)
    other = (values.F * r.v).sum(axis=1) + values.V_t - values.L_t
    size = np.abs(given).sum(axis=1) + np.abs(other)
    constraint = given.sum(axis=1)
    power = np.stack([constraint + other, constraint, size], axis=1)
    small = SAFETY * e.tolerance.rtol * size.max(initial=0.0) + e.tolerance.atol
    work = e.grid.integral(power, np.array([small, small, np.inf]))
    noise = e.spread(E[:, None], E_moved[:, None])[:, 0]
    # A run may be off by the tolerance at each step, and by more at a kink or a jump of a force.
    force, is_slow = e.total_force[:, : e.n], e.once(RowSpacing).is_slow
    small_force = SAFETY * e.tolerance.rtol * np.abs(force).max(axis=0, initial=0.0)
    is_rough = ~e.grid.resolved(force, small_force).all(axis=1) & is_slow
    noise = noise.max(initial=0.0) * (1 + np.arange(rows) / SAFETY + np.cumsum(is_rough))
    rounding = SAFETY * e.tolerance.rtol * work.value[:, 2] + e.tolerance.atol
    largest = max(float(np.ptp(E)), float(np.ptp(values.V)), float(work.value[-1, 2]))
    truncation = work.truncation[:, 0]
    # How a `lagrangian` changes with particles that time itself moves, at rest, is not known here
    is_driven = np.any(values.x_t) and any(np.any(slope[:, e.n :]) for slope in (values.L_q, values.L_v))
    judged = (truncation <= np.maximum(RESOLVED * largest, noise)) & is_slow & (rows > 2)
    judged &= e.is_seen[:, 0] & (not is_driven)
    return Energies(E, E_moved, work, with_truncation(noise + rounding, truncation), judged)


def energy(e: Evidence) -> list[Check]:
    """Energy gained against the work done on the way."""
    balance = e.once(energies)
    apart = (balance.E - balance.E[0] - balance.work.value[:, 0])[:, None]
    limit = balance.limit[:, None]
    judged = e.once(RowSpacing).unaliased(apart, limit, balance.judged[:, None])
    return [judge(ENERGY, ("the whole system",), e.record.t, apart, limit, judged)]
