"""The numbers asked of all contacts in one call: at an instant gaps, their rates, and what is zero among them; in a box
of states the numbers below which no gap is, by interval arithmetic written out as a function.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Indices
from lagcli.compiled import contact_kinds
from lagcli.compiled import parts as shared
from lagcli.compiled.contact_kinds import ContactKind, X, columns
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


class ContactValues:
    """contact_values(t, q, v, p, chosen) -> for each contact, kind by kind, the `COLUMNS` and the entries of its row of
    G; then the units (n,) of `parts.Sizes`, and `MotionNumbers`.

    chosen (6,): rtol; the length of the step that is looked at; size and speed of the motion so far; the time since the
    start; the time by which the point lies behind a switch at which it stands. A contact without a gradient has rates
    of 0.

    g_t, gamma, speeds: dg/dt = G v + g_t, d2g/dt2 = G a - gamma. noise: rounding of g. touching_gap: gaps of contacts
    that are closed within the tolerance of the run. slow: speeds that are none: rounding, what rises no higher than
    rounding under the forces, or what these make across a switch. lowest: heights of rebounds that are not followed.
    pull: the largest accelerations in this motion. blurred: the rounding of gamma.
    """

    def __init__(self, parts: Parts, kinds: Sequence[ContactKind]) -> None:
        self._parts, self.kinds = parts, kinds

    @cached_property
    def order(self) -> npt.NDArray[np.intp]:
        """The places of the numbers in the function: of the columns (K,) one after the other, of the entries of G, and
        of the numbers of the motion."""
        count, n = len(COLUMNS), self._parts.v.numel()
        contacts, G = self._parts.contacts.count, self._parts.contacts.G.nnz()
        found = np.arange(count * contacts + G + n + len(MotionNumbers._fields))
        first = 0
        for kind in self.kinds:
            width = count + kind.at.size
            places = first + np.arange(kind.members.size * width).reshape(kind.members.size, width)
            for column in range(count):
                found[column * contacts + kind.members] = places[:, column]
            found[count * contacts + kind.entries] = places[:, count:]
            first += places.size
        return found

    @cached_property
    def function(self) -> ca.Function:
        """See above."""
        parts = self._parts
        q = parts.y[: parts.v.numel()]
        inputs = [parts.t, q, parts.v, parts.p, ca.SX.sym("chosen", CHOSEN)]

        def packed(inputs: Sequence[X]) -> X:
            t, q, v, p, chosen = inputs
            units, *numbers = self.motion(t, q, v, p, chosen)
            motion = ca.vertcat(*numbers)

            def arguments(at: Indices) -> list[X]:
                return [t, columns(q, at), columns(v, at), p, chosen, columns(units, at), motion]

            found = contact_kinds.of_each(self.kinds, self.of_kinds, arguments)
            return ca.densify(ca.vertcat(*found, units, motion[: len(MotionNumbers._fields)]))

        return contact_kinds.joined("contact_values", inputs, packed, parts)

    @cached_property
    def motion(self) -> ca.Function:
        """motion(t, q, v, p, chosen) -> the units (n,), `MotionNumbers` one by one, and the accelerations that the
        forces have to a unit of rounding."""
        parts = self._parts
        q, v, t = parts.y[: parts.v.numel()], parts.v, parts.t
        chosen = ca.SX.sym("chosen", CHOSEN)
        _, span, least_size, least_speed, _, _ = ca.vertsplit(chosen)
        own = shared.sizes(parts, v, parts.h, parts.M)
        load_off = operation_rules.roundings(ca.densify(parts.h), [t, q, v, parts.p])
        forces_off = shared.sizes(parts, v, load_off, parts.M).a
        speed = ca.fmax(own.v, least_speed)
        size = ca.fmax(own.q + span * ca.fmax(speed, span * own.a), least_size)
        outputs = [own.units, own.a, ROUNDINGS * doubles.EPS * forces_off, size, speed, forces_off]
        return SizedFunction("motion", [t, q, v, parts.p, chosen], list(map(ca.densify, outputs)))

    @cached_property
    def of_kinds(self) -> list[ca.Function]:
        """Of each kind (t, q, v, p, chosen, units, motion) -> the numbers of one contact, of its coordinates alone;
        motion (5,): the numbers of `motion`."""
        return [self._of_kind(kind) for kind in self.kinds]

    def _of_kind(self, kind: ContactKind) -> ca.Function:
        parts = self._parts
        contacts, t = parts.contacts, parts.t
        j, coordinates, entries = (
            each[0].tolist() for each in (kind.members, kind.coordinates, kind.entries)
        )
        q, v = parts.y[coordinates], parts.v[coordinates]
        chosen, units = ca.SX.sym("chosen", CHOSEN), ca.SX.sym("units", len(coordinates))
        motion = ca.SX.sym("motion", len(MotionNumbers._fields) + 1)
        rtol, span, _, _, since, across = ca.vertsplit(chosen)
        acceleration, _, size, speed, forces_off = ca.vertsplit(motion)
        g, g_t, gamma = (ca.densify(x)[j] for x in (contacts.g, contacts.g_t, contacts.gamma))
        pattern = ca.Sparsity.triplet(1, len(coordinates), [0] * len(entries), kind.at.tolist())
        G = ca.SX(pattern, ca.vec(contacts.G.nz[entries])) if entries else ca.SX(pattern)
        has = ca.fabs(ca.densify(ca.sum2(G)) + g_t + gamma) <= LARGEST
        values = ca.if_else(has, ca.vec(G.nz[:]), 0) if entries else ca.SX(0, 1)
        G = ca.SX(pattern, values)
        off = operation_rules.roundings(ca.vertcat(g, g_t, gamma), [t, q, v, parts.p])
        g_off, g_t_off, gamma_off = (ca.if_else(has, x, 0) for x in ca.vertsplit(off))
        g_t, gamma = (ca.if_else(has, x, 0) for x in (g_t, gamma))

        def largest(x: ca.SX) -> ca.SX:
            return ca.densify(ca.fabs(G) @ ca.fabs(x))

        in_units = largest(units)
        extent, terms = in_units * size, largest(v) + ca.fabs(g_t)
        speeds = ca.densify(G @ v) + g_t
        local = largest(q) + ca.fabs(g) + span * terms
        # All that forces have made so far, where they are the rounding of terms that cancel.
        is_rounding = ROUNDINGS * acceleration <= forces_off
        made = ca.if_else(is_rounding, in_units * forces_off * (since + span) ** 2, 0)
        # A gap is a sum of its coordinates, or of terms that cancel, whose roundings are counted.
        noise = doubles.EPS * ca.fmax(ca.fmax(ROUNDINGS * local, g_off), FEW * (extent + made))
        noise += ca.fmax(FEW * doubles.EPS * ca.fabs(t), across) * terms
        # Contacts that are the tolerance of the run away from closed belong to the same instant.
        touching_gap = ca.fmax(4 * noise, rtol * (extent + ca.fabs(g)))
        pull = in_units * acceleration + ca.fabs(gamma)
        slow = ca.fmax(SLOW * in_units * speed, ca.sqrt(2 * pull * FEW * noise))
        slow = ca.fmax(slow, ca.fmax(ROUNDINGS * doubles.EPS * g_t_off, FEW * across * pull))
        blurred = ROUNDINGS * doubles.EPS * gamma_off
        lowest = RESOLVED * doubles.EPS * extent
        numbers = [g, g_t, gamma, has, speeds, noise, touching_gap, slow, lowest, pull, blurred]
        inputs = [t, q, v, parts.p, chosen, units, motion]
        packed = ca.densify(ca.vertcat(*numbers, values))
        return SizedFunction("of_contact", inputs, [packed], {"cse": True})


def moving(parts: Parts, kind: ContactKind) -> ca.Function:
    """moving(t, q, p, dt, dq) -> g of one contact of a kind and its change along (dt, dq), of its coordinates alone."""
    j, coordinates = int(kind.members[0]), kind.coordinates[0].tolist()
    at, p = ca.vertcat(parts.t, parts.y[coordinates]), parts.p
    along, g = ca.SX.sym("along", at.numel()), ca.densify(parts.contacts.g[j])
    outputs = ca.densify(ca.vertcat(g, ca.jtimes(g, at, along)))
    return SizedFunction("moving", [at[0], at[1:], p, along[0], along[1:]], [outputs], {"cse": True})


def floors(parts: Parts, kinds: Sequence[ContactKind]) -> ca.Function:
    """floors(t_low, t_high, q_low, q_high, p) -> (K,); where nothing is known, far below zero."""
    n = parts.v.numel()
    inputs = [
        ca.SX.sym(name, count)
        for name, count in (
            *(("t_low", 1), ("t_high", 1)),
            *(("q_low", n), ("q_high", n), ("p", parts.p.numel())),
        )
    ]
    of_kinds = [_floor(parts, kind) for kind in kinds]
    every = np.concatenate([kind.members for kind in kinds]) if kinds else np.zeros(0, dtype=np.intp)

    def of_all(inputs: Sequence[X]) -> X:
        t_low, t_high, low, high, p = inputs

        def arguments(at: Indices) -> list[X]:
            return [t_low, t_high, columns(low, at), columns(high, at), p]

        found = contact_kinds.of_each(kinds, of_kinds, arguments)
        both: X = ca.vertcat(low[:0], *found)
        return both[np.argsort(every).tolist()]

    return contact_kinds.joined("floors", inputs, of_all, parts)


def _floor(parts: Parts, kind: ContactKind) -> ca.Function:
    """As `floors`, of one contact of a kind, of its coordinates alone."""
    j, coordinates = int(kind.members[0]), kind.coordinates[0].tolist()
    t_low, t_high, n = ca.SX.sym("t_low"), ca.SX.sym("t_high"), len(coordinates)
    low, high, p = ca.SX.sym("q_low", n), ca.SX.sym("q_high", n), ca.SX.sym("p", parts.p.numel())
    below, above = (ca.vertsplit(ca.vertcat(*each)) for each in ((t_low, low, p), (t_high, high, p)))
    given: list[Ends] = list(zip(below, above, strict=True))

    own = ca.vertsplit(ca.vertcat(parts.t, parts.y[coordinates], parts.p))
    graph, names = _GraphIntervals(), operation_graph.names()

    def leaf(number: int | None, constant: float) -> Ends:
        return (ca.SX(constant),) * 2 if number is None else given[number]

    def look(op: int, operands: list[Ends], _: operation_graph.Expression) -> Ends:
        return graph.result(names[op], *operands)

    ((found, _),) = operation_graph.folded(parts.contacts.g[j], own, leaf, look)
    inputs = [t_low, t_high, low, high, p]
    return SizedFunction("floor", inputs, [ca.densify(found)], {"cse": True})


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
