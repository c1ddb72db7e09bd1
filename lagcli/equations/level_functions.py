"""First integrals of differential rows (D.3), and quantities somebody asks for, over the symbols of a system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import casadi as ca

from lagcli.equations.environment import Environment, Value
from lagcli.equations.symbols import FixedExponents, SymbolicAlgebra
from lagcli.equations.system import System
from lagcli.expression import evaluate, integers, parser, tree
from lagcli.frozen import frozen, frozen_value
from lagcli.model import family, invariant
from lagcli.model import model as nouns
from lagcli.smoothness.sized_function import SizedFunction


@frozen
class LevelExpression:
    """A chart of `conserved`, as scalar SX of `System.symbols`; period None where there is none."""

    above: ca.SX
    below: ca.SX
    period: ca.SX | None


@frozen_value
class Charts:
    """Charts with the parameters that stand in exponents, whose values are built in."""

    charts: tuple[LevelExpression, ...]
    built_in: tuple[tuple[str, float], ...]

    def hold_for(self, system: System) -> bool:
        """True if the built-in values are those of the model of a system."""
        fixed = FixedExponents(system.model)
        return all(fixed.value(name) == value for name, value in self.built_in)


class UnknownName(Exception):
    """A name in a chart that stands for nothing there."""


def charts(system: System, written: Sequence[invariant.LevelFunction]) -> Charts:
    """The expressions of charts, whose names are coordinates, parameters, `t` and `pi`. Raises
    `expression.ExpressionError` for a text that is no expression, `UnknownName` for another name."""
    s, fixed = system.symbols, FixedExponents(system.model)
    values: dict[str, Value] = {"t": s.t, "pi": ca.SX(ca.pi)}
    for name, value in s.parameters.items():
        if isinstance(value, tuple):
            values |= {f"{name}.{axis}": x for axis, x in zip("xyz", value, strict=True)}
        else:
            values[name] = value
    values |= {name: s.q[i] for i, name in enumerate(system.model.coordinate_names)}

    def atom(node: tree.Reference) -> Value:
        name = family.name(node.owner, (int(integers.evaluate(i, unknown)) for i in node.indices))
        name += f".{node.member}" if node.member else ""
        if name not in values:
            raise UnknownName(name)
        return values[name]

    def unknown(node: tree.Name | tree.Call, *_: object) -> NoReturn:
        raise UnknownName(node.name if isinstance(node, tree.Name) else node.function)

    algebra, found = SymbolicAlgebra(atom, unknown, fixed), []
    for chart in written:
        texts = (chart.above, chart.below, chart.period or "0")
        above, below, period = (evaluate.scalar(parser.parse(text), algebra) for text in texts)
        found.append(LevelExpression(above, below, None if chart.period is None else period))
    return Charts(tuple(found), fixed.used())


def value(system: System, expression: nouns.Expression) -> ca.SX:
    """The SX of a scalar of t, q, v and p; exponents of parameters are built in."""
    model = system.model
    environment = Environment(model, system.symbols, FixedExponents(model))
    return environment.scalar(expression)


def have_time(system: System, charts: Sequence[LevelExpression]) -> bool:
    """True if t occurs in one of some charts, or in a declared event."""
    values = [ca.densify(system.event_values)]
    values += [ca.densify(part) for chart in charts for part in (chart.above, chart.below)]
    return bool(ca.depends_on(ca.vertcat(*values), system.symbols.t))


def compiled(system: System, charts: Sequence[LevelExpression]) -> ca.Function:
    """levels(t, q, p) -> above and below of K charts (K, 2), their gradients (K, n) each, and periods (K,) or 0."""
    s = system.symbols
    above, below = (
        ca.densify(ca.vertcat(*each)) for each in ([c.above for c in charts], [c.below for c in charts])
    )
    periods = [ca.SX(0) if c.period is None else c.period for c in charts]
    outputs = [ca.horzcat(above, below), ca.jacobian(above, s.q), ca.jacobian(below, s.q)]
    return SizedFunction("levels", [s.t, s.q, system.p], [*outputs, ca.densify(ca.vertcat(*periods))])
