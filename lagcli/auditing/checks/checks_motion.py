"""Checks that need the recorded motion differentiated or integrated: rates, Newton, d'Alembert, energy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lagcli.auditing.checks.audit_report import Check, CheckedLaw, judge
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import Estimate, of_particles, with_truncation
from lagcli.auditing.evidence.laws import LawValues
from lagcli.auditing.evidence.row_spacing import RowSpacing
from lagcli.auditing.evidence.tolerances import RESOLVED, SAFETY, Evidence

RATES = CheckedLaw("rates", "D.24", "dr_k/dt = v_k")
PATH = CheckedLaw("path", "D.24", "r_k(t) - r_k(0) = integral of v_k dt")
IMPULSE = CheckedLaw("impulse", "D.23", "m_k v_k(t) - m_k v_k(0) = integral of F_k + R_k dt")
NEWTON = CheckedLaw("newton", "D.23, D.53", "m_k a_k = F_k + R_k")
DALEMBERT = CheckedLaw("dalembert", "D.26", "sum_k (m_k a_k - F_k) . dr_k = 0 over virtual displacements")
ENERGY = CheckedLaw("energy", "D.10, D.35", "d(T + V)/dt = F_nc . v + Q_nc . q' + dV/dt - dL/dt + R . v")


def rates(e: Evidence) -> list[Check]:
    """The recorded rates against differences of the recorded positions."""
    r = e.record
    q = e.grid.derivative(r.q, SAFETY * e.off_q)
    size = _grouped(np.abs(r.v).max(axis=0), e)
    truncation = q.truncation + e.grid.roughness(r.q, r.v)
    residual = Estimate(q.value - r.v, q.noise + SAFETY * e.off_v, truncation)
    return _held(e, RATES, e.names.v, residual, size, e.once(RowSpacing).is_resolved[0])


def _held(
    e: Evidence, law: CheckedLaw, names: tuple[str, ...], residual: Estimate, size: Array, judged: Array
) -> list[Check]:
    """Residuals within their bounds, judged where truncation leaves little of a size open or less than noise."""
    judged = judged & (residual.truncation <= np.maximum(RESOLVED * size, residual.noise))
    limit = with_truncation(residual.noise, residual.truncation)
    judged = e.once(RowSpacing).unaliased(residual.value, limit, judged)
    return [judge(law, names, e.record.t, residual.value, limit, judged)]


def path(e: Evidence) -> list[Check]:
    """The recorded positions against the integrals of the recorded rates: a slow drift adds up."""
    r = e.record
    return _integrated(e, PATH, (e.names.q, e.names.x), (r.q, r.x), (r.v, r.u), (SAFETY * e.off_q, 0.0))


def impulse(e: Evidence) -> list[Check]:
    """Momenta against the integrals of forces and reactions; of coordinates that carry no dependent particles."""
    r, values, own, force = e.record, e.values, e.laws.index.first_generalized, e.total_force
    force_x = r.R_x + values.force_x
    p = e.masses * r.v + values.L_v
    off = SAFETY * e.masses * e.off_v + e.noise("L_v").max(axis=0, initial=0.0)
    if r.x.size:  # their inertia belongs to the coordinates
        p, force, off = p[:, :own], force[:, :own], off[:own]
    names = (e.names.R_q[: p.shape[1]], e.names.R_x)
    rounded = np.concatenate([e.force_rounding.q[: p.shape[1]], e.force_rounding.x])
    return _integrated(e, IMPULSE, names, (p, e.masses_x * r.u), (force, force_x), (off, rounded))


def _integrated(
    e: Evidence,
    law: CheckedLaw,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    y: tuple[Array, Array],
    rate: tuple[Array, Array],
    off: tuple[Array, Array | float],
) -> list[Check]:
    """y(t) - y(0) against the integral of its rate, of coordinates and of dependent particles; off: by how much y of
    coordinates may be off, and the rounding of the rates."""
    rows = len(e.record.t)
    whole, moving = np.concatenate(y, axis=1), np.concatenate(rate, axis=1)
    size_x = np.abs(y[1]).max(initial=0.0)
    off_x = SAFETY * (e.tolerance.rtol * size_x + e.tolerance.atol * (1 + e.masses_x))
    largest = np.abs(moving).max(axis=0, initial=0.0)
    own = e.laws.index.first_generalized
    for part in (largest[:own], largest[y[0].shape[1] :]):  # the components of a particle have one size
        part[:] = of_particles(part)
    small = e.recorded(largest) + e.tolerance.atol + off[1]
    total = e.grid.integral(moving, small)
    span = np.abs(e.record.t - e.record.t[0])[:, None]
    limit = np.concatenate([off[0], off_x]) * (1 + np.arange(rows) / SAFETY)[:, None] + small * span
    size = np.maximum(np.abs(whole - whole[0]).max(axis=0), np.abs(total.value).max(axis=0))
    residual = Estimate(whole - whole[0] - total.value, limit + total.noise, total.truncation)
    judged = e.is_seen & (e.once(RowSpacing).is_slow and rows > 2)
    return _held(e, law, (*names[0], *names[1]), residual, size, judged)


def _grouped(size: Array, e: Evidence) -> Array:
    """The largest of the three components of each Cartesian particle, others as they are, (n,)."""
    own = e.laws.index.first_generalized
    return np.concatenate([of_particles(size[:own]), size[own:]])


class ForceBalance(NamedTuple):
    """m a - F on coordinates and then on dependent particles, (T, n + 3 Nd), with limits and what can be judged."""

    inertia: Array
    limit: Array
    judged: Array


def force_balance(e: Evidence) -> ForceBalance:
    """m a - F from the recorded velocities; of generalized coordinates d/dt dL/dq' - dL/dq - Q (D.34)."""
    r, values, own, m_x = e.record, e.values, e.laws.index.first_generalized, e.masses_x
    noise, noise_x = e.force_noise
    a, (rate, rate_x) = e.grid.derivative(r.v, SAFETY * e.off_v), e.momentum_rate
    force, force_x = values.force_q(), values.force_x
    inertia = e.masses * a.value + rate.value - force
    limit = e.masses * a.noise + rate.noise + e.noise("Q") + e.noise("L_q") + e.noise("V_q")
    limit[:, :own] += noise
    truncation = np.where(e.masses > 0, e.masses * a.truncation, 0.0)
    truncation = truncation + np.where(np.abs(values.L_v).max(axis=0) > 0, rate.truncation, 0.0)
    truncation = truncation + e.grid.roughness(e.masses * r.v + values.L_v, force + r.R_q)
    size = np.maximum(np.abs(e.masses * a.value), np.abs(force))
    a_x = e.grid.derivative(r.u, SAFETY * e.off_x + e.noise("u"))
    inertia_x = m_x * a_x.value - force_x
    limit_x = m_x * a_x.noise + noise_x
    truncation_x = m_x * a_x.truncation + e.grid.roughness(m_x * r.u, force_x + r.R_x)
    size_x = np.maximum(np.abs(m_x * a_x.value), np.abs(force_x))
    if r.x.size:
        inner = inertia_x - (values.L_x - rate_x.value)
        inertia = inertia + e.pushed(inner)
        limit = limit + e.pushed_limit(limit_x + e.noise("L_x") + rate_x.noise)
        limit = limit + e.spread(e.pushed(inner), e.laws.pushed(r.t, *e.moved, inner))
        pushed = e.pushed_limit(truncation_x)
        pushed[~np.isfinite(truncation_x).all(axis=1)] = np.inf
        truncation = truncation + pushed
        size = np.maximum(size, e.pushed_limit(size_x))
    largest = _grouped(np.maximum(size, np.abs(r.R_q)).max(axis=0), e)
    limit = limit + e.tolerance.atol + e.recorded(r.R_q) + e.force_rounding.q
    slow, slow_x = e.once(RowSpacing).is_resolved
    judged = slow & (truncation <= np.maximum(RESOLVED * largest, limit))
    judged[:, own:] &= np.all(slow_x, axis=1, keepdims=True)  # generalized ones carry particles
    top_x = of_particles(np.maximum(size_x, np.abs(r.R_x)).max(axis=0))
    limit_x = limit_x + e.tolerance.atol + e.recorded(r.R_x) + e.force_rounding.x
    judged_x = slow_x & (truncation_x <= np.maximum(RESOLVED * top_x, limit_x))
    limits = with_truncation(limit, truncation), with_truncation(limit_x, truncation_x)
    both = (inertia, inertia_x), limits, (judged, judged_x)
    return ForceBalance(*(np.concatenate(parts, axis=1) for parts in both))


