"""The verdict for one differential constraint by itself (D.3): exact, integrable, nonholonomic or undecided.

A form omega is exact where d omega = 0; it has an integrating factor mu, mu omega = d phi, where omega ^ d omega = 0
(Frobenius; always so in two variables); otherwise a component of omega ^ d omega that does not vanish is the witness
that no such mu exists. Verdicts hold for generic values of the parameters, wherever the form is defined and not zero.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Literal

import sympy
from sympy.polys.rings import PolyElement

from lagcli import progress
from lagcli.pfaffian import integrating_factors, potential, tidy_integral
from lagcli.pfaffian.exact import enclosure, normal_form, time_limit, zero_test
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms import notation

Kind = Literal["exact", "integrable", "nonholonomic", "undecided"]

_CLOSED = "The mixed partial derivatives agree, so the form is exact"
# Part of the time that is left for the search; the rest is for reporting what was found.
_SEARCH_SHARE = 0.8
# Budgets of operations: of the search for an integrating factor, of the symbolic proof that a witness is not zero, of
# its tidy form, of the factors that all components share.
_SEARCH = 100_000
_WITNESS = 60_000
_TIDY = 15_000
_SHARED = 10_000
# Operations of all coefficients beyond which neither the shortest witness nor common factors are sought.
_LONG = 200
_SHOWN = 160


@dataclass(frozen=True, slots=True)
class FormVerdict:
    """The proved facts of one form.

    `method`: a sentence for the user; `witness`: a component of omega ^ d omega that does not vanish;
    `integrating_factor` * omega = d `integral`, None where no closed form is known; `exceptional`: expressions of the
    parameters at whose zeros the verdict or the integral may be another; `special`: irreducible expressions at whose
    zeros all of omega ^ d omega vanishes.
    """

    kind: Kind
    method: str
    proof: zero_test.Proof = "symbolic"
    integral: sympy.Expr | None = None
    integrating_factor: sympy.Expr | None = None
    witness: sympy.Expr | None = None
    exceptional: tuple[sympy.Expr, ...] = ()
    special: tuple[sympy.Expr, ...] = ()


def classify(form: forms.Form, deadline: float) -> FormVerdict:
    """The verdict for `form`, at the latest at `deadline` (see `progress.after`). A form without a finite real value
    and one that vanishes identically are undecided, with the reason."""
    real = {s: sympy.Symbol(s.name, real=True) for s in (*form.variables, *form.parameters)}
    named = forms.in_symbols(form, real)
    prepared = replace(named, coefficients=tuple(map(forms.plain, named.coefficients)))
    return forms.in_symbols(_judge(prepared, deadline), {r: s for s, r in real.items()})


def _judge(form: forms.Form, deadline: float) -> FormVerdict:
    coefficients = []
    for x, a in zip(form.variables, form.coefficients, strict=True):
        finding = zero_test.is_zero(a, deadline)
        if finding.truth is None:
            has_value = time_limit.answer(deadline, partial(enclosure.has_value, a))
            if has_value is False:
                return _undecided(f"the coefficient of d({x}) has no finite real value at any point tried")
        coefficients.append(sympy.Integer(0) if finding.truth is True else a)
    form = replace(form, coefficients=tuple(coefficients))
    if all(a == 0 for a in form.coefficients):
        return _undecided("all coefficients vanish identically, the form states nothing")
    closed = zero_test.vanish(form.curls(), deadline)
    if closed.truth is True:
        phi, one = _potential(form, deadline), sympy.Integer(1)
        if phi is None:
            method = f"{_CLOSED}; no closed form of its integral was found."
            return FormVerdict("exact", method, integrating_factor=one)
        method = f"{_CLOSED}; its integral was verified by differentiation."
        poles = _poles(phi, form)
        return FormVerdict("exact", method, integral=phi, integrating_factor=one, exceptional=poles)
    verdict = _frobenius(form, deadline)
    if verdict.kind == "nonholonomic":
        return verdict
    found = None
    with contextlib.suppress(time_limit.TimeUpError):  # the whole time may be over
        until = progress.soon(deadline, _SEARCH_SHARE)
        found = time_limit.run(until, lambda: integrating_factors.search(form, until), _SEARCH)
    exactly = "" if closed.truth is False else " Whether it is exact as it is written was not decided."
    if found is not None:
        method = f"An integrating factor was found {found.how} and verified by differentiation.{exactly}"
        phi, poles = found.integral, _poles(found.integral, form)
        return FormVerdict("integrable", method, "symbolic", phi, found.factor, exceptional=poles)
    if verdict.kind == "integrable":
        return replace(verdict, method=f"{verdict.method} No closed form of its integral was found.{exactly}")
    return verdict


def _potential(form: forms.Form, deadline: float) -> sympy.Expr | None:
    """A verified potential of the exact form, tidy if that can be verified."""
    given = frozenset().union(*(a.atoms(sympy.log) for a in form.coefficients))

    def of(way: forms.Form) -> sympy.Expr | None:
        phi = potential.of(way)
        if phi is None:
            return None
        for each in (tidy_integral.potential(phi, form.variables, given), phi):
            pairs = zip(form.variables, form.coefficients, strict=True)
            defects = [forms.partial(each, x) - a for x, a in pairs]
            if potential.writable(each) and zero_test.vanish(defects, deadline).truth is True:
                return each
        return None

    turned = replace(form, variables=form.variables[::-1], coefficients=form.coefficients[::-1])
    found = (
        time_limit.answer(deadline, partial(of, way), integrating_factors.PROOF) for way in (form, turned)
    )
    return next((phi for phi in found if phi is not None), None)


def _frobenius(form: forms.Form, deadline: float) -> FormVerdict:
    """Tell if omega ^ d omega = 0. With one A_k != 0 the components that hold k suffice."""
    size = [a.count_ops() for a in form.coefficients]
    k = form.simplest
    active = [i for i in form.active() if i != k]
    if len(active) < 2:
        return FormVerdict("integrable", "A form in two variables always has an integrating factor.")
    reason = ""
    triples = sorted(combinations(active, 2), key=lambda pair: size[pair[0]] + size[pair[1]])
    components: Iterable[tuple[tuple[int, ...], sympy.Expr]] = (
        ((*sorted((i, j, k)),), form.wedge_component(*sorted((i, j, k)))) for i, j in triples
    )
    if sum(size) <= _LONG:  # the shortest witness is sought
        components = sorted(components, key=lambda c: c[1].count_ops())
    for index, component in components:
        finding = zero_test.is_zero(component, deadline)
        if finding.truth is False:
            return _nonholonomic(form, index, component, deadline)
        if finding.truth is None:
            reason = reason or finding.reason
    if reason:
        return _undecided(f"whether omega ^ d omega vanishes could not be proved: {reason}")
    text = "omega ^ d omega = 0, so the form has an integrating factor (Frobenius)."
    return FormVerdict("integrable", text)


def _nonholonomic(
    form: forms.Form, index: tuple[int, ...], component: sympy.Expr, deadline: float
) -> FormVerdict:
    numeric = zero_test.is_zero(component, deadline).value
    symbolic = partial(zero_test.is_zero, component, deadline, exact_first=True)
    exact = time_limit.answer(deadline, symbolic, _WITNESS)
    proof: zero_test.Proof = "symbolic" if exact is not None and exact.proof == "symbolic" else "numeric"
    tidy = partial(tidy_integral.ratio, component, sympy.Integer(1))
    shown = time_limit.answer(deadline, tidy, _TIDY) or component
    shared: tuple[sympy.Expr, ...] = ()
    if sum(a.count_ops() for a in form.coefficients) <= _LONG:
        shared = time_limit.answer(deadline, partial(_shared_factors, form), _SHARED) or ()
    exceptional = tuple(p for p in shared if p.free_symbols <= set(form.parameters))
    special = tuple(p for p in shared if p not in exceptional)
    i, j, k = (form.variables[n] for n in index)
    value = f" = {notation.written(shown)}" if len(str(shown)) <= _SHOWN else ""
    text = (
        f"The component ({i}, {j}, {k}) of omega ^ d omega{value} is not zero: no integrating factor exists"
    )
    if proof == "numeric" and numeric is not None:
        point = ", ".join(f"{name} = {number}" for name, number in numeric.point)
        error = max(numeric.error, 1e-300)
        text += f" (value {numeric.value:.6g}, error below {error:.1g}, at {point})"
    if exceptional:
        text += f"; it may for {_zeros(exceptional)}"
    if special:
        text += f"; omega ^ d omega drops to zero where {_zeros(special)}"
    return FormVerdict("nonholonomic", text + ".", proof, None, None, shown, exceptional, special)


def _zeros(expressions: Iterable[sympy.Expr]) -> str:
    return " or ".join(f"{notation.written(e)} = 0" for e in expressions)


def _shared_factors(form: forms.Form) -> tuple[sympy.Expr, ...]:
    """Irreducible factors that all components of omega ^ d omega share, but for those that evidently have no real zero:
    at their zeros all vanish."""
    components = sorted((c for c in form.wedge().values() if c != 0), key=lambda c: c.count_ops())
    basis = normal_form.NormalForm(components)
    above = below = basis.ring.zero
    for component in components:  # short ones first: two of them show that most forms share nothing
        element = basis.element(component)
        if element.numer:
            above, below = above.gcd(element.numer), below.gcd(element.denom)
        if above and above.is_ground:
            return ()

    def factors_of(common: PolyElement) -> dict[sympy.Expr, None]:
        """What vanishes with the factors: where |u| or a root of u does, u."""
        found: dict[sympy.Expr, None] = {}
        for part, _ in common.factor_list()[1]:
            factor = basis.expression(part)
            while isinstance(factor, sympy.Abs) or (factor.is_Pow and factor.exp.is_positive):
                factor = factor.args[0]
            found[-factor if factor.could_extract_minus_sign() else factor] = None
        return found

    jumps = factors_of(below)  # |u|/u jumps where u = 0 and does not vanish
    factors = _with_cosines([f for f in factors_of(above) if f not in jumps])
    shown = (f for f in factors if f.free_symbols and not (f.is_positive or f.is_negative or f.is_Pow))
    return tuple(sorted(shown, key=str))


def _with_cosines(factors: list[sympy.Expr]) -> list[sympy.Expr]:
    """cos(u) for 1 - sin(u) and 1 + sin(u), its square in the normal form."""
    for factor in factors:
        for sine in factor.atoms(sympy.sin) if factor.is_Add else ():
            both = [f for f in factors if f in (sine - 1, sine + 1, 1 - sine, -1 - sine)]
            if len(both) == 2:
                cosine = sympy.cos(sine.args[0])
                return _with_cosines([cosine, *(f for f in factors if f not in (*both, cosine))])
    return factors


def _poles(phi: sympy.Expr, form: forms.Form) -> tuple[sympy.Expr, ...]:
    """Parameter expressions by which the integral divides, or of which it takes a root."""
    below = {e.base for e in phi.atoms(sympy.Pow) if e.exp.is_negative or e.exp.is_Integer is False}
    constants = (b for b in below if b.free_symbols and b.free_symbols <= set(form.parameters))
    return tuple(sorted(constants, key=str))


def _undecided(reason: str) -> FormVerdict:
    return FormVerdict("undecided", f"Undecided: {reason}.", "none")
