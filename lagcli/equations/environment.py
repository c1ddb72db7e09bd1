"""The values of a model's expressions as CasADi columns: of a family an SX (K, 1), with one value for each member."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.arrays import Integers
from lagcli.equations.symbols import FixedExponents, SymbolicAlgebra, Symbols
from lagcli.expression import evaluate
from lagcli.model import model as nouns
from lagcli.model.resolve import Leaves, ModelNames, Resolver, Results

Triple = evaluate.Triple[ca.SX]
Value = evaluate.Value[ca.SX]  # a column, or three of a vector


class Columns:
    """Scalars or vectors of numbered members, such as positions of particles, filled batch by batch."""

    def __init__(self, count: int) -> None:
        self._batches: list[tuple[ca.SX, ...]] = []
        self._batch = np.full(count, -1, dtype=np.int64)
        self._row = np.zeros(count, dtype=np.int64)

    def fill(self, numbers: Integers, parts: tuple[ca.SX, ...]) -> None:
        """Take one column (K, 1), or three of a vector, for the members of these numbers (K,)."""
        self._batch[numbers] = len(self._batches)
        self._row[numbers] = np.arange(numbers.size)
        self._batches.append(parts)

    def has(self, numbers: Integers) -> npt.NDArray[np.bool_]:
        """True for those that are filled, (K,)."""
        return np.asarray(self._batch[numbers] >= 0)

    def take(self, numbers: Integers) -> tuple[ca.SX, ...]:
        """The columns (K, 1) of members that are filled."""
        batches, rows = self._batch[numbers], self._row[numbers]
        used, which = np.unique(batches, return_inverse=True)
        parts = [self._batches[batch] for batch in used.tolist()]
        if len(parts) == 1:
            is_all = rows.size == parts[0][0].numel() and bool((rows == np.arange(rows.size)).all())
            return parts[0] if is_all else tuple(taken(part, rows) for part in parts[0])
        if not parts:
            return (ca.SX(0, 1),) * 3
        sizes = [part[0].numel() for part in parts]
        indices = rows + (np.cumsum(sizes) - sizes)[which]
        return tuple(taken(ca.vertcat(*columns), indices) for columns in zip(*parts, strict=True))

    def vectors(self, numbers: Integers) -> Triple:
        """The columns x, y, z (K, 1) of members that are filled, each with a vector."""
        x, y, z = self.take(numbers)
        return x, y, z


def taken(column: ca.SX, rows: Integers) -> ca.SX:
    """Rows of a column, in any order."""
    if rows.size == 1:
        return column[int(rows[0])]
    return ca.vec(column[rows.tolist()])  # CasADi takes of a single row a line, not a column


def column(value: ca.SX, count: int) -> ca.SX:
    """A scalar (1, 1) or a column (K, 1) as a dense column of this length."""
    if value.numel() == count:
        return ca.densify(value)
    return ca.repmat(ca.densify(value), count, 1)


def interleaved(parts: Sequence[ca.SX], count: int | None = None) -> ca.SX:
    """Columns x, y, z (or one) of K members as x1, y1, z1, x2, ...; count: K, asked for where they may be scalars."""
    count = parts[0].numel() if count is None else count
    if len(parts) == 1:
        return column(parts[0], count)
    return ca.vec(ca.horzcat(*(column(part, count) for part in parts)).T)


def rate(value: ca.SX, q: ca.SX, v: ca.SX, t: ca.SX) -> ca.SX:
    """d/dt of a function of (q, t), its differential divided by dt, dense; of one that holds v too, with v fixed."""
    return ca.densify(ca.jtimes(value, q, v) + ca.jtimes(value, t, ca.SX(1)))


def scattered(values: ca.SX, rows: Integers, n: int) -> ca.SX:
    """A column (n, 1) with each value added to its row."""
    if rows.size == 0:
        return ca.SX.zeros(n)
    pattern = ca.Sparsity.triplet(n, rows.size, rows.tolist(), list(range(rows.size)))
    return ca.densify(ca.mtimes(ca.SX(ca.DM(pattern, 1.0)), ca.densify(values)))


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
        self.t, self.q, self.v = symbols.t, symbols.q, symbols.v
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
            for columns, vector in ((self._positions, symbols.q), (self._velocities, symbols.v)):
                parts = tuple(vector[axis : self.first_generalized : 3] for axis in range(3))
                columns.fill(self.cartesian, parts)
        self._free = free if self.dependent.size else None
        if free is not None and self.dependent.size:
            self._positions.fill(self.dependent, free[0])
            self._velocities.fill(self.dependent, free[1])
        self._plain = self.algebra()
        # In an order in which each finds what it uses: a chain of any length needs no recursion.
        for step in model.order:
            if isinstance(step, str):
                self.definition(step)
                continue
            numbers = step.member_numbers + self.particles.first(step.entry)
            if not self._positions.has(numbers).all():
                particle = model.particles[step.entry]
                algebra = self.algebra(particle.members.taken(step.member_numbers))
                position = self.vector(particle.position, algebra)
                self._positions.fill(numbers, tuple(column(part, numbers.size) for part in position))

    def freed(self) -> tuple[Environment, ca.SX, ca.SX]:
        """The environment in which the dependent particles are free, with their r and v (3 D,), x of all before y."""
        count = self.dependent.size
        r, v = (ca.SX.sym(f"{word} free", 3 * count) for word in "rv")
        (x, y, z), (vx, vy, vz) = ca.vertsplit(r, count), ca.vertsplit(v, count)
        free = Environment(self._model, self.symbols, self._fixed, ((x, y, z), (vx, vy, vz)))
        return free, r, v

    def bound(self, value: ca.SX, r: ca.SX, v: ca.SX) -> ca.SX:
        """An expression of the symbols of `freed`, with positions and velocities in their place."""
        own = [ca.vertcat(*self.position(self.dependent)), ca.vertcat(*self.velocity(self.dependent))]
        found: ca.SX = ca.substitute([value], [r, v], own)[0]
        return found

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
        """An algebra of this environment. `variables`: index vectors (K,) of a family; `own`: `m`, `r`, `v` of a
        particle; `results`: what only a motion has; `leaves`: what coordinates stand for, if not these columns."""
        found = Resolver(self.names, leaves or self, variables or {}, own or {}, results)
        return SymbolicAlgebra(found.atom, found.special, self._fixed)

    def scalar(self, expression: nouns.Expression, algebra: SymbolicAlgebra | None = None) -> ca.SX:
        value: ca.SX = evaluate.scalar(expression.tree, algebra or self._plain)
        return value

    def vector(self, vector: nouns.VectorExpression, algebra: SymbolicAlgebra | None = None) -> Triple:
        used = algebra or self._plain
        if len(vector.parts) == 1:
            return evaluate.vector(vector.parts[0].tree, used)
        x, y, z = (evaluate.scalar(part.tree, used) for part in vector.parts)
        return x, y, z

    def equation(self, law: nouns.Law) -> ca.SX:
        """left - right of all members of a law, one after another."""
        parts = evaluate.difference(law.equation.tree, self.algebra(law.members.variables))
        return interleaved(parts, law.members.count)

    @cached_property
    def masses(self) -> ca.SX:
        """m of all particles, (N, 1)."""
        values = [
            column(self.scalar(p.mass, self.algebra(p.members.variables)), p.members.count)
            for p in self._model.particles
            if p.members.count
        ]
        return ca.vertcat(ca.SX(0, 1), *values)

    def constant(self, name: str) -> Value | None:
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
        return ca.SX(ca.DM(values.astype(float)))

    def definition(self, name: str) -> Value:
        if name not in self._values:
            self._values[name] = evaluate.value(self.names.definitions[name], self._plain)
        return self._values[name]
