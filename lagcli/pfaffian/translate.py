"""Differential constraints of a model -> Pfaffian forms in SymPy symbols; parameters stay symbols.

The symbols carry the names of the model format (`x`, `a.x`), so that what is found reads as the user writes.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Mapping
from typing import Any

import sympy
from sympy.printing.str import StrPrinter

from lagcli import model as nouns
from lagcli.expression import evaluate, tree
from lagcli.expression.operators import Operators
from lagcli.pfaffian.form import Form

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{
        name: getattr(sympy, name)
        for name in "sin cos tan asin acos atan atan2 sinh cosh tanh exp log sqrt".split()
    },
    "abs": sympy.Abs,
    "sign": sympy.sign,
    "min": sympy.Min,
    "max": sympy.Max,
}

# Beyond this many operations a form is too large for exact algebra to end in reasonable time.
MAX_OPERATIONS = 4000
# Exact numbers have as many digits as they are written with, and powers multiply them. Arithmetic with millions of
# digits cannot be interrupted, so that no time limit would hold.
MAX_DIGITS = 300
MAX_EXPONENT = 200
TIME = sympy.Symbol("t", real=True)
_DT = sympy.Symbol("dt", real=True)


class TooLarge(Exception):
    """The form of a row has more operations, digits or larger powers than exact algebra is tried on."""


def forms(model: nouns.Model) -> dict[str, Form | TooLarge]:
    """The form of every differential row, by row name; `TooLarge` in place of one that is not attempted."""
    names = _Names(model)
    found: dict[str, Form | TooLarge] = {}
    for law in model.differential:
        assert isinstance(law.equation.tree, tree.Relation)
        try:
            _require_short(law.equation.tree)
            values = evaluate.difference(law.equation.tree, names)
            found |= {row: _form(names, row, value) for row, value in zip(law.rows, values, strict=True)}
        except TooLarge as failure:
            found |= dict.fromkeys(law.rows, failure)
    return found


def _form(names: _Names, row: str, value: Any) -> Form:
    _require_small(value)
    at_rest = dict.fromkeys((*names.differentials.values(), _DT), 0)
    coefficients = {x: sympy.diff(value, d) for x, d in names.differentials.items()}
    # In the velocity form the term without rates stands beside dt; in the other form dt is a symbol.
    coefficients[TIME] = sympy.diff(value, _DT) + value.subs(at_rest)
    used = set().union(*(c.free_symbols for c in coefficients.values()))
    variables = tuple(x for x, c in coefficients.items() if c != 0 or x in used)
    parameters = tuple(p for p in names.parameters if p in used)
    return Form(row, variables, tuple(coefficients[x] for x in variables), parameters)


def _require_short(node: tree.Node) -> None:
    """Raise `TooLarge` for a formula of many terms: SymPy needs time quadratic in them only to add them up."""
    if sum(1 for _ in itertools.islice(tree.walk(node), MAX_OPERATIONS + 1)) > MAX_OPERATIONS:
        raise TooLarge("too many terms")


def _require_small(value: Any) -> Any:
    """The value, unless it has too many operations, written out as a tree, or too large powers: `TooLarge`."""
    for part in value if isinstance(value, tuple) else (value,):
        for count, inner in enumerate(sympy.preorder_traversal(part)):
            if count >= MAX_OPERATIONS or (inner.is_Pow and _is_large(inner.exp)):
                raise TooLarge("too many operations")
    return value


def _is_large(exponent: Any) -> bool:
    return bool(exponent.is_Rational and abs(exponent) > MAX_EXPONENT)


class _Names(Operators):
    """SymPy scalars as an algebra for `expression.evaluate`."""

    def __init__(self, model: nouns.Model) -> None:
        self._model = model
        self._coordinates = {name: sympy.Symbol(name, real=True) for name in model.coordinate_names}
        self.differentials = {x: sympy.Symbol(f"d({x.name})", real=True) for x in self._coordinates.values()}
        self._parameters = {p.name: _parameter(p) for p in model.parameters}
        self._particles = {p.name: p for p in model.particles}
        self._definitions = {d.name: d.expression.tree for d in model.definitions}
        self._values: dict[str, Any] = {}
        self._positions: dict[str, Any] = {}
        # In this order each finds what it uses: a chain of any length needs no recursion.
        # What is too large is met again where a law uses it, and else does no harm.
        for name in model.order:
            with contextlib.suppress(TooLarge):
                self._named(name)
        self.parameters = [
            s
            for value in self._parameters.values()
            for s in (value if isinstance(value, tuple) else (value,))
        ]

    def number(self, node: tree.Number) -> Any:
        if float(node.text) == 0.0:
            return sympy.Integer(0)  # also a number below the smallest double, which is zero everywhere else
        if len(node.text) > MAX_DIGITS:
            raise TooLarge(node.text[:MAX_DIGITS])
        return sympy.Rational(node.text)

    def power(self, node: tree.Node, base: Any, exponent: Any) -> Any:
        if _is_large(exponent):
            raise TooLarge(str(exponent))
        return base**exponent

    def function(self, node: tree.Node, name: str, arguments: tuple[Any, ...]) -> Any:
        return _FUNCTIONS[name](*arguments)

    def atom(self, node: tree.Name | tree.Member | tree.Index) -> Any:
        if isinstance(node, tree.Member):
            if node.owner in self._particles:
                return self._particle_member(node)
            owner = self._named(node.owner)
            return evaluate.component(node, owner, node.member, node.owner)
        assert isinstance(node, tree.Name)
        return self._named(node.name)

    def special(self, node: tree.Call) -> Any:
        argument = node.arguments[0]
        if node.function == "d":
            return _each(_require_small(evaluate.evaluate(argument, self)), self._differential)
        assert node.function == "rate"
        return _each(evaluate.evaluate(argument, self), self._rate)

    def _differential(self, value: Any) -> Any:
        """d value, over the differentials of coordinates and dt."""
        return self._along(value) + sympy.diff(value, TIME) * _DT

    def _rate(self, value: Any) -> Any:
        """The same divided by dt."""
        return self._along(value) + sympy.diff(value, TIME)

    def _along(self, value: Any) -> Any:
        used = value.free_symbols
        return sum(
            (sympy.diff(value, x) * d for x, d in self.differentials.items() if x in used), sympy.Integer(0)
        )

    def _named(self, name: str) -> Any:
        constants: Mapping[str, Any] = {"t": TIME, "pi": sympy.pi, "dt": _DT}
        if name in constants:
            return constants[name]
        for known in (self._parameters, self._coordinates):
            if name in known:
                return known[name]
        if name in self._particles:
            return self._position(name)
        if name not in self._values:
            self._values[name] = _attempted(lambda: self._defined(name))
        return _given(self._values[name])

    def _defined(self, name: str) -> Any:
        _require_short(self._definitions[name])
        return evaluate.evaluate(self._definitions[name], self)

    def _position(self, name: str) -> Any:
        if name not in self._positions:
            self._positions[name] = _attempted(lambda: self._evaluated_position(name))
        return _given(self._positions[name])

    def _evaluated_position(self, name: str) -> Any:
        particle = self._particles[name]
        if not particle.is_dependent:
            return tuple(self._coordinates[f"{name}.{axis}"] for axis in "xyz")
        for part in particle.position.parts:
            _require_short(part.tree)
        if len(particle.position.parts) == 1:
            return evaluate.vector(particle.position.parts[0].tree, self)
        return tuple(evaluate.scalar(part.tree, self) for part in particle.position.parts)

    def _particle_member(self, node: tree.Member) -> Any:
        position = self._position(node.owner)
        if node.member == "v":
            return _each(position, self._rate)
        if node.member.startswith("v"):
            return self._rate(position["xyz".index(node.member[1])])
        return position["xyz".index(node.member)]


def _attempted(compute: Callable[[], Any]) -> Any:
    """The value, or the `TooLarge` that came instead: it is not computed again at every use."""
    try:
        return _require_small(compute())
    except TooLarge as failure:
        return failure


def _given(value: Any) -> Any:
    """The value; raises the `TooLarge` that stands in its place."""
    if isinstance(value, TooLarge):
        raise value
    return value


def _each(value: Any, operation: Callable[[Any], Any]) -> Any:
    return tuple(operation(part) for part in value) if isinstance(value, tuple) else operation(value)


def _parameter(parameter: nouns.Parameter) -> Any:
    if isinstance(parameter.value, tuple):
        return tuple(sympy.Symbol(f"{parameter.name}.{axis}", real=True) for axis in "xyz")
    return sympy.Symbol(parameter.name, real=True)


class _Printer(StrPrinter):  # type: ignore[misc] # SymPy has no types
    """Prints in the notation of the model format."""

    def _print_Abs(self, expression: Any) -> str:
        return f"abs({self._print(expression.args[0])})"

    def _print_Min(self, expression: Any) -> str:
        return f"min({', '.join(map(self._print, expression.args))})"

    def _print_Max(self, expression: Any) -> str:
        return f"max({', '.join(map(self._print, expression.args))})"

    def _print_Exp1(self, expression: Any) -> str:
        return "exp(1)"


def written(expression: Any) -> str:
    """The text of an expression in the notation of the model format."""
    return str(_Printer().doprint(expression))
