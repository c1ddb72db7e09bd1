"""Expressions of a model as formulas: each symbol its own sign, which factor stands first, how a number is written.

Two things never look alike: where the readable sign is taken, the name of the model itself is printed.
"""

from __future__ import annotations

import dataclasses
import itertools

import sympy

from lagcli.derivation.symbolic.calculus import NOTHING, Key, Triple, pieces
from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.symbolic.tidy import merged, shorter, tidy
from lagcli.derivation.writing import formula as f
from lagcli.pfaffian.forms import notation
from lagcli.pfaffian.forms.notation import TIME, ZERO

# Kinds of symbols, in the order in which they stand in a product.
LAMBDA, PARAMETER, COORDINATE, LENGTH, ACCELERATION, RATE, SUM, APPLIED, PRODUCT, VECTOR = range(10)
LEADING = (ACCELERATION, RATE, LAMBDA, PRODUCT, COORDINATE, LENGTH, VECTOR, PARAMETER)  # in a sum

# Decimal places, and digits of round numbers, that are written out.
DECIMALS = 8
_SIMPLE = {(1, 2), (1, 3), (2, 3), (1, 4), (3, 4)}
# Masses stand first in a product, then g and constants of springs and dampers, then lengths: m g L.
_FIRST = {"m": 0, "M": 0, "I": 0, "J": 0, "G": 1, "g": 1, "k": 1, "c": 1}
AXES = tuple(sympy.Symbol(f"axis {axis}") for axis in "xyz")


def _scientific(digits: int, exponent: int) -> str:
    """digits * 10^exponent as 6.674e-11."""
    plain = str(digits).rstrip("0")
    exponent += len(str(digits)) - 1
    return f"{plain[0]}{'.' * (len(plain) > 1)}{plain[1:]}e{exponent}"


def _decimal(p: int, q: int) -> str | None:
    """p/q as a finite decimal, or None where there is none."""
    decimals = next((k for k in range(q.bit_length()) if 10**k % q == 0), None)
    if decimals is None:
        return None
    whole = p * 10**decimals // q
    if decimals > DECIMALS:
        return _scientific(whole, -decimals)
    digits = str(whole).rjust(decimals + 1, "0")
    return f"{digits[:-decimals]}.{digits[-decimals:]}"


