"""Checks that each row of a table must stand alone: constraints, reactions, multipliers, virtual work."""

from __future__ import annotations

import numpy as np

from lagcli.auditing.checks.audit_report import Check, CheckedLaw, judge
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import widest
from lagcli.auditing.evidence.tolerances import SAFETY, Evidence

POSITIONS = CheckedLaw("positions", "D.2", "f_i(r, t) = 0")
VELOCITIES = CheckedLaw("velocities", "D.6", "sum_k B_ik . v_k + B_it = 0")
DEPENDENT = CheckedLaw("dependent", "D.27", "r_k = x_k(q, t), v_k = dx_k/dt")
DEMAND = CheckedLaw("accelerations", "D.24", "d/dt (B v + b) = 0 with a_k = (F_k + R_k)/m_k")
REACTIONS = CheckedLaw("reactions", "D.22", "R_k = sum_i lambda_i B_ik")
MULTIPLIERS = CheckedLaw("multipliers", "D.22", "lambda_i is that of R where it is unique")
IDEAL = CheckedLaw("ideal", "D.11", "sum_k R_k . dr_k = 0 over virtual displacements")
CARRIED = CheckedLaw("generalized", "D.30", "sum_k R_k . dr_k/dq_j = R_j + what acts on q_j itself")
POWER = CheckedLaw("work", "D.6", "sum_k R_k . v_k = - sum_i lambda_i B_it")


def constraints(e: Evidence) -> list[Check]:
    """f and B v + b, and the positions and velocities of dependent particles."""
    r, values, names = e.record, e.values, e.names
    checks = [
        judge(POSITIONS, e.laws.holonomic, r.t, values.f, e.noise("f") + e.tolerance.atol),
        judge(VELOCITIES, e.laws.rows, r.t, values.w, e.noise("w") + e.tolerance.atol),
    ]
    if r.x.size:
        checks.append(judge(DEPENDENT, (*names.x, *names.u), r.t, *dependent(e)))
    return checks


def dependent(e: Evidence) -> tuple[Array, Array]:
    """The positions and velocities of dependent particles beside those of the model, with limits, (T, 6 Nd) each."""
    r, values = e.record, e.values
    apart = np.concatenate([r.x - values.x, r.u - values.u], axis=1)
    return apart, np.concatenate([e.noise("x"), e.noise("u")], axis=1) + e.tolerance.atol


def demand(e: Evidence) -> list[Check]:
    """The demand of the forces on B v + b, without any difference of rows; of models in Cartesian coordinates alone."""
    laws, rows = e.laws, e.looked_at
    r = e.record.part(rows)
    if not laws.C or len(laws.index.coordinates) or laws.model.lagrangian is not None:
        return []

    def second(q: Array, v: Array, forces: Array, later: float = 0.0) -> Array:
        return laws.demanded(r.t + later, q, v, (forces.reshape(len(q), -1) + r.R_q) / e.masses)

    forces = e.particle_forces[rows]
    rates = second(r.q, r.v, forces)
    limit = e.spread(rates, second(e.moved[0][rows], e.moved[1][rows], forces)) + e.tolerance.atol
    # What bends at the time itself has the state after it where it is a contact; of an equation it is one in between.
    sides = np.stack([rates, *(second(r.q, r.v, forces, side * e.clock) for side in (-1, 1))])
    bends = np.ptp(np.sign(sides), axis=0) > 1
    nearest = np.take_along_axis(
        sides, np.abs(np.nan_to_num(sides, nan=np.inf)).argmin(axis=0)[None], axis=0
    )[0]
    rates = np.where(bends & ~np.isin(laws.rows, laws.contacts), 0.0, nearest)
    # F is known to its own noise, R to that of B^T lambda.
    off = e.particle_noise[rows].reshape(len(r.t), -1) + e.reaction_limit[rows]
    off = off + e.recorded(np.abs(r.R_q).max(axis=1, initial=0.0))[:, None]
    limit = limit + np.einsum("mcn,mn->mc", np.abs(e.displacements.B), off / e.masses)
    return [
        judge(DEMAND, laws.rows, r.t, rates, widest(limit), ~np.any(np.isnan(r.lam), axis=1, keepdims=True))
    ]


