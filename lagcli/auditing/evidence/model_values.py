"""The values of the names and of the rows of a model at the rows of a table: arrays (T, K) on a graph.

Holonomic rows come first, then those of rigid bodies, then inequalities that are closed, then differential rows.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from lagcli.auditing.evidence.autodiff import (
    Array,
    AutodiffGraph,
    Directions,
    Edge,
    GraphNode,
    NumberAlgebra,
    Scalar,
    Triple,
    Value,
    value,
)
from lagcli.equations import rigid
from lagcli.expression import evaluate, tree
from lagcli.model import model as nouns
from lagcli.model.family import Integers
from lagcli.model.resolve import ModelNames, Resolver, Results

SPOT = tree.Node(0, 0)
# Turns of all angles but one that are tried where a row has several: what no motion satisfies stays above its limit,
# as no more than some thousand values are compared.
MOST_TURNS = {1: 0, 2: 1000, 3: 20}
RowValues = list[tuple[Scalar, Integers]]
"""Values of rows with their indices among all rows."""


class ModelIndex:
    """The numbering of a model: particles and coordinates by number, and what moves in columns: the n coordinates,
    those of Cartesian particles first, and after them the positions of the Nd dependent particles."""

    def __init__(self, model: nouns.Model) -> None:
        self.model = model
        self.names = ModelNames(model)
        self.particles, self.coordinates = self.names.particles, self.names.coordinates
        counts = [p.members.count for p in model.particles]
        self.is_dependent = np.repeat(np.array([p.is_dependent for p in model.particles], dtype=bool), counts)
        self.cartesian, self.dependent = np.flatnonzero(~self.is_dependent), np.flatnonzero(self.is_dependent)
        self.first_generalized = 3 * self.cartesian.size
        self.n = self.first_generalized + len(self.coordinates)
        self.width = self.n + 3 * self.dependent.size
        # The columns of x, y, z of each particle, (N, 3)
        self.columns: Integers = np.zeros((self.is_dependent.size, 3), dtype=np.int64)
        self.columns[self.cartesian] = np.arange(self.first_generalized).reshape(-1, 3)
        self.columns[self.dependent] = np.arange(self.n, self.width).reshape(-1, 3)
        of_entries = (np.ravel(p.mass_values) for p in model.particles)
        self.masses: Array = np.concatenate([np.zeros(0), *of_entries])
        self.masses_along: Array = np.zeros(self.width)  # each column
        self.masses_along[self.columns] = self.masses[:, None]
        self.constants: dict[str, float | nouns.Vector3] = {"dt": 1.0, **model.constants}
        self.constants |= {p.name: p.value for p in model.parameters}

    def components(self, y: Array) -> Array:
        """The components (T, 3 N) of all particles, in their order, of what is known of each column."""
        return np.asarray(y[:, self.columns.ravel()])


def start(model: nouns.Model) -> tuple[float, Array, Array]:
    """t, q (n,) and v (n,) of the declared start."""
    cartesian = [(p.start, p.start_velocity) for p in model.particles if p.start is not None]
    q = [position.ravel() for position, _ in cartesian] + [c.value for c in model.coordinates]
    v = [moving.ravel() for _, moving in cartesian] + [c.rate for c in model.coordinates]
    nothing = np.zeros(0)
    return model.simulation.start, np.concatenate([nothing, *q]), np.concatenate([nothing, *v])


class ModelOnTable:
    """The model over rows of a table: t (T, 1), q and v (T, n): dependent particles are evaluated from their
    expressions. With q and v of all columns, (T, n + 3 Nd), these are free, leaves as the coordinates are."""

    def __init__(self, index: ModelIndex, t: Array, q: Array, v: Array) -> None:
        self.index, self.rows = index, q.shape[0]
        self.graph = AutodiffGraph({"t": t, "q": q, "v": v}, {"t": np.ones_like(t), "q": v})
        is_free = q.shape[1] > index.n
        # Of each particle the batch in which it was evaluated, and its number there; -1 of leaves
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
            if is_free or not particle.is_dependent:
                continue
            numbers = step.member_numbers + index.particles.first(step.entry)
            algebra = self.algebra(particle.members.taken(step.member_numbers))
            self._positions[number] = (self.vector(particle.position, algebra), numbers)
            self._batch[numbers], self._row[numbers] = number, np.arange(numbers.size)

    @property
    def data(self) -> Directions:
        return self.graph.data

    def constant(self, name: str) -> Value | None:
        if name == "t":
            return self.graph.leaf("t", np.zeros(1, dtype=np.int64))
        known = self.index.constants.get(name)
        if isinstance(known, tuple):
            x, y, z = (np.full((1, 1), part) for part in known)
            return x, y, z
        return None if known is None else np.full((1, 1), float(known))

    def variable(self, name: str, values: Integers) -> Array:
        return values.astype(float)[None, :]

    def differential(self, x: Scalar) -> Scalar:
        return self.graph.rate(x)

    def position(self, numbers: Integers) -> Triple:
        return self._vector(numbers, rates=False)

    def velocity(self, numbers: Integers) -> Triple:
        """v of particles, of dependent ones the total time derivative of x(q, t) (D.27)."""
        return self._vector(numbers, rates=True)

    def generalized(self, numbers: Integers, rates: bool) -> Scalar:
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
        if len(vector.parts) == 1:
            return evaluate.vector(vector.parts[0].tree, algebra)
        x, y, z = (evaluate.scalar(part.tree, algebra) for part in vector.parts)
        return x, y, z

    def definition(self, name: str) -> Value:
        if name not in self._values:
            self._values[name] = evaluate.value(self.index.names.definitions[name], self.algebra())
        return self._values[name]

    def wide(self, x: Scalar, count: int) -> Array:
        """The numbers of a scalar, (T, count)."""
        return np.broadcast_to(value(x), (self.rows, count))

    def _vector(self, numbers: Integers, rates: bool) -> Triple:
        """r or v of particles: leaves, or what was evaluated in one of several batches, put together."""
        batches = self._batch[numbers]
        kinds = np.unique(batches).tolist() or [-1]
        members = [np.flatnonzero(batches == batch) for batch in kinds]
        pairs = zip(kinds, members, strict=True)
        vectors = [self._of_batch(batch, numbers[own], rates) for batch, own in pairs]
        if len(vectors) == 1:
            return vectors[0]
        # Put together in the order asked for
        order = np.argsort(np.concatenate(members), kind="stable")
        components: list[Scalar] = []
        for parts in zip(*vectors, strict=True):
            pieces = [self.wide(part, own.size) for part, own in zip(parts, members, strict=True)]
            links = []
            for part, own in zip(parts, members, strict=True):
                if isinstance(part, GraphNode):
                    column = np.zeros(own.size, dtype=np.int64)
                    taken = column if part.value.shape[1] == 1 else np.arange(own.size)
                    links.append(Edge(part, 1.0, taken, own))
            components.append(self.graph.node(np.concatenate(pieces, axis=1)[:, order], links))
        x, y, z = components
        return x, y, z

    def _of_batch(self, batch: int, numbers: Integers, rates: bool) -> Triple:
        if batch < 0:
            columns = self.index.columns[numbers]
            a, b, c = (self.graph.leaf("v" if rates else "q", columns[:, axis]) for axis in range(3))
            return a, b, c
        triple, members = self._positions[batch]
        rows = self._row[numbers]
        is_whole = rows.size == members.size and bool((rows == np.arange(rows.size)).all())

        def taken(part: Scalar) -> Scalar:
            scalar = self.graph.rate(part) if rates else part
            numbers = value(scalar)
            if is_whole or numbers.ndim < 2 or numbers.shape[1] == 1:
                return scalar
            some = numbers[:, rows]
            if not isinstance(scalar, GraphNode):
                return some
            return self.graph.node(some, (Edge(scalar, 1.0, rows),))

        x, y, z = map(taken, triple)
        return x, y, z


def build(
    on_table: ModelOnTable,
    bodies: Sequence[rigid.Geometry],
    closed: Sequence[tuple[nouns.Inequality, Integers]],
) -> tuple[RowValues, RowValues]:
    """The holonomic and the differential rows; bodies: of `geometries`, closed: of `members`."""
    model = on_table.index.model
    surfaces: RowValues = []
    laws: RowValues = []
    first = 0

    def add(
        into: RowValues, equation: nouns.Expression, variables: Mapping[str, Integers], count: int
    ) -> int:
        """Add the rows of a law, left - right; those of one member stand together. The number of rows so far."""
        assert isinstance(equation.tree, tree.Relation)
        parts = evaluate.difference(equation.tree, on_table.algebra(variables)) if count else ()
        members = np.arange(count, dtype=np.int64)
        for axis, part in enumerate(parts):
            into.append((part, first + len(parts) * members + axis))
        return first + len(parts) * count

    for holonomic in model.holonomic:
        first = add(surfaces, holonomic.equation, holonomic.members.variables, holonomic.members.count)
    for body, geometry in zip(model.rigid, bodies, strict=True):
        for x, offsets in _rigid_rows(on_table, np.array(body.particles, dtype=np.int64), geometry):
            surfaces.append((x, first + offsets))
        first += len(geometry.pairs) + 3 * len(geometry.further)
    for inequality, members in closed:
        first = add(surfaces, inequality.equation, inequality.members.taken(members), members.size)
    for differential in model.differential:
        first = add(laws, differential.equation, differential.members.variables, differential.members.count)
    return surfaces, laws


def geometries(index: ModelIndex) -> tuple[rigid.Geometry, ...]:
    """The geometry of each rigid body at the declared start."""
    t, q, v = start(index.model)
    on_table = ModelOnTable(index, np.full((1, 1), t), q[None, :], v[None, :])
    by_body = []
    for body in index.model.rigid:
        numbers = np.array(body.particles, dtype=np.int64)
        parts = on_table.position(numbers)
        by_body.append(rigid.geometry(np.stack([on_table.wide(p, numbers.size)[0] for p in parts], axis=1)))
    return tuple(by_body)


def members(
    laws: Sequence[nouns.Inequality], numbers: Integers
) -> Iterator[tuple[nouns.Inequality, Integers]]:
    """The inequalities with those of their members that are among these numbers of all."""
    first = 0
    for law in laws:
        count = law.members.count
        own = numbers[(numbers >= first) & (numbers < first + count)] - first
        if own.size:
            yield law, own
        first += count


def _rigid_rows(
    on_table: ModelOnTable, numbers: Integers, geometry: rigid.Geometry
) -> Iterator[tuple[Scalar, Integers]]:
    """The rows of a rigid body: distances of the base, then each further particle by its coefficients."""
    done = functools.partial(on_table.algebra().operation, SPOT)
    base = numbers[list(geometry.base)]

    def minus(left: Triple, right: Triple) -> list[Scalar]:
        return [done("sub", u, w) for u, w in zip(left, right, strict=True)]

    def point(j: int) -> Triple:
        return on_table.position(base[j : j + 1])

    if geometry.pairs:
        one, other = (base[[pair[side] for pair in geometry.pairs]] for side in (0, 1))
        square: Scalar = np.zeros((1, 1))
        for part in minus(on_table.position(one), on_table.position(other)):
            square = done("add", square, done("mul", part, part))
        distances = np.array(geometry.distances)[None, :]
        yield done("sub", done("sqrt", square), distances), np.arange(len(geometry.pairs))
    if not geometry.further:
        return
    further = on_table.position(numbers[list(geometry.further)])
    normal: list[Scalar] = [np.zeros((1, 1))] * 3
    if geometry.gamma.size:
        (p, q, r), (x, y, z) = minus(point(1), point(0)), minus(point(2), point(0))
        for axis, (c, d, e, f) in enumerate(((q, z, r, y), (r, x, p, z), (p, y, q, x))):
            minor = done("sub", done("mul", c, d), done("mul", e, f))
            normal[axis] = done("mul", minor, geometry.gamma[None, :])
    indices = len(geometry.pairs) + 3 * np.arange(len(geometry.further))
    for axis in range(3):
        row = done("sub", further[axis], normal[axis])
        for j in range(len(geometry.base)):
            row = done("sub", row, done("mul", point(j)[axis], geometry.alpha[None, :, j]))
        yield row, indices + axis


def reduced(f: Array, jumps: Mapping[int, tuple[float, ...]]) -> None:
    """Take the whole turns of angles out of f (T, s), in place. jumps: the constants of each row, by its number. A run
    goes on smoothly beyond the cut of `atan2` or `atan`: f differs by whole numbers of what one turn changes it."""
    for row, (size, *others) in jumps.items():
        if 1 + len(others) not in MOST_TURNS:
            continue
        x = f[:, row].real
        best = x - size * np.round(x / size)
        most = MOST_TURNS[1 + len(others)]
        for turns in itertools.product(range(-most, most + 1), repeat=len(others)):
            rest = x - sum(k * other for k, other in zip(turns, others, strict=True))
            rest = rest - size * np.round(rest / size)
            best = np.where(np.abs(rest) < np.abs(best), rest, best)
        f[:, row] += best - x
