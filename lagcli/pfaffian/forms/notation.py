"""The notation of the model format in SymPy, read and written; `folded` takes SymPy's expressions to any arithmetic.

Exact numbers have as many digits as they are written with, and powers multiply them. Arithmetic with millions of digits
cannot be interrupted: what would need them is refused as `TooLarge`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from functools import reduce
from typing import TypeVar

import sympy
from sympy.printing.str import StrPrinter

from lagcli.expression import functions, tree
from lagcli.expression.evaluate import Value
from lagcli.expression.functions import Function
from lagcli.model import model as nouns
from lagcli.model.resolve import Reference, Resolver

FUNCTIONS: dict[str, Callable[..., sympy.Expr]] = {
    row.name: functions.meaning(sympy, row.sympy, row.name) for row in functions.TABLE.values()
}
# The rows of those that are classes of SymPy; a root is a power there.
ROWS: dict[type[sympy.Basic], Function] = {
    meaning: functions.TABLE[name] for name, meaning in FUNCTIONS.items() if isinstance(meaning, type)
}
TIME = sympy.Symbol("t", real=True)
ZERO = sympy.Integer(0)
_CONSTANTS: dict[str, sympy.Expr] = {"pi": sympy.pi, "deg": sympy.pi / 180}


class NotationParameters:
    """Bounds on what is read into exact algebra. The tests are of `tests/unit/test_notation.py`."""

    __slots__ = ()

    most_nodes: int = 4000
    """Nodes of a formula, as SymPy needs time quadratic in them (`test_a_formula_of_many_terms_is_refused`)."""
    most_digits: int = 300
    """Digits of a number as it is written (`test_a_number_of_many_digits_is_refused`)."""
    most_exponent: int = 200
    """The absolute value of a rational exponent (`test_a_large_power_is_refused`)."""
    most_digits_made: int = 1200
    """Digits of any other number, above and below together: a search for prime factors of longer ones hears no
    interrupt for minutes (`test_a_power_of_a_long_number_is_refused`)."""


PARAMETERS = NotationParameters()

T = TypeVar("T")
V = TypeVar("V")
# Of several operands, by two at a time.
_SEVERAL = {sympy.Add: "add", sympy.Mul: "mul", sympy.Min: "fmin", sympy.Max: "fmax"}


class TooLarge(Exception):
    """A value has more operations, digits or larger powers than exact algebra is tried on."""


class SympyAlgebra:
    """SymPy scalars as an algebra for `expression.evaluate`; names are what a resolver says."""

    resolver: Resolver[sympy.Expr]

    def number(self, node: tree.Number) -> sympy.Expr:
        if float(node.text) == 0.0:
            return ZERO  # whatever its exponent is
        if len(node.text) > PARAMETERS.most_digits:
            raise TooLarge("a number has too many digits")
        return sympy.Rational(node.text)

    def operation(self, node: tree.Node, name: str, *parts: sympy.Expr) -> sympy.Expr:
        if name == "pow":
            base, exponent = parts
            if _is_large(exponent):
                raise TooLarge(f"the exponent {exponent} is too large")
            if base.is_Rational and exponent.is_Rational and _is_long(base, abs(float(exponent))):
                raise TooLarge("a number has too many digits")
        return (functions.ARITHMETIC.get(name) or FUNCTIONS[name])(*parts)

    def atom(self, node: Reference) -> Value[sympy.Expr]:
        return self.resolver.atom(node)

    def special(self, node: tree.Call) -> Value[sympy.Expr]:
        return self.resolver.special(node, self)

    def variable(self, name: str, values: float) -> sympy.Expr:
        return sympy.Rational(values)  # exactly, as the weights of points are


def coordinates(model: nouns.Model) -> dict[str, sympy.Symbol]:
    """The symbols of the coordinates of a model, by their names."""
    return {name: sympy.Symbol(name, real=True) for name in model.coordinate_names}


def parameter(declared: nouns.Parameter) -> Value[sympy.Expr]:
    """The symbol of a parameter, or the three of a vector."""
    if isinstance(declared.value, tuple):
        x, y, z = (sympy.Symbol(f"{declared.name}.{axis}", real=True) for axis in "xyz")
        return x, y, z
    return sympy.Symbol(declared.name, real=True)


def constants(model: nouns.Model) -> Mapping[str, sympy.Expr]:
    """The constants that expressions of a model know without a declaration, exactly."""
    return {name: _CONSTANTS[name] for name in model.constants}


def exact(value: float) -> sympy.Expr:
    """The shortest decimal that reads as this double."""
    return sympy.Rational(repr(float(value)))


def require_short(node: tree.Node) -> None:
    """Raise `TooLarge` for a formula of many terms."""
    most = PARAMETERS.most_nodes
    if sum(1 for _ in itertools.islice(tree.walk(node), most + 1)) > most:
        raise TooLarge(f"this has more than {most} terms and factors")


def require_small(value: V, most_operations: int) -> V:
    """The value; raises `TooLarge` where it has too many operations, written out as a tree, or too large powers or
    numbers."""
    for part in value if isinstance(value, tuple) else (value,):
        for count, inner in enumerate(sympy.preorder_traversal(part)):
            if count >= most_operations:
                raise TooLarge(f"this has more than {most_operations} operations when it is written out")
            if inner.is_Pow and _is_large(inner.exp):
                raise TooLarge(f"the exponent {inner.exp} is too large")
            if inner.is_Rational and _is_long(inner):
                raise TooLarge("a number has too many digits")
    return value


def _is_large(exponent: sympy.Expr) -> bool:
    return bool(exponent.is_Rational and abs(exponent) > PARAMETERS.most_exponent)


def _is_long(number: sympy.Rational, power: float = 1.0) -> bool:
    """True if a power of a number has too many digits."""
    bits = int(number.p).bit_length() + int(number.q).bit_length()
    return power * bits * math.log10(2) > PARAMETERS.most_digits_made


class _Printer(StrPrinter):  # type: ignore[misc] # SymPy has no types
    """Prints in the notation of the model format."""

    def _print_call(self, expression: sympy.Expr) -> str:
        return f"{type(expression).__name__.lower()}({', '.join(map(self._print, expression.args))})"

    _print_Abs = _print_Min = _print_Max = _print_call  # noqa: N815 - SymPy's names

    def _as_ordered_terms(self, expression: sympy.Expr, order: str | None = None) -> list[sympy.Expr]:
        """The terms in SymPy's order, but no minus sign first where a term has none."""
        terms = list(super()._as_ordered_terms(expression, order=order))
        first = next((i for i, term in enumerate(terms) if not term.could_extract_minus_sign()), 0)
        return [terms[first], *terms[:first], *terms[first + 1 :]]

    def _print_Exp1(self, expression: sympy.Expr) -> str:
        return "exp(1)"


def written(expression: sympy.Expr) -> str:
    """The text of an expression in the notation of the model format."""
    return str(_Printer().doprint(expression))


def folded(
    e: sympy.Basic,
    leaf: Callable[[sympy.Basic], T],
    result: Callable[..., T],
    known: dict[sympy.Basic, T],
) -> T:
    """Found for an expression by its operations, named as in a `Program` (or as in SymPy), from what is found for
    symbols and numbers. known: what was found before, which grows."""
    if e in known:
        return known[e]
    if not e.args:
        found = leaf(e)
    elif isinstance(e, sympy.Pow) and e.exp == sympy.Rational(1, 2):
        found = result("sqrt", folded(e.base, leaf, result, known))
    else:
        parts = [folded(part, leaf, result, known) for part in e.args]
        if type(e) in _SEVERAL:
            found = reduce(lambda a, b: result(_SEVERAL[type(e)], a, b), parts)
        elif isinstance(e, sympy.Pow):
            found = result("pow", *parts)
        else:
            row = ROWS.get(type(e))
            found = result(e.func.__name__ if row is None else row.operation or row.name, *parts)
    known[e] = found
    return found
