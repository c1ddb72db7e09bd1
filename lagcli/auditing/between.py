"""What the forces do between two rows of a table: a pulse there changes velocities, and no row shows it."""

from __future__ import annotations

import numpy as np

from lagcli.auditing.evidence import Evidence
from lagcli.auditing.tape import Array

AT_ONCE = 16  # steps that are looked at, and more as long as there is something between their rows
PLACES = 31  # within each: a pulse that is shorter than a thirtieth of a step may not be found
FORWARD = 2.0  # of the largest push in a step: how far the reactions may pass it on


def hidden_push(e: Evidence, steps: Array, shown: Array) -> Array:
    """How much larger the forces are between the rows of steps than at their ends, (T - 1,).

    steps (K,): those in question, the worst first; others are 0, and so is what is no larger than `shown` (T - 1,).
    A push is divided by the root of the mass: in that metric reactions to a force are not larger than the force.
    """
    found = np.zeros(len(e.record.t) - 1)
    for first in range(0, len(steps), AT_ONCE):
        some = steps[first : first + AT_ONCE]
        push = _pushes(e, some)
        found[some] = np.where(push > shown[some], push, 0.0)
        if not found[some].any():
            break
    return found


def _pushes(e: Evidence, steps: Array) -> Array:
    """The largest differences from the straight line between the forces at the rows of steps (K,), (K,).

    At states on the straight line between those of the rows.
    """
    r, laws, own = e.record, e.laws, e.laws.cast.first_generalized
    s = np.arange(PLACES + 2)[None, :] / (PLACES + 1)
    s = s * np.ones((len(steps), 1))

    def between(y: Array) -> Array:
        first, last = y[steps][:, None], y[steps + 1][:, None]
        wide = s.reshape(s.shape + (1,) * (y.ndim - 1))
        return np.asarray((first + wide * (last - first)).reshape((-1, *y.shape[1:])))

    values = laws.values(between(r.t), between(r.q), between(r.v), np.zeros((s.size, laws.C)))
    F = values.F
    force = -values.V_q + values.Q + values.L_q
    force[:, :own] += F[:, laws.cast.cartesian].reshape(len(F), -1)
    force_x = -values.V_x + F[:, laws.cast.dependent].reshape(len(F), -1)
    roots = np.sqrt(np.where(e.masses > 0, e.masses, 1.0)), np.sqrt(np.where(e.masses_x > 0, e.masses_x, 1.0))
    pushes = np.concatenate([force / roots[0], force_x / roots[1]], axis=1).reshape(
        len(steps), PLACES + 2, -1
    )
    straight = pushes[:, :1] + s[:, :, None] * (pushes[:, -1:] - pushes[:, :1])
    return np.asarray(FORWARD * np.linalg.norm(pushes - straight, axis=2).max(axis=1))
