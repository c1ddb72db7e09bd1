"""Forces between two rows of a table: a pulse there changes velocities, and no row shows it."""

from __future__ import annotations

import numpy as np

from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.tolerances import Evidence

AT_ONCE = 16  # steps that are looked at, and more as long as there is something between their rows
POINTS = 31  # within each: a pulse that is shorter than a thirtieth of a step may not be found
BENDS, ROUNDED = 2.0, 1e-12  # times the bend that rows show, and a part of the size: what is above is hidden
FORWARD = 2.0  # of the largest push in a step: how far the reactions may pass it on


def hidden_push(e: Evidence, steps: Array, shown: Array) -> Array:
    """The excess of the forces between the rows of steps over those at their ends, (T - 1,).

    steps (K,): those in question, the worst first; others are 0, and so is what is no larger than `shown` (T - 1,).
    A push is divided by the root of the mass: in that metric reactions to a force are not larger than the force.
    """
    found = np.zeros(len(e.record.t) - 1)
    for first in range(0, len(steps), AT_ONCE):
        some = steps[first : first + AT_ONCE]
        push = np.maximum(_pushes(e, some), _drives(e, some))
        found[some] = np.where(push > shown[some], push, 0.0)
        if not found[some].any():
            break
    return found


def _drives(e: Evidence, steps: Array) -> Array:
    """The pushes (K,) by which t alone changes momenta within steps (K,), in rows, dependent particles and inertia,
    beyond what the rows around show; 0 where t occurs in none of them."""
    r = e.record
    s = np.arange(POINTS + 2) / (POINTS + 1)
    first, last = r.t[steps], r.t[steps + 1]
    inside = first[:, None] + s * (last - first)[:, None]
    around = r.t[np.clip(steps[:, None] + np.arange(-1, 3), 0, len(r.t) - 1)]
    fine, coarse = _momenta(e, steps, inside), _momenta(e, steps, around)
    straight = fine[:, :1] + s[None, :, None] * (fine[:, -1:] - fine[:, :1])
    apart = np.linalg.norm(fine - straight, axis=2).max(axis=1)
    bends = np.linalg.norm(np.diff(coarse, 2, axis=1), axis=2).max(axis=1)
    rounding = ROUNDED * np.linalg.norm(fine, axis=2).max(axis=1)
    return np.where(apart > BENDS * bends + rounding, FORWARD * apart / (last - first), 0.0)


def _momenta(e: Evidence, steps: Array, t: Array) -> Array:
    """Momenta over roots of masses that t brings about at times (K, S), with positions and velocities as they are at
    the first rows of steps, (K, S, k)."""
    r, many = e.record, t.shape[1]
    q, v = (np.repeat(y[steps], many, axis=0) for y in (r.q, r.v))
    found = e.laws.values(t.ravel(), q, v, np.zeros((t.size, e.laws.C)))
    heaviest = np.sqrt(max(e.masses.max(initial=0.0), e.masses_x.max(initial=0.0)) or 1.0)
    roots = np.sqrt(np.where(e.masses > 0, e.masses, 1.0))
    parts = [found.L_v / roots, found.x_t * np.sqrt(e.masses_x), found.b * heaviest]
    return np.concatenate(parts, axis=1).reshape(len(steps), many, -1)


def _pushes(e: Evidence, steps: Array) -> Array:
    """The largest differences from the straight line between the forces at the rows of steps (K,), (K,).

    At states on the straight line between those of the rows.
    """
    r, laws = e.record, e.laws
    s = np.arange(POINTS + 2)[None, :] / (POINTS + 1)
    s = s * np.ones((len(steps), 1))

    def between(y: Array) -> Array:
        first, last = y[steps][:, None], y[steps + 1][:, None]
        wide = s.reshape(s.shape + (1,) * (y.ndim - 1))
        return np.asarray((first + wide * (last - first)).reshape((-1, *y.shape[1:])))

    values = laws.values(between(r.t), between(r.q), between(r.v), np.zeros((s.size, laws.C)))
    force = laws.forces_on_coordinates(values)
    force_x = laws.particle_forces(values)[:, laws.index.dependent].reshape(s.size, -1)
    roots = np.sqrt(np.where(e.masses > 0, e.masses, 1.0)), np.sqrt(np.where(e.masses_x > 0, e.masses_x, 1.0))
    pushes = np.concatenate([force / roots[0], force_x / roots[1]], axis=1).reshape(
        len(steps), POINTS + 2, -1
    )
    straight = pushes[:, :1] + s[:, :, None] * (pushes[:, -1:] - pushes[:, :1])
    return np.asarray(FORWARD * np.linalg.norm(pushes - straight, axis=2).max(axis=1))
