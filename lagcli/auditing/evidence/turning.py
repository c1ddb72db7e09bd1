"""The turn of B(q), of the inertia and of the forces with a generalized coordinate between two rows.

Rows at whole or half turns of an angle all show the same B and the same forces, and every formula through them agrees
and is wrong. So these are looked at between the rows, on the way that the rates of each row point to.
"""

from __future__ import annotations

import numpy as np

from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.table_input import Record


class TurningParameters:
    """Points between two rows at which B, the inertia and the forces are looked at, and too much of a turn.

    The tests are of `tests/physics/test_audit_spacing.py`.
    """

    __slots__ = ()

    angle: float = 1.0
    """In radians: what turns by more from a row to the next is not seen by the rows.
    `test_what_turns_by_a_radian_from_row_to_row_is_too_far_apart` fails at 0.1 and 10."""
    between: int = 5
    """Instants between two rows, the golden section times squares, so that no whole number of turns hides from them
    all. `test_no_number_of_whole_turns_between_rows_hides` fails at 0 and 1."""


PARAMETERS = TurningParameters()
GOLDEN = (np.sqrt(5.0) - 1) / 2


def steps(laws: ModelLaws, record: Record, part: float, atol: float) -> Array:
    """True for the steps and columns (T - 1, 3 n) in which something turns too far along a coordinate: the rows,
    the forces on it, its momenta.

    Each row is gone on from with its own rates, so that rows out of order look as they are. part: of the size of a
    column what is noise, beside `atol`.
    """
    sizes = _weights(laws, record)
    rows = _on_coordinates(laws, record.t, record.q, *sizes)
    ahead = np.zeros((len(rows) - 1, rows.shape[1]))
    h = np.diff(record.t)
    for number in range(1, PARAMETERS.between + 1):
        s = h * np.modf(GOLDEN * number**2)[0]
        there = _on_coordinates(laws, record.t[:-1] + s, record.q[:-1] + s[:, None] * record.v[:-1], *sizes)
        ahead = np.maximum(ahead, np.abs(there - rows[:-1]))
    floor = part * np.abs(rows).max(axis=0) + atol
    swing = np.sqrt(2 * np.mean((rows - rows.mean(axis=0)) ** 2, axis=0))
    shown = np.abs(np.diff(rows, axis=0))
    shown = np.maximum(shown, np.concatenate([shown[:1], shown[:-1]]))
    turned = (ahead > 2 * np.sin(PARAMETERS.angle / 2) * swing) | (ahead > 2 * shown)
    return np.asarray(turned & (ahead > floor))


def _weights(laws: ModelLaws, record: Record) -> tuple[Array, Array]:
    """Rates (n,) of the size of those of a record, and multipliers (C,) by which rows pull alike at its first row."""
    random = np.random.default_rng(6)
    lengths = np.nan_to_num(np.linalg.norm(laws.matrix(record.t[:1], record.q[:1], record.v[:1])[0], axis=1))
    rates = np.abs(record.v).max(axis=0) * random.uniform(0.5, 1.0, record.v.shape[1])
    return rates, random.uniform(0.5, 1.0, len(lengths)) / np.where(lengths > 0, lengths, 1.0)


def _on_coordinates(laws: ModelLaws, t: Array, q: Array, rates: Array, multipliers: Array) -> Array:
    """The pull of rows, the forces, and the momenta of given rates, on generalized coordinates, (T, 3 n)."""
    own, count = laws.index.first_generalized, len(t)
    v, lam = (np.broadcast_to(y, (count, len(y))) for y in (rates, multipliers))
    values = laws.values(t, q, v, lam)
    parts = (values.pull, laws.forces_on_coordinates(values), values.L_v)
    return np.asarray(np.nan_to_num(np.concatenate([part[:, own:] for part in parts], axis=1)))
