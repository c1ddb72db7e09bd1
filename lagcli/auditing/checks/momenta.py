"""Momenta J = dL/dq' . xi of symmetries xi of L: what is conserved, and what changes the rest."""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.auditing.checks.audit_report import Check, CheckedLaw, judge
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import TINY
from lagcli.auditing.evidence.row_spacing import RowSpacing
from lagcli.auditing.evidence.tolerances import RESOLVED, SAFETY, Evidence

MOMENTA = CheckedLaw("momenta", "D.39, D.53", "dJ/dt = (lambda^T B + Q_nc) . xi, J = dL/dq' . xi")
# Rows at which a symmetry is tried, evenly over the table.
SAMPLES = 48
SYMMETRIC = 1e-9  # of the size of the terms that would have to cancel


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Symmetry:
    """A displacement xi (T, n) that L does not feel, with its rate along the motion."""

    name: str
    xi: Array
    rate: Array


def candidates(e: Evidence) -> list[Symmetry]:
    """Cyclic coordinates; translations and rotations of all Cartesian particles."""
    r, index = e.record, e.laws.index
    own = index.first_generalized
    found = []
    nothing = np.zeros(r.q.shape)
    for j in range(own, index.n):
        xi = nothing.copy()
        xi[:, j] = 1.0
        found.append(Symmetry(f"cyclic {e.names.q[j]}", xi, nothing))
    if not own:
        return found
    for axis, name in enumerate("xyz"):
        xi = nothing.copy()
        xi[:, axis:own:3] = 1.0
        found.append(Symmetry(f"translation along {name}", xi, nothing))
    for axis, name in enumerate("xyz"):
        found.append(Symmetry(f"rotation about {name}", _turned(r.q, own, axis), _turned(r.v, own, axis)))
    return found


def _turned(y: Array, own: int, axis: int) -> Array:
    """e_axis x y_k of the Cartesian particles, (T, n)."""
    found = np.zeros(y.shape)
    one, other = (axis + 1) % 3, (axis + 2) % 3
    found[:, one:own:3] = -y[:, other:own:3]
    found[:, other:own:3] = y[:, one:own:3]
    return found


def symmetries(e: Evidence) -> list[Symmetry]:
    """The candidates that leave L as it is at rows of the record and beside them."""
    r = e.record
    rows = np.unique(np.linspace(0, len(r.t) - 1, min(SAMPLES, len(r.t))).astype(np.int64))
    random = np.random.default_rng(6)
    shift = (
        1e-3 * np.abs(r.q[rows]).max(axis=0, initial=0.0) * random.standard_normal((len(rows), r.q.shape[1]))
    )
    own = e.laws.index.first_generalized
    found = []
    for one in candidates(e):
        axis = "xyz".find(one.name[-1]) if one.name.startswith("rotation") else -1
        felt, size = 0.0, 0.0
        for q in (r.q[rows], r.q[rows] + shift):
            xi = _turned(q, own, axis) if axis >= 0 else one.xi[rows]
            change, terms = _change_along(e, r.t[rows], q, r.v[rows], xi, one.rate[rows])
            felt, size = max(felt, change), max(size, terms)
        if felt <= SYMMETRIC * size or felt == 0.0:
            found.append(one)
    return found


def _change_along(e: Evidence, t: Array, q: Array, v: Array, xi: Array, rate: Array) -> tuple[float, float]:
    """The largest change of L along (xi, d xi/dt), and the size of what it is made of."""
    L = e.laws.total_lagrangian(t + 0j, q + 1j * TINY * xi, v + 1j * TINY * rate)
    size = np.abs(L.real).max() * np.abs(xi).max() / max(float(np.abs(q).max(initial=0.0)), 1e-300)
    return float(np.abs(L.imag / TINY).max(initial=0.0)), float(size)


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
    for one in symmetries(e):
        J = (p * one.xi).sum(axis=1)
        by_rows, by_forces = (r.R_q * one.xi).sum(axis=1), (force * one.xi).sum(axis=1)
        spread = (np.abs(r.R_q) + np.abs(force)) * np.abs(one.xi)
        impulse = np.stack([by_rows + by_forces, spread.sum(axis=1)], axis=1)
        small = SAFETY * e.tolerance.rtol * float(impulse[:, 1].max(initial=0.0)) + e.tolerance.atol
        rounded = float((e.force_rounding.q * np.abs(one.xi)).sum(axis=1).max(initial=0.0))
        total = e.grid.integral(impulse, np.array([small, np.inf]))
        # A force that rows do not show may stand where xi is small.
        open_ = total.truncation[:, 0] + (unknown * np.abs(one.xi).max(axis=0)).sum(axis=1)
        off = (p_off * np.abs(one.xi)).sum(axis=1) + (np.abs(p) * SAFETY * e.off_q).sum(axis=1)
        limit = off.max(initial=0.0) * (1 + np.arange(rows) / SAFETY)
        limit += e.recorded(total.value[:, 1]) + e.tolerance.atol + total.noise[:, 0]
        limit += rounded * np.abs(r.t - r.t[0])
        limit += np.where(np.isfinite(open_), open_, 0.0)
        size = max(float(np.abs(J).max()), float(total.value[-1, 1]))
        names.append(one.name)
        residuals.append(J - J[0] - total.value[:, 0])
        limits.append(limit)
        judged.append((open_ <= np.maximum(RESOLVED * size, off)) & e.once(RowSpacing).is_slow)
        words.append(_word(one.name, J, by_rows, by_forces, float(spread.sum(axis=1).max(initial=0.0))))
    if not names:
        return [MOMENTA.empty("" if e.is_part else "no symmetry was found")]
    apart, limit = np.stack(residuals, 1), np.stack(limits, 1)
    decided = np.stack(judged, 1) & (rows > 2) & e.is_seen
    if e.once(RowSpacing).is_fast.any():
        decided &= ~(np.abs(apart) > limit)
    check = judge(MOMENTA, names, r.t, apart, limit, decided)
    notes = [] if e.is_part else words
    return [dataclasses.replace(check, note="; ".join([*([check.note] if check.note else []), *notes]))]


def _word(name: str, J: Array, by_rows: Array, by_forces: Array, size: float) -> str:
    tiny = 1e-9 * size
    causes = [
        word
        for word, part in (("constraints", by_rows), ("forces", by_forces))
        if np.abs(part).max(initial=0.0) > tiny
    ]
    if not causes:
        return f"{name}: J = {J[0]:.6g} is conserved"
    return f"{name}: J goes from {J[0]:.6g} to {J[-1]:.6g} by the {' and '.join(causes)}"
