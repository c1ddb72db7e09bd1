"""CasADi scalars as an algebra for `expression.evaluate`."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from lagcli.expression import evaluate, tree
from lagcli.expression.operators import Operators

# Whole powers up to this size are products: exact derivatives everywhere, and faster than pow().
MAX_PRODUCT_POWER = 12

_FUNCTIONS: dict[str, Callable[..., ca.SX]] = {
    **{
        name: getattr(ca, name)
        for name in "sin cos tan asin acos atan sinh cosh tanh exp log sqrt sign".split()
    },
    "abs": ca.fabs,
    "atan2": ca.atan2,
}


class SymbolicAlgebra(Operators[ca.SX]):
    """Scalars are SX expressions, (1, 1) or columns (K, 1) over the members of a family.

    What a name stands for comes from `atom` and `special`.

    fixed: gives the number of an exponent that depends on parameters only (it is then built in), or None.
    """

    def __init__(
        self,
        atom: Callable[[tree.Name | tree.Member | tree.Index], evaluate.Value[ca.SX]],
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

    def power(self, node: tree.Node, base: ca.SX, exponent: ca.SX) -> ca.SX:
        if exponent.numel() == 1:
            return self._power(base, exponent)
        bases = ca.vertsplit(base) if base.numel() > 1 else [base] * exponent.numel()
        powers = map(self._power, bases, ca.vertsplit(exponent))
        return ca.vertcat(ca.SX(0, 1), *powers)

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

    def function(self, node: tree.Node, name: str, arguments: tuple[ca.SX, ...]) -> ca.SX:
        if name in ("min", "max"):
            fold = ca.fmin if name == "min" else ca.fmax
            result = arguments[0]
            for argument in arguments[1:]:
                result = fold(result, argument)
            return result
        return _FUNCTIONS[name](*arguments)


def _product_power(base: ca.SX, exponent: int) -> ca.SX:
    """base ** exponent by repeated squaring."""
    if exponent == 0:
        return ca.SX(1)
    half = _product_power(base, exponent // 2)
    square = half * half
    return square * base if exponent % 2 else square
