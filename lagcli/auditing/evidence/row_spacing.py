"""The motion that the spacing of rows shows: what is too fast for it is not judged by differences.

Rows at whole or half turns of an angle all show the same B and the same forces, and every formula through them agrees
and is wrong: so the model is looked at between the rows too, on the way that the rates of each row point to.
"""

from __future__ import annotations

import functools

import numpy as np

from lagcli import doubles
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import BESIDE, TENTH, TWICE, widest
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.table_input import Record
from lagcli.auditing.evidence.tolerances import SAFETY, Evidence

OFTEN, REACHED = 0.05, BESIDE + 1  # of the rows; rows on either side that an error of one row spoils
FEW = 60  # rows of which an error of one row spoils too many to be told from a fast motion


# Instants between two rows, the golden section times squares, so that no whole number of turns hides from them all: at
# 0 and 1 `test_no_number_of_whole_turns_between_rows_hides` of `tests/physics/test_audit_spacing.py` fails.
BETWEEN = 5
GOLDEN = (np.sqrt(5) - 1) / 2


class RowSpacing:
    """The quantities of a record that its rows show, by the forces and the rates at them."""

    def __init__(self, e: Evidence) -> None:
        self._e = e

    @functools.cached_property
    def is_resolved(self) -> tuple[Array, Array]:
        """True where the spacing resolves the motion of coordinates (T, n) and of dependent particles (T, 3 Nd): by the
        recorded rates or by forces and reactions, as an error in one of them leaves the others smooth."""
        r, own = self._e.record, self._e.laws.index.first_generalized
        force, force_x = self._e.total_force, r.R_x + self._e.values.force_x
        grid, part = self._e.grid, SAFETY * self._e.tolerance.rtol
        by_rates = grid.resolved(r.v, SAFETY * self._e.off_v)
        slow = by_rates | grid.resolved(force, part * np.abs(force).max(axis=0, initial=0.0))
        slow_x = grid.resolved(r.u, SAFETY * self._e.off_x)
        slow_x |= grid.resolved(force_x, part * np.abs(force_x).max(axis=0, initial=0.0))
        if r.x.size:
            slow[:, own:] &= np.all(slow_x, axis=1, keepdims=True) | by_rates[:, own:]
        if self.is_coarse[1].any():
            slow[:, own:] = False
        return slow & ~self.is_coarse[0], slow_x & ~self.is_coarse[1]

    @functools.cached_property
    def is_fast(self) -> Array:
        """True where particles can swing faster than the rows show, (T, n): forces, and those of rows at the same
        lambda, change so much with the positions that (step)^2 dF/dr > m."""
        can_swing = np.zeros(self._e.record.q.shape, dtype=bool)
        own = self._e.laws.index.first_generalized
        if own and len(can_swing) > 1:
            can_swing[:, :own] = np.repeat(widest(self._swing) > 1, 3, axis=1)
        return can_swing

    @functools.cached_property
    def _swing(self) -> Array:
        """(step)^2 dF/dr / m of Cartesian particles, (T, K)."""
        r, one, other = self._e.record, self._e.values, self._e.moved_values
        own, rows = self._e.laws.index.first_generalized, len(r.t)
        change = np.abs(one.pull - other.pull - one.V_q + other.V_q)[:, :own]
        change = change + np.abs(one.F_q - other.F_q)
        stiffness = np.nan_to_num(change) / self._e.off_q[:own] / self._e.masses[:own]
        step = float(np.median(np.diff(r.t)))
        return np.asarray(step * step * stiffness.reshape(rows, -1, 3).max(axis=2))

    @property
    def is_slow(self) -> bool:
        """True if no particle can move much faster than the rows show."""
        return not (self.is_coarse[0].any() or self.is_coarse[1].any())

    def unaliased(self, residual: Array, limit: Array, judged: Array) -> Array:
        """The entries that can be judged, less those that may look wrong as a fast motion is sampled slowly: that is so
        all along, and an error of the table is wrong at some rows."""
        beyond = judged & (np.abs(residual) > limit) & np.any(self.is_fast, axis=1, keepdims=True)
        nearly = beyond & (np.abs(residual) <= TWICE * limit)
        rows = ((beyond & ~nearly) | ~judged).sum(axis=0)
        often = (rows > max(2 * REACHED, OFTEN * len(residual))) | (len(residual) < FEW)
        return np.asarray(judged & ~np.where(often, beyond, nearly))

    @functools.cached_property
    def is_coarse(self) -> tuple[Array, Array]:
        """True where a step of the table changes a velocity by more than itself, (n,) and (3 Nd,): no row speaks for
        its neighbourhood there, whatever the differences say."""
        index, r = self._e.laws.index, self._e.record
        if len(r.t) < 2:
            return np.ones(index.n, dtype=bool), np.ones(r.x.shape[1], dtype=bool)
        step = float(np.median(np.diff(r.t)))
        values, own = self._e.values, index.first_generalized
        a = (values.F_q - values.V_q[:, :own] + r.R_q[:, :own]) / self._e.masses[:own]
        a_x = (values.force_x + r.R_x) / self._e.masses_x
        is_far = np.zeros(index.n, dtype=bool)
        size = max(float(np.abs(r.q[:, :own]).max(initial=0.0)), float(np.abs(r.x).max(initial=0.0)))
        coarse = _coarse(r.v[:, :own], a, step, size)
        if own and not np.any(self._e.values.b):
            # Nothing swings that fast, and what is at rest under a force is no motion.
            coarse &= self._swing.max(axis=0) > TENTH  # (step)^2 dF/dr / m
        is_far[:own] = np.repeat(coarse, 3)
        # Rows, forces or momenta that turn too far with generalized coordinates from a row to the next, all along: an
        # error of a row lets few steps look so
        if own < index.n:
            part = SAFETY * self._e.tolerance.rtol + doubles.SUM
            fast = _turning_steps(self._e.laws, r, part, self._e.tolerance.atol).sum(axis=0)
            rows = len(r.t)
            is_far[own:] = (fast > (rows / 4 if rows < FEW else max(2 * REACHED, OFTEN * rows))).any()
        return is_far, np.repeat(_coarse(r.u, a_x, step, size), 3)