def newton(e: Evidence) -> list[Check]:
    """m a = F + R of every coordinate and of every dependent particle."""
    b, r = e.once(force_balance), e.record
    residual = b.inertia - np.concatenate([r.R_q, r.R_x], axis=1)
    judged = e.once(RowSpacing).unaliased(residual, b.limit, b.judged)
    return [judge(NEWTON, (*e.names.R_q, *e.names.R_x), r.t, residual, b.limit, judged)]


def dalembert(e: Evidence) -> list[Check]:
    """The part of m a - F along virtual displacements."""
    b, d, rows, n = e.once(force_balance), e.displacements, e.looked_at, e.laws.index.n
    w = b.inertia[rows, :n]
    limit = np.sqrt((b.limit[rows, :n] ** 2).sum(axis=1))[:, None]
    limit = limit + 1e-14 * d.condition[:, None] * np.linalg.norm(w, axis=1)[:, None]
    judged = (b.judged[rows, :n].all(axis=1) & ~d.is_singular)[:, None]
    along = d.virtual(w)
    if e.once(RowSpacing).is_fast[rows].any():
        judged = judged & ~(np.abs(along) > limit)
    return [judge(DALEMBERT, e.names.q, e.record.t[rows], along, limit, judged)]


class Energies(NamedTuple):
    """E (T,) = T + V + (q' dL/dq' - L), and at moved states; work (T, 3): of all that changes E, of the constraints,
    and the sizes of its parts; the limit (T,) of E - E(0) - work, and where it can be judged."""

    E: Array
    E_moved: Array
    work: Estimate
    limit: Array
    judged: Array


