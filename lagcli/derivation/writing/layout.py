"""SymPy expressions as formulas: which factor stands first, what becomes a fraction, how a number is written."""

from __future__ import annotations

from collections.abc import Mapping

import sympy

from lagcli.derivation.writing import formula as f
from lagcli.pfaffian.forms import notation

# Kinds of symbols, in the order in which they stand in a product.
LAMBDA, PARAMETER, COORDINATE, LENGTH, ACCELERATION, RATE, SUM, APPLIED, PRODUCT, VECTOR = range(10)

# Decimal places, and digits of round numbers, that are written out.
DECIMALS = 8
_SIMPLE = {(1, 2), (1, 3), (2, 3), (1, 4), (3, 4)}


class Layout:
    """Formulas with the signs of symbols: `shown` (symbol -> node) and `kinds` (symbol -> (kind, index))."""

    def __init__(
        self, shown: Mapping[sympy.Symbol, f.FormulaNode], kinds: Mapping[sympy.Symbol, tuple[int, int]]
    ) -> None:
        self._shown, self._kinds = shown, kinds

    def node(self, value: sympy.Expr) -> f.FormulaNode:
        """The formula of an expression."""
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
                return f.Root(self.node(base))
            shown = self.node(base)
            power = self.node(exponent)
            if isinstance(shown, f.Apply) and shown.power is None and len(shown.arguments) == 1:
                return f.Apply(shown.name, shown.arguments, power)
            return f.FormulaPower(shown, power)
        return self._other(value)

    def _other(self, value: sympy.Expr) -> f.FormulaNode:
        if value == sympy.pi:
            return f.Sign("π")
        if isinstance(value, sympy.Abs):
            return f.Bars(self.node(value.args[0]))
        if isinstance(value, sympy.Heaviside):  # in derivatives of `min` and `max`
            return f.Apply("step", (self.node(value.args[0]),))
        if type(value) in notation.ROWS:
            row = notation.ROWS[type(value)]
            return f.Apply(row.written or row.name, tuple(map(self.node, value.args)))
        if value == sympy.E:
            return f.Apply("exp", (f.ONE,))
        return f.FormulaText(str(value))

    def _term_key(self, term: sympy.Expr) -> tuple[object, ...]:
        """Accelerations first, then rates, then positions; each as they are declared."""
        kinds_of: list[tuple[int, int]] = []
        for symbol in term.free_symbols:
            kinds_of.append(self._kinds.get(symbol, (SUM, 0)))
        kinds = {kind for kind, _ in kinds_of}
        order = [ACCELERATION, RATE, LAMBDA, PRODUCT, COORDINATE, LENGTH, VECTOR, PARAMETER]
        leading = next((i for i, kind in enumerate(order) if kind in kinds), len(order))
        leads = sorted(n for kind, n in kinds_of if leading < len(order) and kind == order[leading])
        degree = term.as_coeff_Mul()[1]
        power = sum(
            int(e)
            for b, e in degree.as_powers_dict().items()
            if self._kinds.get(b, (SUM, 0))[0] == RATE and e.is_Integer
        )
        return leading, -power, leads, sorted(kinds_of), sympy.default_sort_key(term)

    def _signed(self, term: sympy.Expr) -> tuple[int, f.FormulaNode]:
        """The sign of a term and the term without it."""
        coefficient, rest = term.as_coeff_Mul()
        if not coefficient.is_Rational:
            return 1, self._product(term, sympy.Integer(1))
        sign = -1 if coefficient < 0 else 1
        return sign, self._product(rest, abs(coefficient))

    def _product(self, value: sympy.Expr, coefficient: sympy.Expr) -> f.FormulaNode:
        above: list[sympy.Expr] = []
        below: list[sympy.Expr] = []
        for factor in sympy.Mul.make_args(value):
            base, exponent = factor.as_base_exp()
            if factor.is_Pow and base != sympy.E and exponent.could_extract_minus_sign():
                below.append(sympy.Pow(base, -exponent))
            elif factor != 1:
                above.append(factor)
        above.sort(key=self._factor_key)
        below.sort(key=self._factor_key)
        p, q = int(coefficient.p), int(coefficient.q)
        top, bottom = list(map(self.node, above)), list(map(self.node, below))
        if not bottom and (p, q) in _SIMPLE and value.free_symbols:
            return f.FormulaProduct((f.Fraction(f.FormulaNumber(str(p)), f.FormulaNumber(str(q))), *top))
        if q != 1 and ((decimal := _decimal(p, q)) is not None) and (p, q) not in _SIMPLE:
            top.insert(0, f.FormulaNumber(decimal))
        else:
            if p != 1 or not top:
                top.insert(0, f.FormulaNumber(_integer(p)))
            if q != 1:
                bottom.insert(0, f.FormulaNumber(str(q)))
        upper = top[0] if len(top) == 1 else f.FormulaProduct(tuple(top))
        if not bottom:
            return upper
        return f.Fraction(upper, bottom[0] if len(bottom) == 1 else f.FormulaProduct(tuple(bottom)))

    def _factor_key(self, factor: sympy.Expr) -> tuple[object, ...]:
        base, _ = factor.as_base_exp()
        if factor in self._kinds or base in self._kinds:
            return *self._kinds.get(factor, self._kinds.get(base, (SUM, 0))), ""
        if base.is_number:
            return -1, 0, str(base)
        inner = sorted(self._kinds.get(s, (SUM, 0)) for s in base.free_symbols)
        if base.is_Add:
            # A sum of parameters stands with the parameters, one of vectors with the vectors.
            kinds = {kind for kind, _ in inner}
            kind = VECTOR if VECTOR in kinds else PARAMETER if kinds == {PARAMETER} else SUM
            return kind, inner[0][1] if inner else 0, str(base)
        return APPLIED, 0, inner, isinstance(base, sympy.cos), str(base)


def scientific(digits: int, exponent: int) -> str:
    """digits * 10^exponent as 6.674e-11."""
    plain = str(digits).rstrip("0")
    exponent += len(str(digits)) - 1
    return f"{plain[0]}{'.' * (len(plain) > 1)}{plain[1:]}e{exponent}"


def _integer(number: int) -> str:
    """A whole number; one that ends in many zeros as 6e24."""
    text = str(number)
    return scientific(number, 0) if len(text) > DECIMALS and text.endswith("000") else text


def _decimal(p: int, q: int) -> str | None:
    """p/q as a finite decimal, or None where there is none."""
    rest, twos, fives = q, 0, 0
    while rest % 2 == 0:
        rest, twos = rest // 2, twos + 1
    while rest % 5 == 0:
        rest, fives = rest // 5, fives + 1
    decimals = max(twos, fives)
    if rest != 1:
        return None
    if decimals > DECIMALS:
        return scientific(p * 10**decimals // q, -decimals)
    digits = str(p * 10**decimals // q).rjust(decimals + 1, "0")
    return f"{digits[:-decimals]}.{digits[-decimals:]}" if decimals else digits
