"""Differential constraints of a model as Pfaffian forms in SymPy symbols with the names of the model (`x`, `a.x`)."""

from __future__ import annotations

import contextlib
import copy
import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

import numpy as np
import sympy

from lagcli import doubles
from lagcli.arrays import Integers
from lagcli.expression import evaluate, tree
from lagcli.expression.evaluate import Triple, Value
from lagcli.model import family
from lagcli.model import model as nouns
from lagcli.model.family import Family
from lagcli.model.invariant import FirstIntegral
from lagcli.model.resolve import ModelNames, Resolver
from lagcli.pfaffian import level_charts
from lagcli.pfaffian.forms import notation
from lagcli.pfaffian.forms.form import Form, PfaffianBlock
from lagcli.pfaffian.forms.notation import TIME, ZERO, TooLarge, exact

# Beyond this many operations a form is too large for exact algebra to end in reasonable time.
MAX_OPERATIONS = 4000
_DT = sympy.Symbol("dt", real=True)
_ALONE = family.one("")

V = TypeVar("V")


class Translation:
    """The rows of a model in SymPy symbols, all in the same ones."""

    def __init__(self, model: nouns.Model) -> None:
        self._model = model
        self._names = _FormNames(model)

    def forms(self) -> dict[str, Form | TooLarge]:
        """The form of every differential row, by row name; `TooLarge` in place of one that is not attempted."""
        found: dict[str, Form | TooLarge] = {}
        names = self._names
        for row, read in self._differences(self._model.differential):
            value = _attempted(functools.partial(_given, read))
            if isinstance(value, TooLarge):
                found[row] = value
                continue
            present = names.ordered({names.moved[d] for d in value.free_symbols if d in names.moved})
            coefficients = {x: sympy.diff(value, names.differentials[x]) for x in present}
            at_rest = dict.fromkeys((*(names.differentials[x] for x in coefficients), _DT), ZERO)
            # In the velocity form the term without rates stands beside dt; in the other form dt is a symbol.
            coefficients[TIME] = sympy.diff(value, _DT) + value.xreplace(at_rest)
            used = set().union(*(c.free_symbols for c in coefficients.values()))
            moving = {x for x, a in coefficients.items() if a != 0}
            variables = names.ordered(used | moving)
            parameters = tuple(p for p in names.parameters if p in used)
            found[row] = Form(row, variables, tuple(coefficients.get(x, ZERO) for x in variables), parameters)
        return found

    def surface(self, rows: frozenset[str]) -> dict[str, sympy.Expr | TooLarge]:
        """f of the holonomic rows of these names that have a text, by row name; `TooLarge` in place of one not
        attempted."""
        laws = [law for law in self._model.holonomic if not rows.isdisjoint(law.rows)]
        return {
            row: _attempted(functools.partial(_given, value))
            for row, value in self._differences(laws)
            if row in rows
        }

    def block(self, forms: Sequence[Form], surface: Sequence[sympy.Expr]) -> PfaffianBlock:
        """Forms over all coordinates that they and the f of the surface hold, time last."""
        used = set().union(*(f.free_symbols for f in surface), *(form.variables for form in forms))
        variables = self._names.ordered(used)
        used = used.union(*(form.parameters for form in forms))
        rows = []
        for form in forms:
            coefficients = dict(zip(form.variables, form.coefficients, strict=True))
            rows.append(tuple(coefficients.get(x, ZERO) for x in variables))
        parameters = tuple(p for p in self._names.parameters if p in used)
        return PfaffianBlock(
            tuple(form.name for form in forms), variables, tuple(rows), parameters, tuple(surface)
        )

    def vanishes(self, expression: sympy.Expr) -> bool:
        """True if an expression is zero, but for rounding, for the values of the parameters."""
        number = expression.xreplace(self.values).evalf()
        return bool(number.is_number) and abs(number) <= doubles.VALUE

    @functools.cached_property
    def numbers(self) -> dict[sympy.Symbol, float]:
        return {p: float(value) for p, value in self.values.items()}

    @functools.cached_property
    def values(self) -> dict[sympy.Symbol, sympy.Expr]:
        """The parameters and their values, as they are written, or as exact decimals."""
        found: dict[sympy.Symbol, sympy.Expr] = {}
        for parameter in self._model.parameters:
            symbols, value = self._names.named[parameter.name], parameter.value
            if isinstance(value, tuple):
                found |= {symbol: exact(part) for symbol, part in zip(symbols, value, strict=True)}
                continue
            found[symbols] = exact(value)
            if parameter.formula is not None:
                # pi/3 is pi/3 and not a decimal near it: an angle may be the one for which a verdict changes.
                with contextlib.suppress(TooLarge):
                    notation.require_short(parameter.formula.tree)
                    written: sympy.Expr = _require_small(evaluate.value(parameter.formula.tree, self._names))
                    found[symbols] = written.xreplace(found)
        return found

    def written(self, x: sympy.Symbol) -> sympy.Expr | None:
        """The declared value of a coordinate as it is written; None where it is not, or too large."""
        found = self._declarations.get(x.name)
        if found is None:
            return None
        members, member, formulas, axis = found
        try:
            for formula in formulas:
                notation.require_short(formula.tree)
            values = [evaluate.value(one.tree, self._names.at(members, member)) for one in formulas]
            value = values[axis] if len(values) > 1 else values[0]
            value = value[axis] if isinstance(value, tuple) else value
            return _require_small(value.xreplace(self.values))
        except TooLarge:
            return None

    @functools.cached_property
    def _declarations(self) -> dict[str, tuple[Family, int, tuple[nouns.Expression, ...], int]]:
        """For each coordinate its family, its number there, and what was written: of three components, which."""
        found: list[tuple[Family, int, tuple[nouns.Expression, ...], int]] = []
        for particle in self._model.particles:
            if not particle.is_dependent:
                for member in range(particle.members.count):
                    found += [(particle.members, member, particle.position.parts, axis) for axis in range(3)]
        for one in self._model.coordinates:
            formulas = () if one.written is None else (one.written,)
            found += [(one.members, member, formulas, 0) for member in range(one.members.count)]
        names = self._model.coordinate_names
        return {name: entry for name, entry in zip(names, found, strict=True) if entry[2]}

    def _differences(
        self, laws: Iterable[nouns.Holonomic | nouns.Differential]
    ) -> Iterator[tuple[str, sympy.Expr | TooLarge]]:
        """Left side minus right side of every row, by name."""
        for law in laws:
            assert isinstance(law.equation.tree, tree.Relation)
            each = 3 if law.is_vector else 1
            for member in range(law.members.count):
                rows = law.rows[member * each : (member + 1) * each]
                try:
                    notation.require_short(law.equation.tree)
                    there = self._names.at(law.members, member)
                    yield from zip(rows, evaluate.difference(law.equation.tree, there), strict=True)
                except TooLarge as failure:
                    yield from dict.fromkeys(rows, failure).items()