def energies(e: Evidence) -> Energies:
    """Energy and work along the motion, by the recorded v and R."""
    r, values = e.record, e.values

    def total(v: Array, u: Array, at: LawValues) -> Array:
        T = (e.masses * v**2).sum(axis=1) / 2 + (e.masses_x * u**2).sum(axis=1) / 2
        return np.asarray(T + at.V + (v * at.L_v).sum(axis=1) + ((u - at.x_t) * at.L_u).sum(axis=1) - at.L)

    E = total(r.v, r.u, values)
    E_moved = total(e.moved[1], e.moved_values.u, e.moved_values)
    rows = len(r.t)
    constraint = (r.R_q * r.v).sum(axis=1) + (r.R_x * values.x_t).sum(axis=1)
    other = (values.F_q * r.v[:, : values.F_q.shape[1]]).sum(axis=1) + (values.F_x * r.u).sum(axis=1)
    other = other + (values.Q * r.v).sum(axis=1) + values.V_t - values.L_t
    size = np.abs(r.R_q * r.v).sum(axis=1) + np.abs(r.R_x * values.x_t).sum(axis=1) + np.abs(other)
    power = np.stack([constraint + other, constraint, size], axis=1)
    small = SAFETY * e.tolerance.rtol * size.max(initial=0.0) + e.tolerance.atol
    work = e.grid.integral(power, np.array([small, small, np.inf]))
    noise = e.spread(E[:, None], E_moved[:, None])[:, 0]
    # A run may be off by the tolerance at each step, and by more at a kink or a jump of a force.
    force, is_slow = e.total_force, e.once(RowSpacing).is_slow
    small_force = SAFETY * e.tolerance.rtol * np.abs(force).max(axis=0, initial=0.0)
    is_rough = ~e.grid.resolved(force, small_force).all(axis=1) & is_slow
    noise = noise.max(initial=0.0) * (1 + np.arange(rows) / SAFETY + np.cumsum(is_rough))
    rounding = SAFETY * e.tolerance.rtol * work.value[:, 2] + e.tolerance.atol
    largest = max(float(np.ptp(E)), float(np.ptp(values.V)), float(work.value[-1, 2]))
    truncation = work.truncation[:, 0]
    # How a `lagrangian` changes with particles that time itself moves, at rest, is not known here
    through = any(np.abs(slope).max(initial=0.0) > 0 for slope in (values.L_x, values.L_u))
    is_driven = bool(np.abs(values.x_t).max(initial=0.0) > 0 and through)
    judged = (truncation <= np.maximum(RESOLVED * largest, noise)) & is_slow & (rows > 2)
    judged &= e.is_seen[:, 0] & (not is_driven)
    limit = with_truncation(noise + rounding, truncation)
    return Energies(E, E_moved, work, limit, judged)


def energy(e: Evidence) -> list[Check]:
    """Energy gained against the work done on the way."""
    balance = e.once(energies)
    apart = (balance.E - balance.E[0] - balance.work.value[:, 0])[:, None]
    limit = balance.limit[:, None]
    judged = e.once(RowSpacing).unaliased(apart, limit, balance.judged[:, None])
    return [judge(ENERGY, ("the whole system",), e.record.t, apart, limit, judged)]
