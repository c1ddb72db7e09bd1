"""The shorter of equal forms, by a few bounded steps: common factors, sin^2 + cos^2 = 1, sums of angles; an expression
of many operations is left as it is."""

from __future__ import annotations

import math

import sympy

from lagcli import memory

MAX_OPERATIONS = 250  # beyond which nothing is tried
MOST_PARTS = 20_000  # of an expanded form, beyond which it is not made: it becomes no shorter
FEW = 5  # operations that are as short as they get, without sines and cosines


@memory.remembered(4096)
def tidy(value: sympy.Expr) -> sympy.Expr:
    """An equal expression, not longer than this one."""
    operations = value.count_ops()
    if operations > MAX_OPERATIONS or (operations <= FEW and not value.has(sympy.sin, sympy.cos)):
        return value
    forms = [value, sympy.factor_terms(value)]
    if math.prod(_expanded(value)) > MOST_PARTS:
        return min(forms, key=_length)
    wide = sympy.expand(value)
    if wide.count_ops() <= MAX_OPERATIONS:
        forms += [wide, sympy.factor_terms(wide)]
        if wide.is_Add and wide.has(sympy.sin, sympy.cos):
            pairs = (sympy.cos, sympy.sin), (sympy.sin, sympy.cos)
            for each in dict.fromkeys((wide, *(without_squares(wide, *pair) for pair in pairs))):
                joined = _of_two_angles(each)
                forms += [joined, sympy.factor_terms(joined)] if joined != wide else []
    return min(forms, key=_length)


def _expanded(value: sympy.Expr) -> tuple[int, int]:
    """At most how many terms an expanded form would have, before terms cancel, and how many parts one of them."""
    if not value.args:
        return 1, 1
    sizes = [_expanded(part) for part in value.args]
    if value.is_Add:
        return sum(terms for terms, _ in sizes), max(parts for _, parts in sizes)
    if value.is_Mul:
        return math.prod(terms for terms, _ in sizes), sum(parts for _, parts in sizes)
    within = sum(terms * parts for terms, parts in sizes)
    if not value.is_Pow or not value.exp.is_Rational:
        return 1, within
    terms, parts = sizes[0]
    # (a + b)^(7/2) becomes a sum over sqrt(a + b), and the sum of a negative power stays one part of a quotient.
    power = min(int(abs(value.exp)), MAX_OPERATIONS)
    if value.exp.is_negative:
        return 1, terms ** max(1, power) * parts
    return terms**power, parts if value.exp.is_Integer else parts + within


def shorter(*values: sympy.Expr) -> sympy.Expr:
    """The one of equal expressions that reads best."""
    return min(values, key=_length)


def merged(value: sympy.Expr) -> sympy.Expr:
    """A small sum as one product, over one denominator: k (d - L)/d in place of k - k L/d."""
    if value.is_Add and value.count_ops() <= MAX_OPERATIONS // 4:
        joined = sympy.factor_terms(sympy.together(value))
        return value if joined.is_Add else joined
    return value


def _length(value: sympy.Expr) -> int:
    # A minus sign in front of a sum, and a quotient, read worse than their number of operations tells.
    parts = list(sympy.preorder_traversal(value))
    below = sum(2 for part in parts if part.is_Pow and part.exp.is_negative)
    return int(value.count_ops()) + sum(1 for part in parts if part.is_Add) + below


