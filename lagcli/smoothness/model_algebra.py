"""The expressions of a model in an algebra that knows of the motion only that it is one."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Generic, Self, TypeVar

import numpy as np

from lagcli.arrays import Floats, Integers
from lagcli.expression import evaluate, tree
from lagcli.model import model as nouns

S = TypeVar("S")


class ModelAlgebra(Generic[S]):
    """The names of `evaluate.Algebra`: parameters and indices are constants; what depends on coordinates is of the
    motion, but for the definitions in `known`. constant: the value of numbers; motion: of a name that is not known."""

    def __init__(
        self, model: nouns.Model, constant: Callable[[float | Floats], S], motion: Callable[[str], S]
    ) -> None:
        self._constant, self._motion = constant, motion
        self._vectors = {particle.members.base for particle in model.particles}
        self._variables: Mapping[str, Integers] = {}
        self.known: dict[str, evaluate.Value[S]] = {"pi": constant(np.pi), "dt": constant(1.0)}
        for parameter in model.parameters:
            self.known[parameter.name] = evaluate.each(constant, parameter.value)

    def on_a_particle(self, **known: S) -> Self:
        """The algebra in the force of a particle, where `m`, `r` and `v` are its own, whatever else is called so."""
        same = copy.copy(self)
        same._vectors = (self._vectors - {"m"}) | {"r", "v"}
        others = {name: value for name, value in self.known.items() if name not in ("m", "r", "v")}
        same.known = {**others, **known}
        return same

    def value(self, node: tree.Node, variables: Mapping[str, Integers]) -> evaluate.Value[S] | tuple[S, ...]:
        """The value of an expression with these index variables; of an equation left - right."""
        self._variables = variables
        if isinstance(node, tree.Relation):
            return evaluate.difference(node, self)
        return evaluate.value(node, self)

    def number(self, node: tree.Number) -> S:
        return self._constant(float(node.text))

    def atom(self, node: tree.Reference) -> evaluate.Value[S]:
        name, member = node.owner, node.member
        if isinstance(node, tree.Name) and name in self._variables:
            return self._constant(self._variables[name][:, None].astype(float))
        if name in self.known:
            value = self.known[name]
            return value["xyz".index(member)] if member and isinstance(value, tuple) else value
        motion = self._motion(name)
        return (motion,) * 3 if name in self._vectors and member in ("", "v", "a") else motion

    def special(self, node: tree.Call) -> evaluate.Value[S]:
        """Rates and differentials: of the motion as what they are of."""
        argument = node.arguments[0]
        if node.function == "d":
            return evaluate.value(argument, self)
        assert isinstance(argument, tree.Reference)
        return self.atom(argument)

    def operation(self, node: tree.Node, name: str, *parts: S) -> S:
        raise NotImplementedError
