"""The numbers asked of all contacts at an instant, in one call: gaps, their rates, and what is zero among them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.compiled import parts as shared
from lagcli.compiled.parts import Parts

EPS = float(np.finfo(float).eps)
LARGEST = float(np.finfo(float).max)
# The gap of a contact is known to so many roundings of its terms, and to a few of the size of the motion.
ROUNDINGS, FEW = 32.0, 4.0
# A rebound that rises no higher than so many roundings of the size of the motion is not followed.
RESOLVED = 512.0
# Speeds that rise no higher than so many times the rounding of a gap are none.
UNSEEN = 4.0
# Contacts that are this part of the tolerance of the run away from closed belong to the same instant.
TOGETHER = 1.0
# A speed of a gap is none where it is this part of those that it is the difference of.
SLOW = 1e-11

# The columns of `function`, in their order.
COLUMNS = ("g", "g_t", "gamma", "has_gradient", "speeds", "noise", "nearness", "slow", "lowest", "pull")
# Numbers of a run: rtol, span, size and speed.
CHOSEN = 4


def order(pattern: ca.Sparsity) -> npt.NDArray[np.intp]:
    """The order in which a function gives its numbers for rows of this pattern: what belongs to one contact together,
    so that of thousands the numbers between are not all kept at once."""
    K, count = pattern.size1(), len(COLUMNS)
    rows = np.asarray(pattern.row(), dtype=np.intp)
    contact = np.concatenate([np.tile(np.arange(K), count), rows, [K, K]])
    return np.argsort(contact, kind="stable")


def function(parts: Parts) -> ca.Function:
    """contact_values(t, q, v, p, chosen) -> the `COLUMNS` (K,) one after the other, the entries of G, size and speed,
    all of them in the `order` of contacts.

    chosen (4,): rtol; the length of the step that is looked at; the size of the motion and its speed so far, which
    are none the smaller here. A contact without a gradient at the place has rates of 0.

    g_t, gamma, speeds: dg/dt = G v + g_t, d2g/dt2 = G a - gamma. noise: rounding of g: of its terms and the way of a
    step, of the size of the motion, and of the time. nearness: gaps of contacts that are closed as far as a run can
    tell, within its tolerance. slow: speeds that are none: rounding, or what rises no higher than rounding under the
    forces. lowest: heights of rebounds that are not followed. pull: the largest accelerations in this motion.
    """
    contacts, n = parts.contacts, parts.v.numel()
    q, v, t = parts.y[:n], parts.v, parts.t
    chosen = ca.SX.sym("chosen", CHOSEN)
    rtol, span, least_size, least_speed = ca.vertsplit(chosen)
    G = contacts.G
    rows = np.asarray(G.sparsity().row(), dtype=np.int64).tolist()
    g, g_t, gamma = (ca.densify(x) for x in (contacts.g, contacts.g_t, contacts.gamma))
    total = ca.densify(ca.sum2(G)) + g_t + gamma
    has = ca.fabs(total) <= LARGEST
    entries = ca.if_else(ca.vec(has[rows]), ca.vec(G.nz[:]), 0) if rows else ca.SX(0, 1)
    G = ca.SX(G.sparsity(), entries)
    g_t, gamma = (ca.if_else(has, x, 0) for x in (g_t, gamma))
    own = shared.sizes(parts, v, parts.h, parts.M)
    speed = ca.fmax(own.v, least_speed)
    size = ca.fmax(own.q + span * ca.fmax(speed, span * own.a), least_size)

    def largest(x: ca.SX) -> ca.SX:
        return ca.densify(ca.fabs(G) @ ca.fabs(x))

    in_units = largest(own.units)
    extent, terms = in_units * size, largest(v) + ca.fabs(g_t)
    speeds = ca.densify(G @ v) + g_t
    local = largest(q) + ca.fabs(g) + span * terms
    noise = EPS * (ca.fmax(ROUNDINGS * local, FEW * extent) + 4 * ca.fabs(t) * terms)
    nearness = ca.fmax(4 * noise, TOGETHER * rtol * (extent + ca.fabs(g)))
    pull = in_units * own.a + ca.fabs(gamma)
    slow = ca.fmax(SLOW * in_units * speed, ca.sqrt(2 * pull * UNSEEN * noise))
    columns = [g, g_t, gamma, has, speeds, noise, nearness, slow, RESOLVED * EPS * extent, pull]
    packed = ca.densify(ca.vertcat(*columns, entries, size, speed))[order(G.sparsity()).tolist()]
    return ca.Function("contact_values", [t, q, v, parts.p, chosen], [packed], {"cse": parts.is_small})