class Signs:
    """Formulas of expressions, vectors and names of one system."""

    def __init__(self, system: Symbolic) -> None:
        self._system, table = system, system.table
        self._taken: set[tuple[str, bool]] = set()
        self._shown: dict[sympy.Symbol, f.FormulaNode] = {}
        # Places in products: kind, group, number
        self._kinds: dict[sympy.Symbol, tuple[int, int, int]] = {}
        self._vectors: dict[str, sympy.Symbol] = {}
        self._count = 0
        self._show(TIME, f.Sign("t"), "t", PARAMETER, 9)
        masses = set().union(*(table.mass(number).free_symbols for number in range(len(table.particles))))
        for name, value in table.parameters.items():
            sign = f.named(name)
            if not isinstance(value, tuple):
                if not value.is_number:
                    group = 0 if value in masses else _FIRST.get(sign.base, 2)
                    self._show(value, sign, name, PARAMETER, group)
                continue
            for axis, part in zip("xyz", value, strict=True):
                if part.is_Symbol:
                    self._show(part, f.Sign(sign.base, (*sign.sub, axis)), f"{name}.{axis}", PARAMETER)
        letters = {"length": "ℓ", "weight": "α", "height": "η"}
        for symbol in table.body_constants:
            kind, body, label = symbol.name.split(" ")
            sub = ",".join(map(f.subscript, label.split(",")))
            self._show(symbol, f.Sign(letters[kind], (sub,)), f"{body}.{kind}.{label}", PARAMETER)
        generalized = len(system.names) - len(table.generalized)
        for i, name in enumerate(system.names):
            particle, _, axis = name.rpartition(".")
            wanted = f.Sign(axis, (f.subscript(particle),)) if i < generalized else f.named(name)
            sign = self._show(system.q[i], wanted, name, COORDINATE)
            for symbol, dots, of_rate in ((system.v[i], 1, RATE), (system.a[i], 2, ACCELERATION)):
                self._shown[symbol] = dataclasses.replace(sign, dots=dots)
                self._kinds[symbol] = of_rate, 0, i
        every = system.all_closed
        for symbol, row in zip(every.lam, every.rows, strict=True):
            self.show(symbol, self.of_row("λ", row.name), f"lambda.{row.name}")
        for axis, symbol in zip("xyz", AXES, strict=True):
            self._show(symbol, f.Sign("e", (axis,), vector=True), f"e_{axis}", VECTOR)
        # A script letter where the model calls something else T, V or L
        pairs = zip("TVL", "𝒯𝒱ℒ", strict=True)
        self.energies = {plain: self._free(plain, f.Sign(plain), f.Sign(script)) for plain, script in pairs}
        self._abbreviations()

    def show(self, symbol: sympy.Symbol, wanted: f.Sign, name: str) -> f.Sign:
        """The sign of a further symbol that stands beside the multipliers, `name` where that sign is taken."""
        return self._show(symbol, wanted, name, LAMBDA)

    def show_as(self, symbol: sympy.Symbol, node: f.FormulaNode, like: sympy.Symbol | None = None) -> None:
        """Show a further symbol as a formula; it stands where `like` does, or last in a product."""
        self._shown[symbol] = node
        self._kinds[symbol] = (VECTOR, 1, len(self._kinds)) if like is None else self._kinds[like]

    def sign(self, symbol: sympy.Symbol) -> f.Sign:
        """The sign of a symbol that has one of its own."""
        sign = self._shown[symbol]
        assert isinstance(sign, f.Sign)
        return sign

    def node(self, value: sympy.Expr) -> f.FormulaNode:
        self._abbreviations()
        return self._node(value)

    def vector(self, triple: Triple) -> f.FormulaNode:
        """Three components as the vector they are, or as a triple."""
        self._abbreviations()
        vector = self._system.table.recognizer.vector(triple)
        several = sum(1 for part in triple if part != 0) > 1
        if vector is None or (not vector[0] and several):
            return f.Triple(tuple(self.node(tidy(part)) for part in triple))
        return self._node(sum((self._times(merged(tidy(c)), key) for c, key in pieces(vector)), ZERO))

    def scaled(self, factor: sympy.Expr, triple: Triple) -> list[tuple[int, f.FormulaNode]]:
        """The terms of factor * vector; the factor may hold components of vectors, and stays a factor."""
        vector = self._system.table.recognizer.vector(triple)
        if vector is None or (not vector[0] and sum(1 for part in triple if part != 0) > 1):
            if factor == 1:
                return [(1, self.vector(triple))]
            sign, node = f.split(self.node(factor))
            return [(sign, f.FormulaProduct((node, self.vector(triple))))]
        scaled = ((factor * own, key) for own, key in pieces(vector))
        parts = (self._node(self._times(shorter(tidy(own), own), key)) for own, key in scaled)
        return [term for part in parts for term in f.terms_of(part)]

    def _times(self, factor: sympy.Expr, key: Key) -> sympy.Expr:
        """factor * combination; a minus sign turns a difference of vectors round."""
        combination = self._combination(key)
        if combination.is_Add and factor.could_extract_minus_sign():
            return -factor * -combination
        return factor * combination

    def _combination(self, key: Key) -> sympy.Expr:
        """A combination in symbols of vectors, each of which gets its sign here."""
        total = ZERO
        for name, coefficient in key[0]:
            if name not in self._vectors:
                self._vectors[name] = symbol = sympy.Symbol(f"vector {name}")
                dots = {"r ": 0, "v ": 1, "a ": 2}.get(name[:2])
                if dots is None:
                    wanted = f.named(name, vector=True)
                    self._shown[symbol] = self._free(name, wanted, f.Sign(name, vector=True))
                else:
                    self._shown[symbol] = self.of_particle("r", name[2:], dots)
                self._kinds[symbol] = VECTOR, 0, len(self._vectors)
            total += coefficient * self._vectors[name]
        return total + sum((c * axis for c, axis in zip(key[1], AXES, strict=True)), ZERO)

    @staticmethod
    def of_particle(letter: str, particle: str, dots: int = 0) -> f.Sign:
        """r, R or F of a particle."""
        return f.Sign(letter, (f.subscript(particle),), dots, vector=True)

    @staticmethod
    def of_row(letter: str, row: str, *more: str) -> f.Sign:
        """f, gamma or B of a row."""
        return f.Sign(letter, (f.subscript(row), *more))

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
        node = self._node
        definitions: list[tuple[f.FormulaNode, f.FormulaNode]] = []
        for symbol, abbreviation in self._system.table.calculus.known.items():
            if abbreviation.is_root and abbreviation.left is not None:
                definitions.append((self._shown[symbol], f.Bars(node(self._combination(abbreviation.left)))))
            elif abbreviation.is_root:
                definitions.append((self._shown[symbol], f.Root(node(abbreviation.inner))))
        return definitions

    def _show(self, symbol: sympy.Symbol, wanted: f.Sign, name: str, kind: int, group: int = 2) -> f.Sign:
        sign = self._free(name, wanted, f.Sign(name, vector=wanted.vector))
        self._shown[symbol] = sign
        self._kinds[symbol] = kind, group, len(self._kinds)
        return sign

    def _free(self, name: str, *wanted: f.Sign) -> f.Sign:
        """The first of these signs that reads like nothing else, or the name with primes."""
        primed = (f.Sign(name + "'" * k, vector=wanted[0].vector) for k in itertools.count(1))
        for candidate in itertools.chain(wanted, primed):
            key = (candidate.base + "_" + ",".join(candidate.sub)).rstrip("_"), candidate.vector
            if key not in self._taken:
                break
        self._taken.add(key)
        return candidate

    def _abbreviations(self) -> None:
        """Signs for the abbreviations there are by now."""
        known, begin = self._system.table.calculus.known, self._count
        if len(known) == begin:
            return
        self._count = len(known)
        for number, (symbol, abbreviation) in enumerate(list(known.items())[begin:], begin + 1):
            left, right = abbreviation.left, abbreviation.right
            if abbreviation.is_root:
                sign = f.Sign("d", (str(number),))
                if left is None:
                    sign = f.Sign("s", (str(number),))
                elif (
                    left[1] == NOTHING
                    and len(left[0]) <= 2
                    and not any(n.startswith("v ") for n, _ in left[0])
                ):
                    sign = f.Sign("d", tuple(f.subscript(name.removeprefix("r ")) for name, _ in left[0]))
                self._show(symbol, sign, f"d_{number}", LENGTH)
                continue
            assert left is not None
            assert right is not None
            self._kinds[symbol] = PRODUCT, 0, number
            one, other = (self._node(self._combination(key)) for key in (left, right))
            if left == right:
                self._shown[symbol] = f.FormulaPower(f.Bars(one), f.FormulaNumber("2"))
            else:
                self._shown[symbol] = f.Dot(one, other)

    def _node(self, value: sympy.Expr) -> f.FormulaNode:
        """The formula of an expression whose abbreviations have signs."""
        if value in self._shown:
            return self._shown[value]
        if value.is_Add:
            terms = sorted(sympy.Add.make_args(value), key=self._term_key)
            signed = [self._signed(term) for term in terms]
            first = next((i for i, (sign, _) in enumerate(signed) if sign > 0), 0)
            return f.FormulaSum((signed[first], *signed[:first], *signed[first + 1 :]))
        if value.is_Rational or value.is_Mul:
            sign, node = self._signed(value)
            return node if sign > 0 else f.negative(node)
        if value.is_Pow and not isinstance(value, sympy.exp):
            base, exponent = value.as_base_exp()
            if exponent.could_extract_minus_sign():
                return self._product(value, sympy.Integer(1))
            if exponent == sympy.Rational(1, 2):
                return f.Root(self._node(base))
            shown = self._node(base)
            power = self._node(exponent)
            if isinstance(shown, f.Apply) and shown.power is None and len(shown.arguments) == 1:
                return f.Apply(shown.name, shown.arguments, power)
            return f.FormulaPower(shown, power)
        if value == sympy.pi:
            return f.Sign("π")
        if value == sympy.E:
            return f.Apply("exp", (f.ONE,))
        if isinstance(value, sympy.Abs):
            return f.Bars(self._node(value.args[0]))
        if isinstance(value, sympy.Heaviside):  # in derivatives of `min` and `max`
            return f.Apply("step", (self._node(value.args[0]),))
        if type(value) in notation.ROWS:
            row = notation.ROWS[type(value)]
            return f.Apply(row.written or row.name, tuple(map(self._node, value.args)))
        return f.FormulaText(str(value))

    def _term_key(self, term: sympy.Expr) -> tuple[object, ...]:
        """Accelerations first, then rates, then positions; each as they are declared."""
        kinds_of = [self._kinds.get(symbol, (SUM, 0, 0)) for symbol in term.free_symbols]
        kinds = {kind for kind, *_ in kinds_of}
        leading = next((i for i, kind in enumerate(LEADING) if kind in kinds), len(LEADING))
        leads = sorted(place[1:] for place in kinds_of if place[0] in LEADING[leading : leading + 1])
        powers = term.as_coeff_Mul()[1].as_powers_dict()
        of_rates = (e for b, e in powers.items() if self._kinds.get(b, (SUM,))[0] == RATE)
        power = sum(int(e) for e in of_rates if e.is_Integer)
        return leading, -power, leads, sorted(kinds_of), sympy.default_sort_key(term)

    def _signed(self, term: sympy.Expr) -> tuple[int, f.FormulaNode]:
        """The sign of a term and the term without it."""
        coefficient, rest = term.as_coeff_Mul()
        if not coefficient.is_Rational:
            return 1, self._product(term, sympy.Integer(1))
        return -1 if coefficient < 0 else 1, self._product(rest, abs(coefficient))

    def _product(self, value: sympy.Expr, coefficient: sympy.Expr) -> f.FormulaNode:
        above: list[sympy.Expr] = []
        below: list[sympy.Expr] = []
        for factor in sympy.Mul.make_args(value):
            base, exponent = factor.as_base_exp()
            if factor.is_Pow and base != sympy.E and exponent.could_extract_minus_sign():
                below.append(sympy.Pow(base, -exponent))
            elif factor != 1:
                above.append(factor)
        top = list(map(self._node, sorted(above, key=self._factor_key)))
        bottom = list(map(self._node, sorted(below, key=self._factor_key)))
        p, q = int(coefficient.p), int(coefficient.q)
        if not bottom and (p, q) in _SIMPLE and value.free_symbols:
            return f.FormulaProduct((f.Fraction(f.FormulaNumber(str(p)), f.FormulaNumber(str(q))), *top))
        decimal = None if q == 1 or (p, q) in _SIMPLE else _decimal(p, q)
        if decimal is not None:
            top.insert(0, f.FormulaNumber(decimal))
        else:
            if p != 1 or not top:
                is_round = len(str(p)) > DECIMALS and p % 1000 == 0  # as 6e24
                top.insert(0, f.FormulaNumber(_scientific(p, 0) if is_round else str(p)))
            if q != 1:
                bottom.insert(0, f.FormulaNumber(str(q)))
        upper = top[0] if len(top) == 1 else f.FormulaProduct(tuple(top))
        if not bottom:
            return upper
        return f.Fraction(upper, bottom[0] if len(bottom) == 1 else f.FormulaProduct(tuple(bottom)))

    def _factor_key(self, factor: sympy.Expr) -> tuple[object, ...]:
        base, _ = factor.as_base_exp()
        if factor in self._kinds or base in self._kinds:
            return *self._kinds.get(factor, self._kinds.get(base, (SUM, 0, 0))), ""
        if base.is_number:
            return -1, 0, str(base)
        inner = sorted(self._kinds.get(s, (SUM, 0, 0)) for s in base.free_symbols)
        if base.is_Add:
            # A sum of parameters stands with the parameters, one of vectors with the vectors.
            kinds = {kind for kind, *_ in inner}
            kind = VECTOR if VECTOR in kinds else PARAMETER if kinds == {PARAMETER} else SUM
            return kind, *(inner[0][1:] if inner else (0, 0)), str(base)
        return APPLIED, 0, inner, isinstance(base, sympy.cos), str(base)
