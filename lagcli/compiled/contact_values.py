"""The numbers asked of all contacts in one call: at an instant gaps, their rates, and what is zero among them; in a box
of states the numbers below which no gap is, by interval arithmetic written out as a function.
"""

from __future__ import annotations

import functools
import operator
from typing import NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import parts as shared
from lagcli.compiled.parts import Parts
from lagcli.equations import operation_rules
from lagcli.expression import functions
from lagcli.expression.intervals import Ends, Intervals
from lagcli.smoothness import operation_graph
from lagcli.smoothness.sized_function import SizedFunction

LARGEST = float(np.finfo(float).max)
# The gap of a contact is known to so many roundings of its terms, and to a few of the size of the motion; speeds that
# rise no higher than a few times that are none.
ROUNDINGS, FEW = 32.0, 4.0
# A rebound that rises no higher than so many roundings of the size of the motion is not followed.
RESOLVED = 512.0
# A speed of a gap is none where it is this part of those that it is the difference of.
SLOW = 1e-11


# The columns of `function`, in their order.
COLUMNS = (
    "g", "g_t", "gamma", "has_gradient", "speeds", "noise", "touching_gap", "slow", "lowest", "pull", "blurred"
)  # fmt: skip
# Numbers of a run: rtol, span, size, speed, since and across.
CHOSEN = 6


class MotionNumbers(NamedTuple):
    """The end of `function`: the largest acceleration, that which is rounding of the forces, size and speed."""

    acceleration: float
    forces_blurred: float
    size: float
    speed: float


def order(pattern: ca.Sparsity) -> npt.NDArray[np.intp]:
    """The order in which a function gives its numbers for rows of this pattern: what belongs to one contact together,
    so that of thousands the numbers between are not all kept at once."""
    K, count = pattern.size1(), len(COLUMNS)
    rows = np.asarray(pattern.row(), dtype=np.intp)
    contact = np.concatenate(
        [np.tile(np.arange(K), count), rows, np.full(len(MotionNumbers._fields) + pattern.size2(), K)]
    )
    return np.argsort(contact, kind="stable")


def function(parts: Parts) -> ca.Function:
    """contact_values(t, q, v, p, chosen) -> the `COLUMNS` (K,) one after the other, the entries of G, the units (n,) of
    `parts.Sizes`, and `MotionNumbers`, all of them in the `order` of contacts.

    chosen (6,): rtol; the length of the step that is looked at; size and speed of the motion so far; the time since the
    start; the time by which the point lies behind a switch at which it stands. A contact without a gradient has rates
    of 0.

    g_t, gamma, speeds: dg/dt = G v + g_t, d2g/dt2 = G a - gamma. noise: rounding of g. touching_gap: gaps of contacts
    that are closed within the tolerance of the run. slow: speeds that are none: rounding, what rises no higher than
    rounding under the forces, or what these make across a switch. lowest: heights of rebounds that are not followed.
    pull: the largest accelerations in this motion. blurred: the rounding of gamma.
    """
    contacts, n = parts.contacts, parts.v.numel()
    q, v, t = parts.y[:n], parts.v, parts.t
    chosen = ca.SX.sym("chosen", CHOSEN)
    rtol, span, least_size, least_speed, since, across = ca.vertsplit(chosen)
    G = contacts.G
    rows = np.asarray(G.sparsity().row(), dtype=np.int64).tolist()
    g, g_t, gamma = (ca.densify(x) for x in (contacts.g, contacts.g_t, contacts.gamma))
    total = ca.densify(ca.sum2(G)) + g_t + gamma
    has = ca.fabs(total) <= LARGEST
    entries = ca.if_else(ca.vec(has[rows]), ca.vec(G.nz[:]), 0) if rows else ca.SX(0, 1)
    G = ca.SX(G.sparsity(), entries)
    K, values = g.numel(), ca.vertcat(g, g_t, gamma, ca.densify(parts.h))
    off = operation_rules.roundings(values, [t, q, v, parts.p])
    # Where there are no contacts, as with events alone, these are columns too: a slice would be a row.
    *contact_offs, load_off = ca.vertsplit(off, [0, K, 2 * K, 3 * K, off.numel()])
    g_off, g_t_off, gamma_off = (ca.if_else(has, x, 0) for x in contact_offs)
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
    forces_off = shared.sizes(parts, v, load_off, parts.M).a
    # All that forces have made so far, where they are the rounding of terms that cancel.
    made = ca.if_else(ROUNDINGS * own.a <= forces_off, in_units * forces_off * (since + span) ** 2, 0)
    # A gap is a sum of its coordinates, or of terms that cancel, whose roundings are counted.
    noise = doubles.EPS * ca.fmax(ca.fmax(ROUNDINGS * local, g_off), FEW * (extent + made))
    noise += ca.fmax(FEW * doubles.EPS * ca.fabs(t), across) * terms
    # Contacts that are the tolerance of the run away from closed belong to the same instant.
    touching_gap = ca.fmax(4 * noise, rtol * (extent + ca.fabs(g)))
    pull = in_units * own.a + ca.fabs(gamma)
    slow = ca.fmax(SLOW * in_units * speed, ca.sqrt(2 * pull * FEW * noise))
    slow = ca.fmax(slow, ca.fmax(ROUNDINGS * doubles.EPS * g_t_off, FEW * across * pull))
    blurred = ROUNDINGS * doubles.EPS * gamma_off
    lowest = RESOLVED * doubles.EPS * extent
    columns = [g, g_t, gamma, has, speeds, noise, touching_gap, slow, lowest, pull, blurred]
    of_motion = own.a, ROUNDINGS * doubles.EPS * forces_off, size, speed
    packed = ca.densify(ca.vertcat(*columns, entries, own.units, *of_motion))[order(G.sparsity()).tolist()]
    return SizedFunction("contact_values", [t, q, v, parts.p, chosen], [packed], {"cse": parts.is_small})


