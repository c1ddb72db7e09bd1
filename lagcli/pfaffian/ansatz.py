"""Integrals and integrating factors with unknown constants, found by solving linear equations.

All equations are d phi ^ omega = 0 or d(mu omega) = 0 for an integrable omega. There it is enough to ask for
the components (i, k) with one fixed k, A_k != 0: a 2-form eta with omega ^ eta = 0 is beta ^ omega, and beta
may be chosen with beta_k = 0. The factors of the coefficients are the natural Darboux polynomials (G.
Darboux, Bull. Sci. Math. 2, 1878); mu = 1/V with V d omega = dV ^ omega is the inverse integrating factor.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import sympy

from lagcli.pfaffian import potential
from lagcli.pfaffian.exact import constant_combinations, guarded, normal_form
from lagcli.pfaffian.forms import form as forms

# Columns of the linear systems: eight letters and their products of two; factors; monomials of an inverse factor.
MAX_SUMMANDS = 44
MAX_FACTORS = 24
MAX_INVERSE = 90


@dataclass(frozen=True, slots=True)
class Pieces:
    """The pieces of a logarithm: phi or log mu = sum a_j log(factors[j]) + sum b_l summands[l]."""

    factors: tuple[sympy.Expr, ...]
    summands: tuple[sympy.Expr, ...]

    def gradients(self, variables: Sequence[sympy.Symbol]) -> list[list[sympy.Expr]]:
        """Partial derivatives of every log factor and summand; shape (pieces, n)."""
        logs = [[forms.partial(p, x) / p for x in variables] for p in self.factors]
        return logs + [[forms.partial(m, x) for x in variables] for m in self.summands]

    def combine(self, constants: Sequence[sympy.Expr]) -> sympy.Expr:
        """sum a_j log(p_j) + sum b_l m_l."""
        parts = [*(sympy.log(p) for p in self.factors), *self.summands]
        return sum((c * p for c, p in zip(constants, parts, strict=True) if c != 0), sympy.Integer(0))

    def exponential(self, constants: Sequence[sympy.Expr]) -> sympy.Expr:
        """exp of `combine`, as a product of powers."""
        count = len(self.factors)
        powers = (p**c for p, c in zip(self.factors, constants, strict=False))
        exponent = sum(
            (c * m for c, m in zip(constants[count:], self.summands, strict=False)), sympy.Integer(0)
        )
        return sympy.Mul(*powers) * sympy.exp(exponent)


def pivot(form: forms.Form) -> int:
    """The index of the simplest coefficient that is not zero."""
    candidates = [i for i, a in enumerate(form.coefficients) if a != 0]
    return min(candidates, key=lambda i: (form.coefficients[i].count_ops(), i))


def pieces(form: forms.Form, below: Sequence[sympy.Expr] = ()) -> Pieces:
    """Candidates from the coefficients: their letters and irreducible factors, monomials of degree two.

    `below` are denominators the form once had. Raises `normal_form.NoNormalFormError`.
    """
    variables = set(form.variables)
    euler = sum((x * a for x, a in zip(form.variables, form.coefficients, strict=True)), sympy.Integer(0))
    basis = normal_form.NormalForm([*form.coefficients, *form.variables, *below])
    factors: list[sympy.Expr] = []
    letters: list[sympy.Expr] = []
    summands: list[sympy.Expr] = []
    for letter in reversed(basis.letters):
        meaning = basis.means(letter)
        if not meaning.free_symbols & variables:
            continue
        letters.append(letter)
        if isinstance(meaning, sympy.exp):
            summands.append(meaning.args[0])
            continue
        factors.append(meaning)
        if isinstance(meaning, (sympy.sin, sympy.cos)):
            factors.append(1 + meaning)
    for a in [*form.coefficients, euler, *below]:
        element = basis.element(a)
        for part in (element.numer, element.denom):
            factors += [basis.expression(f) for f, _ in part.factor_list()[1]]
    products = [*letters, *(a * b for a, b in combinations_with_replacement(letters, 2))]
    for product in products[:MAX_SUMMANDS]:
        meaning = basis.to_functions(product)
        # cos(u)**2 is 1 - sin(u)**2: it would only add a constant.
        if not (meaning.is_Pow and isinstance(meaning.base, sympy.cos)):
            summands.append(meaning)
    useful = [f for f in dict.fromkeys(factors) if f.free_symbols & variables]
    return Pieces(tuple(useful[:MAX_FACTORS]), tuple(dict.fromkeys(summands)))


def integrals(form: forms.Form, parts: Pieces) -> list[sympy.Expr]:
    """First integrals phi = sum a_j log p_j + sum b_l m_l: d phi ^ omega = 0."""
    a, k = form.coefficients, pivot(form)
    columns = [
        [g[i] * a[k] - g[k] * a[i] for i in range(len(a)) if i != k] for g in parts.gradients(form.variables)
    ]
    return [parts.combine(v) for v in constant_combinations.null_vectors(columns, frozenset(form.parameters))]


def factor(form: forms.Form, parts: Pieces) -> sympy.Expr | None:
    """mu = product of powers p_j^a_j times exp(sum b_l m_l) with d(mu omega) = 0."""
    a, k = form.coefficients, pivot(form)
    others = [i for i in range(len(a)) if i != k]
    columns = [[g[i] * a[k] - g[k] * a[i] for i in others] for g in parts.gradients(form.variables)]
    columns.append([_curl(form, i, k) for i in others])
    for v in constant_combinations.null_vectors(columns, frozenset(form.parameters)):
        if v[-1] != 0:
            return parts.exponential([guarded.cancel(c / v[-1]) for c in v[:-1]])
    return None


def factor_with_function(form: forms.Form, parts: Pieces, m: int) -> sympy.Expr | None:
    """mu = product of powers p_j^a_j times an unknown function of the variable m, with d(mu omega) = 0.

    Covers factors of one variable, linear and Bernoulli equations and separable ones. Its derivative h'
    follows from the component (m, k) and must not depend on the other variables, which is linear in the a_j.
    """
    a, x = form.coefficients, form.variables
    choices = [i for i, c in enumerate(a) if c != 0 and i != m]
    if not choices:
        return None
    k = min(choices, key=lambda i: (a[i].count_ops(), i))
    others = [i for i in range(len(a)) if i not in (k, m)]
    slim = Pieces(parts.factors, ())
    rates: list[sympy.Expr] = []
    columns: list[list[sympy.Expr]] = []
    for g in [*slim.gradients(x), None]:
        if g is None:
            entries, rate = [_curl(form, i, k) for i in others], _curl(form, m, k) / a[k]
        else:
            entries, rate = [g[i] * a[k] - g[k] * a[i] for i in others], g[m] - g[k] * a[m] / a[k]
        rates.append(rate)
        columns.append([*entries, *(forms.partial(rate, x[i]) for i in range(len(a)) if i != m)])
    for v in constant_combinations.null_vectors(columns, frozenset(form.parameters)):
        if v[-1] == 0:
            continue
        constants = [guarded.cancel(c / v[-1]) for c in v]
        rate = _function_of(
            -sum((c * r for c, r in zip(constants, rates, strict=True)), sympy.Integer(0)), x, m
        )
        primitive = None if rate is None else potential.antiderivative(rate, x[m])
        if primitive is not None:
            growth = guarded.powsimp(guarded.expand_log(sympy.exp(guarded.expand(primitive)), force=True))
            return slim.exponential(constants[:-1]) * growth
    return None


def inverse_factors(form: forms.Form, degree: int) -> list[sympy.Expr]:
    """Polynomials V in the letters up to `degree` with V d omega = dV ^ omega: 1/V is an integrating
    factor.
    """
    basis = normal_form.NormalForm([*form.coefficients, *form.variables])
    meanings = [basis.means(g) for g in reversed(basis.letters)]
    varying = [m for m in meanings if m.free_symbols & set(form.variables)]
    monomials: list[sympy.Expr] = []
    for d in range(degree + 1):
        products = [sympy.Mul(*c) for c in combinations_with_replacement(varying, d)]
        if len(monomials) + len(products) > MAX_INVERSE:
            break
        monomials += products
    monomials = [
        v for v in monomials if not any(b.func is sympy.cos and n > 1 for b, n in v.as_powers_dict().items())
    ]
    a, x, k = form.coefficients, form.variables, pivot(form)
    others = [i for i in range(len(a)) if i != k]
    curls = {i: _curl(form, i, k) for i in others}
    columns = [
        [v * curls[i] - (forms.partial(v, x[i]) * a[k] - forms.partial(v, x[k]) * a[i]) for i in others]
        for v in monomials
    ]
    found = []
    for vector in constant_combinations.null_vectors(columns, frozenset(form.parameters)):
        found.append(sum((c * v for c, v in zip(vector, monomials, strict=True)), sympy.Integer(0)))
    return found


def _curl(form: forms.Form, i: int, k: int) -> sympy.Expr:
    a, x = form.coefficients, form.variables
    return forms.partial(a[k], x[i]) - forms.partial(a[i], x[k])


def _function_of(rate: sympy.Expr, x: Sequence[sympy.Symbol], m: int) -> sympy.Expr | None:
    """The rate, known to depend on x[m] only, written so."""
    foreign = set(x) - {x[m]}
    if rate.free_symbols & foreign:
        basis = normal_form.NormalForm([rate])
        rate = basis.expression(basis.element(rate))
    for symbol in sorted(rate.free_symbols & foreign, key=lambda s: s.name):
        values = [guarded.subs(rate, symbol, sympy.Rational(n, 7)) for n in (3, 5, 11)]
        good = [v for v in values if not v.has(sympy.nan, sympy.zoo, sympy.I)]
        if not good:
            return None
        rate = good[0]
    return rate
