"""Integrals of an integrable form "by some hook or crook" (D.3): one strategy after the other, each result
verified.

A strategy proposes a first integral phi; it counts only when mu omega = d phi has been proved for mu =
phi_k/A_k.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial, reduce
from itertools import combinations
from typing import TypeVar

import sympy

from lagcli.pfaffian import ansatz, potential, tidy_integral
from lagcli.pfaffian.exact import guarded, normal_form, time_limit, zero_test
from lagcli.pfaffian.exact.guarded import NoAnswerError
from lagcli.pfaffian.forms import form as forms

Value = TypeVar("Value")

# Budgets of operations: for one step of a strategy, and for the proof of what it proposes.
STEP = 50_000
PROOF = 100_000
MAX_KINKS = 4


@dataclass(frozen=True, slots=True)
class FactorResult:
    """mu omega = d phi, verified; `how` completes the sentence "found ..."."""

    integral: sympy.Expr
    factor: sympy.Expr
    how: str


def search(form: forms.Form, deadline: float) -> FactorResult | None:
    """A verified integral and integrating factor of the integrable form, or None. Ends at `deadline`."""
    for phi, how in _proposals(form, deadline):
        found = _attempt(partial(_accepted, form, phi, how, deadline), deadline, PROOF)
        if found is not None:
            return found
    return None


def primitive(form: forms.Form) -> forms.Form:
    """The form divided by the common factor of its coefficients, and without inactive variables.

    The form itself where there is no normal form.
    """
    try:
        basis = normal_form.NormalForm(form.coefficients)
        entries = [basis.element(a) for a in form.coefficients]
    except NoAnswerError:
        return form
    below = reduce(lambda a, b: a.lcm(b), (e.denom for e in entries), basis.ring.one)
    above = [e.numer * below.exquo(e.denom) for e in entries]
    common = reduce(lambda a, b: a.gcd(b), above, basis.ring.zero)
    slim = [basis.remainder(p.exquo(common)) for p in above]
    scale = reduce(lambda a, b: a.lcm(b), (basis.ring(p.clear_denoms()[0]) for p in slim), basis.ring.one)
    written = forms.Form(
        form.name, form.variables, tuple(basis.expression(p * scale) for p in slim), form.parameters
    )
    return _active_part(written)


def _active_part(form: forms.Form) -> forms.Form:
    active = form.active()
    x, a = form.variables, form.coefficients
    return forms.Form(form.name, tuple(x[i] for i in active), tuple(a[i] for i in active), form.parameters)


def _proposals(form: forms.Form, deadline: float) -> Iterator[tuple[sympy.Expr, str]]:
    """First integrals that are proposed for the form, and how they were found."""
    slim = _attempt(lambda: primitive(form), deadline) or _active_part(form)
    below = {sympy.fraction(guarded.together(a))[1] for a in form.coefficients}
    once = sorted((b for b in below if b.free_symbols & set(slim.variables)), key=str)
    parts = _attempt(lambda: ansatz.pieces(slim, once), deadline) or ansatz.Pieces(
        slim.variables, slim.variables
    )
    tried: set[sympy.Expr] = set()
    for strategy, how in _STRATEGIES:
        hints = _attempt(partial(_listed, strategy, slim, parts), deadline) or []
        for hint in sorted(hints, key=lambda h: isinstance(h, Factor)):  # quadratures are the slow part
            if isinstance(hint, SingleIntegral):
                yield hint.phi, how
            elif hint.mu not in tried:
                tried.add(hint.mu)
                phi = _attempt(partial(_closed, slim, hint.mu), deadline)
                if phi is not None:
                    yield phi, how


def _listed(strategy: "Strategy", form: forms.Form, parts: ansatz.Pieces) -> "list[SingleIntegral | Factor]":
    return list(strategy(form, parts))


def _attempt(work: Callable[[], Value], deadline: float, budget: int = STEP) -> Value | None:
    """The value of one step, None where it fails or is late. Raises `time_limit.TimeUpError` after the whole
    deadline.
    """
    time_limit.check(deadline)
    try:
        return time_limit.run(deadline, work, budget)
    except time_limit.NO_ANSWER:
        return None


def _accepted(form: forms.Form, phi: sympy.Expr, how: str, deadline: float) -> FactorResult | None:
    """phi made tidy, with its factor, if d phi = mu omega is proved; the tidy form first, then phi as it
    came.
    """
    given = frozenset().union(*(a.atoms(sympy.log) for a in form.coefficients))
    try:
        ways = [time_limit.run(deadline, lambda: tidy_integral.integral(phi, form.variables, given))]
    except time_limit.NO_ANSWER:
        ways = []
    for way in dict.fromkeys([*ways, phi]):
        try:
            mu = guarded.attempt(verified, form, way, deadline)
        except time_limit.NO_ANSWER:
            continue
        if mu is not None:
            return FactorResult(way, mu, how)
    return None


def verified(form: forms.Form, phi: sympy.Expr, deadline: float) -> sympy.Expr | None:
    """mu with mu omega = d phi != 0, proved, or None. Raises `time_limit.TimeUpError`."""
    if not potential.writable(phi):
        return None
    gradient = [forms.partial(phi, x) for x in form.variables]
    k = ansatz.pivot(form)
    for i, a in enumerate(form.coefficients):
        if (
            i != k
            and zero_test.is_zero(gradient[i] * form.coefficients[k] - gradient[k] * a, deadline).truth
            is not zero_test.Truth.YES
        ):
            return None
    own = [[gradient[k]]]
    for ((side,),) in forms.kink_sides(own, forms.moduli(own)[:MAX_KINKS]):
        if zero_test.is_zero(side, deadline).truth is not zero_test.Truth.NO:
            return None
    choices = [i for i, a in enumerate(form.coefficients) if a != 0]
    choices = sorted(choices, key=lambda i: form.coefficients[i].count_ops() + gradient[i].count_ops())[:2]
    ways = time_limit.run(
        deadline, lambda: [tidy_integral.ratio(gradient[i], form.coefficients[i]) for i in choices]
    )
    mu = min(ways, key=lambda way: (way.count_ops(), len(str(way))))
    sound = zero_test.is_zero(mu * form.coefficients[k] - gradient[k], deadline).truth is zero_test.Truth.YES
    return mu if sound else tidy_integral.ratio(gradient[k], form.coefficients[k])


# The strategies: each takes the primitive form and the pieces of its coefficients and yields hints.


@dataclass(frozen=True, slots=True)
class SingleIntegral:
    """A proposal for phi."""

    phi: sympy.Expr


@dataclass(frozen=True, slots=True)
class Factor:
    """A proposal for mu."""

    mu: sympy.Expr


Hints = Iterator[SingleIntegral | Factor]
Strategy = Callable[[forms.Form, ansatz.Pieces], Hints]


def _closed(form: forms.Form, factor: sympy.Expr) -> sympy.Expr | None:
    """The potential of factor * omega, if that is exact."""
    scaled = form.times(factor)
    if not all(_vanishes(c) for c in scaled.exterior().values()):
        return None
    slim = tuple(tidy_integral.ratio(a * factor, sympy.Integer(1)) for a in form.coefficients)
    for coefficients in dict.fromkeys((slim, scaled.coefficients)):
        phi = potential.of(forms.Form(form.name, form.variables, coefficients, form.parameters))
        if phi is not None:
            return phi
    return None


def _vanishes(expression: sympy.Expr) -> bool:
    return zero_test.is_zero(expression, math.inf).truth is zero_test.Truth.YES  # a step of a strategy


def _without_common_factor(form: forms.Form, parts: ansatz.Pieces) -> Hints:
    yield Factor(sympy.Integer(1))


def _products(form: forms.Form, parts: ansatz.Pieces) -> Hints:
    found = [p for p in ansatz.integrals(form, parts) if p.free_symbols]
    for phi in sorted(found, key=lambda p: (p.count_ops(), str(p)))[:4]:
        yield SingleIntegral(phi)


def _product_factor(form: forms.Form, parts: ansatz.Pieces) -> Hints:
    mu = ansatz.factor(form, parts)
    if mu is not None:
        yield Factor(mu)


def _one_variable(form: forms.Form, parts: ansatz.Pieces) -> Hints:
    for m in range(len(form.variables)):
        mu = ansatz.factor_with_function(form, parts, m)
        if mu is not None:
            yield Factor(mu)


def _one_combination(form: forms.Form, parts: ansatz.Pieces) -> Hints:
    letter = sympy.Dummy("u", positive=True)
    for x, y in combinations(form.variables, 2):
        choices: list[tuple[sympy.Expr, dict[sympy.Symbol, sympy.Expr]]] = [
            (x + y, {x: letter - y}),
            (x - y, {x: letter + y}),
            (x * y, {x: letter / y}),
            (x / y, {x: letter * y}),
            (x**2 + y**2, {y: sympy.Integer(0), x: sympy.sqrt(letter)}),
        ]
        for u, inverse in choices:
            rate = _rate(form, u, (x, y))
            rate = None if rate is None else _shortest_with(rate, inverse)
            if rate is None or rate.free_symbols & set(form.variables):
                continue
            growth = potential.antiderivative(rate, letter)
            if growth is not None:
                mu = guarded.powsimp(sympy.exp(guarded.expand_log(growth, force=True)))
                yield Factor(guarded.subs(mu, letter, u))


def _shortest_with(rate: sympy.Expr, values: dict[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    return tidy_integral.shortest(guarded.subs(rate, values, simultaneous=True))


def _rate(form: forms.Form, u: sympy.Expr, pair: tuple[sympy.Symbol, sympy.Symbol]) -> sympy.Expr | None:
    """mu'/mu = -(d omega)_ik/(du ^ omega)_ik if that is a function of u alone."""
    a, v, k = form.coefficients, form.variables, ansatz.pivot(form)
    i = next(n for n, x in enumerate(v) if x in pair and n != k)
    wedge = forms.partial(u, v[i]) * a[k] - forms.partial(u, v[k]) * a[i]
    if _vanishes(wedge):
        return None
    rate = (forms.partial(a[i], v[k]) - forms.partial(a[k], v[i])) / wedge
    x, y = pair
    jacobian = forms.partial(rate, x) * forms.partial(u, y) - forms.partial(rate, y) * forms.partial(u, x)
    foreign = (forms.partial(rate, other) for other in v if other not in pair)
    return tidy_integral.ratio(rate, sympy.Integer(1)) if all(map(_vanishes, (jacobian, *foreign))) else None


def _inverse_polynomial(form: forms.Form, parts: ansatz.Pieces) -> Hints:
    """The factors of an inverse factor V are invariant surfaces: products of their powers come first."""
    for degree in (2, 4, 5):
        found = ansatz.inverse_factors(form, degree)
        surfaces = [p for v in found[:2] for p, _ in guarded.factor_list(v)[1]]
        varying = [p for p in dict.fromkeys(surfaces) if p.free_symbols & set(form.variables)]
        if varying:
            yield from _products(form, ansatz.Pieces(tuple(varying), form.variables))
            yield from (Factor(1 / guarded.factor(v)) for v in found[:2])
        if len(found) > 1:
            yield SingleIntegral(tidy_integral.ratio(found[0], found[1]))
            return


_STRATEGIES: tuple[tuple[Strategy, str], ...] = (
    (_without_common_factor, "after division by the common factor of the coefficients"),
    (_products, "as a product of powers and exponentials (linear equations for the exponents)"),
    (_inverse_polynomial, "with a polynomial inverse integrating factor"),
    (_product_factor, "with a product of powers and exponentials as integrating factor"),
    (_one_variable, "with a factor that holds a function of one variable"),
    (_one_combination, "with a factor that depends on one combination of two variables"),
)