def _require_small(value: V) -> V:
    return notation.require_small(value, MAX_OPERATIONS)


class _FormNames(notation.SympyAlgebra):
    """The names of a model in forms: rates are differentials, and parameters symbols."""

    def __init__(self, model: nouns.Model) -> None:
        self._model = model
        self._coordinates = notation.coordinates(model)
        self.differentials = {x: sympy.Symbol(f"d({x.name})", real=True) for x in self._coordinates.values()}
        self.moved = {d: x for x, d in self.differentials.items()}
        self._rank = {x: n for n, x in enumerate((*self.differentials, TIME))}
        self.named = {p.name: notation.parameter(p) for p in model.parameters}
        self._constants: dict[str, Value[sympy.Expr]] = {
            "t": TIME,
            "dt": _DT,
            **notation.constants(model),
            **self.named,
        }
        self._names = ModelNames(model)
        self._particles, self._generalized = self._names.particles, self._names.coordinates
        self._values: dict[str, Value[sympy.Expr] | TooLarge] = {}
        self._positions: dict[int, Triple[sympy.Expr] | TooLarge] = {}
        self._indices: dict[str, int] = {}
        self.resolver = Resolver(self._names, self, {}, {})
        values = (value if isinstance(value, tuple) else (value,) for value in self.named.values())
        self.parameters = [symbol for each in values for symbol in each]
        # In this order each finds what it uses: a chain of any length needs no recursion.
        # What is too large is met again where a law uses it, and else does no harm.
        for step in model.order:
            with contextlib.suppress(TooLarge):
                if isinstance(step, str):
                    self.definition(step)
                    continue
                for number in self._particles.first(step.entry) + step.member_numbers:
                    self.position(np.array([number]))

    def ordered(self, symbols: set[sympy.Symbol]) -> tuple[sympy.Symbol, ...]:
        """The coordinates and time among these symbols, in their order, time last."""
        return tuple(sorted((x for x in symbols if x in self._rank), key=self._rank.__getitem__))

    def at(self, members: Family, member: int) -> _FormNames:
        """The names for one member of a family: its indices are numbers."""
        if not members.variables and not self._indices:
            return self
        there = copy.copy(self)
        there._indices = {name: int(values[member]) for name, values in members.variables.items()}
        there.resolver = Resolver(self._names, there, there._indices, {})
        return there

    def operation(self, node: tree.Node, name: str, *parts: sympy.Expr) -> sympy.Expr:
        base, exponent = parts[0], parts[-1]
        if name == "pow" and exponent.free_symbols and not base.free_symbols.isdisjoint((*self.moved, _DT)):
            # In a row, which is linear in differentials, it is 0 or 1 for the values of the parameters.
            numbers = [part for p in self._model.parameters for part in np.atleast_1d(p.value).tolist()]
            values = dict(zip(self.parameters, map(exact, numbers), strict=True))
            value = exponent.xreplace(values).evalf()
            if value.is_number and abs(value - round(value)) <= doubles.VALUE:
                # Else it is that of a definition that no row can hold.
                parts = base, sympy.Integer(round(value))
        return super().operation(node, name, *parts)

    def constant(self, name: str) -> Value[sympy.Expr] | None:
        return self._constants.get(name)

    def position(self, numbers: Integers) -> Triple[sympy.Expr]:
        number = int(numbers[0])

        def value() -> Triple[sympy.Expr]:
            entry = int(self._particles.entries(numbers[:1])[0])
            particle = self._model.particles[entry]
            if not particle.is_dependent:
                x, y, z = (self._coordinates[f"{self._particles.names[number]}.{axis}"] for axis in "xyz")
                return x, y, z
            parts = [part.tree for part in particle.position.parts]
            for part in parts:
                notation.require_short(part)
            names = self.at(particle.members, number - self._particles.first(entry))
            if len(parts) == 1:
                return evaluate.vector(parts[0], names)
            x, y, z = (evaluate.scalar(part, names) for part in parts)
            return x, y, z

        if number not in self._positions:
            self._positions[number] = _attempted(value)
        return _given(self._positions[number])

    def velocity(self, numbers: Integers) -> Triple[sympy.Expr]:
        x, y, z = (self._along(r) + sympy.diff(r, TIME) for r in self.position(numbers))
        return x, y, z

    def generalized(self, numbers: Integers, rates: bool) -> sympy.Expr:
        """A generalized coordinate, or its differential in place of its rate."""
        coordinate = self._coordinates[self._generalized.names[int(numbers[0])]]
        return self.differentials[coordinate] if rates else coordinate

    def definition(self, name: str) -> Value[sympy.Expr]:

        def value() -> Value[sympy.Expr]:
            notation.require_short(self._names.definitions[name])
            return evaluate.value(self._names.definitions[name], self.at(_ALONE, 0))

        if name not in self._values:
            self._values[name] = _attempted(value)
        return _given(self._values[name])

    def differential(self, value: sympy.Expr) -> sympy.Expr:
        """d value, over the differentials of coordinates and dt. Raises `TooLarge`."""
        return self._along(_require_small(value)) + sympy.diff(value, TIME) * _DT

    def _along(self, value: sympy.Expr) -> sympy.Expr:
        used = (x for x in self.ordered(value.free_symbols) if x != TIME)
        return sum((sympy.diff(value, x) * self.differentials[x] for x in used), ZERO)


def _attempted(compute: Callable[[], V]) -> V | TooLarge:
    """The value, or the `TooLarge` that came instead: it is not computed again at every use."""
    try:
        return _require_small(compute())
    except TooLarge as failure:
        return failure


def _given(value: V | TooLarge) -> V:
    """The value; raises the `TooLarge` that stands in its place."""
    if isinstance(value, TooLarge):
        raise value
    return value


def roots(expression: sympy.Expr) -> set[sympy.Pow]:
    """The powers in an expression that are roots."""
    return {p for p in expression.atoms(sympy.Pow) if p.exp.is_Rational and not p.exp.is_Integer}


def first_integral(
    phi: sympy.Expr, rows: tuple[str, ...], parameters: Iterable[sympy.Symbol]
) -> FirstIntegral:
    """A first integral in the notation of the model, with its charts."""
    return FirstIntegral(notation.written(phi), rows, level_charts.charts(phi, parameters))
