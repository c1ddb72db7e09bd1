"""Derivatives of the model's expressions over numpy arrays: a graph of operations, read forwards or backwards.

A value is an array (T, K): T rows of the table, K members of a family or 1; what depends on parameters alone leaves no
trace on the graph. Leaves are of a kind: `q` coordinates, `v` their rates, `t` time. A tiny imaginary part of numbers
carries one more derivative (the complex step): what is not analytic goes by the real part.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli.arrays import Integers
from lagcli.expression import functions, tree
from lagcli.model.resolve import Reference

Array = npt.NDArray[Any]
Directions = Mapping[str, Array]


@dataclasses.dataclass(slots=True, eq=False)
class Edge:
    """y[:, into] += partial * parent[:, taken]; the partial of a `rate` is d/dt of the parent instead."""

    parent: GraphNode
    partial: Array | float | None
    taken: Integers | None = None
    into: Integers | None = None


@dataclasses.dataclass(slots=True, eq=False)
class GraphNode:
    """A value (T, K) with what it was made from. A leaf has the kind and the indices of its coordinates, (K,)."""

    graph: AutodiffGraph
    number: int
    value: Array
    links: tuple[Edge, ...]
    kind: str = ""
    indices: Integers | None = None


# The second is an array that does not depend on the state.
Scalar = GraphNode | Array
Triple = tuple[Scalar, Scalar, Scalar]
Value = Scalar | Triple


def value(x: Scalar) -> Array:
    """The numbers of a scalar."""
    return x.value if isinstance(x, GraphNode) else np.asarray(x)


class AutodiffGraph:
    """Operations in the order in which they were carried out, over `data`: the arrays (T, width) of each kind.

    `motion`: the rates of `q` and `t` along the recorded motion.
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

    def forward(self, directions: Directions) -> list[Array | None]:
        """The change of every node along directions (T, width) of the kinds given; None where there is none."""
        changes: list[Array | None] = []
        for node in self.nodes:
            changes.append(_tangent(node, changes, directions))
        return changes

    def gradient(
        self, seeds: Sequence[tuple[Scalar, Array]], laws: Sequence[tuple[Scalar, Array]] = ()
    ) -> dict[str, Array]:
        """Backwards: the sum of seed * value by every leaf of a kind, (T, width); rates count as leaves too.

        laws: values that are linear in rates, for which the sum of seed * B_i is added: the virtual displacement of
        d(X) is that of X (D.9), so that it is followed below the rate alone.
        """
        adjoints: list[list[Array | None]] = []
        for given in (seeds, laws):
            adjoints.append([None] * len(self.nodes))
            for x, seed in given:
                if isinstance(x, GraphNode):
                    wide = np.broadcast_shapes(np.shape(seed), x.value.shape)
                    _add(adjoints[-1], x, np.broadcast_to(seed, wide))
        lower, upper = adjoints
        kind = self.data["q"].dtype
        collected = {name: np.zeros(values.shape, dtype=kind) for name, values in self.data.items()}
        for node in reversed(self.nodes):
            low, up = lower[node.number], upper[node.number]
            if low is not None:
                if node.indices is not None:
                    scatter(collected[node.kind], node.indices, np.broadcast_to(low, node.value.shape))
                for link in node.links:
                    _pass(link, low, lower)
            if up is None:
                continue
            if node.indices is not None and node.kind == "v":
                scatter(collected["q"], node.indices, np.broadcast_to(up, node.value.shape))
            for link in node.links:
                _pass(link, up, lower if node.kind == "rate" else upper)
        return collected


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
    if node.kind == "rate":
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


class NumberAlgebra:
    """Scalars are nodes of a graph or plain arrays; see `evaluate.Algebra`. Names come from `atom` and `special`."""

    def __init__(
        self,
        graph: AutodiffGraph,
        atom: Callable[[Reference], Value],
        special: Callable[[tree.Call, NumberAlgebra], Value],
    ) -> None:
        self._graph, self.atom, self._special = graph, atom, special

    def special(self, node: tree.Call) -> Value:
        return self._special(node, self)

    def number(self, node: tree.Number) -> Scalar:
        return np.full((1, 1), float(node.text))

    def operation(self, node: tree.Node, name: str, *parts: Scalar) -> Scalar:
        if name in functions.TABLE:
            return self._function(name, parts)
        values = [value(x) for x in parts]
        if name == "pow":
            x, e = values
            if np.all(e == 0.5):
                return self._function("sqrt", parts[:1])
            result = _power(x, e)
            by_base = np.where(e == 0.0, 0.0, e * _power(x, np.where(e == 0.0, 1.0, e - 1.0)))
            # Where the exponent is a node the base is positive.
            by_exponent = result * np.log(x) if isinstance(parts[1], GraphNode) else 0.0
            return self._graph.result(result, (parts[0], by_base), (parts[1], by_exponent))
        result = functions.ARITHMETIC[name](*values)
        slopes: tuple[Array | float, ...]
        if name == "mul":
            slopes = values[1], values[0]
        elif name == "div":
            slopes = 1 / values[1], -result / values[1]
        else:
            slopes = {"add": (1.0, 1.0), "sub": (1.0, -1.0), "neg": (-1.0,)}[name]
        return self._graph.result(result, *zip(parts, slopes, strict=True))

    def _function(self, name: str, arguments: tuple[Scalar, ...]) -> Scalar:
        row = functions.TABLE[name]
        if row.arguments == functions.MANY:
            extreme, *others = arguments
            for other in others:
                a, b = value(extreme), value(other)
                first = a.real <= b.real if name == "min" else a.real >= b.real
                operands = (extreme, first * 1.0), (other, ~first * 1.0)
                extreme = self._graph.result(np.where(first, a, b), *operands)
            return extreme
        values = [value(x) for x in arguments]
        is_analytic = not (row.is_piecewise or row.jumps == "zero")
        given = values if is_analytic else [x.real for x in values]
        result = row.array(*given)
        assert row.slope is not None, name
        slope = row.slope(np, *(given if row.is_piecewise else values), result)
        slopes = slope if isinstance(slope, tuple) else (slope,)
        if not is_analytic and any(map(np.iscomplexobj, values)):
            result = result + 1j * sum(np.real(a) * x.imag for a, x in zip(slopes, values, strict=True))
        return self._graph.result(result, *zip(arguments, slopes, strict=True))


def _power(x: Array, e: Array) -> Array:
    if e.size == 1 and (one := float(e.real.flat[0])).is_integer() and abs(one) <= 64:
        return np.asarray(np.power(x, one) if np.isrealobj(x) else x ** int(one))
    return np.asarray(np.power(x, e))
