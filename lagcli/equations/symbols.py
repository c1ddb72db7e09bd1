"""The symbols of a model, t, q, v and its parameters, and CasADi scalars as an algebra for `expression.evaluate`."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping

import casadi as ca

from lagcli.expression import evaluate, functions, tree
from lagcli.frozen import frozen
from lagcli.model import model as nouns

# Whole powers up to this size are products: exact derivatives everywhere, and faster than pow().
MAX_PRODUCT_POWER = 12


@frozen
class Symbols:
    """t, q (n), v (n) and the parameters p, with those that belong to names."""

    t: ca.SX
    q: ca.SX
    v: ca.SX
    p: ca.SX
    parameters: Mapping[str, evaluate.Value[ca.SX]]


def fresh(model: nouns.Model) -> Symbols:
    """Fresh symbols for a model; parameters are named so that `FixedExponents` knows them."""
    parameters: dict[str, evaluate.Value[ca.SX]] = {}
    flat = []
    for parameter in model.parameters:
        parts = [ca.SX.sym(label) for label, _ in _labelled(parameter.name, parameter.value)]
        parameters[parameter.name] = (parts[0], parts[1], parts[2]) if len(parts) == 3 else parts[0]
        flat += parts
    n = len(model.coordinate_names)
    return Symbols(
        ca.SX.sym("t"),
        ca.SX.sym("q", n),
        ca.SX.sym("v", n),
        ca.vertcat(ca.SX(0, 1), *flat),
        parameters,
    )


def parameter_values(model: nouns.Model) -> list[float]:
    """Numbers for `Symbols.p`, in its order."""
    return [number for p in model.parameters for _, number in _labelled(p.name, p.value)]


def _labelled(name: str, value: float | nouns.Vector3) -> list[tuple[str, float]]:
    if isinstance(value, tuple):
        return [(f"parameter {name}.{axis}", part) for axis, part in zip("xyz", value, strict=True)]
    return [(f"parameter {name}", value)]


class FixedExponents:
    """Exponents that depend on parameters only are built into the graph; `used` says which those are. x**n with n an
    input has derivatives that are not finite at x = 0 although x**2 is harmless there."""

    def __init__(self, model: nouns.Model) -> None:
        labelled = (pair for p in model.parameters for pair in _labelled(p.name, p.value))
        self._values: dict[str, float] = dict(labelled)
        self._used: set[str] = set()

    def __call__(self, exponent: ca.SX) -> float | None:
        """The number, or None where the exponent depends on more than parameters."""
        symbols = ca.symvar(exponent)
        if any(symbol.name() not in self._values for symbol in symbols):
            return None
        self._used.update(symbol.name() for symbol in symbols)
        numbers = [self._values[symbol.name()] for symbol in symbols]
        value = ca.substitute([exponent], symbols, [ca.SX(number) for number in numbers])[0]
        return float(ca.evalf(value))

    def used(self) -> tuple[tuple[str, float], ...]:
        """The parameters that were built in, with their values."""
        return tuple((name, self._values[name]) for name in sorted(self._used))

    def value(self, name: str) -> float:
        return self._values[name]


class SymbolicAlgebra:
    """Scalars are SX expressions, (1, 1) or columns (K, 1) over the members of a family. fixed: gives the number of an
    exponent that depends on parameters only (it is then built in), or None."""

    def __init__(
        self,
        atom: Callable[[tree.Reference], evaluate.Value[ca.SX]],
        special: Callable[[tree.Call, SymbolicAlgebra], evaluate.Value[ca.SX]],
        fixed: Callable[[ca.SX], float | None],
    ) -> None:
        self.atom = atom
        self._special = special
        self._fixed = fixed

    def special(self, node: tree.Call) -> evaluate.Value[ca.SX]:
        return self._special(node, self)

    def number(self, node: tree.Number) -> ca.SX:
        return ca.SX(float(node.text))

    def operation(self, node: tree.Node, name: str, *parts: ca.SX) -> ca.SX:
        if name == "pow":
            base, exponent = parts
            if exponent.numel() == 1:
                return self._power(base, exponent)
            bases = ca.vertsplit(base) if base.numel() > 1 else [base] * exponent.numel()
            powers = map(self._power, bases, ca.vertsplit(exponent))
            return ca.vertcat(ca.SX(0, 1), *powers)
        if name in functions.ARITHMETIC:
            made: ca.SX = functions.ARITHMETIC[name](*parts)
            return made
        row = functions.TABLE[name]
        found: Callable[..., ca.SX] = functions.meaning(ca, row.casadi or row.operation, name)
        return functools.reduce(found, parts) if row.arguments == functions.MANY else found(*parts)

    def _power(self, base: ca.SX, exponent: ca.SX) -> ca.SX:
        value = float(exponent) if exponent.is_constant() else self._fixed(exponent)
        if value is None:
            return base**exponent
        if abs(value) == 0.5:
            return ca.sqrt(base) if value > 0 else 1 / ca.sqrt(base)
        if value == round(value) and abs(value) <= MAX_PRODUCT_POWER:
            product = _product_power(base, abs(round(value)))
            return product if value >= 0 else 1 / product
        return base**value


def _product_power(base: ca.SX, exponent: int) -> ca.SX:
    if exponent == 0:
        return ca.SX(1)
    half = _product_power(base, exponent // 2)
    square = half * half
    return square * base if exponent % 2 else square
