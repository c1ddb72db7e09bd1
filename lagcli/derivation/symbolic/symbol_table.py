"""The symbols of a model and what its expressions stand for in them: an algebra for `expression.evaluate`."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
import sympy

from lagcli.derivation.symbolic.calculus import NOTHING, Abbreviation, Calculus, Key, Triple, VectorRecognizer
from lagcli.errors import diagnostics
from lagcli.expression import evaluate, functions, tree
from lagcli.expression.evaluate import Value
from lagcli.model import model as nouns
from lagcli.model.family import Family, Integers
from lagcli.model.resolve import ModelNames, Resolver
from lagcli.pfaffian.forms import notation
from lagcli.pfaffian.forms.notation import TIME, ZERO, exact

MAX_OPERATIONS = 6000  # beyond it no person reads an expression, and SymPy needs minutes for it

V = TypeVar("V")
_JUMPING = functions.named(lambda row: row.is_piecewise)


class SymbolTable:
    """All symbols, and the values of definitions, masses and positions; `parameters`: the symbols of parameters, or the
    numbers of those in `values`; `body_constants`: the lengths and weights of rigid bodies."""

    def __init__(self, model: nouns.Model, values: frozenset[str] = frozenset()) -> None:
        self.model = model
        self.coordinates = notation.coordinates(model)
        self.rates = {n: sympy.Symbol(f"rate({n})", real=True) for n in self.coordinates}
        self.accelerations = {n: sympy.Symbol(f"rate(rate({n}))", real=True) for n in self.coordinates}
        self.index = {x: i for i, x in enumerate(self.coordinates.values())}
        self.calculus = Calculus(list(self.coordinates.values()), list(self.rates.values()))
        self.recognizer = VectorRecognizer()
        self.names = ModelNames(model)
        self.particles, self.generalized = self.names.particles, self.names.coordinates
        self.constants = notation.constants(model)
        self.parameter_values: dict[sympy.Symbol, float] = {}
        self.body_constants: dict[sympy.Symbol, float] = {}
        self.parameters: dict[str, Value[sympy.Expr]] = {}
        self.substituted: dict[str, Value[sympy.Expr]] = {}
        self._definitions = {d.name: d.expression for d in model.definitions}
        self._defined: dict[str, Value[sympy.Expr]] = {}
        self._positions: dict[int, Triple] = {}
        self._velocities: dict[int, Triple] = {}
        self._masses: dict[int, sympy.Expr] = {}
        for parameter in model.parameters:
            name, value = parameter.name, parameter.value
            if name in values:
                put: Value[sympy.Expr]
                if isinstance(value, tuple):
                    x, y, z = map(exact, value)
                    put = x, y, z
                elif parameter.formula and not tree.names(parameter.formula.tree) - self.constants.keys():
                    put = self._value(
                        parameter.formula, View(), evaluate.value
                    )  # pi/3 where it is written so
                else:
                    put = exact(value)
                self.parameters[name] = self.substituted[name] = put
            elif isinstance(value, tuple):
                parts = notation.parameter(parameter)
                # A component that is zero is no quantity: it is left out.
                nonzero = [part if number else ZERO for part, number in zip(parts, value, strict=True)]
                self.parameters[name] = tuple(nonzero)
                self.parameter_values |= {s: n for s, n in zip(nonzero, value, strict=True) if s != 0}
                if all(value):
                    self.recognizer.know(name, nonzero)
                else:
                    self.substituted[name] = tuple(nonzero)
            else:
                self.parameters[name] = symbol = notation.parameter(parameter)
                self.parameter_values[symbol] = value
        for number, name in enumerate(self.particles.names):
            if not self.is_dependent(number):
                position = tuple(self.coordinates[f"{name}.{axis}"] for axis in "xyz")
                moving = tuple(self.rates[f"{name}.{axis}"] for axis in "xyz")
                self._positions[number], self._velocities[number] = position, moving
                self.recognizer.know(f"r {name}", position)
                self.recognizer.know(f"v {name}", moving)
                self.recognizer.know(f"a {name}", [self.accelerations[f"{name}.{axis}"] for axis in "xyz"])
        # In the model's order each finds what it uses: a chain of any length needs no recursion
        for step in model.order:
            if isinstance(step, str):
                # What is too large is met again where a law uses it, and else does no harm.
                with contextlib.suppress(diagnostics.ModelError):
                    self.definition(step)
                continue
            for member in step.member_numbers.tolist():
                self.position(self.particles.first(step.entry) + member)

    def evaluated(self, expression: nouns.Expression, view: View | None = None) -> sympy.Expr:
        """A scalar. Raises `diagnostics.ModelError` for what is too large."""
        return self._value(expression, view or View(), evaluate.scalar)

    def _value(self, expression: nouns.Expression, view: View, take: Callable[..., V]) -> V:
        """A scalar, a triple or a value, as `take` makes them of the expression in our algebra."""
        try:
            notation.require_short(expression.tree)
            return notation.require_small(take(expression.tree, _MemberAlgebra(self, view)), MAX_OPERATIONS)
        except notation.TooLarge as failure:
            message = f"the equations cannot be written out: {failure}"
            hint = "`check` and `simulate` have no such limit"
            raise diagnostics.error("too-large-to-derive", message, expression.location, hint) from None

    def triple(self, vector: nouns.VectorExpression, view: View) -> Triple:
        """A vector expression, or three scalar ones."""
        if len(vector.parts) == 1:
            return self._value(vector.parts[0], view, evaluate.vector)
        x, y, z = (self.evaluated(part, view) for part in vector.parts)
        return x, y, z

    def difference(self, equation: nouns.Expression, view: View) -> tuple[sympy.Expr, ...]:
        """left - right of a law, one scalar or three."""
        return self._value(equation, view, evaluate.difference)

    def definition(self, name: str) -> Value[sympy.Expr]:
        if name not in self._defined:
            self._defined[name] = self._value(self._definitions[name], View(), evaluate.value)
        return self._defined[name]

    def is_dependent(self, number: int) -> bool:
        """True if the position of a particle is a function of coordinates and time."""
        return self._entry(number)[0].is_dependent

    def _entry(self, number: int) -> tuple[nouns.Particle, View]:
        entry = int(self.particles.entries(np.array([number]))[0])
        particle = self.model.particles[entry]
        return particle, view(particle.members, number - self.particles.first(entry))

    def position(self, number: int) -> Triple:
        if number not in self._positions:
            particle, there = self._entry(number)
            self._positions[number] = self.triple(particle.position, there)
        return self._positions[number]

    def velocity(self, number: int) -> Triple:
        """v of a particle; of a dependent one the total time derivative of x(q, t)."""
        if number not in self._velocities:
            x, y, z = (self.calculus.rate(part) for part in self.position(number))
            self._velocities[number] = (x, y, z)
        return self._velocities[number]

    def mass(self, number: int) -> sympy.Expr:
        if number not in self._masses:
            particle, there = self._entry(number)
            self._masses[number] = self.evaluated(particle.mass, there)
        return self._masses[number]

    def root(self, inner: sympy.Expr, triple: Triple | None) -> sympy.Expr:
        """The square root, as one symbol where it is that of a sum that moves."""
        moving = self.calculus.symbols(inner) - self.parameter_values.keys()
        if not inner.is_Add or not moving:
            return sympy.sqrt(inner)
        vector = self.recognizer.vector(triple) if triple is not None else None
        if vector is None or any(c.free_symbols for _, c in vector[0]) or not vector[0]:
            return self._abbreviated(inner, None)
        # |U| of the vector up to its sign, the first part positive
        sign = -1 if vector[0][0][1].is_negative else 1
        parts = tuple((n, sign * c) for n, c in vector[0])
        x, y, z = (sign * part for part in vector[1])
        key: Key = parts, (x, y, z)
        u, v, w = self.recognizer.components(key)
        length = self._abbreviated(u**2 + v**2 + w**2, key)
        at_rest = not any(TIME in part.free_symbols for part in key[1])
        if at_rest and all(name.startswith("r ") for name, _ in parts if name[:2] in ("r ", "v ")):
            rate: Key = tuple((f"v{n[1:]}", c) for n, c in parts if n.startswith("r ")), NOTHING
            product, square = self.product(key, rate), self.product(rate, rate)
            self.calculus.products[length] = (product, square)
            self.calculus.rates |= {product: square, square: ZERO}
        return length

    def product(self, one: Key, other: Key) -> sympy.Expr:
        """A symbol for U . W; d^2 where both are the U of a distance."""
        known = self.calculus.by_vectors
        symbol = known.get((one, other)) or known.get((other, one))
        if symbol is not None:
            return symbol**2 if self.calculus.known[symbol].is_root else symbol
        a, b = self.recognizer.components(one), self.recognizer.components(other)
        inner = sum((u * w for u, w in zip(a, b, strict=True)), ZERO)
        symbol = sympy.Symbol(f"product {len(self.calculus.known)}", real=True)
        self.calculus.known[symbol] = Abbreviation(inner, False, one, other)
        known[one, other] = symbol
        return symbol

    def _abbreviated(self, inner: sympy.Expr, key: Key | None) -> sympy.Expr:
        known = self.calculus.by_vectors
        if (known_symbol := known.get(inner)) is not None:
            return known_symbol
        symbol = sympy.Symbol(f"root {len(self.calculus.known)}", positive=True)
        self.calculus.known[symbol] = Abbreviation(inner, True, key, key)
        known[inner] = symbol
        if key is not None:
            known[key, key] = symbol
        return symbol


@dataclasses.dataclass(frozen=True, slots=True)
class View:
    """The values of the names of one member of a family: its indices, and `m`, `r`, `v` of a particle."""

    indices: Mapping[str, int] = dataclasses.field(default_factory=dict)
    own: Mapping[str, Value[sympy.Expr]] = dataclasses.field(default_factory=dict)


def view(members: Family, member: int, own: Mapping[str, Value[sympy.Expr]] | None = None) -> View:
    """The view of a member."""
    return View({n: int(values[member]) for n, values in members.variables.items()}, own or {})


class _MemberAlgebra(notation.SympyAlgebra):
    """The names of a member in the symbols of a world, where roots are abbreviated."""

    def __init__(self, table: SymbolTable, there: View) -> None:
        self._table = table
        self.resolver = Resolver(table.names, self, there.indices, there.own)

    def operation(self, node: tree.Node, name: str, *parts: sympy.Expr) -> sympy.Expr:
        if name == "pow" and parts[1] == sympy.Rational(1, 2):
            return self._table.root(parts[0], None)
        if name in _JUMPING:
            self._table.calculus.has_jumps = True
        if name != "sqrt":
            return super().operation(node, name, *parts)
        triple: Triple | None = None
        if isinstance(node, tree.Call) and node.function in ("norm", "distance"):
            vectors = [evaluate.vector(argument, self) for argument in node.arguments]
            x, y, z = vectors[0] if len(vectors) == 1 else (u - w for u, w in zip(*vectors, strict=True))
            triple = (x, y, z)
        return self._table.root(parts[0], triple)

    def constant(self, name: str) -> Value[sympy.Expr] | None:
        table = self._table
        known: Mapping[str, Value[sympy.Expr]]
        for known in ({"t": TIME, "dt": sympy.Integer(1)}, table.constants, table.parameters):
            if name in known:
                return known[name]
        return None

    def position(self, numbers: Integers) -> Triple:
        return self._table.position(int(numbers[0]))

    def velocity(self, numbers: Integers) -> Triple:
        return self._table.velocity(int(numbers[0]))

    def generalized(self, numbers: Integers, rates: bool) -> sympy.Expr:
        table = self._table
        return (table.rates if rates else table.coordinates)[table.generalized.names[int(numbers[0])]]

    def definition(self, name: str) -> Value[sympy.Expr]:
        return self._table.definition(name)

    def differential(self, value: sympy.Expr) -> sympy.Expr:
        return self._table.calculus.rate(value)
