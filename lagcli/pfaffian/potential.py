"""The potential of an exact form by integrating along the coordinate axes, one coordinate after the other.

Integrands are made rational: by tan u for sines and cosines, and for square roots of Q = a x**2 + b x + c by Euler's
substitutions (Institutionum calculi integralis I, 1768, ch. II), sqrt(Q) = t + sqrt(a) x or x t + sqrt(c), or x t for
c = 0.
"""

from collections.abc import Callable, Iterator

import sympy

from lagcli.pfaffian.exact import guarded
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
# An integrand as a rational function of a new variable, with its weight in it; the variable, and what it is in x.
_RationalWay = tuple[sympy.Expr, sympy.Symbol, sympy.Expr]


def of(form: forms.Form) -> sympy.Expr | None:
    """phi with d phi = omega for a form with d omega = 0, or None where no closed form was found. It is a proposal,
    which the caller verifies, and may run long: call it under `time_limit.run`."""
    pairs = list(zip(form.variables, form.coefficients, strict=True))
    # What is easily integrated comes first: it leaves less for the others.
    pairs.sort(key=lambda pair: not pair[1].is_polynomial(pair[0]))
    phi: sympy.Expr = sympy.Integer(0)
    for n, (x, coefficient) in enumerate(pairs):
        # What is left does not depend on the earlier ones: it is written without them.
        rest = guarded.expand(coefficient - forms.partial(phi, x))
        for earlier, _ in pairs[:n]:
            if earlier not in rest.free_symbols:
                continue
            for value in (0, 1, 2):
                try:
                    fixed = guarded.subs(rest, earlier, value)
                except guarded.SympyFailure:
                    continue
                if not fixed.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
                    rest = fixed
                    break
            else:
                return None
        part = antiderivative(rest, x)
        if part is None:
            return None
        phi += part
    return phi


