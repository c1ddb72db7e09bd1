"""The equations of a point of rest, or of a stationary point, in CasADi symbols (D.25).

    F + B^T lambda + G^T lambda_g = 0,   c = 0,   g >= 0

Rest: F is h of (D.24) without velocities, inertial terms of x(q, t) and L(q, 0) included; c are the holonomic rows,
the levels of integrals, and the parts of rows that move without velocities. Stationary: F = -grad f.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import casadi as ca

from lagcli.equations.level_functions import LevelExpression
from lagcli.equations.system import System


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


def _sides(levels: Sequence[EnforcedLevel]) -> ca.SX:
    return _column([side for side in (level.side for level in levels) if not side.is_constant()])


def of_rest(system: System, invariant_values: Sequence[EnforcedLevel]) -> StaticLaws:
    """The equations of a point of rest: q' = q'' = 0 satisfies (D.24)."""
    symbols, rows, dynamics = system.symbols, system.rows, system.dynamics
    F, value = (_at_rest(system, part) for part in (dynamics.h, dynamics.rest))
    moving = [rows.b[i] for i in range(rows.b.numel()) if not rows.b[i].is_zero()]
    conditions = [system.f, *(level.expression for level in invariant_values), *moving]
    return StaticLaws(
        symbols.t,
        symbols.q,
        system.p,
        ca.densify(F),
        rows.B,
        _column(conditions),
        ca.densify(system.contacts.g),
        system.contacts.G,
        value,
        ca.densify(F + ca.gradient(value, symbols.q)),
        _sides(invariant_values),
        system.model.path,
    )


def of_function(system: System, f: ca.SX, invariant_values: Sequence[EnforcedLevel]) -> StaticLaws:
    """The equations of a stationary point of f(q) on the holonomic surfaces and on levels, whose rows come last in
    B."""
    q = system.symbols.q
    levels = _column([level.expression for level in invariant_values])
    B = ca.vertcat(system.rows.B[: system.holonomic_count, :], ca.jacobian(levels, q))
    return StaticLaws(
        system.symbols.t,
        q,
        system.p,
        ca.densify(-ca.gradient(f, q)),
        B,
        ca.vertcat(system.f, levels),
        ca.densify(system.contacts.g),
        system.contacts.G,
        f,
        ca.SX.zeros(q.numel()),
        _sides(invariant_values),
        system.model.path,
    )


def _at_rest(system: System, value: ca.SX) -> ca.SX:
    v = system.symbols.v
    return ca.substitute(ca.SX(value), v, ca.SX.zeros(v.shape))


def _column(parts: Sequence[ca.SX]) -> ca.SX:
    return ca.densify(ca.vertcat(*parts)) if parts else ca.SX(0, 1)
