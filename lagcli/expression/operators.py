"""Scalars whose own `+ - * /` are the operations: what the algebras over symbols have in common."""

from __future__ import annotations

from typing import Generic, Protocol, Self, TypeVar

from lagcli.expression import tree


class Arithmetic(Protocol):
    """A number or symbol that can be added, subtracted, multiplied and divided."""

    def __add__(self, other: Self, /) -> Self: ...

    def __sub__(self, other: Self, /) -> Self: ...

    def __mul__(self, other: Self, /) -> Self: ...

    def __truediv__(self, other: Self, /) -> Self: ...

    def __neg__(self) -> Self: ...


N = TypeVar("N", bound=Arithmetic)


class Operators(Generic[N]):
    """The arithmetic of `evaluate.Algebra` by the operators of the scalars."""

    def add(self, node: tree.Node, left: N, sign: int, right: N) -> N:
        return left + right if sign > 0 else left - right

    def negate(self, node: tree.Node, value: N) -> N:
        return -value

    def multiply(self, node: tree.Node, left: N, right: N) -> N:
        return left * right

    def divide(self, node: tree.Node, left: N, right: N) -> N:
        return left / right
