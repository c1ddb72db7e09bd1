"""The functions that are watched along a step: gaps of open contacts, multipliers of closed ones, declared events."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np

from lagcli.arrays import Floats, Indices
from lagcli.compiled import NumericSystem, contact_kinds
from lagcli.compiled.column_program import BoundColumns, ColumnProgram
from lagcli.contact import zero_bounds, zero_search
from lagcli.equations.system import System
from lagcli.simulation.scheme import step_end
from lagcli.simulation.scheme.method import WRITTEN_OUT, Method
from lagcli.simulation.scheme.step_end import Compiled
from lagcli.smoothness.sized_function import SizedFunction

LARGEST = float(np.finfo(float).max)
# The hull of a step is made wider by this part of itself on all sides.
WIDER = 1 / 16
# Points in a step at which the watched functions are looked at before its dense output is made; those within are no
# fractions of a period.
NODES = (0, (3 - math.sqrt(5)) / 2, math.sqrt(1 / 2), 1)
DIRECTIONS = {"up": zero_search.UP, "down": zero_search.DOWN, "both": zero_search.BOTH}


class WatchFunctions:
    """Functions w (W,) in this order: of `contacts` g where they are open, lambda of those that are closed, -load of
    those that lie idle; `when` of the events. The functions are of one set of closed contacts, or of all sets of which
    switches choose."""

    def __init__(self, numeric: NumericSystem, method: Method, system: System) -> None:
        C, K = len(system.rows.rows), system.contacts.count
        self._numeric, self._method, self._system = numeric, method, system
        self._closed = [i - C for i in numeric.closed_rows]
        self._idle = [i - C for i in numeric.selection.idle_rows]
        self._open = sorted(set(range(K)) - {*self._closed, *self._idle})
        self._has_switches = numeric.switches.size > 0
        order = range(K) if self._has_switches else [*self._open, *self._closed, *self._idle]
        self.contacts = np.array(order, dtype=np.intp)
        self._first = C
        self._events = numeric.event_values.numel_out(0)

    @cached_property
    def kinds(self) -> WatchKinds:
        """See `WatchKinds`."""
        return WatchKinds(self._system, self.contacts)

    @cached_property
    def watched(self) -> Compiled:
        """watched(t, y, p) -> w (W,)."""
        t, y, p = step_end.symbols(self._numeric, "t y p")
        own = p[: self._numeric.gaps.size1_in(2)]
        values = [self._numeric.gaps(t, y, own)[self._open]] if self._open else []
        if self._closed or self._events:
            rate, lam = self._numeric.solved(t, y, p)
            values += [lam[[self._first + j for j in self._closed]]] if self._closed else []
            values += [-self._numeric.loads(t, y, own, lam)] if self._idle else []
            if self._has_switches:
                gaps = self._numeric.gaps(t, y, own)
                values = [ca.if_else(p[own.numel() :], lam[self._first :], gaps)]
            values += [self._numeric.event_values(t, y, rate, lam, own)] if self._events else []
        return SizedFunction("watched", [t, y, p], [ca.densify(ca.vertcat(*values))])

    @cached_property
    def moving(self) -> Compiled:
        """moving(t, y, y', p) -> w and dw/dt, (W,) each, of a curve through y at t."""
        t, y, p, rate = step_end.symbols(self._numeric, "t y p rate")
        tau = ca.MX.sym("tau")
        w = self.watched(t + tau, y + tau * rate, p)
        slope = ca.densify(ca.substitute(ca.jtimes(w, tau, ca.MX(1)), tau, ca.MX(0)))
        return SizedFunction("moving", [t, y, rate, p], [self.watched(t, y, p), slope])

    @cached_property
    def inside(self) -> Compiled:
        """inside(t, h, x, y, coefficients, p) -> w and dw/dx, (W,) each, at the fraction x of a step from y at t. A gap
        may have no slope at a point, as a distance that is 0 there: what it does beside it counts, and it is 0."""
        t, h, x, y, p = step_end.symbols(self._numeric, "t h x y p")
        coefficients = ca.MX.sym("c", y.numel(), self._method.dense_rows)
        w = self.watched(t + x * h, self._method.interpolated(y, coefficients, x), p)
        slope = ca.densify(ca.jtimes(w, x, ca.MX(1)))
        slope = ca.if_else(ca.fabs(slope) <= LARGEST, slope, 0)
        outputs = [ca.densify(w), slope]
        return self._written_out(SizedFunction("inside", [t, h, x, y, coefficients, p], outputs))

    @cached_property
    def gaps_inside(self) -> GapsInside | None:
        """See `GapsInside`, where the functions are many gaps and no others."""
        if self.hull is None or len(self._open) <= contact_kinds.PARAMETERS.many:
            return None
        found = GapsInside(self._numeric, self._method)
        return found if found.is_whole else None

    @cached_property
    def hull(self) -> Compiled | None:
        """hull(t, h, y, k, new, k_new, p) -> the smallest of numbers (W,), each above 0 where a gap has no zero within
        the step, and those numbers. The quintic curve of `screen` lies in the hull of its control points, which is made
        wider by a part of itself; none of the gaps, by interval arithmetic, is zero there. None where more than gaps is
        watched."""
        if self._closed or self._events or not self._open:
            return None
        n = self._numeric.n
        t, h, p = ca.SX.sym("t"), ca.SX.sym("h"), ca.SX.sym("p", self._numeric.rhs.size1_in(2))
        y, k, new, k_new = (ca.SX.sym(name, 2 * n + 1) for name in ("y", "k", "new", "k_new"))
        points = [y[:n], new[:n]]
        for state, rate, way in ((y, k, h), (new, k_new, -h)):
            q, v, a = state[:n], state[n : 2 * n], rate[n : 2 * n]
            points += [q + way / 5 * v, q + 2 * way / 5 * v + way * way / 20 * a]
        low, high = points[0], points[0]
        for point in points[1:]:
            low, high = ca.fmin(low, point), ca.fmax(high, point)
        wider = WIDER * (high - low)
        floors = self._numeric.gap_floors(t, t + h, low - wider, high + wider, p)
        return SizedFunction("hull", [t, h, y, k, new, k_new, p], [ca.vertcat(ca.mmin(floors), floors)])

    @cached_property
    def screen(self) -> Compiled:
        """screen(t, h, y, k, new, k_new, p) -> the smallest of numbers (W,), each above 0 where a watched function can
        have no zero within the step; the largest -g at its end; and those numbers.

        Each is looked at on the quintic curve q through q, v, a at both ends, at the `NODES`. Between two of them it is
        taken for the cubic of its values and slopes, whose control points bound it, less twice of what such cubics over
        two intervals are off at the node between, and no less than a part of how much they bend: a distance that turns
        round between two points may leave no more trace.
        """
        x, *arguments = step_end.symbols(self._numeric, "x t h y k new k_new p")
        t, h, y, k, new, k_new, p = arguments
        w = self.watched(t + x * h, _quintic(x, h, (y, k), (new, k_new)), p)
        at = SizedFunction("node", [x, *arguments], [w, ca.jtimes(w, x, ca.MX(1))])
        values, slopes = zip(*(at(node, *arguments) for node in NODES), strict=True)
        # Contacts that are on the wrong side are no clear ones; an event may begin on either side.
        contacts = self.contacts.size
        side = ca.MX.ones(contacts, 1)
        if self._events:
            side = ca.vertcat(side, ca.sign(values[0][contacts:]))
        misfits, lowest, bends = [], [], []
        for i in range(1, len(NODES) - 1):
            # The cubic through values and slopes at the nodes on either side.
            d = NODES[i + 1] - NODES[i - 1]
            u = (NODES[i] - NODES[i - 1]) / d
            begin = (1 + 2 * u) * (1 - u) ** 2 * values[i - 1] + u * (1 - u) ** 2 * d * slopes[i - 1]
            cubic = begin + u * u * (3 - 2 * u) * values[i + 1] - u * u * (1 - u) * d * slopes[i + 1]
            misfits.append(ca.fabs(cubic - values[i]))
        for i in range(len(NODES) - 1):
            third = (NODES[i + 1] - NODES[i]) / 3
            inner, outer = values[i] + third * slopes[i], values[i + 1] - third * slopes[i + 1]
            ends = ca.fmin(side * values[i], side * values[i + 1])
            lowest.append(ca.fmin(ends, ca.fmin(side * inner, side * outer)))
            # As `zero_bounds.bend`.
            first, second = values[i] - 2 * inner + outer, inner - 2 * outer + values[i + 1]
            bends.append(ca.fmax(ca.fabs(first), ca.fabs(second)))
        wary = zero_bounds.PARAMETERS.wary * functools.reduce(ca.fmax, bends)
        clear = functools.reduce(ca.fmin, lowest) - ca.fmax(2 * ca.fmax(*misfits), wary)
        gaps = self._numeric.gaps(t + h, new, p[: self._numeric.gaps.size1_in(2)])
        deepest = ca.mmax(-gaps) if gaps.numel() else ca.MX(0)
        screen = SizedFunction("screen", arguments, [ca.densify(ca.vertcat(ca.mmin(clear), deepest, clear))])
        return self._written_out(screen)

    @cached_property
    def clear(self) -> Compiled:
        """clear(t, h, y, k, new, k_new, p) -> a number above 0 where no function has a zero within the step, and the
        largest -g at its end, which is 0 where only gaps above 0 are watched."""
        function = self.hull or self.screen
        inputs = function.mx_in()
        numbers = function(*inputs)
        return SizedFunction("clear", inputs, [ca.vertcat(numbers[0], 0.0 if self.hull else numbers[1])])

    def _written_out(self, function: Compiled) -> Compiled:
        """A function as one graph, which costs a fraction, where it only asks for gaps and is no large one."""
        if self._closed or self._events or self._numeric.gaps.n_instructions() > WRITTEN_OUT:
            return function
        return SizedFunction(function.expand())


# (t, h, q, dq/dx) -> gaps and dg/dx, (k,) each.
GapValues = Callable[[float, float, Floats, Floats], tuple[Floats, Floats]]


class GapsInside:
    """Some of many gaps in a step, by programs of the kinds of contacts; is_whole: there are such programs."""

    def __init__(self, numeric: NumericSystem, method: Method) -> None:
        self._numeric, self._method = numeric, method
        self._kinds = numeric.contact_kinds
        self._t, self._h, self._p = (
            np.zeros((1, 1)),
            np.zeros((1, 1)),
            np.zeros((numeric.gaps.size1_in(2), 1)),
        )
        # Programs of each kind by the number of contacts that they have room for.
        self._bound: dict[tuple[int, int], tuple[Floats, Floats, BoundColumns]] = {}
        self._programs = [ColumnProgram(function) for function in numeric.moving_gaps]
        self.is_whole = all(program.is_whole for program in self._programs)
        count = sum(kind.members.size for kind in self._kinds)
        # The kind of each contact, and its number among those of the kind.
        self._kind, self._member = np.zeros((2, count), dtype=np.intp)
        for number, kind in enumerate(self._kinds):
            self._kind[kind.members], self._member[kind.members] = number, np.arange(kind.members.size)

    @cached_property
    def path(self) -> Compiled:
        """path(x, y, coefficients) -> q and dq/dx (n,) at the fraction x of a step from y."""
        x, y = step_end.symbols(self._numeric, "x y")
        coefficients = ca.MX.sym("c", y.numel(), self._method.dense_rows)
        q = self._method.interpolated(y, coefficients, x)[: self._numeric.n]
        return SizedFunction("path", [x, y, coefficients], [q, ca.jtimes(q, x, ca.MX(1))])

    def _program(self, number: int, count: int) -> tuple[Floats, Floats, BoundColumns]:
        """q and dq/dx, and the program of a kind with room for so many contacts."""
        room = 1 << (count - 1).bit_length()
        if (number, room) not in self._bound:
            q, rate = np.zeros((2, self._kinds[number].coordinates.shape[1], room))
            program = self._programs[number].bound([self._t, q, self._p, self._h, rate], (0, 1))
            self._bound[number, room] = q, rate, program
        return self._bound[number, room]

    def of(self, contacts: Indices, p: Floats) -> GapValues:
        """The gaps of some contacts, as `WatchFunctions.inside`, in memory that the next call overwrites."""
        self._p[:, 0] = p[: self._p.size]
        t, h, parts = self._t, self._h, []
        for number, kind in enumerate(self._kinds):
            at = np.flatnonzero(self._kind[contacts] == number)
            if not at.size:
                continue
            places = np.ascontiguousarray(kind.coordinates[self._member[contacts[at]]].T)
            q, rate, program = self._program(number, at.size)
            parts.append((at, places, q[:, : at.size], rate[:, : at.size], program))
        g, slope = np.zeros((2, contacts.size))

        def values(when: float, span: float, positions: Floats, rates: Floats) -> tuple[Floats, Floats]:
            t[:], h[:] = when, span
            for at, places, q, rate, program in parts:
                q[:], rate[:] = positions[places], rates[places]
                g[at], slope[at] = program.run()[:, : at.size]
            slope[~(np.abs(slope) <= LARGEST)] = 0.0
            return g, slope

        return values


def _quintic(x: ca.MX, h: ca.MX, begin: tuple[ca.MX, ca.MX], end: tuple[ca.MX, ca.MX]) -> ca.MX:
    """The state at the fraction x of a step from the states and their rates at its ends; W is 0."""
    (y, k), (new, k_new) = begin, end
    n = (y.numel() - 1) // 2
    q0, v0, a0 = y[:n], h * y[n : 2 * n], h * h * k[n : 2 * n]
    q1, v1, a1 = new[:n], h * new[n : 2 * n], h * h * k_new[n : 2 * n]
    # Of the rest beyond the parabola of the start: value, slope and curvature at the end.
    r, s, c = q1 - q0 - v0 - a0 / 2, v1 - v0 - a0, a1 - a0
    A, B, D = 10 * r - 4 * s + c / 2, -15 * r + 7 * s - c, 6 * r - 3 * s + c / 2
    q = q0 + x * (v0 + x * (a0 / 2 + x * (A + x * (B + x * D))))
    v = v0 + x * (a0 + x * (3 * A + x * (4 * B + x * 5 * D)))
    return ca.vertcat(q, v / h, ca.MX(1, 1))


class WatchKinds:
    """The kinds of the functions w (W,) of `WatchFunctions`, of contacts and of events. numbers (W,): of their rows,
    contacts from `first_contact` on, and of events after all rows, from `first_event` on; direction (W,): as
    `zero_search` takes it; is_event (W,); records (W,): events that do not end the run; names: of events, by their
    index in w."""

    def __init__(self, system: System, watched: Indices) -> None:
        C, events = len(system.rows.rows), system.model.events
        self.first_contact, self.first_event = C, C + system.contacts.count
        count = system.event_values.numel()
        self.has_events = count > 0
        contacts, of_events = (C + watched).tolist(), range(self.first_event, self.first_event + count)
        self.numbers = np.array([*contacts, *of_events], dtype=np.intp)
        self.is_event = self.numbers >= self.first_event
        self.direction = np.full(self.numbers.size, zero_search.DOWN)
        self.records = np.zeros(self.numbers.size, dtype=bool)
        self.names: dict[int, str] = {}
        for index, event in enumerate(events[:count], start=len(contacts)):
            self.direction[index] = DIRECTIONS[event.direction]
            self.records[index] = event.action == "record"
            self.names[index] = event.name
