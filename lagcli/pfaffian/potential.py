"""The potential of an exact form by integrating along the coordinate axes, one coordinate after the other."""

from collections.abc import Callable, Iterator
from functools import reduce
from math import lcm

import sympy

from lagcli.pfaffian import rational
from lagcli.pfaffian.exact import guarded
from lagcli.pfaffian.exact.guarded import NoAnswerError, SympyFailure
from lagcli.pfaffian.forms import form as forms
from lagcli.pfaffian.forms import notation

WRITABLE = tuple(kind for kind, row in notation.ROWS.items() if row.is_elementary)
"""The functions an integral may hold: those of the model format."""

# Inner functions tried as new variables of an antiderivative.
_SUBSTITUTIONS = 8
_TABLE: dict[type[sympy.Function], Callable[[sympy.Expr], sympy.Expr]] = {
    sympy.sin: lambda u: -sympy.cos(u),
    sympy.cos: sympy.sin,
    sympy.sinh: sympy.cosh,
    sympy.cosh: sympy.sinh,
    sympy.log: lambda u: u * sympy.log(u) - u,
}


def of(form: forms.Form) -> sympy.Expr | None:
    """phi with d phi = omega for a form with d omega = 0, or None where no closed form was found.

    The result is a proposal: the caller verifies it. May run long: call it under `time_limit.run`.
    """
    pairs = list(zip(form.variables, form.coefficients, strict=True))
    # What is easily integrated comes first: it leaves less for the others.
    pairs.sort(key=lambda pair: not pair[1].is_polynomial(pair[0]))
    phi: sympy.Expr = sympy.Integer(0)
    for n, (x, coefficient) in enumerate(pairs):
        rest = _without(coefficient - forms.partial(phi, x), tuple(earlier for earlier, _ in pairs[:n]))
        part = antiderivative(rest, x) if rest is not None else None
        if part is None:
            return None
        phi += part
    return phi


def _without(expression: sympy.Expr, earlier: tuple[sympy.Symbol, ...]) -> sympy.Expr | None:
    """The expression, known not to depend on `earlier`, written without them."""
    expression = guarded.expand(expression)
    for x in earlier:
        if x not in expression.free_symbols:
            continue
        for value in (0, 1, 2):
            try:
                fixed = guarded.subs(expression, x, value)
            except SympyFailure:
                continue
            if not fixed.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
                expression = fixed
                break
        else:
            return None
    return expression


