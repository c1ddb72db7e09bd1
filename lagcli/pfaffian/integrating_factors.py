"""Integrals of an integrable form "by some hook or crook" (D.3): one strategy after the other, each result verified.

A strategy proposes a first integral phi or an integrating factor mu, mostly with constants from linear equations
d phi ^ omega = 0 or d(mu omega) = 0, of which the components (i, k) with one A_k != 0 are enough for an integrable
omega. Factors of the coefficients are the natural Darboux polynomials (G. Darboux, Bull. Sci. Math. 2, 1878); 1/V with
V d omega = dV ^ omega is the inverse integrating factor.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import combinations, combinations_with_replacement
from typing import TypeVar

import sympy

from lagcli.pfaffian import potential, tidy_integral
from lagcli.pfaffian.exact import constant_combinations, guarded, normal_form, time_limit, zero_test
from lagcli.pfaffian.forms import form as forms

Value = TypeVar("Value")

# Budgets of operations: for one step of a strategy, and for the proof of what it proposes.
STEP = 50_000
PROOF = 100_000
MAX_KINKS = 4
# Columns of the linear systems: eight letters and their products of two; factors; monomials of an inverse factor.
MAX_SUMMANDS = 44
MAX_FACTORS = 24
MAX_INVERSE = 90


@dataclass(frozen=True, slots=True)
class FactorResult:
    """mu omega = d phi, verified; `how` completes the sentence "found ..."."""

    integral: sympy.Expr
    factor: sympy.Expr
    how: str


def search(form: forms.Form, deadline: float) -> FactorResult | None:
    """A verified integral and integrating factor of the integrable form, or None. Ends at `deadline`."""
    slim = _attempt(lambda: primitive(form), deadline) or _active_part(form)
    below = {sympy.fraction(guarded.together(a))[1] for a in form.coefficients}
    once = sorted((b for b in below if b.free_symbols & set(slim.variables)), key=str)
    parts = _attempt(lambda: _pieces(slim, once), deadline) or Pieces(slim.variables, slim.variables)
    tried: set[sympy.Expr] = set()
    for strategy, how in _STRATEGIES:
        hints = _attempt(partial(lambda of: list(of(slim, parts)), strategy), deadline) or []
        for proposal, is_factor in sorted(hints, key=lambda h: h[1]):  # quadratures are the slow part
            phi: sympy.Expr | None = proposal
            if is_factor:
                if proposal in tried:
                    continue
                tried.add(proposal)
                phi = _attempt(partial(_closed, slim, proposal), deadline)
            found = None
            if phi is not None:
                found = _attempt(partial(_accepted, form, phi, how, deadline), deadline, PROOF)
            if found is not None:
                return found
    return None


def primitive(form: forms.Form) -> forms.Form:
    """The form divided by the common factor of its coefficients, without inactive variables; as it is where it has no
    normal form."""
    try:
        basis = normal_form.NormalForm(form.coefficients)
        entries = [basis.element(a) for a in form.coefficients]
    except guarded.NoAnswerError:
        return form
    below = reduce(lambda a, b: a.lcm(b), (e.denom for e in entries), basis.ring.one)
    above = [e.numer * below.exquo(e.denom) for e in entries]
    common = reduce(lambda a, b: a.gcd(b), above, basis.ring.zero)
    slim = [basis.remainder(p.exquo(common)) for p in above]
    scale = reduce(lambda a, b: a.lcm(b), (basis.ring(p.clear_denoms()[0]) for p in slim), basis.ring.one)
    written = tuple(basis.expression(p * scale) for p in slim)
    return _active_part(replace(form, coefficients=written))


def _active_part(form: forms.Form) -> forms.Form:
    x, a = form.variables, form.coefficients
    active = form.active()
    return replace(form, variables=tuple(x[i] for i in active), coefficients=tuple(a[i] for i in active))


def _attempt(work: Callable[[], Value], deadline: float, budget: int = STEP) -> Value | None:
    """The value of one step, None where it fails or is late. Raises `TimeUpError` after the whole deadline."""
    time_limit.check(deadline)
    return time_limit.answer(deadline, work, budget)


def _closed(form: forms.Form, factor: sympy.Expr) -> sympy.Expr | None:
    """The potential of factor * omega, if that is exact."""
    scaled = replace(form, coefficients=tuple(factor * a for a in form.coefficients))
    if not all(map(_vanishes, list(scaled.curls()))):
        return None
    slim = tuple(tidy_integral.ratio(a * factor, sympy.Integer(1)) for a in form.coefficients)
    ways = (replace(form, coefficients=way) for way in dict.fromkeys((slim, scaled.coefficients)))
    return next((phi for phi in map(potential.of, ways) if phi is not None), None)


def _vanishes(expression: sympy.Expr) -> bool:
    return zero_test.is_zero(expression, math.inf).truth is True  # a step of a strategy


def _accepted(form: forms.Form, phi: sympy.Expr, how: str, deadline: float) -> FactorResult | None:
    """phi with its factor, if d phi = mu omega is proved; the tidy form first, then phi as it came."""
    given = frozenset().union(*(a.atoms(sympy.log) for a in form.coefficients))
    tidy = time_limit.answer(deadline, lambda: tidy_integral.integral(phi, form.variables, given))
    for way in dict.fromkeys([phi] if tidy is None else [tidy, phi]):
        try:
            mu = guarded.attempt(_verified, form, way, deadline)
        except time_limit.NO_ANSWER:
            continue
        if mu is not None:
            return FactorResult(way, mu, how)
    return None


def _verified(form: forms.Form, phi: sympy.Expr, deadline: float) -> sympy.Expr | None:
    """mu with mu omega = d phi != 0, proved, or None. Raises `time_limit.TimeUpError`."""
    if not potential.writable(phi):
        return None
    gradient = [forms.partial(phi, x) for x in form.variables]
    k, coefficients = form.simplest, form.coefficients
    for i, a in enumerate(coefficients):
        if i != k:
            minor = zero_test.is_zero(gradient[i] * coefficients[k] - gradient[k] * a, deadline)
            if minor.truth is not True:
                return None
    own = [[gradient[k]]]
    for ((side,),) in forms.kink_sides(own, forms.moduli(own)[:MAX_KINKS]):
        if zero_test.is_zero(side, deadline).truth is not False:
            return None
    choices = [i for i, a in enumerate(coefficients) if a != 0]
    choices = sorted(choices, key=lambda i: coefficients[i].count_ops() + gradient[i].count_ops())[:2]
    ways = time_limit.run(
        deadline, lambda: [tidy_integral.ratio(gradient[i], coefficients[i]) for i in choices]
    )
    mu = min(ways, key=lambda way: (way.count_ops(), len(str(way))))
    sound = zero_test.is_zero(mu * coefficients[k] - gradient[k], deadline).truth is True
    return mu if sound else tidy_integral.ratio(gradient[k], coefficients[k])


@dataclass(frozen=True, slots=True)
class Pieces:
    """The pieces of a logarithm: phi or log mu = sum a_j log(factors[j]) + sum b_l summands[l]."""

    factors: tuple[sympy.Expr, ...]
    summands: tuple[sympy.Expr, ...]

    def gradients(self, variables: Sequence[sympy.Symbol]) -> list[list[sympy.Expr]]:
        """Partial derivatives of every log factor and summand; shape (pieces, n)."""
        logs = [[forms.partial(p, x) / p for x in variables] for p in self.factors]
        return logs + [[forms.partial(m, x) for x in variables] for m in self.summands]

    def exponential(self, constants: Sequence[sympy.Expr]) -> sympy.Expr:
        """mu of these constants a_j and b_l, as a product of powers."""
        count = len(self.factors)
        powers = (p**c for p, c in zip(self.factors, constants, strict=False))
        terms = (c * m for c, m in zip(constants[count:], self.summands, strict=False))
        exponent = sum(terms, sympy.Integer(0))
        return sympy.Mul(*powers) * sympy.exp(exponent)


def _pieces(form: forms.Form, below: Sequence[sympy.Expr]) -> Pieces:
    """Candidates from the coefficients and the denominators they once had, `below`: letters and irreducible factors,
    monomials of degree two. Raises `normal_form.NoNormalFormError`."""
    variables = set(form.variables)
    euler = sum((x * a for x, a in zip(form.variables, form.coefficients, strict=True)), sympy.Integer(0))
    basis = normal_form.NormalForm([*form.coefficients, *form.variables, *below])
    factors = basis.surfaces([*form.coefficients, euler, *below], form.variables)
    letters = [g for g in reversed(basis.letters) if basis.means(g).free_symbols & variables]
    summands = [e.args[0] for e in map(basis.means, letters) if isinstance(e, sympy.exp)]
    products = [*letters, *(a * b for a, b in combinations_with_replacement(letters, 2))]
    for product in products[:MAX_SUMMANDS]:
        meaning = basis.to_functions(product)
        # cos(u)**2 is 1 - sin(u)**2: it would only add a constant.
        if not (meaning.is_Pow and isinstance(meaning.base, sympy.cos)):
            summands.append(meaning)
    return Pieces(tuple(factors[:MAX_FACTORS]), tuple(dict.fromkeys(summands)))


# The strategies: each takes the primitive form and the pieces of its coefficients and yields hints: a proposal, and
# whether it is one for mu and not for phi.
Hints = Iterator[tuple[sympy.Expr, bool]]
Strategy = Callable[[forms.Form, Pieces], Hints]


def _without_common_factor(form: forms.Form, parts: Pieces) -> Hints:
    yield sympy.Integer(1), True


def _products(form: forms.Form, parts: Pieces) -> Hints:
    """phi = sum a_j log p_j + sum b_l m_l with d phi ^ omega = 0."""
    logarithms = [*(sympy.log(p) for p in parts.factors), *parts.summands]
    found = []
    for constants in constant_combinations.null_vectors(_minors(form, parts), frozenset(form.parameters)):
        terms = (c * p for c, p in zip(constants, logarithms, strict=True) if c != 0)
        found.append(sum(terms, sympy.Integer(0)))
    found = [p for p in found if p.free_symbols]
    for phi in sorted(found, key=lambda p: (p.count_ops(), str(p)))[:4]:
        yield phi, False


def _minors(form: forms.Form, parts: Pieces) -> list[list[sympy.Expr]]:
    """Of d piece ^ omega the components (i, k), for every piece."""
    a, k = form.coefficients, form.simplest
    others = [i for i in range(len(a)) if i != k]
    return [[g[i] * a[k] - g[k] * a[i] for i in others] for g in parts.gradients(form.variables)]


def _product_factor(form: forms.Form, parts: Pieces) -> Hints:
    """mu = product of powers p_j^a_j times exp(sum b_l m_l) with d(mu omega) = 0."""
    k = form.simplest
    columns = _minors(form, parts)
    columns.append([form.curl(i, k) for i in range(len(form.variables)) if i != k])
    for v in constant_combinations.null_vectors(columns, frozenset(form.parameters)):
        if v[-1] != 0:
            yield parts.exponential([guarded.cancel(c / v[-1]) for c in v[:-1]]), True
            return


def _one_variable(form: forms.Form, parts: Pieces) -> Hints:
    """mu = product of powers p_j^a_j times h(x_m), with d(mu omega) = 0, as of linear, Bernoulli and separable
    equations: h' follows from the component (m, k), and that it depends on x_m alone is linear in the a_j."""
    a, x = form.coefficients, form.variables
    parts = Pieces(parts.factors, ())
    for m in range(len(x)):
        choices = [i for i, c in enumerate(a) if c != 0 and i != m]
        if not choices:
            continue
        k = min(choices, key=lambda i: (a[i].count_ops(), i))
        others = [i for i in range(len(a)) if i not in (k, m)]
        ways = [
            ([g[i] * a[k] - g[k] * a[i] for i in others], g[m] - g[k] * a[m] / a[k])
            for g in parts.gradients(x)
        ]
        ways.append(([form.curl(i, k) for i in others], form.curl(m, k) / a[k]))
        columns = [
            [*entries, *(forms.partial(rate, x[i]) for i in range(len(a)) if i != m)]
            for entries, rate in ways
        ]
        for v in constant_combinations.null_vectors(columns, frozenset(form.parameters)):
            if v[-1] == 0:
                continue
            constants = [guarded.cancel(c / v[-1]) for c in v]
            terms = (c * rate for c, (_, rate) in zip(constants, ways, strict=True))
            rate = _function_of(-sum(terms, sympy.Integer(0)), x, m)
            logarithm = None if rate is None else potential.antiderivative(rate, x[m])
            if logarithm is not None:
                powers = sympy.exp(guarded.expand(logarithm))
                growth = guarded.powsimp(guarded.expand_log(powers, force=True))
                yield parts.exponential(constants[:-1]) * growth, True
                break


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


