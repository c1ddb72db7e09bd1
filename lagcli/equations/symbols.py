"""The symbols of a model, t, q, v and its parameters, and the parameters that are built in as numbers."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from lagcli.expression import evaluate
from lagcli.frozen import frozen
from lagcli.model import model as nouns


@frozen
class Symbols:
    """t, q (n), v (n) and the parameters p, with those that belong to names."""

    t: ca.SX
    q: ca.SX
    v: ca.SX
    p: ca.SX
    parameters: Mapping[str, evaluate.Value[ca.SX]]


class FixedExponents:
    """Exponents that depend on parameters only are built into the graph; `used` says which those are.

    x**n with n an input has derivatives that are not finite at x = 0 although x**2 is harmless there.
    """

    def __init__(self, model: nouns.Model) -> None:
        self._values: dict[str, float] = {}
        for parameter in model.parameters:
            value = parameter.value
            for label, number in _labelled(parameter.name, value):
                self._values[label] = number
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
        """The value a parameter has in this model."""
        return self._values[name]


def _labelled(name: str, value: float | nouns.Vector3) -> list[tuple[str, float]]:
    if isinstance(value, tuple):
        return [(f"parameter {name}.{axis}", part) for axis, part in zip("xyz", value, strict=True)]
    return [(f"parameter {name}", value)]


def symbols(model: nouns.Model) -> Symbols:
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
        ca.vertcat(*flat) if flat else ca.SX(0, 1),
        parameters,
    )


def parameter_values(model: nouns.Model) -> list[float]:
    """Numbers for `Symbols.p`, in its order."""
    return [number for p in model.parameters for _, number in _labelled(p.name, p.value)]
