"""Functions as algebra: expressions become rational functions of generators with polynomial relations.

Generators are the symbols, sin b and cos b with cos^2 b = 1 - sin^2 b, exp b, q-th roots r with r^q = u, |u| with
|u|^2 = u^2, and every other function as a letter of its own. All multiples, halves and sums of angles or exponents that
occur are integer combinations of the arguments b. The relations are a Groebner basis (their leading terms are powers of
different generators): an expression vanishes identically where its numerator leaves no remainder by them.

The converse holds where the generators are algebraically independent up to the relations (`NormalForm.independent`), as
exp u_j, sin and cos of v_j and log w_j are where u_j and i v_j are linearly independent over the rationals modulo
constants and the w_j multiplicatively so (J. Ax, On Schanuel's conjectures, Ann. Math. 93, 1971). Counted are
arguments for which this is evident: distinct monomials, and distinct irreducible w_j.
"""

from collections.abc import Iterable, Sequence
from functools import reduce
from math import gcd, lcm

import sympy
from sympy.polys.fields import FracElement, FracField
from sympy.polys.groebnertools import groebner
from sympy.polys.rings import PolyElement, PolyRing, ring

from lagcli.pfaffian.exact import guarded

# sin 24u is a polynomial of degree 24; roots of higher degree have as long relations.
MAX_MULTIPLE = 24
MAX_ROOT = 12
# Longer arguments of logarithms, and more of them, are not factored.
MAX_OPERATIONS, MAX_LOGARITHMS = 40, 12
_CIRCULAR = (sympy.sin, sympy.cos, sympy.tan, sympy.cot, sympy.sec, sympy.csc)
_HYPERBOLIC = (sympy.sinh, sympy.cosh, sympy.tanh)
_OPAQUE = (sympy.log, sympy.asin, sympy.acos, sympy.atan, sympy.atan2)


# The kind of a letter and what it stands for; of a root: its degree, and above and below of what it is taken of.
_RadicalKey = tuple[str, int, sympy.Expr, sympy.Expr]
_LetterKey = tuple[str] | tuple[str, sympy.Expr] | tuple[str, sympy.Expr, sympy.Expr] | _RadicalKey


class NoNormalFormError(guarded.NoAnswerError):
    """The expression holds something the algebra of generators cannot express; the text says what."""


