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
    def is_resolved(self) -> Array:
        """True where the spacing resolves the motion, (T, n + 3 Nd): by the recorded rates or by forces and reactions,
        as an error in one of them leaves the others smooth."""
        e, force = self._e, self._e.total_force
        by_rates = e.grid.resolved(e.record.v, SAFETY * e.off_v)
        small = SAFETY * e.tolerance.rtol * np.abs(force).max(axis=0, initial=0.0)
        slow = by_rates | e.grid.resolved(force, small)
        generalized = np.s_[:, e.own : e.n]
        slow[generalized] &= np.all(slow[:, e.n :], axis=1, keepdims=True) | by_rates[generalized]
        if self.is_coarse[e.n :].any():
            slow[generalized] = False
        return slow & ~self.is_coarse

    @functools.cached_property
    def is_fast(self) -> Array:
        """True where particles can swing faster than the rows show, (T,): forces, and those of rows at the same
        lambda, change so much with the positions that (step)^2 dF/dr > m."""
        rows = len(self._e.record.t)
        if not self._e.own or rows < 2:
            return np.zeros(rows, dtype=bool)
        return np.asarray((widest(self._swing) > 1).any(axis=1))

    @functools.cached_property
    def _swing(self) -> Array:
        """(step)^2 dF/dr / m of Cartesian particles, (T, K)."""
        e, one, other = self._e, self._e.values, self._e.moved_values
        pairs = (one.pull, other.pull), (one.V_q, other.V_q), (one.F, other.F)
        pull, V_q, F = (here[:, : e.own] - there[:, : e.own] for here, there in pairs)
        stiffness = np.nan_to_num(np.abs(pull - V_q) + np.abs(F)) / e.off_q[: e.own] / e.masses[: e.own]
        step = float(np.median(np.diff(e.record.t)))
        return np.asarray(step * step * stiffness.reshape(len(stiffness), -1, 3).max(axis=2))

    @property
    def is_slow(self) -> bool:
        """True if no particle can move much faster than the rows show."""
        return not self.is_coarse.any()

    def unaliased(self, residual: Array, limit: Array, judged: Array) -> Array:
        """The entries that can be judged, less those that may look wrong as a fast motion is sampled slowly: that is so
        all along, and an error of the table is wrong at some rows."""
        beyond = judged & (np.abs(residual) > limit) & self.is_fast[:, None]
        nearly = beyond & (np.abs(residual) <= TWICE * limit)
        rows = ((beyond & ~nearly) | ~judged).sum(axis=0)
        often = (rows > max(2 * REACHED, OFTEN * len(residual))) | (len(residual) < FEW)
        return np.asarray(judged & ~np.where(often, beyond, nearly))

    @functools.cached_property
    def is_coarse(self) -> Array:
        """True where a step of the table changes a velocity by more than itself, (n + 3 Nd,): no row speaks for its
        neighbourhood there, whatever the differences say."""
        e, r, own, rows = self._e, self._e.record, self._e.own, len(self._e.record.t)
        if rows < 2:
            return np.ones(r.q.shape[1], dtype=bool)
        # Particles by the mean squares of velocities and accelerations; what moves by less than rounding beside the
        # size of the system is at rest
        of_particles = np.delete(np.arange(r.q.shape[1]), np.s_[own : e.n])
        a = (e.values.F - e.values.V_q + r.R)[:, of_particles] / e.masses[of_particles]
        step, size = float(np.median(np.diff(r.t))), float(np.abs(r.q[:, of_particles]).max(initial=0.0))
        squares = ((y.reshape(rows, -1, 3) ** 2).sum(axis=2) for y in (r.v[:, of_particles], a))
        speed, push = (np.sqrt(square.mean(axis=0)) for square in squares)
        coarse = (step * push > speed) & (step * step * push > 1e-9 * size)
        if own and not np.any(e.values.b):
            # Nothing swings that fast, and what is at rest under a force is no motion.
            coarse[: own // 3] &= self._swing.max(axis=0) > TENTH  # (step)^2 dF/dr / m
        is_far = np.zeros(r.q.shape[1], dtype=bool)
        is_far[of_particles] = np.repeat(coarse, 3)
        # Rows, forces or momenta that turn too far with generalized coordinates from a row to the next, all along: an
        # error of a row lets few steps look so
        if own < e.n:
            part = SAFETY * e.tolerance.rtol + doubles.SUM
            fast = _turning_steps(e.laws, r, part, e.tolerance.atol).sum(axis=0)
            most = rows / 4 if rows < FEW else max(2 * REACHED, OFTEN * rows)
            is_far[own : e.n] = (fast > most).any()
        return is_far


def _turning_steps(laws: ModelLaws, record: Record, part: float, atol: float) -> Array:
    """True for the steps and columns (T - 1, 3 n) in which the rows, the forces or the momenta turn too far along a
    coordinate, from each row with its own rates. part: of the size of a column what is noise, beside `atol`."""
    # Rates of the size of those of the record, and multipliers by which rows pull alike at its first row
    random, own, n = np.random.default_rng(6), laws.index.first_generalized, laws.index.n
    t, q, v = record.t, record.q[:, :n], record.v[:, :n]
    lengths = np.nan_to_num(np.linalg.norm(laws.matrix(t[:1], q[:1], v[:1])[0], axis=1))
    rates = np.abs(v).max(axis=0) * random.uniform(0.5, 1.0, n)
    multipliers = random.uniform(0.5, 1.0, len(lengths)) / np.where(lengths > 0, lengths, 1.0)

    def on_coordinates(t: Array, q: Array) -> Array:
        """The pull of rows, the forces, and the momenta of given rates, on generalized coordinates, (T, 3 n)."""
        values = laws.values(t, q, *(np.broadcast_to(y, (len(t), len(y))) for y in (rates, multipliers)))
        parts = (part[:, own:n] for part in (values.pull, values.force(), values.L_v))
        return np.asarray(np.nan_to_num(np.concatenate(list(parts), axis=1)))

    rows, h = on_coordinates(t, q), np.diff(t)
    ahead = np.zeros((len(rows) - 1, rows.shape[1]))
    for number in range(1, BETWEEN + 1):
        s = h * np.modf(GOLDEN * number**2)[0]
        there = on_coordinates(t[:-1] + s, q[:-1] + s[:, None] * v[:-1])
        ahead = np.maximum(ahead, np.abs(there - rows[:-1]))
    floor = part * np.abs(rows).max(axis=0) + atol
    swing = np.sqrt(2 * np.mean((rows - rows.mean(axis=0)) ** 2, axis=0))
    shown = np.abs(np.diff(rows, axis=0))
    shown = np.maximum(shown, np.concatenate([shown[:1], shown[:-1]]))
    # What turns by more than a radian from a row to the next is not seen by the rows.
    turned = (ahead > 2 * np.sin(1 / 2) * swing) | (ahead > 2 * shown)
    return np.asarray(turned & (ahead > floor))