def _coarse(v: Array, a: Array, step: float, size: float) -> Array:
    """True for particles (K,) whose rows are far apart, by the mean squares of velocities and accelerations (T, 3 K);
    what moves by less than rounding beside the `size` of the system is at rest."""
    speed, push = (np.sqrt((y.reshape(len(y), -1, 3) ** 2).sum(axis=2).mean(axis=0)) for y in (v, a))
    return np.asarray((step * push > speed) & (step * step * push > 1e-9 * size))


def _turning_steps(laws: ModelLaws, record: Record, part: float, atol: float) -> Array:
    """True for the steps and columns (T - 1, 3 n) in which the rows, the forces or the momenta turn too far along a
    coordinate, from each row with its own rates. part: of the size of a column what is noise, beside `atol`."""
    # Rates of the size of those of the record, and multipliers by which rows pull alike at its first row
    random = np.random.default_rng(6)
    B = laws.matrix(record.t[:1], record.q[:1], record.v[:1])[0]
    lengths = np.nan_to_num(np.linalg.norm(B, axis=1))
    rates = np.abs(record.v).max(axis=0) * random.uniform(0.5, 1.0, record.v.shape[1])
    sizes = rates, random.uniform(0.5, 1.0, len(lengths)) / np.where(lengths > 0, lengths, 1.0)
    rows = _on_coordinates(laws, record.t, record.q, *sizes)
    ahead = np.zeros((len(rows) - 1, rows.shape[1]))
    h = np.diff(record.t)
    for number in range(1, BETWEEN + 1):
        s = h * np.modf(GOLDEN * number**2)[0]
        there = _on_coordinates(laws, record.t[:-1] + s, record.q[:-1] + s[:, None] * record.v[:-1], *sizes)
        ahead = np.maximum(ahead, np.abs(there - rows[:-1]))
    floor = part * np.abs(rows).max(axis=0) + atol
    swing = np.sqrt(2 * np.mean((rows - rows.mean(axis=0)) ** 2, axis=0))
    shown = np.abs(np.diff(rows, axis=0))
    shown = np.maximum(shown, np.concatenate([shown[:1], shown[:-1]]))
    # What turns by more than a radian from a row to the next is not seen by the rows.
    turned = (ahead > 2 * np.sin(1 / 2) * swing) | (ahead > 2 * shown)
    return np.asarray(turned & (ahead > floor))


def _on_coordinates(laws: ModelLaws, t: Array, q: Array, rates: Array, multipliers: Array) -> Array:
    """The pull of rows, the forces, and the momenta of given rates, on generalized coordinates, (T, 3 n)."""
    own, count = laws.index.first_generalized, len(t)
    v, lam = (np.broadcast_to(y, (count, len(y))) for y in (rates, multipliers))
    values = laws.values(t, q, v, lam)
    parts = (values.pull, values.force_q(), values.L_v)
    return np.asarray(np.nan_to_num(np.concatenate([part[:, own:] for part in parts], axis=1)))