def _of_two_angles(value: sympy.Expr) -> sympy.Expr:
    """cos a cos b + sin a sin b as cos(a - b), and its three kin, in a sum of products."""
    pairs: dict[tuple[sympy.Expr, sympy.Expr, sympy.Expr], dict[str, sympy.Expr]] = {}
    rest = []
    for term in sympy.Add.make_args(value):
        coefficient, plain = term.as_coeff_Mul()
        factors = sympy.Mul.make_args(plain)
        waves = [x for x in factors if isinstance(x, (sympy.sin, sympy.cos))]
        if len(waves) != 2 or waves[0].args == waves[1].args:
            rest.append(term)
            continue
        one, other = sorted(waves, key=lambda wave: sympy.default_sort_key(wave.args[0]))
        others = sympy.Mul(*(x for x in factors if x not in waves))
        kind = "".join("s" if isinstance(wave, sympy.sin) else "c" for wave in (one, other))
        by_kind = pairs.setdefault((others, one.args[0], other.args[0]), {})
        by_kind[kind] = by_kind.get(kind, sympy.Integer(0)) + coefficient
    sin, cos = sympy.sin, sympy.cos
    for (others, a, b), by_kind in pairs.items():
        cc, ss, sc, cs = (by_kind.get(kind, sympy.Integer(0)) for kind in ("cc", "ss", "sc", "cs"))
        if cc and cc == ss:
            even = cc * cos(a - b)
        elif cc and cc == -ss:
            even = cc * cos(a + b)
        else:
            even = cc * cos(a) * cos(b) + ss * sin(a) * sin(b)
        if sc and sc == cs:
            odd = sc * sin(a + b)
        elif sc and sc == -cs:
            odd = sc * sin(a - b)
        else:
            odd = sc * sin(a) * cos(b) + cs * cos(a) * sin(b)
        rest.append(others * (even + odd))
    return sympy.Add(*rest)


def without_squares(
    value: sympy.Expr, squared: type[sympy.Function], other: type[sympy.Function]
) -> sympy.Expr:
    """cos(u)^2 as 1 - sin(u)^2, or the other way round, everywhere."""

    def less(power: sympy.Expr) -> sympy.Expr:
        base, exponent = power.base, int(power.exp)
        return (1 - other(base.args[0]) ** 2) ** (exponent // 2) * base ** (exponent % 2)

    def is_square(part: sympy.Expr) -> bool:
        if not (part.is_Pow and isinstance(part.base, squared)):
            return False
        return bool(part.exp.is_Integer and 2 <= part.exp <= 6)

    return sympy.expand(value.replace(is_square, less))


def by_monomials(value: sympy.Expr, symbols: tuple[sympy.Symbol, ...]) -> list[tuple[sympy.Expr, sympy.Expr]]:
    """A polynomial in `symbols` as (monomial, tidied coefficient); the whole as one term where it is none."""
    present = [s for s in symbols if s in value.free_symbols]
    if not present:
        return [(sympy.Integer(1), tidy(value))] if value != 0 else []
    collected: dict[sympy.Expr, list[sympy.Expr]] = {}
    chosen = frozenset(present)
    for term in sympy.Add.make_args(sympy.expand(value)):
        monomial, rest = [], []
        for factor in sympy.Mul.make_args(term):
            base, exponent = factor.as_base_exp()
            if base in chosen and exponent.is_Integer and exponent > 0:
                monomial.append(factor)
            elif factor.free_symbols & chosen:
                return [(sympy.Integer(1), tidy(value))]
            else:
                rest.append(factor)
        collected.setdefault(sympy.Mul(*monomial), []).append(sympy.Mul(*rest))
    pairs = [(monomial, tidy(sympy.Add(*terms))) for monomial, terms in collected.items()]
    return [(monomial, coefficient) for monomial, coefficient in pairs if coefficient != 0]


def polynomial(value: sympy.Expr, symbols: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    """The value with every coefficient tidied, and terms of equal coefficients together: m (x'^2 + y'^2)/2."""
    groups: dict[sympy.Expr, list[sympy.Expr]] = {}
    for monomial, coefficient in by_monomials(value, symbols):
        if -coefficient in groups:
            groups[-coefficient].append(-monomial)
        else:
            groups.setdefault(coefficient, []).append(monomial)
    return sympy.Add(*(coefficient * sympy.Add(*monomials) for coefficient, monomials in groups.items()))
