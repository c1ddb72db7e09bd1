"""Rows, forces and energies of a model at the rows of a table, from its own expressions over arrays.

Symbols as in (D.6) and (D.34): T rows of the table, n coordinates, N particles, Nd of them dependent, C rows of
which s are holonomic. Units are those of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lagcli.auditing.evidence import model_values
from lagcli.auditing.evidence.autodiff import (
    Array,
    Directions,
    GraphNode,
    NumberAlgebra,
    Scalar,
    Triple,
    Value,
    scatter,
    value,
)
from lagcli.auditing.evidence.model_values import SPOT, ModelIndex, ModelOnTable, RowValues
from lagcli.expression import evaluate
from lagcli.model import model as nouns
from lagcli.model.family import Integers

CHUNK = 200_000  # values of one array: what a cache holds
TINY = 1e-100  # a complex step has no cancellation: so small that its square is nothing


class LawValues(NamedTuple):
    """The values of a model at T rows, along all columns (T, n + 3 Nd) where nothing else is said.

    x, u, x_t (T, 3 Nd): positions, velocities and explicit rates of the dependent particles; f (T, s); w = B v + b,
    b (T, C); pull (T, n) = B^T lambda (D.22); V, V_t (T,) and V_q; L, L_t (T,) and L_q, L_v of the `lagrangian`;
    F: forces without a potential.
    """

    x: Array
    u: Array
    x_t: Array
    f: Array
    w: Array
    b: Array
    pull: Array
    V: Array
    V_t: Array
    V_q: Array
    L: Array
    L_t: Array
    L_q: Array
    L_v: Array
    F: Array

    def force(self, reactions: Array | float = 0.0) -> Array:
        """`reactions` with all that forces and potentials do along each column, and the `lagrangian` on coordinates:
        not what dependent particles hand on, nor -d/dt dL/dv."""
        force, n = reactions - self.V_q + self.F, self.pull.shape[1]
        force[:, :n] += self.L_q[:, :n]
        return np.asarray(force)


class ModelLaws:
    """The laws of a model, ready to be evaluated at any rows. jumps: those of `tolerances.Tolerance`; closed: numbers
    of inequalities that hold as equations g = 0, all where none are given; they stand after the holonomic rows."""

    def __init__(
        self,
        model: nouns.Model,
        jumps: Mapping[int, tuple[float, ...]] | None = None,
        closed: Sequence[int] | None = None,
    ) -> None:
        self.model, self.index, self.contacts = model, ModelIndex(model), model.contact_names
        closed = range(len(self.contacts)) if closed is None else closed
        self._bodies = model_values.geometries(self.index) if model.rigid else ()
        self.holonomic = [name for law in model.holonomic for name in law.rows]
        for body, geometry in zip(model.rigid, self._bodies, strict=True):
            count = len(geometry.pairs) + 3 * len(geometry.further)
            self.holonomic += [f"{body.name}.{i}" for i in range(1, count + 1)]
        self.holonomic += [self.contacts[j] for j in closed]
        self._closed = list(model_values.members(model.inequality, np.array(closed, dtype=np.int64)))
        self.rows = (*self.holonomic, *(name for law in model.differential for name in law.rows))
        self.s, self.C = len(self.holonomic), len(self.rows)
        self.of_contacts = slice(self.s - len(self.contacts), self.s)
        self._pattern: Array | None = None
        self._jumps = jumps or {}

    def values(self, t: Array, q: Array, v: Array, lam: Array) -> LawValues:
        """Everything at T rows: t (T,), q and v (T, n), here and below with further columns or not, lam (T, C)."""
        chunks = [self._values(t[k][:, None], q[k], v[k], lam[k]) for k in self.chunks(len(t))]
        return LawValues(*map(np.concatenate, zip(*chunks, strict=True)))

    def pushed(self, t: Array, q: Array, v: Array, F: Array) -> Array:
        """sum_k F_k . dr_k/dq_j over the dependent particles (D.30): F (T, 3 Nd) to (T, n)."""
        if not self.index.dependent.size:
            return np.zeros((len(q), self.index.n))
        return self._by_chunks(t, q, v, lambda true, k: _onto_coordinates(true, F[k]))

    def on_coordinates(self, t: Array, q: Array, v: Array, y: Array) -> Array:
        """y (T, n + 3 Nd) on coordinates themselves and through the dependent particles, (T, n)."""
        n = self.index.n
        return np.asarray(y[:, :n] + self.pushed(t, q, v, y[:, n:]))

    def displaced(self, t: Array, q: Array, v: Array, dq: Array) -> Array:
        """dr_k = sum_j dr_k/dq_j dq_j of the dependent particles (D.28): (T, n) to (T, 3 Nd)."""
        if not self.index.dependent.size:
            return np.zeros((len(t), 0))
        parts = self.index.dependent
        return self._by_chunks(t, q, v, lambda true, k: _changed(true, true.position(parts), {"q": dq[k]}))

    def _by_chunks(self, t: Array, q: Array, v: Array, make: Callable[[ModelOnTable, slice], Array]) -> Array:
        """The results at all rows of what is made at parts of them."""
        tables = ((self._true(t[k][:, None], q[k], v[k]), k) for k in self.chunks(len(t)))
        return np.concatenate([make(true, k) for true, k in tables])

    def matrix(self, t: Array, q: Array, v: Array) -> Array:
        """B (T, C, n) at few rows: rows that share no coordinate are differentiated together."""
        n = self.index.n
        if not self.C:
            return np.zeros((len(t), 0, n))
        # The coordinates that stand in a row: whatever a rate that is no number spoils
        if self._pattern is None:
            moving = np.tile(v[:1, :n], (n, 1))
            np.fill_diagonal(moving, np.nan)
            self._pattern = np.isnan(self.residuals(np.repeat(t[:1], n), np.tile(q[:1], (n, 1)), moving)[1]).T
        pattern = self._pattern
        # Groups of rows of which no two share a coordinate, greedily
        groups: list[list[int]] = []
        for i, row in enumerate(pattern):
            free_of_it = (group for group in groups if not (pattern[group] & row).any())
            if (group := next(free_of_it, None)) is None:
                groups.append(group := [])
            group.append(i)
        B = np.zeros((len(t), self.C, n))
        true, free = self._on_tables(t[:, None], q, v)
        rows = self._rows(free)
        for group in groups:
            seeds = np.zeros((1, self.C))
            seeds[0, group] = 1.0
            combined = self._pull(true, free, rows, np.broadcast_to(seeds, (len(t), self.C)))
            for i in group:
                B[:, i, pattern[i]] = combined[:, pattern[i]]
        return B

    def residuals(self, t: Array, q: Array, v: Array) -> tuple[Array, Array]:
        """f (T, s) and w = B v + b (T, C); the numbers may be complex."""
        free = self.free(t, q, v)
        return self._residuals(free, self._rows(free))

    def demanded(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """d/dt (B v + b) (T, C) along accelerations a (T, n), of coordinates alone, by a complex step."""
        step, q, v = 1j * TINY, q[:, : self.index.n], v[:, : self.index.n]
        return np.asarray(self.residuals(t + step, q + step * v, v + step * a)[1].imag / TINY)

    def total_lagrangian(self, t: Array, q: Array, v: Array) -> Array:
        """L = T - V + `lagrangian` (T,) of the whole system (D.36); the numbers may be complex."""
        free = self.free(t, q, v)
        total = (self.index.masses_along * free.data["v"] ** 2 / 2).sum(axis=1)
        for part, count in self._potentials(free):
            total = total - free.wide(part, count).sum(axis=1)
        for part in self._lagrangian(free):
            total = total + free.wide(part, 1)[:, 0]
        return np.asarray(total)

    def potential(self, on_table: ModelOnTable) -> Array:
        """V (T,) of the declared potentials and of constant forces."""
        parts = (on_table.wide(part, count).sum(axis=1) for part, count in self._potentials(on_table))
        return np.asarray(sum(parts, np.zeros(on_table.rows)))

    def parts_of_reactions(self, on_table: ModelOnTable, lam: Array) -> Array:
        """lambda_i B_ik on every particle, as far as the rows name it, (T, 3 N); on_table: as of `free`."""
        return self.index.components(_reactions(on_table, self._rows(on_table), lam))

    def free(self, t: Array, q: Array, v: Array) -> ModelOnTable:
        """The model on rows t (T,), q and v (T, n), in which positions of dependent particles are numbers."""
        return self._on_tables(t[:, None], q, v)[1]

    def chunks(self, rows: int) -> Iterator[slice]:
        """Parts of T rows that a cache holds."""
        step = max(8, CHUNK // max(1, self.index.n, self.C))
        return (slice(start, start + step) for start in range(0, max(rows, 1), step))

    def _on_tables(self, t: Array, q: Array, v: Array) -> tuple[ModelOnTable, ModelOnTable]:
        """The true one, and the one in which dependent particles are leaves."""
        true = self._true(t, q, v)
        if not self.index.dependent.size:
            return true, true
        parts = true.position(self.index.dependent)
        x = _interleaved(true, parts, value)
        u = _interleaved(true, parts, lambda part: _moved(true, part))
        whole = (np.concatenate(pair, axis=1) for pair in ((true.data["q"], x), (true.data["v"], u)))
        return true, ModelOnTable(self.index, t, *whole)

    def _true(self, t: Array, q: Array, v: Array) -> ModelOnTable:
        return ModelOnTable(self.index, t, q[:, : self.index.n], v[:, : self.index.n])

    def _rows(self, on_table: ModelOnTable) -> tuple[RowValues, RowValues]:
        return model_values.build(on_table, self._bodies, self._closed)

    def _values(self, t: Array, q: Array, v: Array, lam: Array) -> LawValues:
        true, free = self._on_tables(t, q, v)
        index, n = self.index, self.index.n
        whole, x_t = free.data["q"], np.zeros((len(q), 0))
        if index.dependent.size:
            x_t = _changed(true, true.position(index.dependent), {"t": np.ones_like(t)})
        rows = self._rows(free)
        f, w = self._residuals(free, rows)
        b = np.zeros((len(q), 0))
        if self.C:  # what is left of B v + b where nothing moves but time
            rest = ModelOnTable(index, t, whole, np.concatenate([np.zeros((len(q), n)), x_t], axis=1))
            b = self._residuals(rest, self._rows(rest))[1]
        potentials = list(self._potentials(free))
        V = np.asarray(sum((free.wide(p, c).sum(axis=1) for p, c in potentials), np.zeros(len(q))))
        slope = free.graph.gradient([(p, np.ones((1, c))) for p, c in potentials])
        extra = self._lagrangian(free)
        L = sum((free.wide(p, 1)[:, 0] for p in extra), np.zeros(len(q)))
        pull_of_L = free.graph.gradient([(p, np.ones((1, 1))) for p in extra])
        # Forces without a potential on particles and on coordinates
        F = np.zeros(whole.shape)
        for targets, parts, _ in self._on_particles(free, constant=False):
            for axis, part in enumerate(parts):
                scatter(F, index.columns[targets, axis], free.wide(part, targets.size))
        for force in self.model.forces:
            if isinstance(force, nouns.GeneralizedForce) and force.action.targets.size:
                action = force.action
                algebra = free.algebra(action.variables(force.members))
                pushes = free.wide(evaluate.scalar(force.force.tree, algebra), action.targets.size)
                scatter(F, index.first_generalized + action.targets, pushes)
        return LawValues(
            x=whole[:, n:], u=free.data["v"][:, n:], x_t=x_t, f=f, w=w, b=b,
            pull=self._pull(true, free, rows, lam),
            V=V, V_t=slope["t"][:, 0], V_q=slope["q"],
            L=L, L_t=pull_of_L["t"][:, 0], L_q=pull_of_L["q"], L_v=pull_of_L["v"], F=F,
        )  # fmt: skip

    def _residuals(self, on_table: ModelOnTable, rows: tuple[RowValues, RowValues]) -> tuple[Array, Array]:
        kind = on_table.data["q"].dtype
        surfaces, laws = rows
        f, w = np.zeros((on_table.rows, self.s), dtype=kind), np.zeros((on_table.rows, self.C), dtype=kind)
        for x, indices in surfaces:
            f[:, indices] = on_table.wide(x, indices.size)
            w[:, indices] = np.broadcast_to(_moved(on_table, x), (on_table.rows, indices.size))
        model_values.reduced(f, self._jumps)
        for x, indices in laws:
            w[:, indices] = on_table.wide(x, indices.size)
        return f, w

    def _pull(
        self, true: ModelOnTable, free: ModelOnTable, rows: tuple[RowValues, RowValues], lam: Array
    ) -> Array:
        along, n = _reactions(free, rows, lam), self.index.n
        return along if true is free else along[:, :n] + _onto_coordinates(true, along[:, n:])

    def _potentials(self, on_table: ModelOnTable) -> Iterator[tuple[Scalar, int]]:
        """V in parts with the number of members to sum over: declared ones, and -F . r of constant forces."""
        for force in self.model.forces:
            if isinstance(force, nouns.Potential) and force.members.count:
                algebra = on_table.algebra(force.members.variables)
                yield evaluate.scalar(force.expression.tree, algebra), force.members.count
        for targets, F, algebra in self._on_particles(on_table, constant=True):
            for part, position in zip(F, on_table.position(targets), strict=True):
                product = algebra.operation(SPOT, "mul", part, position)
                yield algebra.operation(SPOT, "neg", product), targets.size

    def _lagrangian(self, on_table: ModelOnTable) -> list[Scalar]:
        declared = self.model.lagrangian
        return [] if declared is None else [evaluate.scalar(declared.tree, on_table.algebra())]

    def _on_particles(
        self, on_table: ModelOnTable, constant: bool
    ) -> Iterator[tuple[Integers, Triple, NumberAlgebra]]:
        for force in self.model.forces:
            if not isinstance(force, nouns.ParticleForce) or force.constant != constant:
                continue
            targets = force.action.targets
            if targets.size == 0:
                continue
            own: dict[str, Value] = {"m": self.index.masses[targets][None, :]}
            own |= {"r": on_table.position(targets), "v": on_table.velocity(targets)}
            algebra = on_table.algebra(force.action.variables(force.members), own)
            yield targets, on_table.vector(force.force, algebra), algebra


def _reactions(on_table: ModelOnTable, rows: tuple[RowValues, RowValues], lam: Array) -> Array:
    """sum_i lambda_i B_i along the columns of a scene."""
    surfaces, laws = ([(x, lam[:, indices]) for x, indices in each] for each in rows)
    return on_table.graph.gradient(surfaces, laws)["q"]


def _onto_coordinates(true: ModelOnTable, F: Array) -> Array:
    """sum_k F_k . dr_k/dq_j of forces (T, 3 Nd) on the dependent particles, (T, n)."""
    parts = true.position(true.index.dependent)
    return true.graph.gradient([(part, F[:, axis::3]) for axis, part in enumerate(parts)])["q"]


def _moved(on_table: ModelOnTable, x: Scalar) -> Array:
    return on_table.graph.moved(x) if isinstance(x, GraphNode) else np.zeros((1, 1))


def _changed(on_table: ModelOnTable, parts: Sequence[Scalar], directions: Directions) -> Array:
    """The change of vectors along directions of the leaves, (T, 3 K)."""
    changes = on_table.graph.forward(directions)

    def take(x: Scalar) -> Array:
        change = changes[x.number] if isinstance(x, GraphNode) else None
        return np.zeros((1, 1)) if change is None else change

    return _interleaved(on_table, parts, take)


def _interleaved(on_table: ModelOnTable, parts: Sequence[Scalar], take: Callable[[Scalar], Array]) -> Array:
    """x1, y1, z1, x2, ... of vectors of K members, (T, 3 K)."""
    count = on_table.index.dependent.size
    components = [np.broadcast_to(take(part), (on_table.rows, count)) for part in parts]
    return np.stack(components, axis=2).reshape(on_table.rows, 3 * count)
