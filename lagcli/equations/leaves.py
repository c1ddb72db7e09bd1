"""The values of the leaves of an expression: names, members of families, `d`, `rate`, `multiplier`, `reaction`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import casadi as ca
import numpy as np

from lagcli.equations.family_columns import Triple, Value
from lagcli.equations.symbols import Symbols
from lagcli.expression import evaluate, integers, tree
from lagcli.model import model as nouns
from lagcli.model.family import MemberIndex, Whole

Results = Callable[[tree.Node, Mapping[str, Whole]], Value]
Reference = tree.Name | tree.Member | tree.Index


ACCELERATIONS = ("a", "ax", "ay", "az")


def is_second(node: tree.Call) -> bool:
    """True if a call is `rate(x, 2)`: an acceleration."""
    return node.function == "rate" and len(node.arguments) > 1 and _is_two(node.arguments[1])


def _is_two(order: tree.Node) -> bool:
    return isinstance(order, tree.Number) and float(order.text) == 2.0


class LeafNames:
    """The names of a model: who is a member of what, and what definitions mean."""

    def __init__(self, model: nouns.Model, symbols: Symbols) -> None:
        self.particles = MemberIndex(particle.members for particle in model.particles)
        self.coordinates = MemberIndex(coordinate.members for coordinate in model.coordinates)
        self.constants: dict[str, Value] = {"t": symbols.t, "dt": ca.SX(1)}
        self.constants |= {name: ca.SX(value) for name, value in model.constants.items()}
        self.constants |= symbols.parameters
        self._definitions = {d.name: d.expression.tree for d in model.definitions}
        self._numbers = {p.name: p.value for p in model.parameters if not isinstance(p.value, tuple)}

    def is_definition(self, name: str) -> bool:
        """True if a definition has this name."""
        return name in self._definitions

    def meaning(self, name: str) -> tree.Node:
        """The expression of a definition."""
        return self._definitions[name]

    def numbers(self, node: Reference, roll: MemberIndex, variables: Mapping[str, Whole]) -> Whole:
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

        return [integers.evaluate(index, lookup) for index in node.indices]


class Leaves(Protocol):
    """The values of the coordinates, rates, indices and definitions of a model in one algebra."""

    def position(self, numbers: Whole) -> Triple:
        """r of particles."""

    def velocity(self, numbers: Whole) -> Triple:
        """v of particles."""

    def generalized(self, numbers: Whole, rates: bool) -> ca.SX:
        """Generalized coordinates, or their rates."""

    def variable(self, name: str, values: Whole) -> ca.SX:
        """An index variable with its values, (K,)."""

    def definition(self, name: str) -> Value:
        """The value of a definition."""

    def rate(self, value: ca.SX) -> ca.SX:
        """d/dt of a function of coordinates and time."""


class Atoms:
    """The values of the leaves of one expression."""

    def __init__(
        self,
        names: LeafNames,
        leaves: Leaves,
        variables: Mapping[str, Whole],
        own: Mapping[str, Value],
        results: Results | None,
    ) -> None:
        self._names, self._leaves, self._variables, self._own = names, leaves, variables, own
        self._results = results

    def atom(self, node: Reference) -> Value:
        """A name, a component, or a member of a family."""
        names = self._names
        if isinstance(node, tree.Name):
            return self._named(node, node.name)
        if node.owner in names.particles and node.owner not in self._own:
            if node.member in ACCELERATIONS:
                return self._result(node)
            return self._particle(node)
        if isinstance(node, tree.Index):
            if node.owner in names.coordinates:
                return self._coordinate(node, rates=False)
            value = self._result(node)
            return evaluate.component(node, value, node.member, node.owner) if node.member else value
        owner = self._named(tree.Name(node.start, node.end, node.owner), node.owner)
        return evaluate.component(node, owner, node.member, node.owner)

    def special(self, node: tree.Call, algebra: evaluate.Algebra[ca.SX]) -> Value:
        """`d`, `rate`, `multiplier`, `reaction`; `algebra` is the one that asks."""
        argument, leaves = node.arguments[0], self._leaves
        if node.function == "d":
            value = evaluate.evaluate(argument, algebra)
            if not isinstance(value, tuple):
                return leaves.rate(value)
            x, y, z = map(leaves.rate, value)
            return x, y, z
        if node.function == "rate" and not is_second(node):
            assert isinstance(argument, (tree.Name, tree.Member, tree.Index))
            owner = argument.name if isinstance(argument, tree.Name) else argument.owner
            if owner in self._names.coordinates:
                return self._coordinate(argument, rates=True)
            velocity = leaves.velocity(self._names.numbers(argument, self._names.particles, self._variables))
            member = "" if isinstance(argument, tree.Name) else argument.member
            return velocity["xyz".index(member)] if member else velocity
        return self._result(node)

    def _result(self, node: tree.Node) -> Value:
        """A value that is known only of a motion: multipliers, reactions, accelerations, energies and outputs."""
        assert self._results is not None, node
        return self._results(node, self._variables)

    def _coordinate(self, node: Reference, rates: bool) -> ca.SX:
        return self._leaves.generalized(
            self._names.numbers(node, self._names.coordinates, self._variables), rates
        )

    def _particle(self, node: tree.Member | tree.Index) -> Value:
        numbers = self._names.numbers(node, self._names.particles, self._variables)
        if node.member == "v":
            return self._leaves.velocity(numbers)
        if node.member.startswith("v"):
            return self._leaves.velocity(numbers)["xyz".index(node.member[1])]
        position = self._leaves.position(numbers)
        return position["xyz".index(node.member)] if node.member else position

    def _named(self, node: tree.Name, name: str) -> Value:
        names = self._names
        if name in self._variables:
            return self._leaves.variable(name, self._variables[name])
        for known in (self._own, names.constants):
            if name in known:
                return known[name]
        if name in names.particles:
            return self._leaves.position(names.particles.find(name, ()))
        if name in names.coordinates:
            return self._coordinate(node, rates=False)
        if names.is_definition(name):
            return self._leaves.definition(name)
        return self._result(node)
