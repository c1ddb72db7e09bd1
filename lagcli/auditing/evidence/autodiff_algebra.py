"""The operations of the model's expressions on a graph, with the derivative of each.

Numbers may be complex with a tiny imaginary part, which carries one more derivative (the complex step): what is not
analytic goes by the real part.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from lagcli.auditing.evidence.autodiff import Array, AutodiffGraph, Scalar, Value, value
from lagcli.expression import functions, tree
from lagcli.model.resolve import Reference


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

    def add(self, node: tree.Node, left: Scalar, sign: int, right: Scalar) -> Scalar:
        a, b = value(left), value(right)
        return self._graph.result(a + b if sign > 0 else a - b, (left, 1.0), (right, float(sign)))

    def negate(self, node: tree.Node, x: Scalar) -> Scalar:
        return self._graph.result(-value(x), (x, -1.0))

    def multiply(self, node: tree.Node, left: Scalar, right: Scalar) -> Scalar:
        a, b = value(left), value(right)
        return self._graph.result(a * b, (left, b), (right, a))

    def divide(self, node: tree.Node, left: Scalar, right: Scalar) -> Scalar:
        a, b = value(left), value(right)
        quotient = a / b
        return self._graph.result(quotient, (left, 1 / b), (right, -quotient / b))

    def power(self, node: tree.Node, base: Scalar, exponent: Scalar) -> Scalar:
        x, e = value(base), value(exponent)
        if np.all(e == 0.5):
            return self.function(node, "sqrt", (base,))
        result = _power(x, e)
        by_base = np.where(e == 0.0, 0.0, e * _power(x, np.where(e == 0.0, 1.0, e - 1.0)))
        by_exponent: Array | float = 0.0
        if value(exponent) is not exponent:  # it is a node: the base is positive then
            by_exponent = result * np.log(x)
        return self._graph.result(result, (base, by_base), (exponent, by_exponent))

    def function(self, node: tree.Node, name: str, arguments: tuple[Scalar, ...]) -> Scalar:
        row = functions.TABLE[name]
        if row.arguments == functions.MANY:
            return functools.reduce(lambda a, b: self._extreme(name, a, b), arguments)
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

    def _extreme(self, name: str, left: Scalar, right: Scalar) -> Scalar:
        a, b = value(left), value(right)
        first = a.real <= b.real if name == "min" else a.real >= b.real
        return self._graph.result(np.where(first, a, b), (left, first * 1.0), (right, ~first * 1.0))


def _power(x: Array, e: Array) -> Array:
    is_integer = e.size == 1 and float(e.real.flat[0]) == round(float(e.real.flat[0]))
    if is_integer and abs(float(e.real.flat[0])) <= 64:
        return np.asarray(np.power(x, float(e.real.flat[0])) if np.isrealobj(x) else x ** int(e.real.flat[0]))
    return np.asarray(np.power(x, e))
