"""Derivatives of the model's expressions over numpy arrays: a graph of operations, read forwards or backwards.

A value is an array (T, K): T rows of the table, K members of a family, 1 where all share it. What depends on
parameters alone is a plain array and leaves no trace on the graph. Leaves are of a kind: `q` coordinates, `v` their
rates, `t` time, `x` and `u` positions and velocities of dependent particles where these are taken as free.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Integers = npt.NDArray[np.int64]
Directions = Mapping[str, Array]


@dataclasses.dataclass(slots=True, eq=False)
class Edge:
    """y[:, into] += partial * parent[:, taken]; the partial of a `rate` is d/dt of the parent instead."""

    parent: GraphNode
    partial: Array | float | None
    taken: Integers | None = None
    into: slice | None = None


@dataclasses.dataclass(slots=True, eq=False)
class GraphNode:
    """A value (T, K) with what it was made from. A leaf has the kind and the indices of its coordinates, (K,)."""

    graph: AutodiffGraph
    number: int
    value: Array
    links: tuple[Edge, ...]
    kind: str = ""
    indices: Integers | None = None

    @property
    def is_rate(self) -> bool:
        """True if this is d/dt of its parent."""
        return self.kind == "rate"


# The second is an array that does not depend on the state.
Scalar = GraphNode | Array
Triple = tuple[Scalar, Scalar, Scalar]
Value = Scalar | Triple


def value(x: Scalar) -> Array:
    """The numbers of a scalar."""
    return x.value if isinstance(x, GraphNode) else np.asarray(x)


class AutodiffGraph:
    """Operations in the order in which they were carried out, over `data`: the arrays (T, width) of each kind.

    `motion`: the rates of `q`, `x` and `t` along the recorded motion.
    """

    def __init__(self, data: Directions, motion: Directions) -> None:
        self.data = data
        self.nodes: list[GraphNode] = []
        self._motion = motion
        self._leaves: dict[tuple[str, bytes], GraphNode] = {}
        self._rates: list[Array | None] = []

    def leaf(self, kind: str, indices: Integers) -> GraphNode:
        """Coordinates of a kind at these indices, (T, K)."""
        key = (kind, indices.tobytes())
        if key not in self._leaves:
            node = self.node(self.data[kind][:, indices], ())
            node.kind, node.indices = kind, indices
            self._leaves[key] = node
        return self._leaves[key]

    def node(self, result: Array, links: Sequence[Edge]) -> GraphNode:
        """The result of an operation."""
        added = GraphNode(self, len(self.nodes), result, tuple(links))
        self.nodes.append(added)
        return added

    def result(self, result: Array, *operands: tuple[Scalar, Array | float]) -> Scalar:
        """The result of an operation on operands with their partial derivatives; a constant of constants."""
        links = [Edge(x, partial) for x, partial in operands if isinstance(x, GraphNode)]
        return self.node(result, links) if links else result

    def rate(self, x: Scalar) -> Scalar:
        """d/dt along the motion of a function of coordinates and time (D.5)."""
        if not isinstance(x, GraphNode):
            return np.zeros((1, 1))
        rate = self.node(self.moved(x), (Edge(x, None),))
        rate.kind = "rate"
        return rate

    def moved(self, node: GraphNode) -> Array:
        """The values (T, K) of d/dt of a function of coordinates and time."""
        for other in self.nodes[len(self._rates) : node.number + 1]:
            self._rates.append(_tangent(other, self._rates, self._motion))
        rate = self._rates[node.number]
        return np.zeros_like(node.value) if rate is None else rate

    def forward(self, directions: Directions, last: int | None = None) -> list[Array | None]:
        """The change of every node along directions (T, width) of the kinds given; None where there is none."""
        changes: list[Array | None] = []
        for node in self.nodes[:last]:
            changes.append(_tangent(node, changes, directions))
        return changes

    def gradient(
        self, seeds: Sequence[tuple[Scalar, Array]], laws: Sequence[tuple[Scalar, Array]] = ()
    ) -> Gradient:
        """Backwards: the sum of seed * value, differentiated by every leaf; rates count as coordinates themselves.

        laws: values that are linear in rates, for which the sum of seed * B_i is added, by virtual displacements: that
        of d(X) is that of X (D.9), so that it is followed below the rate alone.
        """
        lower, upper = self._seeded(seeds), self._seeded(laws)
        collected = Gradient(self.data)
        for node in reversed(self.nodes):
            low, up = lower[node.number], upper[node.number]
            if low is not None:
                if node.indices is not None:
                    collected.add(node, node.kind, low)
                for link in node.links:
                    _pass(link, low, lower)
            if up is None:
                continue
            if node.kind in ("v", "u"):
                collected.add(node, "q" if node.kind == "v" else "x", up)
            for link in node.links:
                _pass(link, up, lower if node.is_rate else upper)
        return collected

    def _seeded(self, seeds: Sequence[tuple[Scalar, Array]]) -> list[Array | None]:
        adjoints: list[Array | None] = [None] * len(self.nodes)
        for x, seed in seeds:
            if isinstance(x, GraphNode):
                _add(adjoints, x, np.broadcast_to(seed, np.broadcast_shapes(np.shape(seed), x.value.shape)))
        return adjoints


class Gradient:
    """The derivatives collected at the leaves, an array (T, width) of each kind."""

    def __init__(self, data: Directions) -> None:
        self._data = data
        self._parts: dict[str, Array] = {}

    def __getitem__(self, kind: str) -> Array:
        if kind not in self._parts:
            self._parts[kind] = np.zeros(self._data[kind].shape, dtype=self._data["q"].dtype)
        return self._parts[kind]

    def add(self, node: GraphNode, kind: str, g: Array) -> None:
        """Add the adjoint of a leaf to its coordinates."""
        assert node.indices is not None
        scatter(self[kind], node.indices, np.broadcast_to(g, node.value.shape))


def scatter(target: Array, indices: Integers, values: Array) -> None:
    """target[:, indices] += values, also where an index comes twice."""
    if indices.size == 1:
        target[:, indices[0]] += values[:, 0]
        return
    unique = np.unique(indices)
    if unique.size == indices.size:
        target[:, indices] += values
        return
    order = np.argsort(indices, kind="stable")
    starts = np.searchsorted(indices[order], unique)
    target[:, unique] += np.add.reduceat(values[:, order], starts, axis=1)


def _tangent(node: GraphNode, known: Sequence[Array | None], directions: Directions) -> Array | None:
    if node.indices is not None:
        along = directions.get(node.kind)
        return None if along is None else along[:, node.indices]
    if node.is_rate:
        return None
    total: Array | None = None
    for link in node.links:
        change = known[link.parent.number]
        if change is None:
            continue
        if link.taken is not None:
            change = np.broadcast_to(change, link.parent.value.shape)[:, link.taken]
        if link.into is not None:
            if total is None:
                total = np.zeros(node.value.shape, dtype=change.dtype)
            total[:, link.into] += change
            continue
        change = link.partial * change
        total = change if total is None else total + change
    return None if total is None else np.broadcast_to(total, node.value.shape)


def _pass(link: Edge, g: Array, adjoints: list[Array | None]) -> None:
    if link.into is not None:
        g = g[:, link.into]
    if link.taken is not None:
        rows = np.zeros((g.shape[0], link.parent.value.shape[1]), dtype=g.dtype)
        scatter(rows, link.taken, np.broadcast_to(g, (g.shape[0], link.taken.size)))
        g = rows
    elif link.partial is not None and link.into is None:
        g = link.partial * g
    _add(adjoints, link.parent, g)


def _add(adjoints: list[Array | None], node: GraphNode, g: Array) -> None:
    """Add to the adjoint of a node, summed over the members that shared its value."""
    rows, members = node.value.shape
    if g.shape[1] != members:
        g = g.sum(axis=1, keepdims=True) if members == 1 else np.broadcast_to(g, (g.shape[0], members))
    if g.shape[0] != rows:
        g = np.broadcast_to(g, (rows, members))
    known = adjoints[node.number]
    adjoints[node.number] = g if known is None else known + g