def _one_combination(form: forms.Form, parts: Pieces) -> Hints:
    letter = sympy.Dummy("u", positive=True)
    a, v, k = form.coefficients, form.variables, form.simplest
    for x, y in combinations(v, 2):
        i = next(n for n, z in enumerate(v) if z in (x, y) and n != k)
        choices: list[tuple[sympy.Expr, dict[sympy.Symbol, sympy.Expr]]] = [
            (x + y, {x: letter - y}),
            (x - y, {x: letter + y}),
            (x * y, {x: letter / y}),
            (x / y, {x: letter * y}),
            (x**2 + y**2, {y: sympy.Integer(0), x: sympy.sqrt(letter)}),
        ]
        for u, inverse in choices:
            # mu'/mu = -(d omega)_ik/(du ^ omega)_ik, if that is a function of u alone
            wedge = forms.partial(u, v[i]) * a[k] - forms.partial(u, v[k]) * a[i]
            if _vanishes(wedge):
                continue
            rate = form.curl(k, i) / wedge
            along = forms.partial(rate, x) * forms.partial(u, y), forms.partial(rate, y) * forms.partial(u, x)
            foreign = (forms.partial(rate, other) for other in v if other not in (x, y))
            if not all(map(_vanishes, (along[0] - along[1], *foreign))):
                continue
            rate = tidy_integral.ratio(rate, sympy.Integer(1))
            rate = tidy_integral.shortest(guarded.subs(rate, inverse, simultaneous=True))
            if rate.free_symbols & set(form.variables):
                continue
            growth = potential.antiderivative(rate, letter)
            if growth is not None:
                mu = guarded.powsimp(sympy.exp(guarded.expand_log(growth, force=True)))
                yield guarded.subs(mu, letter, u), True


