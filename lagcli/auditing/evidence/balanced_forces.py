"""The rounding of forces that balance each other: of a body at rest that is all there is of its motion.

A tolerance follows the size of the motion, and of a motion that is none it is nothing; forces that cancel are known to
a part of themselves, and push by that much.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import LawValues, ModelLaws
from lagcli.auditing.evidence.table_input import Record

# Rows at which positions are moved by their rounding, and how much further: random moves show a part of the largest
# change.
SAMPLES, FURTHER = 9, 4
PARTS = ("V_q", "Q", "L_q", "pull")


@dataclasses.dataclass(frozen=True, slots=True)
class ForceRounding:
    """The rounding of the forces on coordinates q (n,) and on dependent particles x (3 Nd,), and of the accelerations a
    (n,) that follow from it."""

    q: Array
    x: Array
    a: Array


def rounding(laws: ModelLaws, record: Record, values: LawValues) -> ForceRounding:
    """The rounding of the forces of a record with the values of the laws at its rows."""
    index, own = laws.index, laws.index.first_generalized
    if not len(record.t):
        return ForceRounding(*(np.zeros(part.shape[1]) for part in (record.q, record.x, record.q)))
    rows = np.unique(np.linspace(0, len(record.t) - 1, min(SAMPLES, len(record.t))).astype(np.int64))
    random = np.random.default_rng(6)
    part = record.part(rows)
    moved = part.q * (1 + FURTHER * doubles.SUM * random.choice((-1.0, 1.0), size=part.q.shape))
    there = laws.values(part.t, moved, part.v, part.lam)

    def largest(y: Array) -> Array:
        return np.asarray(np.abs(np.nan_to_num(y)).max(axis=0, initial=0.0))

    q = doubles.SUM * largest(record.R_q)
    for name in PARTS:
        whole, shifted = getattr(values, name), getattr(there, name)
        q = q + doubles.SUM * largest(whole) + largest(shifted - whole[rows])
    pushed = doubles.SUM * largest(values.F) + largest(there.F - values.F[rows])
    q[:own] += pushed[index.cartesian].ravel()
    x = doubles.SUM * (largest(record.R_x) + largest(values.V_x)) + largest(there.V_x - values.V_x[rows])
    x = x + pushed[index.dependent].ravel()
    # The multipliers are solved for together: what pushes one coordinate is rounded in all, as far as it moves them.
    M, M_x = _inertia(laws, part), np.repeat(index.masses[index.dependent], 3)
    common = max((_ratio(y, np.sqrt(m)).max(initial=0.0) for y, m in ((q, M), (x, M_x))), default=0.0)
    q, x = np.maximum(q, common * np.sqrt(M)), np.maximum(x, common * np.sqrt(M_x))
    return ForceRounding(q, x, _ratio(q, M))


def _ratio(y: Array, by: Array) -> Array:
    """y/by, and 0 where `by` is."""
    return np.asarray(np.divide(y, by, out=np.zeros_like(y), where=by > 0))


def _inertia(laws: ModelLaws, record: Record) -> Array:
    """The diagonal of the mass matrix (n,) at the first row."""
    index, n = laws.index, laws.index.n
    M = np.zeros(n)
    M[: index.first_generalized] = np.repeat(index.masses[index.cartesian], 3)
    t, q, lam = (np.repeat(part[:1], n + 1, axis=0) for part in (record.t, record.q, record.lam))
    unit = np.vstack([np.eye(n), np.zeros((1, n))])
    if laws.model.lagrangian is not None:
        L_v = laws.values(t, q, unit, lam).L_v
        M += np.abs(np.diagonal(L_v[:n] - L_v[n]))
    if index.dependent.size:
        moved = laws.displaced(t, q, 0 * unit, unit)[:n]
        M += (np.repeat(index.masses[index.dependent], 3) * moved**2).sum(axis=1)
    return M
