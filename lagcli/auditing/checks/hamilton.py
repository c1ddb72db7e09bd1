"""Hamilton's principle (D.49) on the recorded path, without an acceleration: the action and its variations."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from lagcli.auditing.checks.audit_report import FAR_APART, Check, CheckedLaw, judge
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import DifferenceGrid
from lagcli.auditing.evidence.row_spacing import RowSpacing
from lagcli.auditing.evidence.table_input import Record
from lagcli.auditing.evidence.tolerances import RESOLVED, SAFETY, Evidence
from lagcli.auditing.evidence.virtual_space import VirtualSpace

HAMILTON = CheckedLaw("hamilton", "D.49", "integral of dL + Q_nc . dq = 0 over varied paths with fixed ends")
ACTION = CheckedLaw("action", "D.49", "S(eps) - S(0) = O(eps^2) on varied paths with f = 0")
LEAST, MOST = 25, 401  # rows of a window
VECTORS = 6  # directions varied in a window
BUMP = 4  # c(t) = (4 s (1 - s))**BUMP vanishes at both ends, with its first derivatives
EPSILON = 1e-3  # of the size of the path, for S(eps)


class Window:
    """A stretch of the record with a basis of virtual displacements that goes along with it."""

    def __init__(self, e: Evidence, rows: Array) -> None:
        self.e, self.rows = e, rows
        self.record: Record = e.record.part(rows)
        self.grid = DifferenceGrid(self.record.t, e.clock)
        if len(e.looked_at) == len(e.record.t):
            self.space = e.displacements.part(slice(int(rows[0]), int(rows[-1]) + 1))
        else:
            self.space = VirtualSpace(e.laws.matrix(self.record.t, self.record.q, self.record.v))
        t = self.record.t
        s = (t - t[0]) / (t[-1] - t[0])
        self.bump = (4 * s * (1 - s)) ** BUMP
        # A few directions: all, or as many mixtures of them
        self.basis = self.space.basis(len(rows) // 2)
        if len(self.basis) > VECTORS:
            mixed = np.random.default_rng(6).standard_normal((VECTORS, len(self.basis))) @ self.basis
            self.basis = mixed / np.linalg.norm(mixed, axis=1)[:, None]

    def path(self, w: Array) -> Array:
        """dq (T, n): the part of w (n,) that the rows leave free, times c(t)."""
        return np.asarray(self.bump[:, None] * self.space.virtual(np.broadcast_to(w, self.record.q.shape)))

    def name(self, w: Array) -> str:
        """The coordinate that moves most."""
        r = self.record
        return f"{self.e.names.q[int(np.argmax(np.abs(w)))]} over t = {r.t[0]:.4g} to {r.t[-1]:.4g}"


def windows(e: Evidence) -> list[Window]:
    """The whole record and its thirds, or, where B is large, a stretch in the middle."""
    T = len(e.record.t)
    if T < LEAST:
        return []
    most = max(LEAST, min(MOST, len(e.looked_at) * (1 if len(e.looked_at) < T else MOST)))
    if most >= T:
        cuts = [(0, T)]
        if T >= 3 * LEAST:
            cuts += [(k * T // 3, (k + 1) * T // 3) for k in range(3)]
    else:
        starts = np.linspace(0, T - most, 3)
        cuts = [
            (int(first), int(first) + most) for first in (starts if len(e.looked_at) == T else starts[1:2])
        ]
    every_window = [Window(e, np.arange(first, last)) for first, last in cuts]
    # Where the rank is the same all along, displacements go along smoothly
    regular = [window for window in every_window if not window.space.is_singular.any() and len(window.basis)]
    return [window for window in regular if not e.hidden[window.rows[:-1]].any()]


def check(e: Evidence) -> list[Check]:
    """The integral of dL + Q_nc . dq over each window and direction."""
    varied = [(window, w, _variation(window, w)) for window in e.once(windows) for w in window.basis]
    if varied:
        return [_judged(HAMILTON, varied)]
    if len(e.record.t) >= LEAST and not e.hidden.any():
        return [HAMILTON.empty("nothing is free to vary")]
    return [HAMILTON.unjudged(f"{FAR_APART}: {LEAST} are needed, and no push between two of them")]


def _judged(law: CheckedLaw, varied: Sequence[tuple[Window, Array, tuple[float, float, bool]]]) -> Check:
    """The check of variations, each with its integral, limit, and whether it can be judged."""
    residuals, limits, judged = (np.array([[answer[k] for _, _, answer in varied]]) for k in range(3))
    names = [window.name(w) for window, w, _ in varied]
    # One row and a column for each variation; the time is where the first window begins.
    check = judge(law, names, varied[0][0].record.t[:1], residuals, limits, judged)
    curve: list[tuple[float, float]] = []
    for window, _, (residual, limit, known) in varied:
        if known:
            t, ratio = window.record.t, abs(residual) / limit if residual else 0.0
            curve += [(float(t[0]), ratio), (float(t[-1]), ratio), (float(t[-1]), np.nan)]
    return dataclasses.replace(check, curve=tuple(curve))


def _variation(window: Window, w: Array) -> tuple[float, float, bool]:
    """The integral, its limit, and whether it can be judged."""
    e, r, rows = window.e, window.record, window.rows
    V, index = e.values, e.laws.index
    dq = window.path(w)
    dx = e.laws.displaced(r.t, r.q, r.v, dq)
    zero = np.zeros(1)
    dv, du = window.grid.derivative(dq, zero), window.grid.derivative(dx, zero)
    force_q = e.laws.forces_on_coordinates(V)[rows]
    force_x = V.L_x[rows] + e.particle_forces[rows][:, index.dependent].reshape(len(r.t), -1)
    p_q = e.masses * r.v + V.L_v[rows]
    p_x = e.masses_x * r.u + V.L_u[rows]
    terms = [(force_q, dq), (force_x, dx), (p_q, dv.value), (p_x, du.value)]
    integrand = sum(((a * b).sum(axis=1) for a, b in terms), np.zeros(len(r.t)))
    size = sum((np.abs(a * b).sum(axis=1) for a, b in terms), np.zeros(len(r.t)))
    open_ = (np.abs(p_q) * dv.truncation).sum(axis=1) + (np.abs(p_x) * du.truncation).sum(axis=1)
    blur = (np.abs(p_q) * dv.noise).sum(axis=1) + (np.abs(p_x) * du.noise).sum(axis=1)
    sums = np.stack([integrand, size, open_, blur], axis=1)
    small = SAFETY * e.tolerance.rtol * float(size.max(initial=0.0)) + e.tolerance.atol
    total = window.grid.integral(sums, np.array([small, np.inf, np.inf, np.inf]))
    scale = float(total.value[-1, 1])
    truncation = float(total.truncation[-1, 0]) + abs(float(total.value[-1, 2]))
    rounded = (e.force_rounding.q * np.abs(dq)).sum(axis=1) + (e.force_rounding.x * np.abs(dx)).sum(axis=1)
    noise = SAFETY * (e.tolerance.rtol + 1e-15) * scale * float(window.space.condition.max())
    noise += float(rounded.max(initial=0.0)) * float(np.ptp(r.t))
    noise += e.tolerance.atol + float(total.noise[-1, 0]) + abs(float(total.value[-1, 3]))
    integral = float(total.value[-1, 0])
    judged = truncation <= max(RESOLVED * scale, noise) and e.once(RowSpacing).is_slow
    judged = judged and not (e.once(RowSpacing).is_fast[rows].any() and abs(integral) > noise + truncation)
    return integral, noise + truncation, judged


def action(e: Evidence) -> list[Check]:
    """The slope of S(eps) at 0, where all rows are holonomic and all forces have potentials."""
    laws = e.laws
    if laws.s < laws.C or np.any(e.values.F) or np.any(e.values.Q) or laws.index.n > 60:
        return []
    varied = [(window, w, _slope(window, w)) for window in e.once(windows)[:1] for w in window.basis[:3]]
    known = [(window, w, answer) for window, w, answer in varied if answer is not None]
    return [_judged(ACTION, known)] if known else []


def _slope(window: Window, w: Array) -> tuple[float, float, bool] | None:
    """dS/deps by central differences at two steps, its limit, and whether it can be judged."""
    e, r = window.e, window.record
    extent = max(float(np.ptp(r.q, axis=0).max()), 1e-300)
    carried = e.laws.pushed(r.t, r.q, r.v, e.masses_x * r.u) if r.x.size else np.zeros(r.q.shape)
    slopes, wrong, scale = [], 0.0, 0.0
    for step in (EPSILON * extent, EPSILON * extent / 2):
        sides = []
        for sign in (1.0, -1.0):
            q = _onto(window, r.q + sign * step * window.path(w))
            if q is None:
                return None
            v = window.grid.derivative(q, np.zeros(1))
            L = e.laws.total_lagrangian(r.t, q, v.value)
            p = np.abs(e.masses * v.value + e.values.L_v[window.rows] + carried)
            open_ = (p * v.truncation).sum(axis=1)
            sums, small = np.stack([L, open_, np.abs(L)], axis=1), 1e-9 * np.abs(L).max()
            total = window.grid.integral(sums, np.array([small, np.inf, np.inf]))
            sides.append(float(total.value[-1, 0]))
            wrong += (float(total.truncation[-1, 0]) + abs(float(total.value[-1, 1]))) / (2 * step)
            scale = max(scale, float(total.value[-1, 2]))
        slopes.append((sides[0] - sides[1]) / (2 * step))
    usual = scale / extent
    noise = 1e3 * e.tolerance.rtol * usual / EPSILON + 1e-12 * usual / EPSILON
    limit = noise + wrong + 0.1 * abs(slopes[0] - slopes[1])
    return (4 * slopes[1] - slopes[0]) / 3, limit, limit <= 0.03 * usual


def _onto(window: Window, q: Array) -> Array | None:
    """q (T, n) moved onto f = 0 across the surface; None where that fails."""
    laws, t, v = window.e.laws, window.record.t, window.record.v
    if not laws.C:
        return q
    size = max(1.0, float(np.abs(q).max()))
    f = laws.residuals(t, q, v)[0]
    for _ in range(12):
        # B of the path itself will do: q is near it.
        q = q - window.space.step(f)
        f = laws.residuals(t, q, v)[0]
        if np.abs(f).max() < 1e-15 * size:
            break
    return q if np.abs(f).max() < 1e-12 * size else None
