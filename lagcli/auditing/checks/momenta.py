"""Momenta J = dL/dq' . xi of symmetries xi of L: what is conserved, and what changes the rest."""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.auditing.checks.audit_report import Check, CheckedLaw, judge
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import TINY
from lagcli.auditing.evidence.row_spacing import RowSpacing
from lagcli.auditing.evidence.tolerances import RESOLVED, SAFETY, Evidence

MOMENTA = CheckedLaw("momenta", "D.39, D.53", "dJ/dt = (lambda^T B + Q_nc) . xi, J = dL/dq' . xi")
# Rows at which a symmetry is tried, evenly over the table.
SAMPLES = 48


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Symmetry:
    """A displacement xi (T, n) that L does not feel, with its rate along the motion."""

    name: str
    xi: Array
    rate: Array


def symmetries(e: Evidence) -> list[Symmetry]:
    """Displacements that leave L as it is at rows of the record and beside them: along cyclic coordinates, and
    translations and rotations of all Cartesian particles."""
    r, index = e.record, e.laws.index
    own = index.first_generalized
    rows = np.unique(np.linspace(0, len(r.t) - 1, min(SAMPLES, len(r.t))).astype(np.int64))
    shift = 1e-3 * np.abs(r.q[rows]).max(axis=0, initial=0.0)
    beside = r.q[rows] + shift * np.random.default_rng(6).standard_normal((len(rows), r.q.shape[1]))
    still, unfelt = np.zeros(r.q.shape), []

    def try_(name: str, xi: Array, rate: Array, xi_beside: Array) -> None:
        felt, size = 0.0, 0.0
        for q, along in ((r.q[rows], xi[rows]), (beside, xi_beside)):
            L = e.laws.total_lagrangian(
                r.t[rows] + 0j, q + 1j * TINY * along, r.v[rows] + 1j * TINY * rate[rows]
            )
            extent = max(float(np.abs(q).max(initial=0.0)), 1e-300)
            felt = max(felt, float(np.abs(L.imag / TINY).max(initial=0.0)))
            size = max(size, float(np.abs(L.real).max() * np.abs(along).max() / extent))
        if felt <= doubles.ZERO * size or felt == 0.0:
            unfelt.append(Symmetry(name, xi, rate))

    for j in range(own, index.n):
        xi = still.copy()
        xi[:, j] = 1.0
        try_(f"cyclic {e.names.q[j]}", xi, still, xi[rows])
    for axis, name in enumerate("xyz" if own else ""):
        xi = still.copy()
        xi[:, axis:own:3] = 1.0
        try_(f"translation along {name}", xi, still, xi[rows])
    for axis, name in enumerate("xyz" if own else ""):
        turned = [_turned(y, own, axis) for y in (r.q, r.v, beside)]
        try_(f"rotation about {name}", *turned)
    return unfelt


def _turned(y: Array, own: int, axis: int) -> Array:
    """e_axis x y_k of the Cartesian particles, (T, n)."""
    turned = np.zeros(y.shape)
    second, third = (axis + 1) % 3, (axis + 2) % 3
    turned[:, second:own:3], turned[:, third:own:3] = -y[:, third:own:3], y[:, second:own:3]
    return turned


def check(e: Evidence) -> list[Check]:
    """J against the impulse of constraints and other forces, of every symmetry that is found; what it does is reported
    of the whole of a run."""
    r, values, index = e.record, e.values, e.laws.index
    own, rows = index.first_generalized, len(r.t)
    p = e.masses * r.v + values.L_v + e.pushed(e.masses_x * r.u + values.L_u)
    p_off = SAFETY * e.masses * e.off_v + e.noise("L_v")
    p_off = p_off + e.pushed_limit(e.masses_x * e.recorded(np.abs(r.u).max(initial=0.0)) + 0 * r.u)
    force = values.Q.copy()
    force[:, :own] += values.F[:, index.cartesian].reshape(rows, -1)
    force = force + e.pushed(values.F[:, index.dependent].reshape(rows, -1))
    unknown = e.grid.integral(r.R_q + force, np.full(r.q.shape[1], np.inf)).truncation
    names, residuals, limits, judged, words = [], [], [], [], []
    for symmetry in symmetries(e):
        xi, size_xi = symmetry.xi, np.abs(symmetry.xi)
        J = (p * xi).sum(axis=1)
        by_rows, by_forces = (r.R_q * xi).sum(axis=1), (force * xi).sum(axis=1)
        spread = ((np.abs(r.R_q) + np.abs(force)) * size_xi).sum(axis=1)
        small = SAFETY * e.tolerance.rtol * float(spread.max(initial=0.0)) + e.tolerance.atol
        rounded = float((e.force_rounding.q * size_xi).sum(axis=1).max(initial=0.0))
        total = e.grid.integral(np.stack([by_rows + by_forces, spread], axis=1), np.array([small, np.inf]))
        # A force that rows do not show may stand where xi is small.
        open_ = total.truncation[:, 0] + (unknown * size_xi.max(axis=0)).sum(axis=1)
        off = (p_off * size_xi).sum(axis=1) + (np.abs(p) * SAFETY * e.off_q).sum(axis=1)
        limit = off.max(initial=0.0) * (1 + np.arange(rows) / SAFETY)
        limit += e.recorded(total.value[:, 1]) + e.tolerance.atol + total.noise[:, 0]
        limit += rounded * np.abs(r.t - r.t[0])
        limit += np.where(np.isfinite(open_), open_, 0.0)
        size = max(float(np.abs(J).max()), float(total.value[-1, 1]))
        names.append(symmetry.name)
        residuals.append(J - J[0] - total.value[:, 0])
        limits.append(limit)
        judged.append((open_ <= np.maximum(RESOLVED * size, off)) & e.once(RowSpacing).is_slow)
        tiny = 1e-9 * float(spread.max(initial=0.0))
        acting = (("constraints", by_rows), ("forces", by_forces))
        causes = [word for word, part in acting if np.abs(part).max(initial=0.0) > tiny]
        if causes:
            change = f"J goes from {J[0]:.6g} to {J[-1]:.6g} by the {' and '.join(causes)}"
        else:
            change = f"J = {J[0]:.6g} is conserved"
        words.append(f"{symmetry.name}: {change}")
    if not names:
        return [MOMENTA.empty("" if e.is_part else "no symmetry was found")]
    apart, limit = np.stack(residuals, 1), np.stack(limits, 1)
    decided = np.stack(judged, 1) & (rows > 2) & e.is_seen
    if e.once(RowSpacing).is_fast.any():
        decided &= ~(np.abs(apart) > limit)
    check = judge(MOMENTA, names, r.t, apart, limit, decided)
    notes = [] if e.is_part else words
    return [dataclasses.replace(check, note="; ".join([*([check.note] if check.note else []), *notes]))]
