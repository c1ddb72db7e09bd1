"""What turns with a generalized coordinate between two rows: B(q), the inertia, and the forces.

Rows at whole or half turns of an angle all show the same B and the same forces, and every formula through them agrees
and is wrong. So these are looked at between the rows, on the cubic through the states of both.
"""

from __future__ import annotations

import numpy as np

from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.table_input import Record


class TurningParameters:
    """Where B, the inertia and the forces are looked at between two rows, and what is too much of a turn.

    The tests are of `tests/physics/test_audit_spacing.py`.
    """

    __slots__ = ()

    angle: float = 1.0
    """In radians: what turns by more from a row to the next is not seen by the rows.
    `test_what_turns_by_a_radian_from_row_to_row_is_too_far_apart` fails at 0.1 and 10."""
    between: int = 5
    """Instants between two rows, the multiples of the golden section, so that no whole number of turns hides from them
    all. `test_no_number_of_whole_turns_between_rows_hides` fails at 0 and 1."""


PARAMETERS = TurningParameters()
GOLDEN = (np.sqrt(5.0) - 1) / 2


def steps(laws: ModelLaws, found: Record, part: float, atol: float) -> Array:
    """True for the steps and columns (T - 1, 3 n) in which something turns too far along a coordinate: the rows,
    the forces on it, its momenta.

    part: of the size of a column what is noise, beside `atol`.
    """
    s = np.modf(GOLDEN * np.arange(1, PARAMETERS.between + 1))[0][:, None]
    t, q = _between(found, s)
    sizes = _weights(laws, found)
    inside, rows = (_on_coordinates(laws, *states, *sizes) for states in ((t, q), (found.t, found.q)))
    inside = inside.reshape(len(rows) - 1, len(s), rows.shape[1])
    straight = rows[:-1, None] + s * (rows[1:] - rows[:-1])[:, None]
    apart = np.abs(inside - straight).max(axis=1)
    floor = part * np.abs(rows).max(axis=0) + atol
    swing = np.sqrt(np.mean((rows - rows.mean(axis=0)) ** 2, axis=0))
    turned = apart > (1 - np.cos(PARAMETERS.angle / 2)) * swing
    bends = np.zeros(rows.shape)
    bends[1:-1] = np.abs(np.diff(rows, 2, axis=0))
    hidden = apart > np.maximum(bends[1:], bends[:-1])
    return np.asarray((turned | hidden) & (apart > floor))


def _between(found: Record, s: Array) -> tuple[Array, Array]:
    """Times and positions at the parts s (S, 1) of each step, on the cubic through its ends, ((T - 1) S,)."""
    h = np.diff(found.t)[:, None, None]
    rise, v, w = np.diff(found.q, axis=0)[:, None], h * found.v[:-1, None], h * found.v[1:, None]
    q = found.q[:-1, None] + s * (v + s * (3 * rise - 2 * v - w + s * (v + w - 2 * rise)))
    t = found.t[:-1, None, None] + s * h
    return t.ravel(), q.reshape(t.size, found.q.shape[1])


def _weights(laws: ModelLaws, found: Record) -> tuple[Array, Array]:
    """Rates (n,) of the size of those of a record, and multipliers (C,) by which rows pull alike at its first row."""
    random = np.random.default_rng(6)
    lengths = np.nan_to_num(np.linalg.norm(laws.matrix(found.t[:1], found.q[:1], found.v[:1])[0], axis=1))
    rates = np.abs(found.v).max(axis=0) * random.uniform(0.5, 1.0, found.v.shape[1])
    return rates, random.uniform(0.5, 1.0, len(lengths)) / np.where(lengths > 0, lengths, 1.0)


def _on_coordinates(laws: ModelLaws, t: Array, q: Array, rates: Array, multipliers: Array) -> Array:
    """The pull of rows, the forces, and the momenta of given rates, on generalized coordinates, (T, 3 n)."""
    own, count = laws.index.first_generalized, len(t)
    v, lam = (np.broadcast_to(y, (count, len(y))) for y in (rates, multipliers))
    values = laws.values(t, q, v, lam)
    parts = (values.pull, laws.forces_on_coordinates(values), values.L_v)
    return np.nan_to_num(np.concatenate([part[:, own:] for part in parts], axis=1))
