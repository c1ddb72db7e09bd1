"""The signs of a model's symbols, each quantity its own."""

from __future__ import annotations

import dataclasses

import sympy

from lagcli.derivation.symbolic.calculus import Key, Triple
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import merged, shorter, tidy
from lagcli.derivation.symbolic.vectors import pieces
from lagcli.derivation.writing import formula as f
from lagcli.derivation.writing import layout, paper_names
from lagcli.derivation.writing.layout import Layout
from lagcli.pfaffian.forms.notation import TIME

# Masses stand first in a product, then g and constants of springs and dampers, then lengths: m g L.
_FIRST = {"m": 0, "M": 0, "I": 0, "J": 0, "G": 1, "g": 1, "k": 1, "c": 1}
_SCRIPT = {"T": "𝒯", "V": "𝒱", "L": "ℒ"}
AXES = tuple(sympy.Symbol(f"axis {axis}") for axis in "xyz")


class Signs:
    """Formulas of expressions, vectors and names of one system."""

    def __init__(self, system: Symbolic) -> None:
        self._system = system
        self._register = paper_names.Register()
        self._shown: dict[sympy.Symbol, f.FormulaNode] = {}
        self._kinds: dict[sympy.Symbol, tuple[int, int]] = {}
        self._vectors: dict[str, sympy.Symbol] = {}
        self._layout = Layout(self._shown, self._kinds)
        self._count = 0
        self._masses: set[sympy.Symbol] = set()
        for number in range(len(system.table.particles)):
            self._masses |= system.table.mass(number).free_symbols
        self._show(TIME, f.Sign("t"), "t", layout.PARAMETER, 9)
        self._parameters()
        letters = {"length": "ℓ", "weight": "α", "height": "η"}
        for symbol in system.constants:
            kind, body, label = symbol.name.split(" ")
            sub = ",".join(paper_names.subscript(part) for part in label.split(","))
            self._show(symbol, f.Sign(letters[kind], (sub,)), f"{body}.{kind}.{label}", layout.PARAMETER)
        self._coordinates()
        every = system.all_closed
        for symbol, row in zip(every.lam, every.rows, strict=True):
            self._show(
                symbol, f.Sign("λ", (paper_names.subscript(row.name),)), f"lambda.{row.name}", layout.LAMBDA
            )
        for axis, symbol in zip("xyz", AXES, strict=True):
            self._show(symbol, f.Sign("e", (axis,), vector=True), f"e_{axis}", layout.VECTOR)
        # A script letter where the model calls something else T, V or L
        self.energies = {
            letter: self._register.take_first((f.Sign(letter), f.Sign(_SCRIPT[letter])), letter)
            for letter in "TVL"
        }
        self._abbreviations()

    def show(self, symbol: sympy.Symbol, wanted: f.Sign, name: str) -> f.Sign:
        """The sign of a further symbol that stands beside the multipliers, `name` where that sign is taken."""
        return self._show(symbol, wanted, name, layout.LAMBDA)

    def show_rate(self, symbol: sympy.Symbol, of: sympy.Symbol) -> None:
        """A symbol for the rate of a further symbol, shown with a dot."""
        self._shown[symbol], self._kinds[symbol] = dataclasses.replace(self.sign(of), dots=1), self._kinds[of]

    def show_deviation(self, symbol: sympy.Symbol, of: sympy.Symbol, dots: int = 0) -> None:
        """A symbol for the deviation of another one, or for its rates; it stands last in a product."""
        self._shown[symbol] = f.Sign("δ" + self.sign(of).base, self.sign(of).sub, dots)
        self._kinds[symbol] = layout.VECTOR, 1_000_000 + len(self._kinds)

    def show_jump(self, symbol: sympy.Symbol, number: int) -> None:
        """A symbol for the change of a rate, shown as the rate after less the rate before."""
        after, before = (dataclasses.replace(self.sign(self._system.v[number]), sup=sup) for sup in "+-")
        self._shown[symbol] = f.FormulaSum(((1, after), (-1, before)))
        self._kinds[symbol] = layout.ACCELERATION, number

    def show_after(self, symbol: sympy.Symbol, number: int) -> None:
        """A symbol for a rate just after an impact."""
        self._shown[symbol] = dataclasses.replace(self.sign(self._system.v[number]), sup="+")
        self._kinds[symbol] = layout.RATE, number

    def sign(self, symbol: sympy.Symbol) -> f.Sign:
        """The sign of a symbol that has one of its own."""
        sign = self._shown[symbol]
        assert isinstance(sign, f.Sign)
        return sign

    def node(self, value: sympy.Expr) -> f.FormulaNode:
        """The formula of an expression."""
        self._abbreviations()
        return self._layout.node(value)

    def vector(self, triple: Triple) -> f.FormulaNode:
        """Three components as the vector they are, or as a triple."""
        self._abbreviations()
        vector = self._system.table.recognizer.vector(triple)
        several = sum(1 for part in triple if part != 0) > 1
        if vector is None or (not vector.parts and several):
            return f.Triple(tuple(self.node(tidy(part)) for part in triple))
        total = sympy.Integer(0)
        for factor, key in pieces(vector):
            total += self._times(merged(tidy(factor)), key)
        return self._layout.node(total)

    def scaled(self, factor: sympy.Expr, triple: Triple) -> list[tuple[int, f.FormulaNode]]:
        """The terms of factor * vector; the factor may hold components of vectors, and stays a factor."""
        vector = self._system.table.recognizer.vector(triple)
        if vector is None or (not vector.parts and sum(1 for part in triple if part != 0) > 1):
            if factor == 1:
                return [(1, self.vector(triple))]
            sign, node = 1, self.node(factor)
            if isinstance(node, f.FormulaSum) and len(node.terms) == 1:
                sign, node = node.terms[0]
            return [(sign, f.FormulaProduct((node, self.vector(triple))))]
        terms: list[tuple[int, f.FormulaNode]] = []
        for own, key in pieces(vector):
            node = self._layout.node(self._times(shorter(tidy(factor * own), factor * own), key))
            terms += node.terms if isinstance(node, f.FormulaSum) else [(1, node)]
        return terms

    def _times(self, factor: sympy.Expr, key: Key) -> sympy.Expr:
        """factor * combination; a minus sign turns a difference of vectors round."""
        combination = self._combination(key)
        if combination.is_Add and factor.could_extract_minus_sign():
            return -factor * -combination
        return factor * combination

    def key(self, key: Key) -> f.FormulaNode:
        """The formula of a combination of vectors."""
        return self._layout.node(self._combination(key))

    def _combination(self, key: Key) -> sympy.Expr:
        parts, rest = key
        total = sum((c * self._vector_symbol(n) for n, c in parts), sympy.Integer(0))
        return total + sum((c * axis for c, axis in zip(rest, AXES, strict=True)), sympy.Integer(0))

    def _vector_symbol(self, name: str) -> sympy.Symbol:
        if name not in self._vectors:
            self._vectors[name] = symbol = sympy.Symbol(f"vector {name}")
            dots = {"r ": 0, "v ": 1, "a ": 2}.get(name[:2])
            if dots is None:
                shown = self._register.take(paper_names.sign(name, vector=True), name)
            else:
                shown = self.of_particle("r", name[2:], dots)
            self._shown[symbol] = shown
            self._kinds[symbol] = layout.VECTOR, len(self._vectors)
        return self._vectors[name]

    @staticmethod
    def of_particle(letter: str, particle: str, dots: int = 0) -> f.Sign:
        """r, R or F of a particle."""
        return f.Sign(letter, (paper_names.subscript(particle),), dots, vector=True)

    @staticmethod
    def of_row(letter: str, row: str, *more: str) -> f.Sign:
        """f, gamma or B of a row."""
        return f.Sign(letter, (paper_names.subscript(row), *more))

    def with_prefix(self, prefix: str, number: int) -> f.Sign:
        """d or δ before a coordinate."""
        sign = self.sign(self._system.q[number])
        return f.Sign(prefix + sign.base, sign.sub)

    def label(self, number: int) -> str:
        """A coordinate as a subscript."""
        sign = self.sign(self._system.q[number])
        return sign.base + "".join(sign.sub)

    def definitions(self) -> list[tuple[f.FormulaNode, f.FormulaNode]]:
        """The abbreviations for lengths with what they stand for."""
        self._abbreviations()
        known = self._system.table.calculus.known
        definitions: list[tuple[f.FormulaNode, f.FormulaNode]] = []
        for symbol, abbreviation in known.items():
            if abbreviation.is_root and abbreviation.left is not None:
                definitions.append((self._shown[symbol], f.Bars(self.key(abbreviation.left))))
            elif abbreviation.is_root:
                definitions.append((self._shown[symbol], f.Root(self._layout.node(abbreviation.inner))))
        return definitions

    def _show(self, symbol: sympy.Symbol, wanted: f.Sign, name: str, kind: int, first: int = 2) -> f.Sign:
        sign = self._register.take(wanted, name)
        self._shown[symbol] = sign
        self._kinds[symbol] = kind, first * 1_000_000 + len(self._kinds)
        return sign

    def _parameters(self) -> None:
        table = self._system.table
        for name, value in table.parameters.items():
            sign = paper_names.sign(name)
            if not isinstance(value, tuple):
                if not value.is_number:
                    first = 0 if value in self._masses else _FIRST.get(sign.base, 2)
                    self._show(value, sign, name, layout.PARAMETER, first)
                continue
            for axis, part in zip("xyz", value, strict=True):
                if part.is_Symbol:
                    wanted = f.Sign(sign.base, (*sign.sub, axis))
                    self._show(part, wanted, f"{name}.{axis}", layout.PARAMETER)

    def _coordinates(self) -> None:
        system = self._system
        generalized = len(system.names) - len(system.table.generalized)
        for i, name in enumerate(system.names):
            particle, _, axis = name.rpartition(".")
            wanted = paper_names.component(particle, axis) if i < generalized else paper_names.sign(name)
            sign = self._show(system.q[i], wanted, name, layout.COORDINATE)
            for symbol, dots, kind in (
                (system.v[i], 1, layout.RATE),
                (system.a[i], 2, layout.ACCELERATION),
            ):
                self._shown[symbol] = dataclasses.replace(sign, dots=dots)
                self._kinds[symbol] = kind, i

    def _abbreviations(self) -> None:
        """Signs for the abbreviations there are by now."""
        known = self._system.table.calculus.known
        if len(known) == self._count:
            return
        new = list(known.items())[self._count :]
        self._count = len(known)
        for number, (symbol, abbreviation) in enumerate(new, self._count - len(new) + 1):
            if abbreviation.is_root:
                self._show(symbol, self._length(abbreviation.left, number), f"d_{number}", layout.LENGTH)
                continue
            assert abbreviation.left is not None
            assert abbreviation.right is not None
            self._kinds[symbol] = layout.PRODUCT, number
            left, right = self.key(abbreviation.left), self.key(abbreviation.right)
            if abbreviation.left == abbreviation.right:
                self._shown[symbol] = f.FormulaPower(f.Bars(left), f.FormulaNumber("2"))
            else:
                self._shown[symbol] = f.Dot(left, right)

    def _length(self, key: Key | None, number: int) -> f.Sign:
        if key is None:
            return f.Sign("s", (str(number),))
        plain = all(part == 0 for part in key[1]) and len(key[0]) <= 2
        if not plain or any(name.startswith("v ") for name, _ in key[0]):
            return f.Sign("d", (str(number),))
        return f.Sign("d", tuple(paper_names.subscript(name.removeprefix("r ")) for name, _ in key[0]))
