"""Forces between two rows of a table: a pulse there changes velocities, and no row shows it."""

from __future__ import annotations

import numpy as np

from lagcli import doubles
from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.tolerances import SAFETY, Evidence

AT_ONCE = 16  # steps that are looked at, and more as long as there is something between their rows
POINTS = 31  # within each: a pulse that is shorter than a thirtieth of a step may not be found
PARTS = np.arange(POINTS + 2) / (POINTS + 1)  # of a step, both ends among them
BENDS = 2.0  # times the bend that rows show: what is above is hidden
FORWARD = 2.0  # of the largest push in a step: how far the reactions may pass it on


def hidden_push(e: Evidence, steps: Array, shown: Array) -> Array:
    """The excess of the forces between the rows of steps over those at their ends, (T - 1,).

    steps (K,): those in question, the worst first; others are 0, and so is what is no larger than `shown` (T - 1,), but
    for impulses, which no row shows.
    A push is divided by the root of the mass: in that metric reactions to a force are not larger than the force.
    """
    excess = np.zeros(len(e.record.t) - 1)
    for first in range(0, len(steps), AT_ONCE):
        some = steps[first : first + AT_ONCE]
        push = np.maximum(_pushes(e, some), _drives(e, some))
        excess[some] = np.maximum(np.where(push > shown[some], push, 0.0), _impulses(e, some))
        if not excess[some].any():
            break
    return excess


def _drives(e: Evidence, steps: Array) -> Array:
    """The pushes (K,) by which t alone changes momenta within steps (K,), in rows, dependent particles and inertia,
    beyond what the rows around show; 0 where t occurs in none of them."""
    r = e.record
    first, last = r.t[steps], r.t[steps + 1]
    inside = first[:, None] + PARTS * (last - first)[:, None]
    around = r.t[np.clip(steps[:, None] + np.arange(-1, 3), 0, len(r.t) - 1)]
    fine, coarse = _momenta(e, steps, inside), _momenta(e, steps, around)
    apart, bends = _bulge(fine), np.linalg.norm(np.diff(coarse, 2, axis=1), axis=2).max(axis=1)
    rounding = doubles.VALUE * np.linalg.norm(fine, axis=2).max(axis=1)
    return np.where(apart > BENDS * bends + rounding, FORWARD * apart / (last - first), 0.0)


def _bulge(y: Array) -> Array:
    """The largest distances of values (K, S, k) within steps from the straight line between those at the ends, (K,)."""
    straight = y[:, :1] + PARTS[None, :, None] * (y[:, -1:] - y[:, :1])
    return np.asarray(np.linalg.norm(y - straight, axis=2).max(axis=1))


def _root(masses: Array) -> Array:
    """The roots of masses, 1 where there is none."""
    return np.sqrt(np.where(masses > 0, masses, 1.0))


def _impulses(e: Evidence, steps: Array) -> Array:
    """The pushes (K,) by which rows jump within steps (K,): a wall whose velocity jumps strikes what rests on it.

    With t, positions and velocities on the straight line between those of the rows.
    """
    r, laws = e.record, e.laws
    t, q, v = (_between(y, steps) for y in (r.t, r.q, r.v))
    # Rows are states after what jumps at their times.
    w = laws.values(t + 2 * e.clock, q, v, np.zeros((len(t), laws.C))).w.reshape(len(steps), POINTS + 2, -1)
    changes = np.abs(np.diff(w, axis=1))
    largest = changes.max(axis=1, initial=0.0)
    is_sudden = largest > BENDS * np.median(changes, axis=1)
    if not is_sudden.any():
        return np.zeros(len(steps))
    B = laws.matrix(r.t[steps], r.q[steps], r.v[steps])
    jumps = np.where(is_sudden & (largest > SAFETY * np.abs(B) @ e.off_v), largest, 0.0)
    lengths = np.linalg.norm(B / _root(e.masses), axis=2)
    struck = np.where(lengths > 0, jumps / np.where(lengths > 0, lengths, 1.0), 0.0)
    return np.asarray(FORWARD * struck.sum(axis=1) / (r.t[steps + 1] - r.t[steps]))


def _between(y: Array, steps: Array) -> Array:
    """Values (K S, ...) at the parts of the straight lines between rows of steps (K,)."""
    first, last = y[steps][:, None], y[steps + 1][:, None]
    wide = PARTS.reshape((1, -1) + (1,) * (y.ndim - 1))
    return np.asarray((first + wide * (last - first)).reshape((-1, *y.shape[1:])))


def _momenta(e: Evidence, steps: Array, t: Array) -> Array:
    """Momenta over roots of masses that t brings about at times (K, S), with positions and velocities as they are at
    the first rows of steps, (K, S, k)."""
    r, many = e.record, t.shape[1]
    q, v = (np.repeat(y[steps], many, axis=0) for y in (r.q, r.v))
    values = e.laws.values(t.ravel(), q, v, np.zeros((t.size, e.laws.C)))
    heaviest = np.sqrt(max(e.masses.max(initial=0.0), e.masses_x.max(initial=0.0)) or 1.0)
    parts = [values.L_v / _root(e.masses), values.x_t * np.sqrt(e.masses_x), values.b * heaviest]
    return np.concatenate(parts, axis=1).reshape(len(steps), many, -1)


def _pushes(e: Evidence, steps: Array) -> Array:
    """The largest differences from the straight line between the forces at the rows of steps (K,), (K,).

    At states on the straight line between those of the rows.
    """
    r, laws = e.record, e.laws
    t, q, v = (_between(y, steps) for y in (r.t, r.q, r.v))
    values = laws.values(t, q, v, np.zeros((len(t), laws.C)))
    force_x = laws.particle_forces(values)[:, laws.index.dependent].reshape(len(t), -1)
    force = laws.forces_on_coordinates(values) / _root(e.masses), force_x / _root(e.masses_x)
    return FORWARD * _bulge(np.concatenate(force, axis=1).reshape(len(steps), POINTS + 2, -1))
