"""What the names of a model stand for: CasADi symbols for parameters, coordinates, rates, time, and what follows."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import model as nouns
from lagcli.expression import evaluate, tree, whole
from lagcli.mechanics.algebra import SymbolicAlgebra
from lagcli.members import Roll, Whole

Triple = tuple[Any, Any, Any]  # columns of SX


@dataclasses.dataclass(frozen=True, slots=True)
class Symbols:
    """t, q (n), v (n) and the parameters p, with those that belong to names."""

    t: Any
    q: Any
    v: Any
    p: Any
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
    parameters: dict[str, Any] = {}
    flat = []
    for parameter in model.parameters:
        parts = [ca.SX.sym(label) for label, _ in _labelled(parameter.name, parameter.value)]
        parameters[parameter.name] = tuple(parts) if len(parts) == 3 else parts[0]
        flat += parts
    n = len(model.coordinate_names)
    return Symbols(
        ca.SX.sym("t"),
        ca.SX.sym("q", n),
        ca.SX.sym("v", n),
        ca.vertcat(*flat) if flat else ca.SX(0, 1),
        parameters,
    )


def parameter_values(model: nouns.Model) -> list[float]:
    """Numbers for `Symbols.p`, in its order."""
    return [number for p in model.parameters for _, number in _labelled(p.name, p.value)]


class Columns:
    """Scalars or vectors of numbered members, such as positions of particles, filled batch by batch."""

    def __init__(self, count: int) -> None:
        self._batches: list[tuple[Any, ...]] = []
        self._batch = np.full(count, -1, dtype=np.int64)
        self._row = np.zeros(count, dtype=np.int64)

    def fill(self, numbers: Whole, parts: tuple[Any, ...]) -> None:
        """Take one column (K, 1), or three of a vector, for the members of these numbers (K,)."""
        self._batch[numbers] = len(self._batches)
        self._row[numbers] = np.arange(numbers.size)
        self._batches.append(parts)

    def has(self, numbers: Whole) -> npt.NDArray[np.bool_]:
        """Which of these are filled, (K,)."""
        return np.asarray(self._batch[numbers] >= 0)

    def take(self, numbers: Whole) -> tuple[Any, ...]:
        """The columns (K, 1) of members that are filled."""
        batches, rows = self._batch[numbers], self._row[numbers]
        used, which = np.unique(batches, return_inverse=True)
        parts = [self._batches[batch] for batch in used.tolist()]
        if len(parts) == 1:
            return parts[0] if _is_all(rows, parts[0][0]) else tuple(taken(part, rows) for part in parts[0])
        if not parts:
            return (ca.SX(0, 1),) * 3
        sizes = [part[0].numel() for part in parts]
        places = rows + (np.cumsum(sizes) - sizes)[which]
        return tuple(taken(ca.vertcat(*columns), places) for columns in zip(*parts, strict=True))


def taken(column: Any, rows: Whole) -> Any:
    """Rows of a column, in any order."""
    return column[rows.tolist()] if rows.size != 1 else column[int(rows[0])]


def _is_all(rows: Whole, column: Any) -> bool:
    return rows.size == column.numel() and bool((rows == np.arange(rows.size)).all())


def column(value: Any, count: int) -> Any:
    """A scalar (1, 1) or a column (K, 1) as a dense column of this length."""
    if value.numel() == count:
        return ca.densify(value)
    return ca.repmat(ca.densify(value), count, 1)


def interleaved(parts: Sequence[Any], count: int) -> Any:
    """Columns x, y, z (or one) of K members as x1, y1, z1, x2, ...: the order of rows and coordinates."""
    if len(parts) == 1:
        return column(parts[0], count)
    return ca.vec(ca.horzcat(*(column(part, count) for part in parts)).T)


class Environment:
    """Evaluates the model's expressions over symbols; of a family for all its members at once.

    A scalar is an SX (1, 1), or a column (K, 1) with one value for each member; a vector is a triple of them.
    free: columns of positions and velocities of the dependent particles, in their order, to differentiate by
    them as if they were free; else these are evaluated from their expressions.
    """

    def __init__(
        self,
        model: nouns.Model,
        symbols: Symbols,
        fixed: FixedExponents,
        free: tuple[Triple, Triple] | None = None,
    ) -> None:
        self._model = model
        self.symbols = symbols
        self._fixed = fixed
        self.particles = Roll(particle.members for particle in model.particles)
        self.coordinates = Roll(coordinate.members for coordinate in model.coordinates)
        self._laws = {d.name: d.expression for d in model.definitions}
        self._numbers = {p.name: p.value for p in model.parameters if not isinstance(p.value, tuple)}
        self._values: dict[str, Any] = {}
        self._positions, self._velocities = Columns(len(self.particles)), Columns(len(self.particles))
        self.is_dependent = np.repeat(
            np.array([p.is_dependent for p in model.particles], dtype=bool),
            [p.members.count for p in model.particles],
        )
        self.cartesian, self.dependent = np.flatnonzero(~self.is_dependent), np.flatnonzero(self.is_dependent)
        self._rank = np.cumsum(~self.is_dependent) - 1  # of a Cartesian particle among its kind
        self.first_generalized = 3 * self.cartesian.size
        if self.cartesian.size:
            self._positions.fill(self.cartesian, self._own_components(symbols.q))
            self._velocities.fill(self.cartesian, self._own_components(symbols.v))
        if free is not None and self.dependent.size:
            self._positions.fill(self.dependent, free[0])
            self._velocities.fill(self.dependent, free[1])
        self._plain = self.algebra()
        self._fill()

    def rows_of(self, numbers: Whole) -> Whole:
        """The places of x of Cartesian particles in q and v."""
        return 3 * self._rank[numbers]

    def algebra(
        self,
        variables: Mapping[str, Whole] | None = None,
        own: Mapping[str, Any] | None = None,
        results: Callable[[tree.Node, Mapping[str, Whole]], Any] | None = None,
    ) -> SymbolicAlgebra:
        """An algebra of this environment. `variables`: index vectors (K,) of a family; `own`: `m`, `r`, `v` of
        a particle; `results`: what `multiplier`, `reaction`, `kinetic` and `potential` stand for."""
        atoms = _Atoms(self, variables or {}, own or {}, results)
        return SymbolicAlgebra(atoms.atom, atoms.special, self._fixed)

    def scalar(self, expression: nouns.Expression, algebra: SymbolicAlgebra | None = None) -> Any:
        """SX of a scalar expression."""
        return evaluate.scalar(expression.tree, algebra or self._plain)

    def either(self, expression: nouns.Expression, algebra: SymbolicAlgebra | None = None) -> list[Any]:
        """SX of a scalar or vector expression, as one or three."""
        value = evaluate.evaluate(expression.tree, algebra or self._plain)
        return list(value) if isinstance(value, tuple) else [value]

    def vector(self, vector: nouns.VectorExpression, algebra: SymbolicAlgebra | None = None) -> Triple:
        """SX of the three components."""
        used = algebra or self._plain
        if len(vector.parts) == 1:
            return evaluate.vector(vector.parts[0].tree, used)
        x, y, z = (evaluate.scalar(part.tree, used) for part in vector.parts)
        return x, y, z

    def equation(self, law: nouns.Holonomic | nouns.Differential) -> Any:
        """left - right of all members of a law, one after another."""
        assert isinstance(law.equation.tree, tree.Relation)
        parts = evaluate.difference(law.equation.tree, self.algebra(law.members.variables))
        return interleaved(parts, law.members.count)

    def masses(self) -> Any:
        """m of all particles, (N, 1)."""
        values = [
            column(self.scalar(p.mass, self.algebra(p.members.variables)), p.members.count)
            for p in self._model.particles
            if p.members.count
        ]
        return ca.vertcat(*values) if values else ca.SX(0, 1)

    def position(self, numbers: Whole) -> Triple:
        """r of particles, columns (K, 1)."""
        x, y, z = self._positions.take(numbers)
        return x, y, z

    def velocity(self, numbers: Whole) -> Triple:
        """v of particles, columns (K, 1); of dependent ones the total time derivative of x(q, t)."""
        if not self._velocities.has(numbers).all():
            # All that can be told by now, in one go.
            able = self._positions.has(self.dependent) & ~self._velocities.has(self.dependent)
            x, y, z = (self.rate(part) for part in self.position(self.dependent[able]))
            self._velocities.fill(self.dependent[able], (x, y, z))
        x, y, z = self._velocities.take(numbers)
        return x, y, z

    def rate(self, value: Any) -> Any:
        """d/dt of a function of (q, t): its differential, divided by dt."""
        s = self.symbols
        return ca.densify(ca.jtimes(value, s.q, s.v) + ca.jtimes(value, s.t, ca.SX(1)))

    def definition(self, name: str) -> Any:
        """The value of a definition."""
        if name not in self._values:
            self._values[name] = evaluate.evaluate(self._laws[name].tree, self._plain)
        return self._values[name]

    def is_definition(self, name: str) -> bool:
        """Whether a definition has this name."""
        return name in self._laws

    def numbers(
        self, node: tree.Name | tree.Member | tree.Index, roll: Roll, variables: Mapping[str, Whole]
    ) -> Whole:
        """The numbers of the members a reference stands for, (1,) or (K,)."""
        if isinstance(node, tree.Index):
            return roll.find(node.owner, self._index_values(node, variables))
        return roll.find(node.owner if isinstance(node, tree.Member) else node.name, ())

    def indices(self, node: tree.Index, variables: Mapping[str, Whole]) -> list[tuple[int, ...]]:
        """The indices of a reference, one tuple for each member."""
        vectors = np.broadcast_arrays(*(np.atleast_1d(i) for i in self._index_values(node, variables)))
        return list(zip(*(vector.tolist() for vector in vectors), strict=True))

    def _index_values(self, node: tree.Index, variables: Mapping[str, Whole]) -> list[int | Whole]:
        def lookup(name: tree.Name) -> float | Whole:
            return variables[name.name] if name.name in variables else self._numbers[name.name]

        return [whole.evaluate(index, lookup) for index in node.indices]

    def _fill(self) -> None:
        """Evaluate positions and definitions in an order in which each finds what it uses.

        So a chain of any length needs no recursion.
        """
        for step in self._model.order:
            if isinstance(step, str):
                self.definition(step)
                continue
            numbers = step.places + self.particles.first(step.entry)
            if self._positions.has(numbers).all():
                continue
            particle = self._model.particles[step.entry]
            algebra = self.algebra(particle.members.taken(step.places))
            x, y, z = (column(part, numbers.size) for part in self.vector(particle.position, algebra))
            self._positions.fill(numbers, (x, y, z))

    def _own_components(self, vector: Any) -> Triple:
        x, y, z = (vector[axis : self.first_generalized : 3] for axis in range(3))
        return x, y, z


class _Atoms:
    """What the leaves of one expression stand for."""

    def __init__(
        self,
        environment: Environment,
        variables: Mapping[str, Whole],
        own: Mapping[str, Any],
        results: Callable[[tree.Node, Mapping[str, Whole]], Any] | None,
    ) -> None:
        self._environment, self._variables, self._own, self._results = environment, variables, own, results

    def atom(self, node: tree.Name | tree.Member | tree.Index) -> Any:
        """A name, a component, or a member of a family."""
        environment = self._environment
        if isinstance(node, tree.Name):
            return self._named(node, node.name)
        if node.owner in environment.particles and node.owner not in self._own:
            return self._particle(node)
        if isinstance(node, tree.Index):
            if node.owner in environment.coordinates:
                return self._coordinate(node, environment.symbols.q)
            assert self._results is not None, node.owner
            value = self._results(node, self._variables)
            return evaluate.component(node, value, node.member, node.owner) if node.member else value
        owner = self._named(tree.Name(node.start, node.end, node.owner), node.owner)
        return evaluate.component(node, owner, node.member, node.owner)

    def special(self, node: tree.Call) -> Any:
        """`d`, `rate`, `multiplier`, `reaction`."""
        argument, environment = node.arguments[0], self._environment
        if node.function == "d":
            value = evaluate.evaluate(argument, environment.algebra(self._variables, self._own))
            if isinstance(value, tuple):
                return tuple(environment.rate(part) for part in value)
            return environment.rate(value)
        if node.function == "rate":
            assert isinstance(argument, (tree.Name, tree.Member, tree.Index))
            owner = argument.name if isinstance(argument, tree.Name) else argument.owner
            if owner in environment.coordinates:
                return self._coordinate(argument, environment.symbols.v)
            velocity = environment.velocity(self._numbers(argument, environment.particles))
            member = "" if isinstance(argument, tree.Name) else argument.member
            return velocity["xyz".index(member)] if member else velocity
        assert self._results is not None, node.function
        return self._results(node, self._variables)

    def _numbers(self, node: tree.Name | tree.Member | tree.Index, roll: Roll) -> Whole:
        return self._environment.numbers(node, roll, self._variables)

    def _coordinate(self, node: tree.Name | tree.Member | tree.Index, vector: Any) -> Any:
        environment = self._environment
        return taken(vector, environment.first_generalized + self._numbers(node, environment.coordinates))

    def _particle(self, node: tree.Member | tree.Index) -> Any:
        numbers = self._numbers(node, self._environment.particles)
        if node.member == "v":
            return self._environment.velocity(numbers)
        if node.member.startswith("v"):
            return self._environment.velocity(numbers)["xyz".index(node.member[1])]
        position = self._environment.position(numbers)
        return position["xyz".index(node.member)] if node.member else position

    def _named(self, node: tree.Name, name: str) -> Any:
        environment = self._environment
        s = environment.symbols
        constants = {"t": s.t, "pi": ca.SX(ca.pi), "dt": ca.SX(1)}
        if name in self._variables:
            return ca.SX(ca.DM(self._variables[name].astype(float)))
        if name in self._own:
            return self._own[name]
        if name in constants:
            return constants[name]
        if name in s.parameters:
            return s.parameters[name]
        if name in environment.particles:
            return environment.position(environment.particles.find(name, ()))
        if name in environment.coordinates:
            return self._coordinate(node, s.q)
        if environment.is_definition(name):
            return environment.definition(name)
        assert self._results is not None, name
        return self._results(node, self._variables)