def antiderivative(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """An antiderivative in functions of the model format for generic parameters, or None. All symbols count as
    positive, which leads to real logarithms and arctangents; the caller verifies the result."""
    if expression.has(sympy.Abs):
        return _with_moduli(expression, x)
    positive = {s: sympy.Dummy(s.name, positive=True) for s in sorted(expression.free_symbols, key=str)}
    back = {dummy: s for s, dummy in positive.items()}
    x, expression = positive.get(x, x), expression.xreplace(positive)
    # First with 1 - cos(al)**2 for squares of constant sines: 1 - sin(al)**2 as a constant of its own has no sign, and
    # no real root.
    squares = {
        p: 1 - sympy.cos(p.base.args[0]) ** 2
        for p in expression.atoms(sympy.Pow)
        if p.exp == 2 and isinstance(p.base, sympy.sin) and not p.has(x)
    }
    for way in (expression.xreplace(squares), expression) if squares else (expression,):
        # What is constant under a name of its own: sin(y) would only burden the algebra.
        functions = (e for e in way.atoms(sympy.Function, sympy.Pow) if not e.has(x))
        fixed = [e for e in functions if not (e.is_Pow and e.exp.is_Rational)]
        names = {e: sympy.Dummy(f"c{n}", positive=True) for n, e in enumerate(sorted(fixed, key=str))}
        found = _integrated(way.xreplace(names), x)
        if found is not None:
            return found.xreplace({dummy: e for e, dummy in names.items()}).xreplace(back)
    return None


def _with_moduli(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The rules for |u|, u = a x + b, with constant coefficient: the integral of |u| is u|u|/(2a), that of |u|/u is
    |u|/a; neither jumps at the kink. No other moduli."""
    rest, moduli = guarded.expand(expression), sorted(expression.atoms(sympy.Abs), key=str)
    names = {m: sympy.Dummy(f"m{n}", positive=True) for n, m in enumerate(moduli)}
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
    return None if part is None else (total + part).xreplace({dummy: m for m, dummy in names.items()})


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
    varying = rest.as_independent(x, as_Add=False)[1]
    ways = [_substituted, _made_rational, _rationalized, _solved]
    if varying.is_Pow and not varying.exp.is_Integer:
        # A power by itself has a shorter integral in SymPy's tables: asin(x) for one over a root.
        ways = [_substituted, _rationalized, _solved, _made_rational]
    for way in ways:
        try:
            found = guarded.attempt(way, guarded.factor_terms(rest), x)
        except guarded.NoAnswerError:
            continue
        if found is not None and found.has(x) and writable(found):  # a Piecewise may begin with a constant
            return total + found
    return None


def _tabled(e: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The integral of one function of a linear argument, for generic parameters."""
    if e == 1:
        return x
    power, exponent = (e.base, e.exp) if e.is_Pow and not isinstance(e, sympy.exp) else (e, sympy.Integer(1))
    if exponent.has(x):
        return None
    is_reciprocal = isinstance(power, (sympy.sin, sympy.cos)) and exponent in (-1, -2)
    u = power.args[0] if is_reciprocal or isinstance(e, sympy.exp) or type(e) in _TABLE else power
    slope = sympy.diff(u, x)
    if slope == 0 or slope.has(x):
        return None
    if is_reciprocal and isinstance(power, sympy.sin):
        return (sympy.log(sympy.tan(u / 2)) if exponent == -1 else -sympy.cos(u) / sympy.sin(u)) / slope
    if is_reciprocal:
        return (sympy.log((1 + sympy.sin(u)) / sympy.cos(u)) if exponent == -1 else sympy.tan(u)) / slope
    if isinstance(e, sympy.exp):
        return e / slope
    if type(e) in _TABLE:
        return _TABLE[type(e)](u) / slope
    if exponent == -1:
        return sympy.log(u) / slope
    return u ** (exponent + 1) / (slope * (exponent + 1))


def _substituted(e: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The integral of g(u) u' by the one of g, for the functions u that occur and their arguments."""
    new = sympy.Dummy("s", positive=True)
    functions = sorted((f for f in e.atoms(sympy.Function) if f.has(x)), key=_length)
    bases = sorted((p.base for p in e.atoms(sympy.Pow) if p.base.is_Add and p.base.has(x)), key=str)
    inner = dict.fromkeys([*bases, *(f.args[0] for f in functions if f.args[0] != x), *functions])
    for u in list(inner)[:_SUBSTITUTIONS]:
        rest = guarded.cancel(e / sympy.diff(u, x)).xreplace({u: new})
        if not rest.has(x):
            found = _integrated(rest, new)
            return None if found is None else found.xreplace({new: u})
    return None


def _length(e: sympy.Expr) -> tuple[int, str]:
    return e.count_ops(), str(e)


def _varying(e: sympy.Expr, x: sympy.Symbol) -> tuple[list[sympy.Expr], list[sympy.Expr]]:
    """Its sines, cosines and tangents, and its roots and other powers that are not whole."""
    turned = [f for f in e.atoms(sympy.sin, sympy.cos, sympy.tan) if f.has(x)]
    powers = (p for p in e.atoms(sympy.Pow) if p.has(x) and not p.exp.is_Integer)
    return turned, [p for p in powers if not isinstance(p, sympy.exp)]


def _without_tangents(e: sympy.Expr) -> sympy.Expr:
    return guarded.expand_trig(e).replace(sympy.tan, lambda a: sympy.sin(a) / sympy.cos(a))


def _rationalized(e: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """A rational function of sin u and cos u, by the half angle as new variable."""
    turned, roots = _varying(e, x)
    if not turned or roots:
        return None
    below = sympy.fraction(guarded.together(e))[1]
    u = min((f.args[0] for f in turned), key=_length)
    slope, new = sympy.diff(u, x), sympy.Dummy("s", positive=True)
    if slope.has(x) or not below.has(sympy.sin, sympy.cos, sympy.tan):
        return None
    sine, cosine = sympy.sin(u), sympy.cos(u)
    plain = _without_tangents(e)
    written = plain.xreplace({sine: 2 * new / (1 + new**2), cosine: (1 - new**2) / (1 + new**2)})
    if written.has(x):
        return None
    written = guarded.cancel(guarded.together(written * (2 / (slope * (1 + new**2)))))
    if not written.is_rational_function(new):
        return None
    return guarded.subs(_solved(written, new), new, sympy.tan(u / 2))


def _solved(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    above, below = sympy.fraction(guarded.cancel(expression))
    if not above.has(x) and below.is_polynomial(x) and guarded.degree(below, x) == 2:
        # k/(a x**2 + b x + c) where the sign of D = 4 a c - b**2 depends on parameters: as for D > 0. Where D < 0 the
        # root is not real, and the values of the parameters are to be put in first.
        a, b, c = guarded.Poly(below, x).all_coeffs()
        square = guarded.factor(4 * a * c - b**2)
        if square.is_positive is None and square.is_negative is None and square != 0:
            root = sympy.sqrt(square)
            return 2 * above * sympy.atan((2 * a * x + b) / root) / root
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


def _made_rational(e: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The integral by a substitution that makes the function rational; all symbols are positive."""
    turned, roots = _varying(e, x)
    ways: Iterator[_RationalWay] = iter(())
    if turned and not roots:
        # tan u, for what is the same at u + pi
        u = min((f.args[0] for f in turned), key=_length)
        slope = sympy.diff(u, x)
        new, c = sympy.Dummy("s", positive=True), sympy.Dummy("c", positive=True)
        written = guarded.cancel(_without_tangents(e).xreplace({sympy.sin(u): new * c, sympy.cos(u): c}))
        if slope.has(x) or written.has(x) or not written.is_rational_function(new, c):
            return None
        even = _without_odd(written, c, 1 / (1 + new**2))
        if even is not None:
            ways = iter([(guarded.cancel(even / (slope * (1 + new**2))), new, sympy.tan(u))])
    elif roots and not turned and all(p.exp.is_Rational for p in roots):
        ways = _by_roots(e, x, roots)
    for integrand, new, back in ways:
        found = _solved(integrand, new)
        if found.has(new) and writable(found):
            return _with_plain_root(found.xreplace({new: back}), x)
    return None


def _by_roots(e: sympy.Expr, x: sympy.Symbol, roots: list[sympy.Expr]) -> Iterator[_RationalWay]:
    """The root of one polynomial of the first or second degree, or the quotient of two roots of the first."""
    new, r = sympy.Dummy("s", positive=True), sympy.Dummy("r", positive=True)
    bases = sorted({p.base for p in roots}, key=str)
    if not all(base.is_polynomial(x) for base in bases):
        return
    polynomials = [guarded.Poly(base, x) for base in bases]
    degrees = [p.degree() for p in polynomials]
    ways: list[tuple[sympy.Expr, sympy.Expr]] = []
    if degrees == [1]:
        q = sympy.ilcm(1, *(p.exp.q for p in roots))
        slope, rest = polynomials[0].all_coeffs()
        written = e.xreplace({p: new ** (p.exp * q) for p in roots}).xreplace({x: (new**q - rest) / slope})
        ways.append((written * q * new ** (q - 1) / slope, bases[0] ** sympy.Rational(1, q)))
    elif degrees == [1, 1] and all(p.exp.q == 2 for p in roots):
        (a, b), (c, d) = (p.all_coeffs() for p in polynomials)
        image = (d * new**2 - b) / (a - c * new**2)  # (a x + b)/(c x + d) = s**2
        names = {p: (new * r if p.base == bases[0] else r) ** (2 * p.exp) for p in roots}
        written = guarded.cancel(e.xreplace(names).xreplace({x: image}))
        even = _without_odd(written, r, (c * image + d))
        if even is not None:
            ways.append((even * sympy.diff(image, new), sympy.sqrt(bases[0]) / sympy.sqrt(bases[1])))
    elif degrees == [2] and all(p.exp.q == 2 for p in roots):
        a, b, c = polynomials[0].all_coeffs()
        root = sympy.sqrt(polynomials[0].as_expr())
        substitutions = []  # x and sqrt(Q) in t, and t in x
        if c == 0:
            image = b / (new**2 - a)
            substitutions.append((image, image * new, root / x))
        if c.is_positive:
            image = (2 * sympy.sqrt(c) * new - b) / (a - new**2)
            substitutions.append((image, image * new + sympy.sqrt(c), (root - sympy.sqrt(c)) / x))
        if a.is_positive:
            image = (new**2 - c) / (b - 2 * sympy.sqrt(a) * new)
            substitutions.append((image, new + sympy.sqrt(a) * image, root - sympy.sqrt(a) * x))
        for image, value, back in substitutions:
            written = e.xreplace({p: r ** (2 * p.exp) for p in roots}).xreplace({x: image, r: value})
            ways.append((written * sympy.diff(image, new), back))
    for integrand, back in ways:
        written = guarded.cancel(guarded.together(integrand))
        if written.is_rational_function(new):
            yield written, new, back


def _without_odd(written: sympy.Expr, r: sympy.Symbol, square: sympy.Expr) -> sympy.Expr | None:
    """A rational function of r**2 = `square` in terms of that; None where it holds r itself."""
    parts = [guarded.Poly(part, r) for part in sympy.fraction(written)]
    if len({n % 2 for part in parts for (n,) in part.monoms()}) > 1:
        return None
    above, below = (
        sum((a * square ** (n // 2) for (n,), a in part.terms()), sympy.Integer(0)) for part in parts
    )
    return above / below


def _with_plain_root(integral: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """The integral with its algebraic part A + B sqrt(Q), where it holds one square root sqrt(Q)."""
    roots = {p.base for p in integral.atoms(sympy.Pow) if p.has(x) and p.exp.is_Rational and p.exp.q == 2}
    algebraic = [a for a in sympy.Add.make_args(integral) if not a.has(sympy.Function)]
    if len(roots) != 1 or not algebraic:
        return integral
    (square,) = roots
    r = sympy.Dummy("r", positive=True)
    powers = (p for p in integral.atoms(sympy.Pow) if p.base == square and not p.exp.is_Integer)
    names = {p: r ** int(2 * p.exp) for p in powers}
    above, below = sympy.fraction(guarded.together(sympy.Add(*algebraic).xreplace(names)))
    if not (above.is_polynomial(r) and below.is_polynomial(r)):
        return integral
    below = guarded.rem(below, r**2 - square, r)
    conjugate = guarded.subs(below, r, -r)
    above = guarded.rem(guarded.expand(above * conjugate), r**2 - square, r)
    below = guarded.rem(guarded.expand(below * conjugate), r**2 - square, r)
    written = sympy.Add(*(guarded.cancel(above.coeff(r, n) / below) * r**n for n in (0, 1)))
    return sympy.Add(integral, -sympy.Add(*algebraic), written.xreplace({r: sympy.sqrt(square)}))
