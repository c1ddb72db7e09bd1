"""Scalars whose own `+ - * /` are the operations: what the algebras over symbols have in common."""

from __future__ import annotations

from typing import Any

from lagcli.expression import tree


class Operators:
    """The arithmetic of `evaluate.Algebra` by the operators of the scalars."""

    def add(self, node: tree.Node, left: Any, sign: int, right: Any) -> Any:
        return left + right if sign > 0 else left - right

    def negate(self, node: tree.Node, value: Any) -> Any:
        return -value

    def multiply(self, node: tree.Node, left: Any, right: Any) -> Any:
        return left * right

    def divide(self, node: tree.Node, left: Any, right: Any) -> Any:
        return left / right