def reactions(e: Evidence) -> list[Check]:
    """R = B^T lambda, and lambda from R."""
    r = e.record
    if not e.laws.C:
        return [judge(REACTIONS, e.names.R_q, r.t, r.R_q, e.reaction_limit)]
    apart = r.R_q - e.values.pull
    known = np.isfinite(r.lam).all(axis=1)
    return [
        judge(REACTIONS, e.names.R_q, r.t[known], apart[known], e.reaction_limit[known]),
        _multipliers(e),
    ]


def _multipliers(e: Evidence) -> Check:
    """lambda of the rows looked at, where it is unique; one that is no number must have a pole there."""
    rows, d, r = e.looked_at, e.displacements, e.record
    expected, spread = d.multipliers(r.R_q[rows], e.reaction_limit[rows])
    lam = r.lam[rows]
    limit = spread + d.condition[:, None] * e.recorded(expected) + e.tolerance.atol
    judged = d.is_unique & ~d.is_singular[:, None]
    missing = np.isnan(lam)
    apart = np.where(missing, np.inf, lam - np.nan_to_num(expected))
    judged |= missing & ~d.is_singular[:, None]
    limit = np.where(missing, e.tolerance.atol, limit)
    # A multiplier that is unique nowhere is not compared with R; that it is not is stated in words.
    compared = np.flatnonzero((d.is_unique | missing).any(axis=0) | d.is_singular.all())
    names = [e.laws.rows[i] for i in compared]
    return judge(MULTIPLIERS, names, r.t[rows], apart[:, compared], limit[:, compared], judged[:, compared])


def ideal(e: Evidence) -> list[Check]:
    """Virtual work (D.11) on an orthonormal basis, by the part of R along it, and the real power beside it."""
    rows, d, r = e.looked_at, e.displacements, e.record
    R = r.R_q[rows]
    size = np.linalg.norm(R, axis=1)[:, None]
    limit = np.linalg.norm(e.reaction_limit[rows], axis=1)[:, None] + 1e-14 * d.condition[:, None] * size
    checks = [judge(IDEAL, e.names.R_q, r.t[rows], d.virtual(R), limit, ~d.is_singular[:, None])]
    if e.laws.C:
        real = (r.R_q * r.v).sum(axis=1)
        given = -(r.lam * e.values.b).sum(axis=1)
        speed = np.abs(r.v)
        limit = (e.reaction_limit * speed).sum(axis=1) + (np.abs(r.R_q) * SAFETY * e.off_v).sum(axis=1)
        limit += np.nan_to_num(np.abs(r.lam) * (e.noise("b") + e.noise("w"))).sum(axis=1) + e.tolerance.atol
        known = np.isfinite(given)
        checks.append(
            judge(POWER, ("all particles",), r.t[known], (real - given)[known, None], limit[known, None])
        )
    return checks


def carried(e: Evidence) -> list[Check]:
    """The virtual work of R of the dependent particles: that of the multipliers and of what acts on q itself."""
    r, values = e.record, e.values
    if not r.x.size:
        return []
    own = e.laws.index.first_generalized
    rate, rate_x = e.momentum_rate
    acting = (-values.V_q + values.Q + values.L_q - rate.value)[:, own:]
    carriers = e.pushed(r.R_x - values.L_x + rate_x.value)[:, own:]
    residual = carriers - acting - r.R_q[:, own:]
    moved = e.laws.pushed(r.t, *e.moved, r.R_x)
    # R of dependent particles is known to its rounding, and as F is
    size, noise = np.abs(r.R_x), e.particle_noise[:, e.laws.index.dependent].reshape(r.R_x.shape)
    noise = e.recorded(size + size.max(axis=0, initial=0.0)) + noise
    limit = e.spread(e.pushed(r.R_x), moved)[:, own:] + e.pushed_limit(noise)[:, own:]
    limit += (e.noise("V_q") + e.noise("Q") + e.noise("L_q") + rate.noise)[:, own:] + e.tolerance.atol
    truncation = rate.truncation[:, own:] + np.abs(e.pushed_limit(rate_x.truncation))[:, own:]
    limit += np.abs(e.pushed_limit(e.noise("L_x") + rate_x.noise))[:, own:]
    judged = truncation <= np.maximum(1e-3 * np.abs(acting).max(axis=0), limit)
    limit = limit + np.where(np.isfinite(truncation), truncation, 0.0)
    return [judge(CARRIED, e.names.q[own:], r.t, residual, limit, judged)]
