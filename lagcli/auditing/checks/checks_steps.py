"""Each step of a table by itself: what changes from one row to the next against the rates at the rows.

A wrong row spoils the differences of its neighbours, and bounds made of them. So bounds are made of the rates alone:
of forces and reactions where velocities are judged. A fault e in a velocity then makes the bound of a step h of a
motion of frequency w larger by h w e, which is less than e wherever rows show the motion.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.auditing.checks.audit_report import Check, Law, judge
from lagcli.auditing.evidence import differences
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import CAUTION, TENTH, TWICE, WIDE, of_particles
from lagcli.auditing.evidence.row_spacing import OFTEN, REACHED, RowSpacing
from lagcli.auditing.evidence.tolerances import SAFETY, Evidence

STEPS = Law("steps", "D.23, D.24", "r and m v of a row and the next: integrals of v and F + R over the step")
ORDERS = {order: CAUTION / 2**order for order in (2, 4, 6)}
"""Rows of the interpolant of the rates with the part of their differences of that order that bounds its error.

A rate that jumps by J within a step is off by J/2 on average, and its differences of order 2, 4, 6 around are J, 3 J,
10 J: the bound is twice what one jump needs, and more than a kink or a smooth rate do.
"""
NODES = 4  # of a quadrature that is exact for the polynomials of six rows and their moments
LEAST = 3  # differences of an order, of which one may vanish by chance
# Between two rows of a table a pulse changes velocities, and no row shows it.
AT_ONCE = 16  # steps that are looked at, and more as long as there is something between their rows
POINTS = 31  # within each: a pulse that is shorter than a thirtieth of a step may not be found
PARTS = np.arange(POINTS + 2) / (POINTS + 1)  # of a step, both ends among them


class Quantity(NamedTuple):
    """Columns y (T, k) with their rates, by how much both may be off, (T, k), and which cannot be shown, (k,).

    size: the largest rate; root: of the mass, or 1. second: the rates of the rates, which make the bounds then.
    """

    names: tuple[str, ...]
    y: Array
    rate: Array
    off: Array
    off_rate: Array
    coarse: Array
    size: Array
    root: Array
    second: Array | None = None
    off_second: Array | None = None


class TableSteps:
    """The T - 1 steps of the times t (T,), known to `clock`, and the polynomials through rows around each."""

    def __init__(self, t: Array, clock: float = 0.0) -> None:
        self.t, self.h, self.clock = t, np.diff(t), clock
        self.orders = [m for m in ORDERS if len(t) >= m + LEAST]

    @functools.cached_property
    def weights(self) -> dict[int, tuple[Array, Array, Array]]:
        """By order: indices (T - 1, m), weights of the integral of s -> y and of s -> (h/2 - s) y over each step."""
        return {m: differences.step_weights(self.t, m, NODES) for m in self.orders}

    def spread(self, m: int, y: Array) -> Array:
        """The largest differences of order m of columns y (T, k) around each step, (T - 1, k)."""
        size = np.abs(differences.scaled_differences(self.t, y, m))
        # Differences of the rows j to j + m count for the steps j - 1 to j + m.
        padded = np.zeros((len(self.h) + m + 1, y.shape[1]))
        padded[m : m + len(size)] = size
        windows = np.lib.stride_tricks.sliding_window_view(padded, m + 2, axis=0)
        return np.asarray(windows.max(axis=2)[: len(self.h)])


def quantities(e: Evidence) -> list[Quantity]:
    """Positions with their velocities, momenta with forces and reactions: of particles, then of coordinates. Where the
    momentum of particles is m v, accelerations make the bounds of positions. Momenta of generalized coordinates are
    there where no particles depend on them."""
    r, n, own, width, m = e.record, e.n, e.own, e.record.q.shape[1], e.masses
    coarse = e.once(RowSpacing).is_coarse
    off_q, off_v = (np.repeat(SAFETY * off[None], len(r.t), axis=0) for off in (e.off_q, e.off_v))
    off_q[:, n:], off_v[:, n:] = e.noise("x"), e.noise("u")
    F, off_F = e.total_force, e.total_noise + e.recorded(r.R) + e.tolerance.atol
    off_F[:, :n] += e.reaction_limit
    off_F[:, n:] += SAFETY * e.tolerance.rtol * np.abs(r.R[:, n:]).max(axis=0, initial=0.0)
    p, off_p = m * r.v, m * off_v
    p[:, :n] += e.values.L_v[:, :n]
    off_p[:, :n] += e.noise("L_v")[:, :n]
    listed = []
    for k in (np.s_[:own], np.s_[n:width]):
        if not m[k].size:
            continue
        fastest, largest = (of_particles(np.abs(each[:, k]).max(axis=0)) for each in (r.v, F))
        roots = np.sqrt(m[k])
        is_plain = np.array_equal(p[:, k], m[k] * r.v[:, k])
        a = (F[:, k] / m[k], off_F[:, k] / m[k]) if is_plain else (None, None)
        of_rates = r.v[:, k], off_q[:, k], off_v[:, k], coarse[k], fastest, roots
        of_forces = F[:, k], off_p[:, k], off_F[:, k], coarse[k], largest, roots
        listed.append(Quantity(e.names.q[k], r.q[:, k], *of_rates, *a))
        listed.append(Quantity(e.names.v[k], p[:, k], *of_forces))
    if n > own:
        k = np.s_[own:n]
        is_coarse, roots = coarse[k] | bool(coarse[n:].any()), np.ones(n - own)
        if n == width:
            step = float(np.median(np.diff(r.t))) if len(r.t) > 1 else np.inf
            push, size = (np.sqrt((y[:, k] ** 2).mean(axis=0)) for y in (F, p))
            is_coarse = is_coarse | np.any(step * push > size)
            of_forces = F[:, k], off_p[:, k], off_F[:, k], is_coarse, np.abs(F[:, k]).max(axis=0), roots
            listed.append(Quantity(e.names.v[k], p[:, k], *of_forces))
        of_rates = r.v[:, k], off_q[:, k], off_v[:, k], is_coarse, np.abs(r.v[:, k]).max(axis=0), roots
        listed.append(Quantity(e.names.q[k], r.q[:, k], *of_rates))
    return listed


def steps(e: Evidence) -> list[Check]:
    """Every step of every quantity. Steps with a push that no row shows are kept in `e.hidden`."""
    grid = TableSteps(e.record.t, e.clock)
    h = grid.h[:, None]
    rows = e.once(RowSpacing).is_fast
    fast = rows[1:] | rows[:-1]
    every_quantity = quantities(e)
    parts = [judged_steps(grid, quantity, fast) for quantity in every_quantity]
    names = [name for quantity in every_quantity for name in quantity.names]
    residual, limit, judged = (np.concatenate([part[k] for part in parts], axis=1) for k in range(3))
    beyond = judged & (np.abs(residual) > limit)
    if beyond.any():
        worst = np.max(np.where(beyond, np.abs(residual) / limit, 0.0), axis=1)
        wrong = np.argsort(-worst, kind="stable")[: int(beyond.any(axis=1).sum())]
        # By how much the forces of the rows bend around each step, divided by the root of the mass
        shown = np.full(len(grid.h), np.inf)
        if 2 in grid.orders:
            bends = [grid.spread(2, each.rate) / each.root for each in every_quantity if each.second is None]
            shown = np.linalg.norm(np.concatenate(bends, axis=1), axis=1)
        # The excess of forces between the rows over those at the ends, where it is larger than what rows show, and of
        # impulses, which no row shows
        push = np.zeros(len(grid.h))
        for first in range(0, len(wrong), AT_ONCE):
            some = wrong[first : first + AT_ONCE]
            pushes, impulses = _pushes(e, some)
            push[some] = np.maximum(np.where(pushes > TWICE * shown[some], pushes, 0.0), impulses)
            if not push[some].any():
                break
        e.hidden |= push > 0
        # The most that a push within a step changes: a momentum, or a position
        most = h * push[:, None]
        changes = [most * e.root if e.second is None else h * most / e.root for e in every_quantity]
        limit = limit + np.concatenate(changes, axis=1)
    beyond = judged & (np.abs(residual) > limit) & fast[:, None]
    if np.any(beyond, axis=1).sum() > max(2 * REACHED, OFTEN * len(residual)):
        # So a motion looks that is too fast for the rows; an error of the table is wrong at some
        judged &= ~beyond
    # True where a particle is farther from its last position than it can come, however fast it swings between rows
    far = []
    for each in every_quantity:
        most = np.full((1, 1), np.inf)
        if each.second is not None:
            most = WIDE * h * (each.size + h * of_particles(np.abs(each.second).max(axis=0)))
        far.append(np.abs(np.diff(each.y, axis=0)) > each.off[1:] + most)
    judged |= np.concatenate(far, axis=1) & (np.abs(residual) > limit)
    return [judge(STEPS, names, e.record.t[:-1], residual, limit, judged)]


def judged_steps(grid: TableSteps, quantity: Quantity, fast: Array) -> tuple[Array, Array, Array]:
    """Residuals and limits of the steps of a quantity and what can be judged, (T - 1, k) each.

    fast (T - 1,): where particles may swing faster than the rows show, so that a polynomial of high order is none.
    """
    shape = (len(grid.h), quantity.y.shape[1])
    residual, best, truncation = np.zeros(shape), np.full(shape, np.inf), np.full(shape, np.inf)
    h = grid.h[:, None]
    change = np.diff(quantity.y, axis=0)
    off = np.maximum(quantity.off[1:], quantity.off[:-1])
    off = off + grid.clock * np.abs(quantity.rate[1:]) + differences.CLOCK * np.abs(quantity.y[1:])
    off_rate = np.maximum(quantity.off_rate[1:], quantity.off_rate[:-1])
    for m, (indices, plain, moment) in grid.weights.items():
        if quantity.second is None:
            apart = change - differences.combined(indices, plain, quantity.rate)
            open_ = ORDERS[m] * h * grid.spread(m, quantity.rate)
            limit = off + h * off_rate + open_
        else:
            assert quantity.off_second is not None
            apart = change - h * (quantity.rate[1:] + quantity.rate[:-1]) / 2
            apart = apart - differences.combined(indices, moment, quantity.second)
            open_ = ORDERS[m] * h * h / 4 * grid.spread(m, quantity.second)
            off_second = np.maximum(quantity.off_second[1:], quantity.off_second[:-1])
            limit = off + h * off_rate + h * h / 4 * off_second + open_
        if m == 2:
            limit = limit + np.where(fast[:, None], (WIDE - 1) * open_, 0.0)
        # Where the rows of the interpolant stand around the step: others see half of a jump only.
        i = np.arange(len(grid.h))[:, None]
        is_around = (i >= m // 2 - 1) & (i <= len(grid.h) - m // 2)
        better = (limit < best) & is_around & ~(fast[:, None] & (m > 2))
        pairs = (apart, residual), (limit, best), (open_, truncation)
        residual, best, truncation = (np.where(better, new, old) for new, old in pairs)
    # A wide bound is no reason to pass, but what is beyond it fails all the same.
    close = truncation <= np.maximum(TENTH * h * quantity.size, best - truncation)
    judged = (close | (np.abs(residual) > best)) & ~quantity.coarse
    return residual, best, judged


def _pushes(e: Evidence, steps: Array) -> tuple[Array, Array]:
    """What pushes within steps (K,) beyond what rows show: by forces or by t alone, and by rows that jump, (K,) each;
    divided by the root of the mass, so that reactions to a force are not larger than the force."""
    r, laws, n = e.record, e.laws, e.n
    root = np.sqrt(np.where(e.masses > 0, e.masses, 1.0))

    def bulge(y: Array) -> Array:
        """The largest distances of values (K, S, k) from the straight line between those at the ends, (K,)."""
        straight = y[:, :1] + PARTS[None, :, None] * (y[:, -1:] - y[:, :1])
        return np.asarray(np.linalg.norm(y - straight, axis=2).max(axis=1))

    # Forces at states on the straight lines between those of the rows
    states = []
    for y in (r.t, r.q, r.v):
        first, last = y[steps][:, None], y[steps + 1][:, None]
        parts = PARTS.reshape((1, -1) + (1,) * (y.ndim - 1))
        states.append(np.asarray((first + parts * (last - first)).reshape((-1, *y.shape[1:]))))
    t, q, v = states
    nothing = np.zeros((len(t), laws.C))
    values = laws.values(t, q, v, nothing)
    pushes = TWICE * bulge((values.force() / root).reshape(len(steps), POINTS + 2, -1))
    # Momenta that t alone brings about, at the positions and velocities of the first rows: in rows, dependent
    # particles and inertia, beyond what the rows around show
    heaviest = np.sqrt(e.masses.max(initial=0.0) or 1.0)

    def momenta(t: Array) -> Array:
        """At times (K, S), (K, S, k)."""
        q, v = (np.repeat(y[steps], t.shape[1], axis=0) for y in (r.q, r.v))
        at = laws.values(t.ravel(), q, v, np.zeros((t.size, laws.C)))
        parts = [at.L_v[:, :n] / root[:n], at.x_t * root[n:], at.b * heaviest]
        return np.concatenate(parts, axis=1).reshape(len(steps), t.shape[1], -1)

    h = r.t[steps + 1] - r.t[steps]
    fine = momenta(r.t[steps][:, None] + PARTS * h[:, None])
    coarse = momenta(r.t[np.clip(steps[:, None] + np.arange(-1, 3), 0, len(r.t) - 1)])
    apart, bends = bulge(fine), np.linalg.norm(np.diff(coarse, 2, axis=1), axis=2).max(axis=1)
    rounding = doubles.VALUE * np.linalg.norm(fine, axis=2).max(axis=1)
    drives = np.where(apart > TWICE * bends + rounding, TWICE * apart / h, 0.0)
    # A wall whose velocity jumps strikes what rests on it; rows are states after what jumps at their times.
    w = laws.values(t + 2 * e.clock, q, v, nothing).w.reshape(len(steps), POINTS + 2, -1)
    changes = np.abs(np.diff(w, axis=1))
    largest = changes.max(axis=1, initial=0.0)
    is_sudden = largest > TWICE * np.median(changes, axis=1)
    impulses = np.zeros(len(steps))
    if is_sudden.any():
        B = laws.matrix(r.t[steps], r.q[steps], r.v[steps])
        jumps = np.where(is_sudden & (largest > SAFETY * np.abs(B) @ e.off_v[:n]), largest, 0.0)
        lengths = np.linalg.norm(B / root[:n], axis=2)
        struck = np.where(lengths > 0, jumps / np.where(lengths > 0, lengths, 1.0), 0.0)
        impulses = np.asarray(TWICE * struck.sum(axis=1) / h)
    return np.maximum(pushes, drives), impulses
