"""The equations of a point of rest, or of a stationary point (D.25): in CasADi symbols, and at numbers.

    F + B^T lambda + G^T lambda_g = 0,   c = 0,   g >= 0

Rest: F is h of (D.24) without velocities, inertial terms of x(q, t) and L(q, 0) included; c are the holonomic rows,
the levels of integrals, and the parts of rows that move without velocities. Stationary: F = -grad f.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import program
from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.program import Program
from lagcli.equations.level_functions import LevelExpression
from lagcli.equations.power_series import SeriesFunction
from lagcli.equations.system import System
from lagcli.linear import decompositions
from lagcli.smoothness.sized_function import SizedFunction

# By how much results grow of operations that are linear, for each operand; and functions without which nothing is
# periodic.
LINEAR = {"add": (1, 1), "sub": (1, -1), "neg": (-1,), "twice": (2,), "assign": (1,)}
WAVES = frozenset(("sin", "cos", "tan"))
# Of more unknowns starts aside wait, no known point is taken out and higher derivatives are not looked at: it costs too
# much. Of more than the second algebra is sparse.
LARGE = 60
DENSE = 2 * LARGE


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class StaticLaws:
    """Expressions of t, q (n,) and p: F (n,), B (C, n), c (k,), g (K,), G (K, n), and the function that is stationary.

    value: f, or the effective potential where the forces have one by their declaration; driving (n,): the rest of
    F, what is declared without a potential; sides: positive on the leaves through the start
    (`EnforcedLevel.side`); path: of the model.
    """

    t: ca.SX
    q: ca.SX
    p: ca.SX
    F: ca.SX
    B: ca.SX
    c: ca.SX
    g: ca.SX
    G: ca.SX
    value: ca.SX
    driving: ca.SX
    sides: ca.SX
    path: str


@dataclasses.dataclass(frozen=True, slots=True)
class EnforcedLevel:
    """The level of a first integral through a start: its chart with above and below there."""

    chart: LevelExpression
    above: float
    below: float

    @property
    def expression(self) -> ca.SX:
        """Zero on the level; of a chart with a period less its whole periods."""
        chart = self.chart
        if chart.period is None:
            return chart.above * self.below - chart.below * self.above
        turned = chart.above - self.above
        return turned - chart.period * ca.floor(turned / chart.period + 0.5)

    @property
    def side(self) -> ca.SX:
        """Positive as far as the chart above/below is regular from the start on: where above and below are both zero
        a level passes on to another leaf (y dx - x dy = 0 has rays as leaves, lines through 0 as levels)."""
        below, above = self.chart.below, self.chart.above
        if self.chart.period is not None or (below.is_constant() and above.is_constant()):
            return ca.SX(1)
        return below * self.below + above * self.above


def laws(system: System, levels: Sequence[EnforcedLevel], f: ca.SX | None = None) -> StaticLaws:
    """The equations of a point of rest, where q' = q'' = 0 satisfies (D.24); or of a stationary point of f(q) on
    holonomic surfaces and levels, whose rows come last in B."""
    symbols, rows, contacts = system.symbols, system.rows, system.contacts
    q, v, further = symbols.q, symbols.v, [level.expression for level in levels]
    if f is None:
        parts = (ca.SX(part) for part in (system.dynamics.h, system.dynamics.rest))
        F, value = (ca.substitute(part, v, ca.SX.zeros(v.shape)) for part in parts)
        B, driving = rows.B, ca.densify(F + ca.gradient(value, q))
        further += [rows.b[i] for i in range(rows.b.numel()) if not rows.b[i].is_zero()]
    else:
        F, value, driving = -ca.gradient(f, q), f, ca.SX.zeros(q.numel())
        B = ca.vertcat(rows.B[: system.holonomic_count, :], ca.jacobian(_column(further), q))
    sides = [side for side in (level.side for level in levels) if not side.is_constant()]
    conditions, g = _column([system.f, *further]), ca.densify(contacts.g)
    given = (
        symbols.t,
        q,
        system.p,
        ca.densify(F),
        B,
        conditions,
        g,
        contacts.G,
        value,
        driving,
        _column(sides),
    )
    return StaticLaws(*given, path=system.model.path)


def _column(parts: Sequence[ca.SX]) -> ca.SX:
    return ca.densify(ca.vertcat(*parts)) if parts else ca.SX(0, 1)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Values:
    """F (n,), B (C, n), c (k,), dc (k, n), g (K,), G (K, n), and K (n, n), the gradient of F + B^T lambda by q."""

    F: Floats
    B: Floats
    c: Floats
    dc: Floats
    g: Floats
    G: Floats
    K: Floats

    @property
    def finite(self) -> bool:
        """True if all that equality rows need is finite."""
        return all(bool(np.isfinite(part).all()) for part in (self.F, self.B, self.c, self.dc, self.K))

    def rows(self, closed: Sequence[int]) -> Floats:
        """B, then the gradients of closed contacts."""
        return np.vstack([self.B, self.G[list(closed)]])


class StaticProblem:
    """The values of one problem, with exact derivatives. n, C, K: coordinates, equality rows, contacts; `times`: those
    at which its equations are to hold, one where nothing depends on t; `later`: others, at which found points must."""

    def __init__(self, laws: StaticLaws, p: Floats, start: tuple[float, Floats], duration: float) -> None:
        self.laws, self.p = laws, p
        self.evaluations = 0  # so far: what a search may cost is counted, not timed
        self.n, self.C, self.K = laws.q.numel(), laws.B.shape[0], laws.g.numel()
        self.t, self.begin = start
        self._series: dict[tuple[int, ...], SeriesFunction] = {}
        self._precise: dict[tuple[int, ...], Program] = {}
        self.times: tuple[float, ...] = (self.t,)
        self.later: tuple[float, ...] = ()
        everything = _stacked([laws.F, laws.B, laws.c, laws.g, laws.G])
        if not ca.depends_on(everything, laws.t):
            return
        # Is it so at random points round the start?
        times = [self.t + part * (duration or 1.0) for part in decompositions.generic_parts(8)]
        function = SizedFunction("parts", [laws.t, laws.q, laws.p], [everything])
        random, is_steady = np.random.default_rng(0), True
        size = float(np.abs(self.begin).max(initial=0.0)) or 1.0
        for part in (0.0, 0.1, 1.0):
            q = self.begin + part * size * random.standard_normal(self.n)
            first, *others = (function(t, q, self.p).full() for t in (self.t, *times))
            for other in others:
                both = np.isfinite(first) & np.isfinite(other)
                least = doubles.VALUE * max(np.abs(first[both]).max(initial=0.0), doubles.TINY)
                is_steady &= not (np.abs(other - first)[both] > least).any()
        if not is_steady:
            # Every third together with the start; the others again when a point is found.
            self.times = (self.t, *times[3::3])
            self.later = tuple(t for t in times if t not in self.times)

    @cached_property
    def _bound(self) -> BoundFunction:
        """All values, on arrays of its own: to convert what it returns would take longer than to compute it."""
        laws = self.laws
        lam = ca.SX.sym("lam", self.C + self.K)
        K = ca.jacobian(self._acting(list(range(self.K)), lam), laws.q)
        outputs = [laws.F, laws.B, laws.c, ca.jacobian(laws.c, laws.q), laws.g, laws.G, K]
        inputs = [laws.t, laws.q, lam, laws.p]
        function = SizedFunction("statics", inputs, [ca.densify(o) for o in outputs])
        numbers = np.array(self.p, dtype=float).ravel()
        return BoundFunction(function, [np.zeros(1), np.zeros(self.n), np.zeros(self.C + self.K), numbers])

    @cached_property
    def _value(self) -> ca.Function:
        laws = self.laws
        outputs = [laws.value, laws.driving, ca.densify(ca.jacobian(laws.driving, laws.q)), laws.sides]
        return SizedFunction("value", [laws.t, laws.q, laws.p], outputs)

    def at(self, t: float, q: Floats, lam: Floats) -> Values:
        """All values; lam (C + K,)."""
        self.evaluations += 1
        bound = self._bound
        of_t, of_q, of_lam, _ = bound.arguments
        of_t[0], of_q[:], of_lam[:] = t, q, lam
        bound.trigger()
        n, k, laws = self.n, self.laws.c.numel(), self.laws
        shapes = ((n,), (self.C, n), (k,), (k, n), (self.K,), (self.K, n), (n, n))
        F, B, c, dc, g, G, K = (
            np.array(part.reshape(shape, order="F"))
            for part, shape in zip(bound.results, shapes, strict=True)
        )
        if self.K and not np.isfinite(K).all() and np.isfinite(G[lam[self.C :] != 0]).all():
            # The gradient of an open contact may have no value: K without those.
            closed = np.flatnonzero(lam[self.C :]).tolist()
            some = ca.SX.sym("lam", self.C + len(closed))
            gradient = ca.densify(ca.jacobian(self._acting(closed, some), laws.q))
            function = SizedFunction("K", [laws.t, laws.q, some, laws.p], [gradient])
            K = function(t, q, np.concatenate([lam[: self.C], lam[self.C :][closed]]), self.p).full()
        return Values(F, B, c, dc, g, G, K)

    def _acting(self, closed: list[int], lam: ca.SX) -> ca.SX:
        """F + B^T lambda with the lambda of all rows and of these contacts; CasADi has no product with nothing."""
        acting = self.laws.F
        if self.C:
            acting = acting + self.laws.B.T @ lam[: self.C]
        if closed:
            acting = acting + self.laws.G[closed, :].T @ lam[self.C :]
        return acting

    def value(self, q: Floats) -> float:
        """f, or the declared part of the effective potential, at the start time."""
        return float(self._value(self.t, q, self.p)[0])

    def driving(self, q: Floats) -> tuple[Floats, Floats]:
        """The forces at rest that the declared potential leaves, (n,), and their gradient (n, n)."""
        _, found, gradient, _ = self._value(self.t, q, self.p)
        return found.full().ravel(), gradient.full()

    def is_beyond(self, q: Floats) -> bool:
        """True if q is on another leaf of a level: beyond singular points, but for a part of the way to them."""
        if not self.laws.sides.numel():
            return False
        there, here = (self._value(self.t, each, self.p)[3].full() for each in (q, self.begin))
        return bool((there <= doubles.ZERO * here).any())

    def of_place(self, *parts: ca.SX) -> Program:
        """Expressions, column by column, as a function of q and of (t, p), as a list of operations."""
        inputs = [self.laws.q, ca.vertcat(self.laws.t, self.laws.p)]
        return program.written_out(SizedFunction("of_place", inputs, [_stacked(parts)]))

    @cached_property
    def value_program(self) -> Program:
        """The function, or the declared potential, as a function of q and of (t, p)."""
        return self.of_place(self.laws.value)

    def with_gradient(self, part: ca.SX) -> Program:
        """An expression (k,), then its gradient column by column (k, n), as a function of q and of (t, p)."""
        return self.of_place(part, ca.jacobian(part, self.laws.q))

    def exact_programs(self, closed: tuple[int, ...]) -> tuple[Program, Program]:
        """All equations with these contacts closed, and the other gaps with sides of leaves; of (q, lambda), (t, p)."""
        others = [k for k in range(self.K) if k not in closed]
        signs = [self.laws.g[others], self.laws.sides]
        return program.written_out(self._balance(closed)), program.written_out(self._balance(closed, signs))

    def precise_program(self, closed: tuple[int, ...]) -> Program:
        """Equations with these contacts closed (m,), then their gradient by columns (m, k); of (q, lambda), (t, p)."""
        if closed not in self._precise:
            f = self._balance(closed)
            x, numbers = (ca.SX.sym("x", f.size1_in(i)) for i in range(2))
            residual = f(x, numbers)
            both = _stacked([residual, ca.jacobian(residual, x)])
            self._precise[closed] = program.written_out(SizedFunction("precise", [x, numbers], [both]))
        return self._precise[closed]

    def balance_series(self, closed: tuple[int, ...]) -> SeriesFunction:
        """All equations with these contacts closed as power series of (q, lambda) and of (t, p)."""
        if closed not in self._series:
            self._series[closed] = SeriesFunction(self._balance(closed), is_strict=True)
        return self._series[closed]

    def _balance(self, closed: tuple[int, ...], instead: Sequence[ca.SX] = ()) -> ca.Function:
        """The equations with these contacts closed, or expressions instead of them."""
        laws = self.laws
        lam = ca.SX.sym("lam", self.C + len(closed))
        equations = [self._acting(list(closed), lam), laws.c, laws.g[list(closed)]]
        inputs = [ca.vertcat(laws.q, lam), ca.vertcat(laws.t, laws.p)]
        return SizedFunction("exact", inputs, [_stacked(instead or equations)])

    @property
    def is_large(self) -> bool:
        """True if there are many coordinates and equality rows."""
        return self.n + self.C > LARGE

    @property
    def nothing(self) -> Floats:
        """lambda = 0, (C + K,)."""
        return np.zeros(self.C + self.K)

    def contact_sets(self) -> Iterator[tuple[int, ...]]:
        """All sets of contacts, the small ones first."""
        return subsets(range(self.K))

    def acting(self, closed: Sequence[int]) -> list[int]:
        """The places in lambda of the equality rows and of closed contacts."""
        return [*range(self.C), *(self.C + k for k in closed)]

    def whole(self, closed: Sequence[int], multipliers: Floats) -> Floats:
        """lambda (C + K,) from that of the equality rows and of closed contacts."""
        lam = self.nothing
        lam[self.acting(closed)] = multipliers
        return lam


def subsets(of: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """All sets of some numbers, the small ones first."""
    return itertools.chain.from_iterable(itertools.combinations(of, size) for size in range(len(of) + 1))


def _stacked(parts: Sequence[ca.SX]) -> ca.SX:
    return ca.vertcat(*(ca.vec(ca.densify(part)) for part in parts))


def angles(problem: StaticProblem, positions: ca.SX) -> tuple[tuple[bool, ...], tuple[bool, ...]]:
    """For each of the n coordinates, whether the equations have the period 2 pi in it, by their form; and whether the
    function or positions have not: x - 2 sin x is stationary at pi/3 and at pi/3 + 2 pi, which are two points."""
    laws = problem.laws
    equations = problem.of_place(laws.F, laws.B, laws.c, laws.g, laws.G)
    if not any(name in WAVES for name, *_ in equations.steps):
        return (False,) * problem.n, (False,) * problem.n
    occurring = {ins[1] for name, _, ins, _ in equations.steps if name == "input" and ins[0] == 0}
    found = tuple(k in occurring and _is_periodic(equations, k) for k in range(problem.n))
    shown = problem.of_place(laws.value, positions)
    return found, tuple(is_angle and not _is_periodic(shown, k) for k, is_angle in enumerate(found))


def _is_periodic(program: Program, index: int) -> bool:
    """True if every output stays the same when one input grows by 2 pi."""
    grows: dict[int, float] = {}  # how many times the value of a register grows with the input
    constants: dict[int, float] = {}
    for name, out, ins, value in program.steps:
        given = [] if name in ("input", "const") else [grows[i] for i in ins]
        if name == "input":
            found = float(ins == (0, index))
        elif not any(given):
            found = 0.0
        elif name in LINEAR:
            found = sum(factor * each for factor, each in zip(LINEAR[name], given, strict=True))
        elif name == "mul" and ins[0] in constants:
            found = constants[ins[0]] * given[1]
        elif name in WAVES and given[0] == round(given[0]):
            found = 0.0
        else:
            return False
        if name != "output":
            grows[out[0]] = found
            constants.pop(out[0], None)
        if name == "const":
            constants[out[0]] = value
    return True