def antiderivative(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """An antiderivative in functions of the model format for generic parameters, or None.

    All symbols count as positive, which leads to real logarithms and arctangents; the caller verifies the
    result.
    """
    if expression.has(sympy.Abs):
        return _with_moduli(expression, x)
    positive = {s: sympy.Dummy(s.name, positive=True) for s in sorted(expression.free_symbols, key=str)}
    x = positive.get(x, x)
    for masked in _variants(expression.xreplace(positive), x):
        found = _masked(masked, x)
        if found is not None:
            return found.xreplace({dummy: s for s, dummy in positive.items()})
    return None


def _variants(expression: sympy.Expr, x: sympy.Symbol) -> Iterator[sympy.Expr]:
    """The expression with 1 - cos(al)**2 for squares of constant sines, and as it is.

    1 - sin(al)**2 as a constant of its own has no sign, and no real root.
    """
    squares = {
        p: 1 - sympy.cos(p.base.args[0]) ** 2
        for p in expression.atoms(sympy.Pow)
        if p.exp == 2 and isinstance(p.base, sympy.sin) and not p.has(x)
    }
    if squares:
        yield expression.xreplace(squares)
    yield expression


def _masked(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """Put what is constant under a name of its own: sin(y) would only burden the algebra."""
    fixed = [
        e for e in expression.atoms(sympy.Function, sympy.Pow) if not e.has(x) and not _is_rational_power(e)
    ]
    names = {e: sympy.Dummy(f"c{n}", positive=True) for n, e in enumerate(sorted(fixed, key=str))}
    found = _integrated(expression.xreplace(names), x)
    return None if found is None else found.xreplace({dummy: e for e, dummy in names.items()})


def _is_rational_power(e: sympy.Expr) -> bool:
    return bool(e.is_Pow and e.exp.is_Rational)


def _with_moduli(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The rules for |u|, u = a x + b, with constant coefficient: the integral of |u| is u|u|/(2a), that of |u|/u is
    |u|/a; neither jumps at the kink. No other moduli.
    """
    rest, moduli = guarded.expand(expression), sorted(expression.atoms(sympy.Abs), key=str)
    names = {m: sympy.Dummy(f"m{n}", positive=True) for n, m in enumerate(moduli)}
    back = {dummy: m for m, dummy in names.items()}
    rest = rest.xreplace(names)
    total: sympy.Expr = sympy.Integer(0)
    for modulus, dummy in names.items():
        u = modulus.args[0]
        slope = sympy.diff(u, x)
        if slope == 0:
            continue
        step = rest.coeff(dummy, 1).coeff(1 / u, 1)
        if not (step.has(x) or slope.has(x) or slope.has(sympy.Abs)):
            total += step * dummy / slope
            rest = guarded.expand(rest - step * dummy / u)
        weight = rest.coeff(dummy, 1)
        if weight.has(x) or slope.has(x) or slope.has(sympy.Abs):
            return None
        rest = guarded.expand(rest - weight * dummy)
        if rest.has(dummy):
            return None
        total += weight * u * dummy / (2 * slope)
    part = antiderivative(rest, x)
    return None if part is None else (total + part).xreplace(back)


def _integrated(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    if x not in expression.free_symbols:
        return expression * x
    total: sympy.Expr = sympy.Integer(0)
    rest: sympy.Expr = sympy.Integer(0)
    for term in sympy.Add.make_args(guarded.expand(expression, log=False)):
        constant, varying = term.as_independent(x, as_Add=False)
        known = _tabled(varying, x)
        if known is None:
            rest += term
        else:
            total += constant * known
    if rest == 0:
        return total
    for way in _ways(rest, x):
        try:
            found = guarded.attempt(way, guarded.factor_terms(rest), x)
        except NoAnswerError:
            continue
        if found is not None and found.has(x) and writable(found):  # a Piecewise may begin with a constant
            return total + found
    return None


def _ways(
    e: sympy.Expr, x: sympy.Symbol
) -> tuple[Callable[[sympy.Expr, sympy.Symbol], sympy.Expr | None], ...]:
    """Ways to integrate. A power by itself has a shorter integral in SymPy's tables: asin(x) for one over a root."""
    varying = e.as_independent(x, as_Add=False)[1]
    if varying.is_Pow and not varying.exp.is_Integer:
        return _substituted, _rationalized, _solved, _made_rational
    return _substituted, _made_rational, _rationalized, _solved


def _tabled(e: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The integral of one function of a linear argument, for generic parameters."""
    if e == 1:
        return x
    power, exponent = (e.base, e.exp) if e.is_Pow and not isinstance(e, sympy.exp) else (e, sympy.Integer(1))
    if exponent.has(x):
        return None
    if isinstance(power, (sympy.sin, sympy.cos)) and exponent in (-1, -2):
        return _reciprocal(power, int(exponent), x)
    u = e.args[0] if isinstance(e, sympy.exp) or type(e) in _TABLE else power
    slope = sympy.diff(u, x)
    if slope == 0 or slope.has(x):
        return None
    if isinstance(e, sympy.exp):
        return e / slope
    if type(e) in _TABLE:
        return _TABLE[type(e)](u) / slope
    if exponent == -1:
        return sympy.log(u) / slope
    return u ** (exponent + 1) / (slope * (exponent + 1))


def _reciprocal(turned: sympy.Expr, exponent: int, x: sympy.Symbol) -> sympy.Expr | None:
    """The integrals of 1/sin u, 1/cos u and their squares."""
    u = turned.args[0]
    slope = sympy.diff(u, x)
    if slope.has(x):
        return None
    if isinstance(turned, sympy.sin):
        return (sympy.log(sympy.tan(u / 2)) if exponent == -1 else -sympy.cos(u) / sympy.sin(u)) / slope
    return (sympy.log((1 + sympy.sin(u)) / sympy.cos(u)) if exponent == -1 else sympy.tan(u)) / slope


def _substituted(e: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The integral of g(u) u' by the one of g, for the functions u that occur and their arguments."""
    new = sympy.Dummy("s", positive=True)
    functions = sorted(
        (f for f in e.atoms(sympy.Function) if f.has(x)), key=lambda f: (f.count_ops(), str(f))
    )
    bases = sorted((p.base for p in e.atoms(sympy.Pow) if p.base.is_Add and p.base.has(x)), key=str)
    inner = dict.fromkeys([*bases, *(f.args[0] for f in functions if f.args[0] != x), *functions])
    for u in list(inner)[:_SUBSTITUTIONS]:
        rest = guarded.cancel(e / sympy.diff(u, x)).xreplace({u: new})
        if not rest.has(x):
            found = _integrated(rest, new)
            return None if found is None else found.xreplace({new: u})
    return None


def _made_rational(e: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """A function that a substitution makes rational."""
    for way in rational.ways(e, x):
        found = _solved(way.integrand, way.new)
        if found.has(way.new) and writable(found):
            return rational.plain(found.xreplace({way.new: way.back}), x)
    return None


def _rationalized(e: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """A rational function of sin u, cos u or of a root of x, by the half angle or the root as new variable."""
    new = sympy.Dummy("s", positive=True)
    turned = [f for f in e.atoms(sympy.sin, sympy.cos, sympy.tan) if f.has(x)]
    roots = [
        p for p in e.atoms(sympy.Pow) if p.has(x) and not p.exp.is_Integer and not isinstance(p, sympy.exp)
    ]
    if turned and not roots:
        below = sympy.fraction(guarded.together(e))[1]
        u = min((f.args[0] for f in turned), key=lambda a: (a.count_ops(), str(a)))
        slope = sympy.diff(u, x)
        if slope.has(x) or not below.has(sympy.sin, sympy.cos, sympy.tan):
            return None
        sine, cosine = sympy.sin(u), sympy.cos(u)
        plain = guarded.expand_trig(e).replace(sympy.tan, lambda a: sympy.sin(a) / sympy.cos(a))
        written = plain.xreplace({sine: 2 * new / (1 + new**2), cosine: (1 - new**2) / (1 + new**2)})
        back, weight = sympy.tan(u / 2), 2 / (slope * (1 + new**2))
    elif roots and all(p.base == x and p.exp.is_Rational for p in roots):
        q = reduce(lcm, (int(p.exp.q) for p in roots))
        written = guarded.powdenest(guarded.subs(e, x, new**q), force=True)
        back, weight = x ** sympy.Rational(1, q), q * new ** (q - 1)
    else:
        return None
    if written.has(x):
        return None
    written = guarded.cancel(guarded.together(written * weight))
    if not written.is_rational_function(new):
        return None
    return guarded.subs(_solved(written, new), new, back)


def _arctangent(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The integral of k/(a x**2 + b x + c) where the sign of D = 4 a c - b**2 depends on parameters: as for D > 0.

    Where D < 0 the root is not real, and the values of the parameters are to be put in first.
    """
    above, below = sympy.fraction(guarded.cancel(expression))
    if above.has(x) or not below.is_polynomial(x) or guarded.degree(below, x) != 2:
        return None
    a, b, c = guarded.poly(below, x).all_coeffs()
    square = guarded.factor(4 * a * c - b**2)
    if square.is_positive is not None or square.is_negative is not None or square == 0:
        return None
    root = sympy.sqrt(square)
    return 2 * above * sympy.atan((2 * a * x + b) / root) / root


def _solved(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    known = _arctangent(expression, x)
    if known is not None:
        return known
    found = guarded.integrate(expression, x)
    if found.has(sympy.Piecewise):
        # The first branch is the one for generic parameters, as in x**(k + 1)/(k + 1) with k != -1.
        found = guarded.piecewise_fold(found)
        found = found.replace(lambda e: isinstance(e, sympy.Piecewise), lambda e: e.args[0][0])
    return found


def writable(expression: sympy.Expr) -> bool:
    """True if the expression is real, finite and holds functions of the model format only."""
    if expression.has(sympy.I, sympy.Integral, sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.RootSum):
        return False
    return all(isinstance(f, WRITABLE) for f in expression.atoms(sympy.Function))