def _inverse_polynomial(form: forms.Form, parts: Pieces) -> Hints:
    """Polynomials V in the letters with V d omega = dV ^ omega, whose factors are invariant surfaces."""
    a, x, k = form.coefficients, form.variables, form.simplest
    curls = {i: form.curl(i, k) for i in range(len(a)) if i != k}
    for degree in (2, 4, 5):
        basis = normal_form.NormalForm([*a, *x])
        meanings = map(basis.means, reversed(basis.letters))
        letters = [m for m in meanings if m.free_symbols & set(x)]
        monomials: list[sympy.Expr] = []
        for d in range(degree + 1):
            products = [sympy.Mul(*c) for c in combinations_with_replacement(letters, d)]
            if len(monomials) + len(products) > MAX_INVERSE:
                break
            monomials += products
        powers = {v: v.as_powers_dict().items() for v in monomials}
        monomials = [v for v in monomials if not any(b.func is sympy.cos and n > 1 for b, n in powers[v])]
        columns = []
        for v in monomials:
            slope = forms.partial(v, x[k])
            wedge = {i: forms.partial(v, x[i]) * a[k] - slope * a[i] for i in curls}
            columns.append([v * curls[i] - wedge[i] for i in curls])
        found = []
        for vector in constant_combinations.null_vectors(columns, frozenset(form.parameters)):
            found.append(sum((c * v for c, v in zip(vector, monomials, strict=True)), sympy.Integer(0)))
        surfaces = [p for v in found[:2] for p, _ in guarded.factor_list(v)[1]]
        varying = [p for p in dict.fromkeys(surfaces) if p.free_symbols & set(x)]
        if varying:
            yield from _products(form, Pieces(tuple(varying), x))
            yield from ((1 / guarded.factor(v), True) for v in found[:2])
        if len(found) > 1:
            yield tidy_integral.ratio(found[0], found[1]), False
            return


_STRATEGIES: tuple[tuple[Strategy, str], ...] = (
    (_without_common_factor, "after division by the common factor of the coefficients"),
    (_products, "as a product of powers and exponentials (linear equations for the exponents)"),
    (_inverse_polynomial, "with a polynomial inverse integrating factor"),
    (_product_factor, "with a product of powers and exponentials as integrating factor"),
    (_one_variable, "with a factor that holds a function of one variable"),
    (_one_combination, "with a factor that depends on one combination of two variables"),
)
