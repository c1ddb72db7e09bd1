"""Substitutions that make a function rational: tan u for sines and cosines, and those of Euler for square roots.

L. Euler, Institutionum calculi integralis I (1768), ch. II: with Q = a x**2 + b x + c a rational function of x and
sqrt(Q) becomes one of t by sqrt(Q) = t + sqrt(a) x, by sqrt(Q) = x t + sqrt(c), or where c = 0 by sqrt(Q) = x t.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import sympy

from lagcli.pfaffian.exact import guarded


@dataclass(frozen=True, slots=True)
class RationalWay:
    """The integrand as a rational function of `new`, with the weight dx/d(new) in it; `back` is `new` in x."""

    integrand: sympy.Expr
    new: sympy.Symbol
    back: sympy.Expr


def ways(e: sympy.Expr, x: sympy.Symbol) -> Iterator[RationalWay]:
    """The substitutions that fit; all symbols are positive."""
    turned = [f for f in e.atoms(sympy.sin, sympy.cos, sympy.tan) if f.has(x)]
    roots = [
        p for p in e.atoms(sympy.Pow) if p.has(x) and not p.exp.is_Integer and not isinstance(p, sympy.exp)
    ]
    if turned and not roots:
        yield from _tangent(e, x, turned)
    elif roots and not turned and all(p.exp.is_Rational for p in roots):
        yield from _roots(e, x, roots)


def _tangent(e: sympy.Expr, x: sympy.Symbol, turned: list[sympy.Expr]) -> Iterator[RationalWay]:
    """tan u, for what is the same at u + pi."""
    u = min((f.args[0] for f in turned), key=lambda a: (a.count_ops(), str(a)))
    slope = sympy.diff(u, x)
    new, c = sympy.Dummy("s", positive=True), sympy.Dummy("c", positive=True)
    plain = guarded.expand_trig(e).replace(sympy.tan, lambda a: sympy.sin(a) / sympy.cos(a))
    written = guarded.cancel(plain.xreplace({sympy.sin(u): new * c, sympy.cos(u): c}))
    if slope.has(x) or written.has(x) or not written.is_rational_function(new, c):
        return
    parts = [guarded.poly(part, c) for part in sympy.fraction(written)]
    parities = {n % 2 for part in parts for (n,) in part.monoms()}
    if len(parities) > 1:
        return
    above, below = (
        sum((a * (1 + new**2) ** (-(n // 2)) for (n,), a in part.terms()), sympy.Integer(0)) for part in parts
    )
    yield RationalWay(guarded.cancel(above / (below * slope * (1 + new**2))), new, sympy.tan(u))


def _roots(e: sympy.Expr, x: sympy.Symbol, roots: list[sympy.Expr]) -> Iterator[RationalWay]:
    """The root of one polynomial of the first or second degree, or the quotient of two roots of the first."""
    new, r = sympy.Dummy("s", positive=True), sympy.Dummy("r", positive=True)
    bases = sorted({p.base for p in roots}, key=str)
    if not all(base.is_polynomial(x) for base in bases):
        return
    polynomials = [guarded.poly(base, x) for base in bases]
    degrees = [p.degree() for p in polynomials]
    if degrees == [1]:
        q = sympy.ilcm(1, *(p.exp.q for p in roots))
        slope, rest = polynomials[0].all_coeffs()
        written = e.xreplace({p: new ** (p.exp * q) for p in roots}).xreplace({x: (new**q - rest) / slope})
        yield from _way(written * q * new ** (q - 1) / slope, new, bases[0] ** sympy.Rational(1, q))
    elif degrees == [1, 1] and all(p.exp.q == 2 for p in roots):
        (a, b), (c, d) = (p.all_coeffs() for p in polynomials)
        image = (d * new**2 - b) / (a - c * new**2)  # (a x + b)/(c x + d) = s**2
        names = {p: (new * r if p.base == bases[0] else r) ** (2 * p.exp) for p in roots}
        written = guarded.cancel(e.xreplace(names).xreplace({x: image}))
        even = _without_odd(written, r, (c * image + d))
        if even is not None:
            yield from _way(even * sympy.diff(image, new), new, sympy.sqrt(bases[0]) / sympy.sqrt(bases[1]))
    elif degrees == [2] and all(p.exp.q == 2 for p in roots):
        for image, root, back in _euler(polynomials[0], x, new):
            written = e.xreplace({p: r ** (2 * p.exp) for p in roots}).xreplace({x: image, r: root})
            yield from _way(written * sympy.diff(image, new), new, back)


def _euler(
    square: sympy.Poly, x: sympy.Symbol, t: sympy.Symbol
) -> Iterator[tuple[sympy.Expr, sympy.Expr, sympy.Expr]]:
    """x and sqrt(Q) in t, and t in x."""
    a, b, c = square.all_coeffs()
    root = sympy.sqrt(square.as_expr())
    if c == 0:
        image = b / (t**2 - a)
        yield image, image * t, root / x
    if c.is_positive:
        image = (2 * sympy.sqrt(c) * t - b) / (a - t**2)
        yield image, image * t + sympy.sqrt(c), (root - sympy.sqrt(c)) / x
    if a.is_positive:
        image = (t**2 - c) / (b - 2 * sympy.sqrt(a) * t)
        yield image, t + sympy.sqrt(a) * image, root - sympy.sqrt(a) * x


def _without_odd(written: sympy.Expr, r: sympy.Symbol, square: sympy.Expr) -> sympy.Expr | None:
    """A rational function of r**2 = `square` in terms of that; None where it holds r itself."""
    parts = [guarded.poly(part, r) for part in sympy.fraction(written)]
    if len({n % 2 for part in parts for (n,) in part.monoms()}) > 1:
        return None
    above, below = (
        sum((a * square ** (n // 2) for (n,), a in part.terms()), sympy.Integer(0)) for part in parts
    )
    return above / below


def plain(integral: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """The integral with its algebraic part A + B sqrt(Q), where it holds one square root sqrt(Q)."""
    roots = {p.base for p in integral.atoms(sympy.Pow) if p.has(x) and p.exp.is_Rational and p.exp.q == 2}
    algebraic = [a for a in sympy.Add.make_args(integral) if not a.has(sympy.Function)]
    if len(roots) != 1 or not algebraic:
        return integral
    (square,) = roots
    r = sympy.Dummy("r", positive=True)
    names = {
        p: r ** int(2 * p.exp) for p in integral.atoms(sympy.Pow) if p.base == square and not p.exp.is_Integer
    }
    above, below = sympy.fraction(guarded.together(sympy.Add(*algebraic).xreplace(names)))
    if not (above.is_polynomial(r) and below.is_polynomial(r)):
        return integral
    below = guarded.rem(below, r**2 - square, r)
    conjugate = guarded.subs(below, r, -r)
    above = guarded.rem(guarded.expand(above * conjugate), r**2 - square, r)
    below = guarded.rem(guarded.expand(below * conjugate), r**2 - square, r)
    written = sympy.Add(*(guarded.cancel(above.coeff(r, n) / below) * r**n for n in (0, 1)))
    return sympy.Add(integral, -sympy.Add(*algebraic), written.xreplace({r: sympy.sqrt(square)}))


def _way(integrand: sympy.Expr, new: sympy.Symbol, back: sympy.Expr) -> Iterator[RationalWay]:
    written = guarded.cancel(guarded.together(integrand))
    if written.is_rational_function(new):
        yield RationalWay(written, new, back)
