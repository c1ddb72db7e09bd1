"""Hamilton's principle (D.49) on the recorded path, without an acceleration, and the momenta of symmetries of L."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.auditing.checks.audit_report import FAR_APART, Check, Law, judge
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import DifferenceGrid, with_truncation
from lagcli.auditing.evidence.laws import TINY
from lagcli.auditing.evidence.row_spacing import RowSpacing
from lagcli.auditing.evidence.tolerances import RESOLVED, SAFETY, Evidence
from lagcli.auditing.evidence.virtual_space import VirtualSpace

HAMILTON = Law("hamilton", "D.49", "integral of dL + Q_nc . dq = 0 over varied paths with fixed ends")
ACTION = Law("action", "D.49", "S(eps) - S(0) = O(eps^2) on varied paths with f = 0")
LEAST, MOST = 25, 401  # rows of a window
VECTORS = 6  # directions varied in a window
BUMP = 4  # c(t) = (4 s (1 - s))**BUMP vanishes at both ends, with its first derivatives
MOMENTA = Law("momenta", "D.39, D.53", "dJ/dt = (lambda^T B + Q_nc) . xi, J = dL/dq' . xi")
SAMPLES = 48  # rows at which a symmetry is tried, evenly over the table


class Window:
    """A stretch of the record with a basis of virtual displacements that goes along with it."""

    def __init__(self, e: Evidence, rows: Array) -> None:
        self.e, self.rows = e, rows
        self.record = e.record.part(rows)
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
        everywhere = np.broadcast_to(w, (len(self.rows), len(w)))
        return np.asarray(self.bump[:, None] * self.space.virtual(everywhere))

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
        starts = np.linspace(0, T - most, 3).astype(np.int64).tolist()
        cuts = [(first, first + most) for first in (starts if len(e.looked_at) == T else starts[1:2])]
    every_window = [Window(e, np.arange(first, last)) for first, last in cuts]
    # Where the rank is the same all along, displacements go along smoothly
    regular = [window for window in every_window if not window.space.is_singular.any() and len(window.basis)]
    return [window for window in regular if not e.hidden[window.rows[:-1]].any()]


def hamilton(e: Evidence) -> list[Check]:
    """The integral of dL + Q_nc . dq over each window and direction."""
    varied = [(window, w, _variation(window, w)) for window in e.once(windows) for w in window.basis]
    if varied:
        return [_judged(HAMILTON, varied)]
    if len(e.record.t) >= LEAST and not e.hidden.any():
        return [HAMILTON.empty("nothing is free to vary")]
    return [HAMILTON.unjudged(f"{FAR_APART}: {LEAST} are needed, and no push between two of them")]


def _judged(law: Law, varied: Sequence[tuple[Window, Array, tuple[float, float, bool]]]) -> Check:
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
    dq = window.path(w)
    dq = np.concatenate([dq, e.laws.displaced(r.t, r.q, r.v, dq)], axis=1)
    dv = window.grid.derivative(dq, np.zeros(1))
    force = (e.values.F - e.values.V_q + e.values.L_q)[rows]
    p = e.masses * r.v + e.values.L_v[rows]
    terms = np.concatenate([force * dq, p * dv.value], axis=1)
    open_, blur = ((np.abs(p) * part).sum(axis=1) for part in (dv.truncation, dv.noise))
    sums = np.stack([terms.sum(axis=1), np.abs(terms).sum(axis=1), open_, blur], axis=1)
    size = sums[:, 1]
    small = SAFETY * e.tolerance.rtol * float(size.max(initial=0.0)) + e.tolerance.atol
    total = window.grid.integral(sums, np.array([small, np.inf, np.inf, np.inf]))
    scale = float(total.value[-1, 1])
    truncation = float(total.truncation[-1, 0]) + abs(float(total.value[-1, 2]))
    rounded = (e.force_rounding[0] * np.abs(dq)).sum(axis=1)
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
    if laws.s < laws.C or np.any(e.values.F) or laws.index.n > 60:
        return []
    varied = [(window, w, _slope(window, w)) for window in e.once(windows)[:1] for w in window.basis[:3]]
    known = [(window, w, answer) for window, w, answer in varied if answer is not None]
    return [_judged(ACTION, known)] if known else []


def _slope(window: Window, w: Array) -> tuple[float, float, bool] | None:
    """dS/deps by central differences at two steps, its limit, and whether it can be judged; None where f = 0 is not
    reached."""
    e, r, n = window.e, window.record, window.e.n
    extent = max(float(np.ptp(r.q[:, :n], axis=0).max()), 1e-300)
    carried = e.laws.pushed(r.t, r.q, r.v, (e.masses * r.v)[:, n:])
    slopes, wrong, scale = [], 0.0, 0.0
    for step in (RESOLVED * extent, RESOLVED * extent / 2):
        sides = []
        for sign in (1.0, -1.0):
            q = r.q[:, :n] + sign * step * window.path(w)
            if e.laws.C:  # moved onto f = 0 across the surface
                size = max(1.0, float(np.abs(q).max()))
                f = e.laws.residuals(r.t, q, r.v)[0]
                for _ in range(12):
                    # B of the path itself will do: q is near it.
                    q = q - window.space.step(f)
                    f = e.laws.residuals(r.t, q, r.v)[0]
                    if np.abs(f).max() < 1e-15 * size:
                        break
                if not np.abs(f).max() < 1e-12 * size:
                    return None
            v = window.grid.derivative(q, np.zeros(1))
            L = e.laws.total_lagrangian(r.t, q, v.value)
            p = np.abs(e.masses[:n] * v.value + e.values.L_v[window.rows, :n] + carried)
            open_ = (p * v.truncation).sum(axis=1)
            sums, small = np.stack([L, open_, np.abs(L)], axis=1), 1e-9 * np.abs(L).max()
            total = window.grid.integral(sums, np.array([small, np.inf, np.inf]))
            sides.append(float(total.value[-1, 0]))
            wrong += (float(total.truncation[-1, 0]) + abs(float(total.value[-1, 1]))) / (2 * step)
            scale = max(scale, float(total.value[-1, 2]))
        slopes.append((sides[0] - sides[1]) / (2 * step))
    usual = scale / extent
    noise = 1e3 * e.tolerance.rtol * usual / RESOLVED + 1e-12 * usual / RESOLVED
    limit = noise + wrong + 0.1 * abs(slopes[0] - slopes[1])
    return (4 * slopes[1] - slopes[0]) / 3, limit, limit <= 0.03 * usual


class Symmetry(NamedTuple):
    """A displacement xi (T, n) that L does not feel, with its rate along the motion."""

    name: str
    xi: Array
    rate: Array


def symmetries(e: Evidence) -> list[Symmetry]:
    """Symmetries of L at rows of the record and beside them: cyclic coordinates, and translations and rotations of all
    Cartesian particles."""
    r, own, n, unfelt = e.record, e.own, e.n, list[Symmetry]()
    rows = np.unique(np.linspace(0, len(r.t) - 1, min(SAMPLES, len(r.t))).astype(np.int64))
    whole, still = r.q[:, :n], np.zeros((len(r.t), n))
    shift = 1e-3 * np.abs(whole[rows]).max(axis=0, initial=0.0)
    beside = whole[rows] + shift * np.random.default_rng(6).standard_normal((len(rows), n))

    def try_(name: str, xi: Array, rate: Array, xi_beside: Array) -> None:
        felt, size = 0.0, 0.0
        for q, along in ((whole[rows], xi[rows]), (beside, xi_beside)):
            v = r.v[rows, :n] + 1j * TINY * rate[rows]
            L = e.laws.total_lagrangian(r.t[rows] + 0j, q + 1j * TINY * along, v)
            extent = max(float(np.abs(q).max(initial=0.0)), 1e-300)
            felt = max(felt, float(np.abs(L.imag / TINY).max(initial=0.0)))
            size = max(size, float(np.abs(L.real).max() * np.abs(along).max() / extent))
        if felt <= doubles.ZERO * size or felt == 0.0:
            unfelt.append(Symmetry(name, xi, rate))

    for j in range(own, n):
        xi = still.copy()
        xi[:, j] = 1.0
        try_(f"cyclic {e.names.q[j]}", xi, still, xi[rows])
    for axis, name in enumerate("xyz" if own else ""):
        xi = still.copy()
        xi[:, axis:own:3] = 1.0
        try_(f"translation along {name}", xi, still, xi[rows])
    for axis, name in enumerate("xyz" if own else ""):
        second, third, turned = (axis + 1) % 3, (axis + 2) % 3, []
        for y in (whole, r.v[:, :n], beside):  # e_axis x y_k
            across = np.zeros(y.shape)
            across[:, second:own:3], across[:, third:own:3] = -y[:, third:own:3], y[:, second:own:3]
            turned.append(across)
        try_(f"rotation about {name}", *turned)
    return unfelt


def momenta(e: Evidence) -> list[Check]:
    """J against the impulse of constraints and other forces, of every symmetry; said of the whole of a run."""
    r, values, rows, n = e.record, e.values, len(e.record.t), e.n
    R, u = r.R[:, :n], r.v[:, n:]
    p = e.laws.on_coordinates(r.t, r.q, r.v, e.masses * r.v + values.L_v)
    p_off = (SAFETY * e.masses * e.off_v + e.noise("L_v"))[:, :n]
    p_off = p_off + e.pushed_limit(e.masses[n:] * e.recorded(np.abs(u).max(initial=0.0)) + 0 * u)
    force = e.laws.on_coordinates(r.t, r.q, r.v, values.F)
    unknown = e.grid.integral(R + force, np.full(n, np.inf)).truncation
    names, residuals, limits, judged, words = [], [], [], [], []
    for symmetry in symmetries(e):
        xi, size_xi = symmetry.xi, np.abs(symmetry.xi)
        J = (p * xi).sum(axis=1)
        by_rows, by_forces = (R * xi).sum(axis=1), (force * xi).sum(axis=1)
        spread = ((np.abs(R) + np.abs(force)) * size_xi).sum(axis=1)
        small = SAFETY * e.tolerance.rtol * float(spread.max(initial=0.0)) + e.tolerance.atol
        rounded = float((e.force_rounding[0][:n] * size_xi).sum(axis=1).max(initial=0.0))
        total = e.grid.integral(np.stack([by_rows + by_forces, spread], axis=1), np.array([small, np.inf]))
        # A force that rows do not show may stand where xi is small.
        open_ = total.truncation[:, 0] + (unknown * size_xi.max(axis=0)).sum(axis=1)
        off = (p_off * size_xi).sum(axis=1) + (np.abs(p) * SAFETY * e.off_q[:n]).sum(axis=1)
        limit = off.max(initial=0.0) * (1 + np.arange(rows) / SAFETY)
        limit += e.recorded(total.value[:, 1]) + e.tolerance.atol + total.noise[:, 0]
        limit = with_truncation(limit + rounded * np.abs(r.t - r.t[0]), open_)
        size = max(float(np.abs(J).max()), float(total.value[-1, 1]))
        names.append(symmetry.name)
        residuals.append(J - J[0] - total.value[:, 0])
        limits.append(limit)
        judged.append((open_ <= np.maximum(RESOLVED * size, off)) & e.once(RowSpacing).is_slow)
        tiny = 1e-9 * float(spread.max(initial=0.0))
        acting = (("constraints", by_rows), ("forces", by_forces))
        causes = [word for word, part in acting if np.abs(part).max(initial=0.0) > tiny]
        change = f"J = {J[0]:.6g} is conserved"
        if causes:
            change = f"J goes from {J[0]:.6g} to {J[-1]:.6g} by the {' and '.join(causes)}"
        words.append(f"{symmetry.name}: {change}")
    if not names:
        return [MOMENTA.empty("" if e.is_part else "no symmetry was found")]
    apart, limit = np.stack(residuals, 1), np.stack(limits, 1)
    decided = np.stack(judged, 1) & (rows > 2) & e.is_seen
    if e.once(RowSpacing).is_fast.any():
        decided &= ~(np.abs(apart) > limit)
    check = judge(MOMENTA, names, r.t, apart, limit, decided)
    notes = (check.note, *(() if e.is_part else words))
    return [dataclasses.replace(check, note="; ".join(filter(None, notes)))]