def floors(parts: Parts) -> ca.Function:
    """floors(t_low, t_high, q_low, q_high, p) -> (K,); where nothing is known, far below zero."""
    n = parts.v.numel()
    t_low, t_high = ca.SX.sym("t_low"), ca.SX.sym("t_high")
    low, high, p = ca.SX.sym("q_low", n), ca.SX.sym("q_high", n), ca.SX.sym("p", parts.p.numel())
    below, above = (ca.vertsplit(ca.vertcat(*each)) for each in ((t_low, low, p), (t_high, high, p)))
    given: list[Ends] = list(zip(below, above, strict=True))

    own = ca.vertsplit(ca.vertcat(parts.t, parts.y[:n], parts.p))
    graph, names = _GraphIntervals(), operation_graph.names()

    def leaf(number: int | None, constant: float) -> Ends:
        return (ca.SX(constant),) * 2 if number is None else given[number]

    def look(op: int, operands: list[Ends], _: operation_graph.Expression) -> Ends:
        return graph.result(names[op], *operands)

    found = (low for low, _ in operation_graph.folded(parts.contacts.g, own, leaf, look))
    return SizedFunction("floors", [t_low, t_high, low, high, p], [ca.vertcat(ca.SX(0, 1), *found)])


class _GraphIntervals(Intervals):
    """The arithmetic of ranges of expressions. Roundings of gaps are counted where they are compared."""

    # A bound that says nothing, as the product of four of them does: zero times infinity is no number.
    most = 2.0**255
    least = staticmethod(lambda *numbers: functools.reduce(ca.fmin, numbers))
    largest = staticmethod(lambda *numbers: functools.reduce(ca.fmax, numbers))
    where, both = staticmethod(ca.if_else), staticmethod(ca.logic_and)
    times, power = staticmethod(operator.mul), staticmethod(operator.pow)

    def told(self, low: ca.SX, high: ca.SX) -> Ends:
        return ca.SX(low), ca.SX(high)

    def wide(self, low: ca.SX, high: ca.SX) -> Ends:
        return low, high

    def call(self, row: functions.Function, *x: ca.SX) -> ca.SX:
        made: ca.SX = functions.meaning(ca, row.casadi or row.operation, row.name)(*x)
        return made

    def number(self, a: Ends) -> float | None:
        return float(a[0]) if a[0].is_constant() and _is_one(a) else None

    def multiply(self, a: Ends, b: Ends) -> Ends:
        if a is b:
            low, high = self.result("fabs", a)
            return low * low, high * high
        if _is_one(b):
            a, b = b, a
        if _is_one(a):
            x, y = a[0] * b[0], a[0] * b[1]
            return ca.fmin(x, y), ca.fmax(x, y)
        return super().multiply(a, b)

    def divide(self, a: Ends, b: Ends) -> Ends:
        # A divisor that may be zero leaves bounds that say nothing.
        apart = b[0] * b[1] > 0
        return self.multiply(
            a, (ca.if_else(apart, 1 / b[1], -self.most), ca.if_else(apart, 1 / b[0], self.most))
        )

    def wave(self, row: functions.Function, a: Ends, crest: float) -> Ends:
        """No farther from its value in the middle than the argument is."""
        value, reach = self.call(row, (a[0] + a[1]) / 2), (a[1] - a[0]) / 2
        return ca.fmax(value - reach, -1), ca.fmin(value + reach, 1)


def _is_one(a: Ends) -> bool:
    """True for one number in place of a range."""
    return bool(ca.is_equal(a[0], a[1]))
