"""The values of a model's expressions: CasADi columns, of a family for all its members at once."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from lagcli.equations.family_columns import Columns, Triple, Value, column, interleaved, rate, taken
from lagcli.equations.symbols import FixedExponents, SymbolicAlgebra, Symbols
from lagcli.expression import evaluate, tree
from lagcli.model import model as nouns
from lagcli.model.family import Integers
from lagcli.model.resolve import Leaves, ModelNames, Resolver, Results


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
        self.names = ModelNames(model)
        self._constants: dict[str, Value] = {"t": symbols.t, "dt": ca.SX(1)}
        self._constants |= {name: ca.SX(value) for name, value in model.constants.items()}
        self._constants |= symbols.parameters
        self.particles, self.coordinates = self.names.particles, self.names.coordinates
        self._values: dict[str, Value] = {}
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
        self._free = free if self.dependent.size else None
        if free is not None and self.dependent.size:
            self._positions.fill(self.dependent, free[0])
            self._velocities.fill(self.dependent, free[1])
        self._plain = self.algebra()
        self._fill()

    @property
    def t(self) -> ca.SX:
        """Time."""
        return self.symbols.t

    @property
    def q(self) -> ca.SX:
        """All coordinates, (n, 1)."""
        return self.symbols.q

    @property
    def v(self) -> ca.SX:
        """Their rates, (n, 1)."""
        return self.symbols.v

    def rows_of(self, numbers: Integers) -> Integers:
        """The indices of x of Cartesian particles in q and v."""
        return 3 * self._rank[numbers]

    def algebra(
        self,
        variables: Mapping[str, Integers] | None = None,
        own: Mapping[str, Value] | None = None,
        results: Results[ca.SX] | None = None,
        leaves: Leaves[ca.SX] | None = None,
    ) -> SymbolicAlgebra:
        """An algebra of this environment. `variables`: index vectors (K,) of a family; `own`: `m`, `r`, `v` of
        a particle; `results`: what `multiplier`, `reaction`, `kinetic` and `potential` stand for; `leaves`: what
        the coordinates stand for, if not these columns."""
        found = Resolver(self.names, leaves or self, variables or {}, own or {}, results)
        return SymbolicAlgebra(found.atom, found.special, self._fixed)

    def scalar(self, expression: nouns.Expression, algebra: SymbolicAlgebra | None = None) -> ca.SX:
        """SX of a scalar expression."""
        return evaluate.scalar(expression.tree, algebra or self._plain)

    def either(self, expression: nouns.Expression, algebra: SymbolicAlgebra | None = None) -> list[ca.SX]:
        """SX of a scalar or vector expression, as one or three."""
        value = evaluate.value(expression.tree, algebra or self._plain)
        return list(value) if isinstance(value, tuple) else [value]

    def vector(self, vector: nouns.VectorExpression, algebra: SymbolicAlgebra | None = None) -> Triple:
        """SX of the three components."""
        used = algebra or self._plain
        if len(vector.parts) == 1:
            return evaluate.vector(vector.parts[0].tree, used)
        x, y, z = (evaluate.scalar(part.tree, used) for part in vector.parts)
        return x, y, z

    def equation(self, law: nouns.Law) -> ca.SX:
        """left - right of all members of a law, one after another."""
        assert isinstance(law.equation.tree, tree.Relation)
        parts = evaluate.difference(law.equation.tree, self.algebra(law.members.variables))
        return interleaved(parts, law.members.count)

    def masses(self) -> ca.SX:
        """m of all particles, (N, 1)."""
        values = [
            column(self.scalar(p.mass, self.algebra(p.members.variables)), p.members.count)
            for p in self._model.particles
            if p.members.count
        ]
        return ca.vertcat(*values) if values else ca.SX(0, 1)

    def constant(self, name: str) -> Value | None:
        """t, dt, a constant or a parameter; None for another name."""
        return self._constants.get(name)

    def position(self, numbers: Integers) -> Triple:
        """r of particles, columns (K, 1)."""
        return self._positions.vectors(numbers)

    def velocity(self, numbers: Integers) -> Triple:
        """v of particles, columns (K, 1); of dependent ones the total time derivative of x(q, t)."""
        if not self._velocities.has(numbers).all():
            # All that is known by now, in one go.
            able = self._positions.has(self.dependent) & ~self._velocities.has(self.dependent)
            x, y, z = (self.rate(part) for part in self.position(self.dependent[able]))
            self._velocities.fill(self.dependent[able], (x, y, z))
        return self._velocities.vectors(numbers)

    def rate(self, value: ca.SX) -> ca.SX:
        """d/dt of a function of (q, t), and of free positions: its differential, divided by dt."""
        found = rate(value, self.q, self.v, self.t)
        if self._free is None:
            return found
        member_numbers, rates = (ca.vertcat(*parts) for parts in self._free)
        return ca.densify(found + ca.jtimes(value, member_numbers, rates))

    differential = rate

    def generalized(self, numbers: Integers, rates: bool) -> ca.SX:
        """Generalized coordinates or their rates, (K, 1)."""
        return taken(self.symbols.v if rates else self.symbols.q, self.first_generalized + numbers)

    def variable(self, name: str, values: Integers) -> ca.SX:
        """The values of an index variable, (K, 1)."""
        return ca.SX(ca.DM(values.astype(float)))

    def definition(self, name: str) -> Value:
        """The value of a definition."""
        if name not in self._values:
            self._values[name] = evaluate.value(self.names.definitions[name], self._plain)
        return self._values[name]

    def _fill(self) -> None:
        """Evaluate positions and definitions in an order in which each finds what it uses.

        So a chain of any length needs no recursion.
        """
        for step in self._model.order:
            if isinstance(step, str):
                self.definition(step)
                continue
            numbers = step.member_numbers + self.particles.first(step.entry)
            if self._positions.has(numbers).all():
                continue
            particle = self._model.particles[step.entry]
            algebra = self.algebra(particle.members.taken(step.member_numbers))
            x, y, z = (column(part, numbers.size) for part in self.vector(particle.position, algebra))
            self._positions.fill(numbers, (x, y, z))

    def _own_components(self, vector: ca.SX) -> Triple:
        x, y, z = (vector[axis : self.first_generalized : 3] for axis in range(3))
        return x, y, z
