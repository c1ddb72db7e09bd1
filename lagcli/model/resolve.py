"""The one place that says what a name in an expression of a model stands for, in whatever algebra it is evaluated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, Protocol, TypeVar

import numpy as np

from lagcli.arrays import Integers
from lagcli.expression import evaluate, integers, tree
from lagcli.expression.evaluate import Value
from lagcli.expression.functions import Number
from lagcli.model import family
from lagcli.model.family import MemberIndex
from lagcli.model.model import Model

Reference = tree.Reference
IndexValue = Number  # or a vector (K,) over the members of a family
Variables = Mapping[str, IndexValue]  # of index variables
S = TypeVar("S")
Results = Callable[[tree.Node, Variables], Value[S]]

ACCELERATIONS = ("a", "ax", "ay", "az")


def is_second(node: tree.Call) -> bool:
    """True if a call is `rate(x, 2)`: an acceleration."""
    if node.function != "rate" or len(node.arguments) < 2:
        return False
    order = node.arguments[1]
    return isinstance(order, tree.Number) and float(order.text) == 2.0


class ModelNames:
    """The names of a model: particles and coordinates by their numbers, and what definitions mean."""

    def __init__(self, model: Model) -> None:
        self.particles = MemberIndex([particle.members for particle in model.particles])
        self.coordinates = MemberIndex([coordinate.members for coordinate in model.coordinates])
        self.definitions = {d.name: d.expression.tree for d in model.definitions}
        self._numbers = {p.name: p.value for p in model.parameters if not isinstance(p.value, tuple)}

    def numbers(self, node: Reference, member_index: MemberIndex, variables: Variables) -> Integers:
        """The numbers of the members a reference stands for, (1,) or (K,)."""
        return member_index.find(node.owner, self._indices(node, variables))

    def names(self, node: Reference, variables: Variables) -> list[str]:
        """The names of what a reference stands for, one for each member, without a component."""
        if not node.indices:
            return [node.owner]
        vectors = np.broadcast_arrays(*(np.atleast_1d(i) for i in self._indices(node, variables)))
        indices = zip(*(vector.tolist() for vector in vectors), strict=True)
        return [family.name(node.owner, index) for index in indices]

    def _indices(self, node: Reference, variables: Variables) -> list[int | Integers]:
        def lookup(name: tree.Name) -> float | Integers:
            return variables[name.name] if name.name in variables else self._numbers[name.name]

        return [integers.evaluate(index, lookup) for index in node.indices]


class Leaves(Protocol[S]):
    """The values, in one algebra, of what a model declares. `numbers`: of members, (1,) or (K,).

    constant: t, dt, pi, or a parameter, None for another name; position, velocity: r and v of particles; generalized:
    coordinates, or their rates; variable: an index variable with its value, or its values (K,); differential: `d` of a
    function of coordinates and time, with dt as the constant of that name.
    """

    def constant(self, name: str) -> Value[S] | None: ...

    def position(self, numbers: Integers) -> tuple[S, S, S]: ...

    def velocity(self, numbers: Integers) -> tuple[S, S, S]: ...

    def generalized(self, numbers: Integers, rates: bool) -> S: ...

    def variable(self, name: str, values: IndexValue) -> S: ...

    def definition(self, name: str) -> Value[S]: ...

    def differential(self, value: S) -> S: ...


class Resolver(Generic[S]):
    """The names of one expression, resolved to values. own: names that only this expression knows, such as `m`, `r`,
    `v` of a particle; results: what is known only of a motion, such as multipliers and accelerations."""

    def __init__(
        self,
        names: ModelNames,
        leaves: Leaves[S],
        variables: Variables,
        own: Mapping[str, Value[S]],
        results: Results[S] | None = None,
    ) -> None:
        self._names, self._leaves, self._variables, self._own = names, leaves, variables, own
        self._results = results

    def atom(self, node: Reference) -> Value[S]:
        names = self._names
        if isinstance(node, tree.Name):
            return self._named(node)
        if node.owner in names.particles and node.owner not in self._own:
            if node.member in ACCELERATIONS:
                return self._result(node)
            numbers = names.numbers(node, names.particles, self._variables)
            is_velocity = node.member.startswith("v")
            vector = self._leaves.velocity(numbers) if is_velocity else self._leaves.position(numbers)
            axis = node.member[1:] if is_velocity else node.member
            return vector["xyz".index(axis)] if axis else vector
        if isinstance(node, tree.Index):
            if node.owner in names.coordinates:
                return self._coordinate(node, rates=False)
            value = self._result(node)
            return evaluate.component(node, value, node.member, node.owner) if node.member else value
        owner = self._named(tree.Name(node.start, node.end, node.owner))
        return evaluate.component(node, owner, node.member, node.owner)

    def special(self, node: tree.Call, algebra: evaluate.Algebra[S]) -> Value[S]:
        """`d`, `rate`, `multiplier`, `reaction`; `algebra` is the one that asks."""
        argument, leaves = node.arguments[0], self._leaves
        if node.function == "d":
            return evaluate.each(leaves.differential, evaluate.value(argument, algebra))
        if node.function != "rate" or is_second(node):
            return self._result(node)
        assert isinstance(argument, Reference)
        if argument.owner in self._names.coordinates:
            return self._coordinate(argument, rates=True)
        velocity = leaves.velocity(self._names.numbers(argument, self._names.particles, self._variables))
        return velocity["xyz".index(argument.member)] if argument.member else velocity

    def _result(self, node: tree.Node) -> Value[S]:
        assert self._results is not None, node
        return self._results(node, self._variables)

    def _coordinate(self, node: Reference, rates: bool) -> S:
        numbers = self._names.numbers(node, self._names.coordinates, self._variables)
        return self._leaves.generalized(numbers, rates)

    def _named(self, node: tree.Name) -> Value[S]:
        name, names, leaves = node.name, self._names, self._leaves
        if name in self._variables:
            return leaves.variable(name, self._variables[name])
        if name in self._own:
            return self._own[name]
        if (known := leaves.constant(name)) is not None:
            return known
        if name in names.particles:
            return leaves.position(names.particles.find(name, ()))
        if name in names.coordinates:
            return self._coordinate(node, rates=False)
        if name in names.definitions:
            return leaves.definition(name)
        return self._result(node)
