"""The potential of an exact form by integrating along the coordinate axes, one coordinate after the other."""

import sympy

from lagcli.pfaffian import form as forms
from lagcli.pfaffian import limit

WRITABLE = (
    sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan, sympy.atan2,
    sympy.sinh, sympy.cosh, sympy.tanh, sympy.exp, sympy.log, sympy.Abs,
)  # fmt: skip
"""The functions an integral may hold: those of the model format."""


def of(form: forms.Form) -> sympy.Expr | None:
    """phi with d phi = omega for a form with d omega = 0, or None where no closed form was found.

    The result is a proposal: the caller verifies it. May run long: call it under `limit.run`.
    """
    variables = form.variables
    phi: sympy.Expr = sympy.Integer(0)
    for n, (x, coefficient) in enumerate(zip(variables, form.coefficients, strict=True)):
        rest = _without(coefficient - forms.partial(phi, x), variables[:n])
        part = antiderivative(rest, x) if rest is not None else None
        if part is None:
            return None
        phi += part
    return phi


def _without(expression: sympy.Expr, earlier: tuple[sympy.Symbol, ...]) -> sympy.Expr | None:
    """The expression, known not to depend on `earlier`, written without them."""
    expression = sympy.expand(expression)
    for x in earlier:
        if x not in expression.free_symbols:
            continue
        for value in (0, 1, 2):
            try:
                fixed = expression.subs(x, value)
            except limit.FAILURES:
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
    found = _integrated(expression.xreplace(positive), x)
    return None if found is None else found.xreplace({dummy: s for s, dummy in positive.items()})


def _with_moduli(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """The rule for |a x + b| with constant coefficient: u|u|/(2a), which has no jump at the kink; no other
    moduli.
    """
    rest, moduli = sympy.expand(expression), sorted(expression.atoms(sympy.Abs), key=str)
    names = {m: sympy.Dummy(f"m{n}", positive=True) for n, m in enumerate(moduli)}
    back = {dummy: m for m, dummy in names.items()}
    rest = rest.xreplace(names)
    total: sympy.Expr = sympy.Integer(0)
    for modulus, dummy in names.items():
        u = modulus.args[0]
        slope = sympy.diff(u, x)
        if slope == 0:
            continue
        weight = rest.coeff(dummy, 1)
        if weight.has(x) or slope.has(x) or slope.has(sympy.Abs):
            return None
        rest = sympy.expand(rest - weight * dummy)
        if rest.has(dummy):
            return None
        total += weight * u * dummy / (2 * slope)
    part = antiderivative(rest, x)
    return None if part is None else (total + part).xreplace(back)


def _integrated(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    if x not in expression.free_symbols:
        return expression * x
    if expression.is_polynomial(x):
        terms = sympy.Poly(expression, x).terms()
        return sum((c * x ** (n + 1) / (n + 1) for (n,), c in terms), sympy.Integer(0))
    try:
        found = sympy.integrate(expression, x)
    except limit.FAILURES:
        return None
    if found.has(sympy.Piecewise):
        # The first branch is the one for generic parameters, as in x**(k + 1)/(k + 1) with k != -1.
        found = sympy.piecewise_fold(found)
        found = found.replace(lambda e: isinstance(e, sympy.Piecewise), lambda e: e.args[0][0])
    return found if writable(found) else None


def writable(expression: sympy.Expr) -> bool:
    """Whether the expression is real, finite and holds functions of the model format only."""
    if expression.has(sympy.I, sympy.Integral, sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.RootSum):
        return False
    return all(isinstance(f, WRITABLE) for f in expression.atoms(sympy.Function))
