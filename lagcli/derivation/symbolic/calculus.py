"""Derivatives with abbreviations: a distance stays one symbol, and is differentiated by the chain rule.

With d = |U| the derivative is dd = U . dU / d, so that nothing with a square root is ever expanded: equations stay
as short as they are on paper, and cheap at any number of particles.
"""

from __future__ import annotations

import dataclasses

import sympy

from lagcli import memory
from lagcli.pfaffian.forms.notation import TIME, ZERO

Triple = tuple[sympy.Expr, sympy.Expr, sympy.Expr]
# A linear combination of vectors: names of vectors with their coefficients, and a rest along the axes.
Key = tuple[tuple[tuple[str, sympy.Expr], ...], Triple]
# From so many terms on those of a sum are looked up by the symbols in them.
MANY = 12


@dataclasses.dataclass(frozen=True, slots=True)
class Abbreviation:
    """A symbol for a root of `inner` (`is_root`) or for `inner` itself.

    `left` and `right`: where `inner` is a product of vectors left . right, their texts for printing.
    """

    inner: sympy.Expr
    is_root: bool
    left: Key | None = None
    right: Key | None = None


class Calculus:
    """Partial derivatives and rates of expressions in coordinates, rates, time and abbreviations."""

    def __init__(self, coordinates: list[sympy.Symbol], rates: list[sympy.Symbol]) -> None:
        self.moving = dict(zip(coordinates, rates, strict=True))
        self.known: dict[sympy.Symbol, Abbreviation] = {}
        # d -> (U . dU/dt, |dU/dt|^2) of a distance whose U is linear in positions.
        self.products: dict[sympy.Symbol, tuple[sympy.Expr, sympy.Expr]] = {}
        self.rates: dict[sympy.Symbol, sympy.Expr] = {}  # those of products of vectors, with velocities fixed
        # (U, W) -> the symbol of U . W, or of |U|; of another root, what is under it -> its symbol.
        self.by_vectors: dict[tuple[Key, Key] | sympy.Expr, sympy.Symbol] = {}
        self._symbols: dict[sympy.Symbol, frozenset[sympy.Symbol]] = {}
        self._partials: dict[tuple[sympy.Symbol, sympy.Symbol], sympy.Expr] = {}
        self.has_jumps = False

    def symbols(self, value: sympy.Expr) -> frozenset[sympy.Symbol]:
        """Everything a value depends on, also through abbreviations, these included."""
        symbols = set(value.free_symbols)
        for symbol in value.free_symbols & self.known.keys():
            if symbol not in self._symbols:
                self._symbols[symbol] = self.symbols(self.known[symbol].inner)
            symbols |= self._symbols[symbol]
        return frozenset(symbols)

    def partial(self, value: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
        """dvalue/dx with everything else fixed."""
        total = self._plain(value, x) if x in value.free_symbols else ZERO
        for symbol in sorted(value.free_symbols & self.known.keys(), key=str):
            if (symbol, x) not in self._partials:
                known = self.known[symbol]
                inner = self.partial(known.inner, x) if x in self.symbols(known.inner) else ZERO
                self._partials[symbol, x] = inner / (2 * symbol) if known.is_root else inner
            if self._partials[symbol, x] != 0:
                total += self._plain(value, symbol) * self._partials[symbol, x]
        return total

    def rate(self, value: sympy.Expr) -> sympy.Expr:
        """d/dt of a function of coordinates and time; of one that holds rates too, with the rates fixed."""
        total = self._plain(value, TIME) if TIME in value.free_symbols else ZERO
        for x in sorted(value.free_symbols & self.moving.keys(), key=str):
            total += self._plain(value, x) * self.moving[x]
        for symbol in sorted(value.free_symbols & self.known.keys(), key=str):
            total += self._plain(value, symbol) * self._rate_of(symbol)
        return total

    def expanded(self, value: sympy.Expr, only: frozenset[sympy.Symbol] | None = None) -> sympy.Expr:
        """The value without abbreviations, or without those that depend on some of `only` these symbols."""
        while True:
            found = {}
            for symbol in value.free_symbols & self.known.keys():
                known = self.known[symbol]
                if only is None or self.symbols(known.inner) & only:
                    found[symbol] = sympy.sqrt(known.inner) if known.is_root else known.inner
            if not found:
                return value
            value = value.xreplace(found)

    def _plain(self, value: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
        derivative = slope(value, x)
        # A jump has no slope; where it stands the compiled equations have none either.
        return derivative.replace(sympy.DiracDelta, lambda *_: ZERO) if self.has_jumps else derivative

    def _rate_of(self, symbol: sympy.Symbol) -> sympy.Expr:
        if symbol in self.products:
            return self.products[symbol][0] / symbol
        if symbol in self.rates:
            return self.rates[symbol]
        known = self.known[symbol]
        inner = self.rate(known.inner)
        return inner / (2 * symbol) if known.is_root else inner


def slope(value: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """dvalue/dx, x a symbol, without SymPy's detours where the value is plain arithmetic."""
    if value == x:
        return sympy.Integer(1)
    if not value.args or (not value.is_Add and x not in value.free_symbols):
        return ZERO
    if value.is_Add:
        terms = value.args if len(value.args) < MANY else _terms(value).get(x, ())
        return sympy.Add(*(slope(term, x) for term in terms))
    if value.is_Mul:
        terms = []
        for index, factor in enumerate(value.args):
            inner = slope(factor, x)
            if inner != 0:
                terms.append(sympy.Mul(*value.args[:index], inner, *value.args[index + 1 :]))
        return sympy.Add(*terms)
    if value.is_Pow and x not in value.exp.free_symbols:
        return value.exp * value.base ** (value.exp - 1) * slope(value.base, x)
    return sympy.diff(value, x)


@memory.remembered(128)
def _terms(value: sympy.Expr) -> dict[sympy.Expr, list[sympy.Expr]]:
    """The terms of a long sum by the symbols they hold: it is differentiated by each of them."""
    terms: dict[sympy.Expr, list[sympy.Expr]] = {}
    for term in value.args:
        for symbol in term.free_symbols:
            terms.setdefault(symbol, []).append(term)
    return terms
