"""The values of the names of a model at the rows of a table: arrays (T, K) on a graph."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lagcli.auditing.evidence.autodiff import (
    Array,
    AutodiffGraph,
    Directions,
    Edge,
    GraphNode,
    Scalar,
    Triple,
    Value,
    value,
)
from lagcli.auditing.evidence.autodiff_algebra import NumberAlgebra
from lagcli.expression import evaluate
from lagcli.model import model as nouns
from lagcli.model.family import Integers
from lagcli.model.resolve import ModelNames, Resolver, Results


class ModelIndex:
    """The numbering of a model: particles and coordinates by number, their indices among the coordinates, masses."""

    def __init__(self, model: nouns.Model) -> None:
        self.model = model
        self.names = ModelNames(model)
        self.particles, self.coordinates = self.names.particles, self.names.coordinates
        counts = [p.members.count for p in model.particles]
        self.is_dependent = np.repeat(np.array([p.is_dependent for p in model.particles], dtype=bool), counts)
        self.cartesian, self.dependent = np.flatnonzero(~self.is_dependent), np.flatnonzero(self.is_dependent)
        # The index of a particle among those of its kind.
        self.rank = (
            np.where(self.is_dependent, np.cumsum(self.is_dependent), np.cumsum(~self.is_dependent)) - 1
        )
        self.first_generalized = 3 * self.cartesian.size
        self.n = self.first_generalized + len(self.coordinates)
        self.masses = np.concatenate([np.zeros(0), *(np.ravel(p.mass_values) for p in model.particles)])
        self.constants: dict[str, float | nouns.Vector3] = {"dt": 1.0, **model.constants}
        self.constants |= {p.name: p.value for p in model.parameters}


def start(model: nouns.Model) -> tuple[float, Array, Array]:
    """t, q (n,) and v (n,) of the declared start."""
    cartesian = [(p.start, p.start_velocity) for p in model.particles if p.start is not None]
    q = [position.ravel() for position, _ in cartesian] + [c.value for c in model.coordinates]
    v = [moving.ravel() for _, moving in cartesian] + [c.rate for c in model.coordinates]
    nothing = np.zeros(0)
    return model.simulation.start, np.concatenate([nothing, *q]), np.concatenate([nothing, *v])


class ModelOnTable:
    """The model over rows of a table: t (T, 1), q and v (T, n).

    free: positions and velocities (T, 3 Nd) of the dependent particles, which are then leaves of their own; else
    they are evaluated from their expressions.
    """

    def __init__(
        self, index: ModelIndex, t: Array, q: Array, v: Array, free: tuple[Array, Array] | None = None
    ) -> None:
        self.index, self.rows = index, q.shape[0]
        data: dict[str, Array] = {"t": t, "q": q, "v": v}
        motion: dict[str, Array] = {"t": np.ones_like(t), "q": v}
        if free is not None:
            data |= {"x": free[0], "u": free[1]}
            motion["x"] = free[1]
        self.graph = AutodiffGraph(data, motion)
        self._free = free is not None
        self._positions: dict[int, tuple[Triple, Integers]] = {}
        self._batch: Integers = np.full(len(index.particles), -1, dtype=np.int64)
        self._row: Integers = np.zeros(len(index.particles), dtype=np.int64)
        self._values: dict[str, Value] = {}
        # Definitions and positions in an order in which each finds what it uses, without recursion
        for number, step in enumerate(index.model.order):
            if isinstance(step, str):
                self.definition(step)
                continue
            particle = index.model.particles[step.entry]
            if self._free or not particle.is_dependent:
                continue
            numbers = step.member_numbers + index.particles.first(step.entry)
            algebra = self.algebra(particle.members.taken(step.member_numbers))
            self._positions[number] = (self.vector(particle.position, algebra), numbers)
            self._batch[numbers], self._row[numbers] = number, np.arange(numbers.size)

    @property
    def data(self) -> Directions:
        """The arrays of each kind."""
        return self.graph.data

    def constant(self, name: str) -> Value | None:
        """t, dt, a constant or a parameter; None for another name."""
        if name == "t":
            return self.graph.leaf("t", np.zeros(1, dtype=np.int64))
        known = self.index.constants.get(name)
        if isinstance(known, tuple):
            x, y, z = (np.full((1, 1), part) for part in known)
            return x, y, z
        return None if known is None else np.full((1, 1), float(known))

    def variable(self, name: str, values: Integers) -> Array:
        """The values of an index variable, (1, K)."""
        return values.astype(float)[None, :]

    def differential(self, x: Scalar) -> Scalar:
        """The rate of change with the motion."""
        return self.graph.rate(x)

    def position(self, numbers: Integers) -> Triple:
        """r of particles."""
        return self._vector(numbers, rates=False)

    def velocity(self, numbers: Integers) -> Triple:
        """v of particles, of dependent ones the total time derivative of x(q, t) (D.27)."""
        return self._vector(numbers, rates=True)

    def generalized(self, numbers: Integers, rates: bool) -> Scalar:
        """Generalized coordinates, or their rates."""
        return self.graph.leaf("v" if rates else "q", self.index.first_generalized + numbers)

    def algebra(
        self,
        variables: Mapping[str, Integers] | None = None,
        own: Mapping[str, Value] | None = None,
        results: Results[Scalar] | None = None,
    ) -> NumberAlgebra:
        """An algebra with index vectors (K,) of a family, `m`, `r`, `v` of a particle, and results of the run."""
        resolver = Resolver(self.index.names, self, variables or {}, own or {}, results)
        return NumberAlgebra(self.graph, resolver.atom, resolver.special)

    def vector(self, vector: nouns.VectorExpression, algebra: NumberAlgebra) -> Triple:
        """The components of a vector expression."""
        if len(vector.parts) == 1:
            return evaluate.vector(vector.parts[0].tree, algebra)
        x, y, z = (evaluate.scalar(part.tree, algebra) for part in vector.parts)
        return x, y, z

    def definition(self, name: str) -> Value:
        """The value of a definition."""
        if name not in self._values:
            self._values[name] = evaluate.value(self.index.names.definitions[name], self.algebra())
        return self._values[name]

    def wide(self, x: Scalar, count: int) -> Array:
        """The numbers of a scalar, (T, count)."""
        return np.broadcast_to(value(x), (self.rows, count))

    def _vector(self, numbers: Integers, rates: bool) -> Triple:
        index = self.index
        dependent = index.is_dependent[numbers]
        if not dependent.any() or (self._free and dependent.all()):
            kind = ("v" if rates else "q") if not dependent.any() else ("u" if rates else "x")
            first = 3 * index.rank[numbers]
            a, b, c = (self.graph.leaf(kind, first + axis) for axis in range(3))
            return a, b, c
        groups = np.where(dependent, -2 if self._free else self._batch[numbers], -1)
        if np.unique(groups).size == 1:
            return self._evaluated(int(groups[0]), numbers, rates)
        parts: list[list[tuple[Scalar, Integers]]] = [[], [], []]
        for group in np.unique(groups):
            member_numbers = np.flatnonzero(groups == group)
            if group < 0:
                vector = self._vector(numbers[member_numbers], rates)
            else:
                vector = self._evaluated(int(group), numbers[member_numbers], rates)
            for axis in range(3):
                parts[axis].append((vector[axis], member_numbers))
        x, y, z = (self._joined(part, numbers.size) for part in parts)
        return x, y, z

    def _evaluated(self, batch: int, numbers: Integers, rates: bool) -> Triple:
        triple, members = self._positions[batch]
        rows = self._row[numbers]
        is_whole = rows.size == members.size and bool((rows == np.arange(rows.size)).all())

        def taken(part: Scalar) -> Scalar:
            scalar = self.graph.rate(part) if rates else part
            numbers = value(scalar)
            if is_whole or numbers.ndim < 2 or numbers.shape[1] == 1:
                return scalar
            some = numbers[:, rows]
            return (
                self.graph.node(some, (Edge(scalar, 1.0, rows),)) if isinstance(scalar, GraphNode) else some
            )

        x, y, z = map(taken, triple)
        return x, y, z

    def _joined(self, parts: list[tuple[Scalar, Integers]], count: int) -> Scalar:
        """Scalars of several groups of members put together in the order asked for."""
        pieces = [(x, self.wide(x, member_numbers.size)) for x, member_numbers in parts]
        order = np.argsort(np.concatenate([member_numbers for _, member_numbers in parts]), kind="stable")
        together = np.concatenate([piece for _, piece in pieces], axis=1)
        links, start = [], 0
        for x, piece in pieces:
            if isinstance(x, GraphNode):
                column = np.zeros(piece.shape[1], dtype=np.int64)
                taken = column if x.value.shape[1] == 1 else np.arange(piece.shape[1])
                links.append(Edge(x, 1.0, taken, slice(start, start + piece.shape[1])))
            start += piece.shape[1]
        joined = self.graph.node(together, links)
        return self.graph.node(together[:, order], (Edge(joined, 1.0, order),))
