"""The verdict for one differential constraint by itself (D.3): exact, integrable, nonholonomic or undecided.

A form omega is exact where d omega = 0; it has an integrating factor mu, mu omega = d phi, where omega ^ d
omega = 0 (Frobenius; always so in two variables); otherwise no such mu exists, and a component of omega ^ d
omega that does not vanish is the witness. Verdicts hold for generic values of the parameters and wherever
the form is defined and not zero; parameter values at which a verdict may change are in
`Verdict.exceptional`.
"""

from dataclasses import dataclass
from functools import partial, reduce
from itertools import combinations
from typing import Literal

import sympy

from lagcli.pfaffian import enclosure, factors, limit, potential, tidy, tower, zero
from lagcli.pfaffian import form as forms

Kind = Literal["exact", "integrable", "nonholonomic", "undecided"]

_CLOSED = "The mixed partial derivatives agree, so the form is exact"
_SEARCH_SHARE = 0.8
_SEARCH_SECONDS = 8.0
_WITNESS_SECONDS = 2.0
_SHOWN = 160


@dataclass(frozen=True, slots=True)
class Witness:
    """A component of omega ^ d omega that does not vanish, and the variables it belongs to."""

    variables: tuple[sympy.Symbol, sympy.Symbol, sympy.Symbol]
    component: sympy.Expr
    value: enclosure.NonZero | None = None


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is proved of one form.

    `integrating_factor` * omega = d `integral`, both None where no closed form is known; the factor of an
    exact form is 1. `method` is a sentence for the user. `exceptional` holds expressions of the parameters
    at whose zeros the verdict or the integral may be another one.
    """

    kind: Kind
    integral: sympy.Expr | None
    integrating_factor: sympy.Expr | None
    method: str
    proof: zero.Proof
    witness: Witness | None = None
    exceptional: tuple[sympy.Expr, ...] = ()


def classify(form: forms.Form, deadline: float) -> Verdict:
    """The verdict for `form`, at the latest at `deadline` (monotonic clock, s; see `limit.after`).

    A form without a finite real value and one that vanishes identically are undecided, with the reason.
    """
    real = {s: sympy.Symbol(s.name, real=True) for s in (*form.variables, *form.parameters)}
    back = {r: s for s, r in real.items()}
    prepared = forms.Form(
        form.name,
        tuple(real[x] for x in form.variables),
        tuple(_plain(a.xreplace(real)) for a in form.coefficients),
        tuple(real[p] for p in form.parameters),
    )
    return _spoken(_judge(prepared, deadline), back)


def _plain(coefficient: sympy.Expr) -> sympy.Expr:
    """min, max and sign in terms of |u|."""
    if coefficient.has(sympy.Min, sympy.Max):
        coefficient = coefficient.replace(
            sympy.Min, lambda *u: reduce(lambda a, b: (a + b - sympy.Abs(a - b)) / 2, u)
        )
        coefficient = coefficient.replace(
            sympy.Max, lambda *u: reduce(lambda a, b: (a + b + sympy.Abs(a - b)) / 2, u)
        )
    return coefficient.replace(sympy.sign, lambda u: sympy.Abs(u) / u)


def _judge(form: forms.Form, deadline: float) -> Verdict:
    form, doubt = _without_zeros(form, deadline)
    if doubt is not None:
        return doubt
    if all(a == 0 for a in form.coefficients):
        return _undecided("all coefficients vanish identically, the form states nothing")
    closed = zero.vanish(list(form.exterior().values()), deadline)
    if closed.truth is zero.Truth.YES:
        return _exact(form, deadline)
    return _not_exact(form, closed, deadline)


def _without_zeros(form: forms.Form, deadline: float) -> tuple[forms.Form, Verdict | None]:
    """The form with coefficients that vanish identically replaced by 0, or the reason why it cannot be
    judged.
    """
    coefficients = []
    for x, a in zip(form.variables, form.coefficients, strict=True):
        finding = zero.is_zero(a, deadline)
        if finding.truth is zero.Truth.UNKNOWN and not _has_value(a, deadline):
            return form, _undecided(f"the coefficient of d({x}) has no finite real value at any point tried")
        coefficients.append(sympy.Integer(0) if finding.truth is zero.Truth.YES else a)
    return forms.Form(form.name, form.variables, tuple(coefficients), form.parameters), None


def _has_value(expression: sympy.Expr, deadline: float) -> bool:
    try:
        return limit.run(deadline, lambda: enclosure.has_value(expression))
    except limit.TimeUpError:
        return True


def _exact(form: forms.Form, deadline: float) -> Verdict:
    phi = _potential(form, deadline)
    if phi is None:
        method = f"{_CLOSED}; no closed form of its integral was found."
        return Verdict("exact", None, sympy.Integer(1), method, "symbolic")
    method = f"{_CLOSED}; its integral was verified by differentiation."
    return Verdict("exact", phi, sympy.Integer(1), method, "symbolic", exceptional=_poles(phi, form))


def _potential(form: forms.Form, deadline: float) -> sympy.Expr | None:
    """A verified potential of the exact form, tidy if that can be verified."""
    orders = [form, forms.Form(form.name, form.variables[::-1], form.coefficients[::-1], form.parameters)]
    for way in orders:
        until = min(deadline, limit.after(factors.SLICE))
        try:
            phi = limit.run(until, partial(potential.of, way))
            if phi is None:
                continue
            for each in (limit.run(until, partial(tidy.potential, phi, form.variables)), phi):
                pairs = zip(form.variables, form.coefficients, strict=True)
                defects = [forms.partial(each, x) - a for x, a in pairs]
                if potential.writable(each) and zero.vanish(defects, until).truth is zero.Truth.YES:
                    return each
        except limit.NO_ANSWER:
            continue
    return None


def _not_exact(form: forms.Form, closed: zero.Finding, deadline: float) -> Verdict:
    verdict = _frobenius(form, deadline)
    if verdict.kind == "nonholonomic":
        return verdict
    found = _search(form, deadline)
    exactly = "" if closed.truth is zero.Truth.NO else " Whether it is exact as it stands was not decided."
    if found is not None:
        method = f"An integrating factor was found {found.how} and verified by differentiation.{exactly}"
        phi, mu = found.integral, found.factor
        return Verdict("integrable", phi, mu, method, "symbolic", exceptional=_poles(phi, form))
    if verdict.kind == "integrable":
        method = f"{verdict.method} No closed form of its integral was found.{exactly}"
        return Verdict("integrable", None, None, method, verdict.proof)
    return verdict


def _search(form: forms.Form, deadline: float) -> factors.Found | None:
    try:
        return factors.search(form, limit.after(min(_SEARCH_SHARE * limit.left(deadline), _SEARCH_SECONDS)))
    except limit.TimeUpError:
        return None


def _frobenius(form: forms.Form, deadline: float) -> Verdict:
    """Whether omega ^ d omega = 0. With one A_k != 0 the components that hold k suffice."""
    k = min(
        (i for i, a in enumerate(form.coefficients) if a != 0),
        key=lambda i: (form.coefficients[i].count_ops(), i),
    )
    active = [i for i in form.active() if i != k]
    if len(active) < 2:
        text = "A form in two variables always has an integrating factor."
        return Verdict("integrable", None, None, text, "symbolic")
    reason = ""
    components = [
        ((*sorted((i, j, k)),), form.wedge_component(*sorted((i, j, k)))) for i, j in combinations(active, 2)
    ]
    for index, component in sorted(components, key=lambda c: c[1].count_ops()):
        finding = zero.is_zero(component, deadline)
        if finding.truth is zero.Truth.NO:
            return _nonholonomic(form, index, component, deadline)
        if finding.truth is zero.Truth.UNKNOWN:
            reason = reason or finding.reason
    if reason:
        return _undecided(f"whether omega ^ d omega vanishes could not be proved: {reason}")
    text = "omega ^ d omega = 0, so the form has an integrating factor (Frobenius)."
    return Verdict("integrable", None, None, text, "symbolic")


def _nonholonomic(
    form: forms.Form, index: tuple[int, ...], component: sympy.Expr, deadline: float
) -> Verdict:
    until = min(deadline, limit.after(_WITNESS_SECONDS))
    exact = zero.is_zero_exactly(component, until)
    numeric = zero.is_zero(component, until).value
    try:
        shown = limit.run(until, lambda: tidy.ratio(component, sympy.Integer(1)))
        exceptional = limit.run(until, lambda: _parameter_factors(form))
    except limit.NO_ANSWER:
        shown, exceptional = component, ()
    i, j, k = (form.variables[n] for n in index)
    proof: zero.Proof = (
        "symbolic" if exact.truth is zero.Truth.NO and exact.proof == "symbolic" else "numeric"
    )
    value = f" = {shown}" if len(str(shown)) <= _SHOWN else ""
    text = (
        f"The component ({i}, {j}, {k}) of omega ^ d omega{value} is not zero: no integrating factor exists"
    )
    if proof == "numeric" and numeric is not None:
        place = ", ".join(f"{name} = {number}" for name, number in numeric.point)
        error = max(numeric.error, 1e-300)
        text += f" (value {numeric.value:.6g}, error below {error:.1g}, at {place})"
    if exceptional:
        text += "; it may for " + " or ".join(f"{e} = 0" for e in exceptional)
    return Verdict(
        "nonholonomic", None, None, text + ".", proof, Witness((i, j, k), shown, numeric), exceptional
    )


def _parameter_factors(form: forms.Form) -> tuple[sympy.Expr, ...]:
    """Factors of parameters alone that all components of omega ^ d omega share: at their zeros all vanish."""
    if not form.parameters:
        return ()
    components = [c for c in form.wedge().values() if c != 0]
    try:
        basis = tower.Tower(components)
        numerators = [e.numer for e in tower.elements(basis, components) if e.numer]
    except tower.NoNormalFormError:
        return ()
    common = reduce(lambda a, b: a.gcd(b), numerators)
    parts = (basis.expression(p) for p, _ in common.factor_list()[1])
    return tuple(p for p in parts if p.free_symbols and p.free_symbols <= set(form.parameters))


def _poles(phi: sympy.Expr, form: forms.Form) -> tuple[sympy.Expr, ...]:
    """Parameter expressions by which the integral divides."""
    below = {b for e in phi.atoms(sympy.Pow) for b in [e.base] if e.exp.is_negative}
    constants = (b for b in below if b.free_symbols and b.free_symbols <= set(form.parameters))
    return tuple(sorted(constants, key=str))


def _undecided(reason: str) -> Verdict:
    return Verdict("undecided", None, None, f"Undecided: {reason}.", "none")


def _spoken(verdict: Verdict, back: dict[sympy.Symbol, sympy.Symbol]) -> Verdict:
    """The verdict in the symbols of the caller."""

    def turn(e: sympy.Expr | None) -> sympy.Expr | None:
        return None if e is None else e.xreplace(back)

    witness = verdict.witness
    if witness is not None:
        i, j, k = (back[x] for x in witness.variables)
        witness = Witness((i, j, k), witness.component.xreplace(back), witness.value)
    return Verdict(
        verdict.kind,
        turn(verdict.integral),
        turn(verdict.integrating_factor),
        verdict.method,
        verdict.proof,
        witness,
        tuple(e.xreplace(back) for e in verdict.exceptional),
    )