class NormalForm:
    """The generators of the given expressions, all at once, and the normal form of rational expressions in them.

    `surface`: expressions that count as zero; then a remainder that is not zero proves nothing. Raises
    `NoNormalFormError` for unknown functions and for multiple angles beyond `MAX_MULTIPLE`.
    """

    def __init__(self, expressions: Iterable[sympy.Expr], surface: Sequence[sympy.Expr] = ()) -> None:
        self.meaning: dict[sympy.Symbol, sympy.Expr] = {}
        self.independent = True
        self._relations: list[sympy.Expr] = []
        self._known: dict[_LetterKey, sympy.Symbol] = {}
        self._multiples: dict[tuple[str, sympy.Expr], list[sympy.Rational]] = {}
        self._units: dict[tuple[str, sympy.Expr], sympy.Rational] = {}
        logs: dict[sympy.Expr, None] = {}
        self._written: dict[sympy.Expr, sympy.Expr] = {}
        self._split_memo: dict[sympy.Expr, list[tuple[sympy.Rational, sympy.Expr]]] = {}
        listed = [sympy.sympify(e) for e in (*expressions, *surface)]
        # First pass: which multiples of which angles and exponents occur.
        for part in (part for e in listed for part in sympy.preorder_traversal(e)):
            if isinstance(part, _CIRCULAR):
                self._note("circle", part.args[0])
            elif isinstance(part, (sympy.exp, *_HYPERBOLIC)):
                self._note("exp", part.args[0])
            elif isinstance(part, sympy.log) and part.free_symbols:
                logs[guarded.cancel(part.args[0])] = None
            elif _is_exponential(part):
                self._note("exp", part.exp * sympy.log(part.base))
        self._sums = _dependent(logs)
        written = [self._write(e) for e in listed]
        self.independent = self._roots_are_independent() and self.independent and not surface
        letters = set().union(*(e.free_symbols for e in [*written, *self._relations]), set())
        rank = {g: n for n, g in enumerate(self.meaning)}
        # Later generators stand on earlier ones and come first: the relations lead with their powers.
        order = sorted(letters, key=lambda s: (-rank.get(s, -1), s.name))
        self.letters: tuple[sympy.Symbol, ...] = tuple(order) or (sympy.Dummy("one"),)
        self.ring: PolyRing = ring(self.letters, sympy.QQ)[0]
        self.field: FracField = self.ring.to_field()
        self._ideal: list[PolyElement] = [self._fraction(r).numer for r in self._relations]
        if surface:
            vanishing = [self._fraction(e).numer for e in written[-len(surface) :]]
            self._ideal = guarded.call(groebner, [p for p in (*self._ideal, *vanishing) if p], self.ring)

    def element(self, expression: sympy.Expr) -> FracElement:
        """The expression as a fraction of polynomials, reduced. Raises `NoNormalFormError` where the denominator
        vanishes identically, and for an expression that is no rational combination of parts of those given."""
        known = len(self.meaning)
        written = self._write(sympy.sympify(expression))
        if len(self.meaning) != known:
            raise NoNormalFormError(f"{expression} was not known when the normal form was built")
        return self.reduced(self._fraction(written))

    def _fraction(self, written: sympy.Expr) -> FracElement:
        """An expression in generators as a `field` element, not reduced."""
        try:
            return self.field.from_expr(written)
        except (ValueError, ZeroDivisionError) as error:
            text = f"{self.to_functions(written)} is not rational in its generators"
            raise NoNormalFormError(text) from error

    def reduced(self, fraction: FracElement) -> FracElement:
        """Numerator and denominator replaced by their remainders."""
        denominator = self.remainder(fraction.denom)
        if not denominator:
            raise NoNormalFormError("a denominator vanishes identically")
        return self.field(self.remainder(fraction.numer)) / self.field(denominator)

    def remainder(self, polynomial: PolyElement) -> PolyElement:
        """The normal form of a `ring` element modulo the relations."""
        return polynomial.rem(self._ideal) if self._ideal and polynomial else polynomial

    def expression(self, element: FracElement | PolyElement) -> sympy.Expr:
        """The SymPy expression of a `ring` or `field` element."""
        return self.to_functions(element.as_expr())

    def surfaces(
        self, expressions: Iterable[sympy.Expr], variables: Sequence[sympy.Symbol]
    ) -> list[sympy.Expr]:
        """The letters, and the irreducible factors of some expressions, that hold variables: where they are zero may be
        invariant surfaces."""
        found: list[sympy.Expr] = []
        for meaning in map(self.means, reversed(self.letters)):
            if not isinstance(meaning, sympy.exp):
                found.append(meaning)
            if isinstance(meaning, (sympy.sin, sympy.cos)):
                found.append(1 + meaning)
        for e in expressions:
            element = self.element(e)
            parts = (f for part in (element.numer, element.denom) for f, _ in part.factor_list()[1])
            found += [self.expression(f) for f in parts]
        return [f for f in dict.fromkeys(found) if f.free_symbols & set(variables)]

    def means(self, letter: sympy.Symbol) -> sympy.Expr:
        """The function that a letter stands for, or the symbol it is."""
        return self.meaning.get(letter, letter)

    def to_functions(self, written: sympy.Expr) -> sympy.Expr:
        """An expression in generators in terms of the functions they stand for."""
        for letter in reversed(self.meaning):
            written = written.xreplace({letter: self.meaning[letter]})
        return written

    def _note(self, kind: str, argument: sympy.Expr) -> None:
        for coefficient, base in self._split(argument):
            multiples = self._multiples.setdefault((kind, base), [])
            if coefficient not in multiples:
                multiples.append(coefficient)

    def _split(self, argument: sympy.Expr) -> list[tuple[sympy.Rational, sympy.Expr]]:
        """The argument as a sum of rational multiples of signless terms."""
        if argument not in self._split_memo:
            plain = guarded.cancel(argument).replace(_is_log_of_number, _log_of_primes)
            terms = sympy.Add.make_args(guarded.expand(plain))
            self._split_memo[argument] = [term.as_coeff_Mul(rational=True) for term in terms if term != 0]
        return self._split_memo[argument]

    def _count(self, kind: str, coefficient: sympy.Rational, base: sympy.Expr) -> tuple[int, sympy.Rational]:
        """(n, unit) with coefficient = n * unit, where the unit is the greatest that all multiples have in common."""
        key = (kind, base)
        if key not in self._units:
            found = self._multiples.get(key, [coefficient])
            above, below = (int(c.p) for c in found), (int(c.q) for c in found)
            self._units[key] = sympy.Rational(reduce(gcd, above), reduce(lcm, below))
        n = coefficient / self._units[key]
        if not n.is_Integer or abs(n) > MAX_MULTIPLE:
            raise NoNormalFormError(f"the multiples of {base} are too far apart")
        return int(n), self._units[key]

    # Second pass: expressions in generators.

    def _write(self, e: sympy.Expr) -> sympy.Expr:
        if e not in self._written:
            self._written[e] = self._translated(e)
        return self._written[e]

    def _translated(self, e: sympy.Expr) -> sympy.Expr:
        if e.is_Rational or e.is_Symbol:
            return e
        if isinstance(e, (sympy.Add, sympy.Mul)):
            return e.func(*(self._write(a) for a in e.args))
        if isinstance(e, sympy.Pow):
            return self._power(e)
        if e is sympy.pi:
            return self._letter(("pi",), e)
        if e is sympy.E:
            return self._exponential(sympy.Integer(1))
        if isinstance(e, sympy.exp):
            return self._exponential(e.args[0])
        if isinstance(e, _CIRCULAR):
            c, s = self._circular(e.args[0])
            above, below = {
                sympy.sin: (s, 1), sympy.cos: (c, 1), sympy.tan: (s, c),
                sympy.cot: (c, s), sympy.sec: (1, c), sympy.csc: (1, s),
            }[type(e)]  # fmt: skip
            if below == 0:
                raise NoNormalFormError(f"{e} has a pole")
            return above / sympy.sympify(below)
        if isinstance(e, _HYPERBOLIC):
            grown = self._exponential(e.args[0])
            rise, fall = grown - 1 / grown, grown + 1 / grown
            above, below = {sympy.sinh: (rise, 2), sympy.cosh: (fall, 2), sympy.tanh: (rise, fall)}[type(e)]
            return above / sympy.sympify(below)
        if isinstance(e, sympy.Abs):
            # |N/D| as a letter over D; its relation has two roots, so that only numbers can prove a difference
            self.independent = False
            above, below = sympy.fraction(guarded.together(self._write(e.args[0])))
            return self._radical(("absolute", 2, guarded.expand(above**2), below), e) / below
        if isinstance(e, _OPAQUE):
            plain = _log_of_primes(e) if _is_log_of_number(e) else e
            if plain != e:
                return self._write(plain)
            same = e.func(*(guarded.cancel(a) for a in e.args))
            if not isinstance(same, _OPAQUE):
                raise NoNormalFormError(f"{e} changes its kind when its argument is simplified")
            if isinstance(same, sympy.log) and same.args[0] in self._sums:
                return self._write(self._sums[same.args[0]])
            evident = isinstance(same, sympy.log) and same.args[0].is_Symbol
            self.independent = self.independent and evident
            return self._letter(("function", same), same)
        raise NoNormalFormError(f"{getattr(e.func, '__name__', e)} has no algebraic treatment")

    def _letter(self, key: _LetterKey, meaning: sympy.Expr) -> sympy.Symbol:
        if key not in self._known:
            letter = sympy.Dummy(f"g{len(self._known)}")
            self._known[key] = letter
            self.meaning[letter] = meaning
        return self._known[key]

    def _circular(self, argument: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
        """cos and sin of a sum of angles by the addition theorems."""
        c, s = sympy.Integer(1), sympy.Integer(0)
        for coefficient, base in self._split(argument):
            known: tuple[sympy.Expr, ...] = ()
            if base is sympy.pi:
                known = sympy.cos(coefficient * base), sympy.sin(coefficient * base)
            if known and not any(value.has(*_CIRCULAR) for value in known):
                cn, sn = map(self._write, known)
            else:
                n, unit = self._count("circle", coefficient, base)
                self._demand_monomial(base)
                s1 = self._letter(("sin", base), sympy.sin(unit * base))
                fresh = ("cos", base) not in self._known
                c1 = self._letter(("cos", base), sympy.cos(unit * base))
                if fresh:
                    self._relations.append(c1**2 + s1**2 - 1)
                cn, sn = sympy.Integer(1), sympy.Integer(0)
                for _ in range(abs(n)):
                    cn, sn = guarded.expand(cn * c1 - sn * s1), guarded.expand(sn * c1 + cn * s1)
                sn = sn if n > 0 else -sn
            c, s = guarded.expand(c * cn - s * sn), guarded.expand(s * cn + c * sn)
        return c, s

    def _exponential(self, argument: sympy.Expr) -> sympy.Expr:
        product: sympy.Expr = sympy.Integer(1)
        for coefficient, base in self._split(argument):
            if _is_log_of_number(base):
                product *= self._write(base.args[0] ** coefficient)
                continue
            n, unit = self._count("exp", coefficient, base)
            self._demand_monomial(base)
            product *= self._letter(("exp", base), sympy.exp(unit * base)) ** n
        return product

    def _demand_monomial(self, base: sympy.Expr) -> None:
        """Distinct monomials in the symbols are linearly independent modulo constants; other terms may not be."""
        powers = base.as_powers_dict()
        if not base.free_symbols or not all(b.is_Symbol and n.is_Integer for b, n in powers.items()):
            self.independent = False

    def _power(self, e: sympy.Pow) -> sympy.Expr:
        base, exponent = e.args
        if exponent.is_Integer:
            return self._write(base) ** exponent
        if exponent.is_Rational:
            quotient, rest = divmod(int(exponent.p), int(exponent.q))
            # The q-th root of `radicand`, as a letter over a denominator, which keeps the relation a
            # polynomial. With radicand N/D the letter is D (N/D)^(1/q) and its q-th power N D^(q-1).
            q = int(exponent.q)
            meaning = base ** sympy.Rational(1, exponent.q)
            if q > MAX_ROOT:
                raise NoNormalFormError(f"the root {meaning} is too high")
            above, below = sympy.fraction(guarded.together(self._write(base)))
            power = guarded.expand(above * below ** (q - 1))
            if power.is_Rational and not (power.is_Integer and sympy.isprime(int(power))):
                self.independent = False
            root = self._radical(("root", q, power, below), meaning) / below
            return self._write(base) ** quotient * root**rest
        if _is_exponential(e):
            return self._exponential(exponent * sympy.log(base))
        # base**(k + 1) = base**k * base: the rational part of the exponent apart, the rest a letter a term.
        self.independent = False
        product: sympy.Expr = sympy.Integer(1)
        for coefficient, term in self._split(exponent):
            if term == 1:
                product *= self._power(sympy.Pow(base, coefficient, evaluate=False)) if base != 1 else 1
            elif coefficient.q == 1:
                product *= self._letter(("power", base, term), base**term) ** int(coefficient)
            else:
                unit = term / coefficient.q
                product *= self._letter(("power", base, unit), base**unit) ** int(coefficient.p)
        return product

    def _radical(self, key: _RadicalKey, meaning: sympy.Expr) -> sympy.Symbol:
        _, q, power, below = key
        fresh = key not in self._known
        letter = self._letter(key, self.to_functions(below) * meaning)
        if fresh:
            self._relations.append(letter**q - power)
        return letter

    def _roots_are_independent(self) -> bool:
        """True if no product of some radicands can be a power (else: not evident)."""
        powers = [key[2] for key in self._known if len(key) == 4 and key[0] == "root"]
        seen: set[sympy.Expr] = set()
        for power in powers:
            plain = not (power.free_symbols & set(self.meaning))
            factors = guarded.factor_list(power)[1] if plain else []
            own = [f for f, n in factors if n == 1]
            if power.is_Rational and len(powers) == 1:
                continue
            if len(own) != len(factors) or not own or seen & set(own):
                return False
            seen |= set(own)
        return True


def _is_exponential(e: sympy.Basic) -> bool:
    """True if it is a power like 2**x, which is exp(x*log(2))."""
    return bool(e.is_Pow and e.base.is_Rational and e.base.is_positive and not e.exp.is_Rational)


def _is_log_of_number(e: sympy.Basic) -> bool:
    return bool(isinstance(e, sympy.log) and e.args[0].is_Rational and e.args[0].is_positive)


def _log_of_primes(e: sympy.Expr) -> sympy.Expr:
    """log(12) as 2 log(2) + log(3): logarithms of primes are independent over the rationals."""
    powers = sympy.factorrat(e.args[0])
    return sympy.Add(*(n * sympy.log(p) for p, n in powers.items()))


def _dependent(arguments: Iterable[sympy.Expr]) -> dict[sympy.Expr, sympy.Expr]:
    """The logarithms of arguments that are products of powers of simpler ones, and of a positive rational number, as
    sums: log(x y) is log(x) + log(y) where all three have values."""
    listed = sorted(set(arguments), key=lambda a: (a.count_ops(), str(a)))
    if not 2 <= len(listed) <= MAX_LOGARITHMS or any(a.count_ops() > MAX_OPERATIONS for a in listed):
        return {}
    # The irreducible factors of each with their powers, and the number before them
    powers: list[dict[sympy.Expr, int]] = []
    numbers = []
    for argument in listed:
        own: dict[sympy.Expr, int] = {}
        number = sympy.Integer(1)
        for part, sign in zip(sympy.fraction(guarded.together(argument)), (1, -1), strict=True):
            constant, factors = guarded.factor_list(part)
            number *= constant**sign
            for f, n in factors:
                own[f] = own.get(f, 0) + sign * n
        powers.append(own)
        numbers.append(number)
    columns = sorted(set().union(*powers), key=str)
    table = [[own.get(f, 0) for f in columns] for own in powers]
    independent: list[int] = []
    found = {}
    for k, row in enumerate(table):
        # w with sum_i w_i rows_i = row, or None; the rows are independent
        weights = None
        if independent:
            A = sympy.Matrix([table[i] for i in independent]).T
            w = guarded.call((A.T * A).inv) * A.T * sympy.Matrix(row)
            weights = list(w) if A * w == sympy.Matrix(row) else None
        if weights is None:
            independent.append(k)
            continue
        rest = numbers[k] / sympy.Mul(*(numbers[i] ** w for i, w in zip(independent, weights, strict=True)))
        if rest.is_Rational and rest.is_positive:
            terms = (w * sympy.log(listed[i]) for i, w in zip(independent, weights, strict=True))
            found[listed[k]] = sympy.Add(sympy.log(rest), *terms)
    return found
