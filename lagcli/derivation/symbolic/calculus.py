"""Derivatives with abbreviations, and vectors: a distance stays one symbol, differentiated by the chain rule.

With d = |U| the derivative is dd = U . dU / d: equations stay as short as on paper, and cheap at any number of
particles. Three components are recognized as the vector they are: (x_b - x_a, y_b - y_a, z_b - z_a)/d is (r_b - r_a)/d.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import sympy

from lagcli import memory
from lagcli.pfaffian.forms.notation import TIME, ZERO

Triple = tuple[sympy.Expr, sympy.Expr, sympy.Expr]
# A linear combination of vectors: names of vectors with their coefficients, and a rest along the axes.
Key = tuple[tuple[tuple[str, sympy.Expr], ...], Triple]
NOTHING: Triple = (ZERO, ZERO, ZERO)
MANY = 12  # terms: those of a longer sum are looked up by the symbols in them


@dataclasses.dataclass(frozen=True, slots=True)
class Abbreviation:
    """A symbol for a root of `inner` (`is_root`) or for `inner` itself, where that is a product of vectors left . right
    with these for printing."""

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
            if symbol in self.products:
                moved = self.products[symbol][0] / symbol
            elif symbol in self.rates:
                moved = self.rates[symbol]
            else:
                moved = self.rate(self.known[symbol].inner)
                moved = moved / (2 * symbol) if self.known[symbol].is_root else moved
            total += self._plain(value, symbol) * moved
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


class VectorRecognizer:
    """Recognizes vectors by the symbols of their components."""

    def __init__(self) -> None:
        self._axes: tuple[dict[sympy.Symbol, str], ...] = ({}, {}, {})
        self._components: set[sympy.Symbol] = set()
        self.triples: dict[str, Triple] = {}
        self._found: dict[Triple, Key | None] = {}

    def know(self, name: str, triple: Sequence[sympy.Symbol]) -> None:
        """Note that three symbols are the components of the vector of this name."""
        self.triples[name] = (triple[0], triple[1], triple[2])
        for known, symbol in zip(self._axes, triple, strict=True):
            known[symbol] = name
            self._components.add(symbol)

    def vector(self, triple: Triple) -> Key | None:
        """The combination of vectors, or None where the components are none."""
        if triple in self._found:
            return self._found[triple]
        self._found[triple] = None
        by_axis: list[dict[str, sympy.Expr]] = []
        rest = []
        for value, names in zip(triple, self._axes, strict=True):
            own = [s for s in value.free_symbols if s in names]
            linear = {s: slope(value, s) for s in own}
            left = value.xreplace(dict.fromkeys(own, ZERO))
            if any(c.free_symbols & self._components for c in (*linear.values(), left)):
                return None
            rest.append(left)
            by_axis.append({names[s]: linear[s] for s in own})
        x, y, z = by_axis
        if not (x.keys() == y.keys() == z.keys()):
            return None
        if any(x[n] != other and sympy.expand(x[n] - other) != 0 for n in x for other in (y[n], z[n])):
            return None
        parts = tuple((n, x[n]) for n in sorted(x, key=list(self.triples).index))
        self._found[triple] = parts, (rest[0], rest[1], rest[2])
        return self._found[triple]

    def components(self, key: Key) -> Triple:
        parts, rest = key
        x, y, z = (sum((c * self.triples[n][axis] for n, c in parts), rest[axis]) for axis in range(3))
        return x, y, z


def pieces(vector: Key) -> list[tuple[sympy.Expr, Key]]:
    """The vector as a sum of scalar * (plain combination). Where the coefficients cancel these are differences from one
    vector, else vectors whose coefficients differ by a number share one factor. The rest along the axes is the last
    piece."""
    parts, rest = dict(vector[0]), vector[1]
    combinations: list[tuple[sympy.Expr, list[tuple[str, sympy.Expr]]]] = []
    if len(parts) >= 3 and sympy.expand(sum(parts.values())) == 0:
        centre = max(parts, key=lambda n: (parts[n].count_ops(), n))
        alike: dict[sympy.Expr, list[str]] = {}
        for name, c in parts.items():
            if name != centre:
                alike.setdefault(c, []).append(name)
        for c, names in alike.items():
            combination = [*((n, sympy.Integer(1)) for n in names), (centre, sympy.Integer(-len(names)))]
            combinations.append((c, sorted(combination, key=lambda part: part[0])))
    else:
        for name, c in parts.items():
            for first, members in combinations:
                ratio = c / first
                if ratio.is_number:
                    members.append((name, ratio))
                    break
            else:
                combinations.append((c, [(name, sympy.Integer(1))]))
    summands: list[tuple[sympy.Expr, Key]] = []
    for c, members in combinations:
        # The first vector gets a positive sign, so that r_a - r_b and r_b - r_a are one thing.
        sign = -1 if members[0][1].is_negative else 1
        summands.append((sign * c, (tuple((name, sign * weight) for name, weight in members), NOTHING)))
    if rest != NOTHING:
        summands.append((sympy.Integer(1), ((), rest)))
    return summands
