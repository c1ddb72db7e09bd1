"""What the names of a model stand for: CasADi symbols for parameters, coordinates, rates, time, and what follows."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from lagcli import model as nouns
from lagcli.expression import evaluate, tree
from lagcli.mechanics.algebra import SymbolicAlgebra

Triple = tuple[Any, Any, Any]


@dataclasses.dataclass(frozen=True, slots=True)
class Symbols:
    """t, q (n), v (n) and the parameters p, with the slices that belong to names."""

    t: Any
    q: Any
    v: Any
    p: Any
    index: Mapping[str, int]  # coordinate name -> its row in q and v
    parameters: Mapping[str, Any]  # name -> scalar or triple of SX


class FixedExponents:
    """Exponents that depend on parameters only are built into the graph; `used` says which those are.

    x**n with n an input has derivatives that are not finite at x = 0 although x**2 is harmless there.
    """

    def __init__(self, model: nouns.Model) -> None:
        self._values: dict[str, float] = {}
        for parameter in model.parameters:
            value = parameter.value
            for label, number in _labelled(parameter.name, value):
                self._values[label] = number
        self._used: set[str] = set()

    def __call__(self, exponent: Any) -> float | None:
        """The number, or None where the exponent depends on more than parameters."""
        symbols = ca.symvar(exponent)
        if any(symbol.name() not in self._values for symbol in symbols):
            return None
        self._used.update(symbol.name() for symbol in symbols)
        numbers = [self._values[symbol.name()] for symbol in symbols]
        value = ca.substitute([exponent], symbols, [ca.SX(number) for number in numbers])[0]
        return float(ca.evalf(value))

    def used(self) -> tuple[tuple[str, float], ...]:
        """The parameters that were built in, with their values."""
        return tuple((name, self._values[name]) for name in sorted(self._used))

    def value(self, name: str) -> float:
        """The value a parameter has in this model."""
        return self._values[name]


def _labelled(name: str, value: float | nouns.Vector3) -> list[tuple[str, float]]:
    if isinstance(value, tuple):
        return [(f"parameter {name}.{axis}", part) for axis, part in zip("xyz", value, strict=True)]
    return [(f"parameter {name}", value)]


def symbols(model: nouns.Model) -> Symbols:
    """Fresh symbols for a model; parameters are named so that `FixedExponents` knows them."""
    names = model.coordinate_names
    parameters: dict[str, Any] = {}
    flat = []
    for parameter in model.parameters:
        parts = [ca.SX.sym(label) for label, _ in _labelled(parameter.name, parameter.value)]
        parameters[parameter.name] = tuple(parts) if len(parts) == 3 else parts[0]
        flat += parts
    n = len(names)
    return Symbols(
        ca.SX.sym("t"),
        ca.SX.sym("q", n),
        ca.SX.sym("v", n),
        ca.vertcat(*flat) if flat else ca.SX(0, 1),
        {name: i for i, name in enumerate(names)},
        parameters,
    )


def parameter_values(model: nouns.Model) -> list[float]:
    """Numbers for `Symbols.p`, in its order."""
    return [number for p in model.parameters for _, number in _labelled(p.name, p.value)]


class Environment:
    """Evaluates the model's expressions over symbols.

    positions, velocities: triples of SX by particle. Those of dependent particles are evaluated from their
    expressions unless they are given (to differentiate by them as if they were free).
    results: what `multiplier`, `reaction`, `kinetic` and `potential` stand for (outputs only).
    """

    def __init__(
        self,
        model: nouns.Model,
        symbols: Symbols,
        fixed: FixedExponents,
        free: Mapping[str, tuple[Triple, Triple]] | None = None,
    ) -> None:
        self._model = model
        self.symbols = symbols
        self._fixed = fixed
        self._particles = {particle.name: particle for particle in model.particles}
        self._definitions = {d.name: d.expression for d in model.definitions}
        self._positions: dict[str, Triple] = {name: pair[0] for name, pair in (free or {}).items()}
        self._velocities: dict[str, Triple] = {name: pair[1] for name, pair in (free or {}).items()}
        self._values: dict[str, Any] = {}
        self._is_filled = False
        self._algebra = self.algebra()

    def algebra(
        self,
        own: Mapping[str, Any] | None = None,
        results: Callable[[tree.Node], Any] | None = None,
    ) -> SymbolicAlgebra:
        """An algebra of this environment. `own`: `m`, `r`, `v` of a particle; `results`: of outputs."""

        def atom(node: tree.Node) -> Any:
            return self._atom(node, own or {}, results)

        def special(node: tree.Call) -> Any:
            return self._special(node, results)

        return SymbolicAlgebra(atom, special, self._fixed)

    def scalar(self, expression: nouns.Expression, algebra: SymbolicAlgebra | None = None) -> Any:
        """SX of a scalar expression."""
        return evaluate.scalar(expression.tree, algebra or self._algebra)

    def either(self, expression: nouns.Expression, algebra: SymbolicAlgebra | None = None) -> list[Any]:
        """SX of a scalar or vector expression, as one or three."""
        value = evaluate.evaluate(expression.tree, algebra or self._algebra)
        return list(value) if isinstance(value, tuple) else [value]

    def vector(self, vector: nouns.VectorExpression, algebra: SymbolicAlgebra | None = None) -> Triple:
        """SX of the three components."""
        used = algebra or self._algebra
        if len(vector.parts) == 1:
            return evaluate.vector(vector.parts[0].tree, used)
        x, y, z = (evaluate.scalar(part.tree, used) for part in vector.parts)
        return x, y, z

    def equation(self, equation: nouns.Expression) -> list[Any]:
        """left - right, one SX or three."""
        assert isinstance(equation.tree, tree.Relation)
        return list(evaluate.difference(equation.tree, self._algebra))

    def position(self, name: str) -> Triple:
        """r of a particle."""
        self._fill()
        if name not in self._positions:
            particle = self._particles[name]
            if particle.is_dependent:
                self._positions[name] = self.vector(particle.position)
            else:
                self._positions[name] = self._own_components(name, self.symbols.q)
        return self._positions[name]

    def _fill(self) -> None:
        """Evaluate definitions and positions in an order in which each finds what it uses.

        So a chain of any length needs no recursion.
        """
        if self._is_filled:
            return
        self._is_filled = True
        for name in self._model.order:
            self._named(tree.Name(0, 0, name), name, {}, None)

    def velocity(self, name: str) -> Triple:
        """v of a particle; of a dependent one the total time derivative of x(q, t)."""
        if name not in self._velocities:
            if self._particles[name].is_dependent:
                x, y, z = (self.rate(part) for part in self.position(name))
                self._velocities[name] = (x, y, z)
            else:
                self._velocities[name] = self._own_components(name, self.symbols.v)
        return self._velocities[name]

    def rate(self, value: Any) -> Any:
        """d/dt of a function of (q, t): its differential, divided by dt."""
        s = self.symbols
        return ca.jtimes(value, s.q, s.v) + ca.jacobian(value, s.t)

    def _own_components(self, name: str, vector: Any) -> Triple:
        first = self.symbols.index[f"{name}.x"]
        return vector[first], vector[first + 1], vector[first + 2]

    def _atom(
        self, node: tree.Node, own: Mapping[str, Any], results: Callable[[tree.Node], Any] | None
    ) -> Any:
        if isinstance(node, tree.Member):
            if node.owner in self._particles and node.owner not in own:
                return self._particle_member(node)
            owner = self._named(tree.Name(node.start, node.end, node.owner), node.owner, own, results)
            return evaluate.component(node, owner, node.member, node.owner)
        assert isinstance(node, tree.Name)
        return self._named(node, node.name, own, results)

    def _particle_member(self, node: tree.Member) -> Any:
        if node.member == "v":
            return self.velocity(node.owner)
        if node.member.startswith("v"):
            return self.velocity(node.owner)["xyz".index(node.member[1])]
        return self.position(node.owner)["xyz".index(node.member)]

    def _named(
        self, node: tree.Node, name: str, own: Mapping[str, Any], results: Callable[[tree.Node], Any] | None
    ) -> Any:
        constants = {"t": self.symbols.t, "pi": ca.SX(ca.pi), "dt": ca.SX(1)}
        if name in own:
            return own[name]
        if name in constants:
            return constants[name]
        if name in self.symbols.parameters:
            return self.symbols.parameters[name]
        if name in self._particles:
            return self.position(name)
        if name in self.symbols.index:
            return self.symbols.q[self.symbols.index[name]]
        if name in self._definitions:
            self._fill()
            if name not in self._values:
                self._values[name] = evaluate.evaluate(self._definitions[name].tree, self._algebra)
            return self._values[name]
        assert results is not None, name
        return results(node)

    def _special(self, node: tree.Call, results: Callable[[tree.Node], Any] | None) -> Any:
        argument = node.arguments[0]
        if node.function == "d":
            value = evaluate.evaluate(argument, self._algebra)
            if isinstance(value, tuple):
                return tuple(self.rate(part) for part in value)
            return self.rate(value)
        if node.function == "rate":
            if isinstance(argument, tree.Member):
                return self.velocity(argument.owner)["xyz".index(argument.member)]
            assert isinstance(argument, tree.Name)
            if argument.name in self._particles:
                return self.velocity(argument.name)
            return self.symbols.v[self.symbols.index[argument.name]]
        assert results is not None, node.function
        return results(node)
