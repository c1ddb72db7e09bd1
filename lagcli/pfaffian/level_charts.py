"""A first integral phi -> charts in which its level surfaces are enforced: quotients without poles and jumps.

phi = const is above * below(0) - below * above(0) = 0 for every quotient above/below that is phi or a monotone function
of it. A pole of phi is none of the chart; roots, logarithms and angles are removed by functions of phi: of a product of
powers one with coprime integers, positive ones above, as exponents; of sums with logarithms exp(phi); of a multiple of
an angle tan(phi): with angles of (x_i, y_i), the imaginary over the real part of prod (x_i + i y_i)^n_i exp(i u).
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import sympy

from lagcli.model import invariant
from lagcli.pfaffian import tidy_integral
from lagcli.pfaffian.exact import guarded, time_limit
from lagcli.pfaffian.forms import notation

Variables = tuple[sympy.Symbol, ...]
Quotient = tuple[sympy.Expr, sympy.Expr]

# Larger powers are not multiplied out; longer expressions are not searched for common factors.
MOST_TURNS, SHORT = 6, 300
BUDGET = 60_000  # operations
_ONE = sympy.Integer(1)
_ANGLES = (sympy.atan2, sympy.atan)
_REGULAR = tuple(kind for kind, row in notation.ROWS.items() if row.is_entire)


def charts(phi: sympy.Expr, constants: Iterable[sympy.Symbol] = ()) -> tuple[invariant.LevelFunction, ...]:
    """Charts of an integral, the best first; none where no form without jumps is known. constants: the parameters."""
    variables = tuple(sorted(phi.free_symbols - set(constants), key=sympy.default_sort_key))

    def found() -> tuple[invariant.LevelFunction, ...]:
        if any(_jumps(angle, variables) for angle in phi.atoms(*_ANGLES)):
            return _of_angles(phi, variables)
        quotients = _quotients(phi, variables)
        quotients = [q for q in quotients if all(_is_continuous(part, variables) for part in q)]
        quotients.sort(key=lambda q: not all(_is_regular(part, variables) for part in q))  # stable
        return tuple(dict.fromkeys(_written(*quotient) for quotient in quotients))

    known = time_limit.answer(math.inf, found, BUDGET)
    if known is None:
        return (_written(phi),) if _is_continuous(phi, variables) else ()
    return known


def _written(
    above: sympy.Expr, below: sympy.Expr = _ONE, period: sympy.Expr | None = None
) -> invariant.LevelFunction:
    around = None if period is None else notation.written(period)
    return invariant.LevelFunction(notation.written(above), notation.written(below), around)


def _jumps(angle: sympy.Expr, variables: Variables) -> bool:
    """True if an angle has a branch cut, or is an arc tangent of a quotient that has a pole."""
    below = angle.args[1] if isinstance(angle, sympy.atan2) else _fraction(angle.args[0])[1]
    return bool(below.has(*variables))


def _fraction(expression: sympy.Expr) -> Quotient:
    above, below = sympy.fraction(guarded.together(expression), exact=True)
    return above, below


def _of_angles(phi: sympy.Expr, variables: Variables) -> tuple[invariant.LevelFunction, ...]:
    """Charts of phi = sum c_i theta_i + u, or of exp(phi), with commensurate c_i."""
    if not phi.is_Add and not any(isinstance(f, _ANGLES) for f in sympy.Mul.make_args(phi)):
        phi = guarded.expand_log(sympy.log(phi), force=True)
    angles, others = [], []
    for term in sympy.Add.make_args(guarded.expand(phi)):
        constant, varying = term.as_independent(*variables, as_Add=False)
        if not (isinstance(varying, _ANGLES) and _jumps(varying, variables)):
            others.append(term)
            continue
        # atan2 and an arc tangent of the quotient differ by whole half turns, and these are of no account where
        # the real and the imaginary part change signs together; a period of whole turns allows for continuation.
        y, x = varying.args if isinstance(varying, sympy.atan2) else _fraction(varying.args[0])
        angles.append((constant, x, y))
    rest = sympy.Add(*others)
    if not angles or any(isinstance(e, _ANGLES) for e in _jumping(rest, variables)):
        return ()
    first = angles[0][0]
    ratios = [guarded.cancel(c / first) for c, _, _ in angles]
    if not all(r.is_Rational for r in ratios):
        return ()
    scale = tidy_integral.coprime_scale(ratios)
    numbers, unit = [int(n * scale) for n in ratios], guarded.cancel(first / scale)
    rest = _untangled(rest)
    u = guarded.expand(rest / unit)
    result = []
    if sum(map(abs, numbers)) <= MOST_TURNS and _is_regular(u, variables):
        # The imaginary and the real part of prod (x + i y)^n exp(i u)
        real, imaginary = sympy.cos(u), sympy.sin(u)
        for n, (_, x, y) in zip(numbers, angles, strict=True):
            for _ in range(abs(n)):
                turned = y if n > 0 else -y
                real, imaginary = real * x - imaginary * turned, real * turned + imaginary * x
        result.append(_written(guarded.expand(imaginary), guarded.expand(real)))
    if _is_continuous(rest, variables):
        phi = sum((c * sympy.atan2(y, x) for c, x, y in angles), rest)
        result.append(_written(phi, period=2 * sympy.pi * unit))
    return tuple(result)


def _jumping(expression: sympy.Expr, variables: Variables) -> list[sympy.Expr]:
    return [a for a in expression.atoms(*_ANGLES) if _jumps(a, variables)]


def _quotients(phi: sympy.Expr, variables: Variables) -> list[Quotient]:
    """above, below of phi and of monotone functions of it."""
    phi = _untangled(phi)
    if any(a.args[0].has(*variables) for a in phi.atoms(sympy.log)):
        phi = _untangled(tidy_integral.integral(phi, variables))
    # The factors that vary with their exponents, and w of a factor exp(w); signs of factors do not matter.
    powers: dict[sympy.Expr, sympy.Expr] = {}
    exponential = sympy.Integer(0)
    for factor in sympy.Mul.make_args(_cancelled(phi)):
        if not factor.has(*variables) or isinstance(factor, sympy.sign):
            continue
        if isinstance(factor, sympy.exp):
            exponential += factor.args[0]
            continue
        base, exponent = factor.as_base_exp()
        if exponent.has(*variables):
            base, exponent = factor, sympy.Integer(1)
        base = base.args[0] if isinstance(base, sympy.Abs) else base
        powers[base] = powers.get(base, sympy.Integer(0)) + exponent
    powers = {b: n for b, n in powers.items() if n != 0}
    if not powers:
        return _quotients(exponential, variables)  # phi = exp(w), and w has the same levels
    numbers = list(powers.values())
    if not all(n.is_Rational for n in numbers):
        return [_split(powers, exponential)]
    scale = tidy_integral.coprime_scale(numbers)
    integers, bases = [int(n * scale) for n in numbers], list(powers)
    exponential *= scale
    whole = dict(zip(bases, map(sympy.Integer, integers), strict=True))
    found = [_split(whole, exponential)]
    if exponential != 0:
        plain = _split(whole, sympy.Integer(0))
        found.append((plain[0], plain[1] * sympy.exp(guarded.expand(-exponential))))
    # On the level zero of a factor that is squared the gradient vanishes: there a root of the product serves.
    for n in sorted({abs(n) for n in integers if abs(n) > 1}):
        rooted = {
            (b if k % n == 0 else sympy.Abs(b)): sympy.Rational(k, n)
            for b, k in zip(bases, integers, strict=True)
        }
        found.append(_split(rooted, exponential / n))
    return found


def _untangled(phi: sympy.Expr) -> sympy.Expr:
    """Without tan and tanh, and with half angles where both they and whole ones occur."""
    phi = phi.replace(sympy.tan, lambda u: sympy.sin(u) / sympy.cos(u))
    phi = phi.replace(sympy.tanh, lambda u: sympy.sinh(u) / sympy.cosh(u))
    arguments = {f.args[0] for f in phi.atoms(sympy.sin, sympy.cos)}
    for u in sorted(arguments, key=sympy.default_sort_key):
        if guarded.expand(2 * u) in arguments:
            s, c = sympy.sin(u), sympy.cos(u)
            double = guarded.expand(2 * u)
            phi = guarded.subs(phi, {sympy.sin(double): 2 * s * c, sympy.cos(double): c**2 - s**2})
    return phi


def _cancelled(phi: sympy.Expr) -> sympy.Expr:
    """The quotient as a product, without common factors above and below."""
    if phi.count_ops() > SHORT:
        return guarded.together(phi)
    phi = guarded.factor(guarded.together(phi))
    arguments = {f.args[0] for f in _fraction(phi)[1].atoms(sympy.sin, sympy.cos)}
    for u in sorted(arguments, key=sympy.default_sort_key):
        # Sine and cosine of u hide factors from polynomials. With w = tan(u/2), sin(u) = 2 w/(1 + w^2) and
        # cos(u) = (1 - w^2)/(1 + w^2) all of them show.
        w = sympy.Dummy("w", real=True)
        tangents = {sympy.sin(u): 2 * w / (1 + w**2), sympy.cos(u): (1 - w**2) / (1 + w**2)}
        parts = [_fraction(guarded.subs(part, tangents)) for part in _fraction(phi)]
        if not guarded.gcd(*(part for part, _ in parts)).has(w):
            continue
        product = guarded.factor(parts[0][0] * parts[1][1] / (parts[1][0] * parts[0][1]))
        s, c = sympy.sin(u / 2), sympy.cos(u / 2)
        phi = sympy.Integer(1)
        for factor in sympy.Mul.make_args(product):
            base, n = factor.as_base_exp()
            if not base.has(w):
                phi *= factor
                continue
            degree = guarded.degree(base, w)
            homogeneous = sum(a * s**k * c ** (degree - k) for (k,), a in guarded.Poly(base, w).terms())
            phi *= (guarded.trigsimp(homogeneous) / c**degree) ** n
    return phi


def _split(powers: dict[sympy.Expr, sympy.Expr], exponential: sympy.Expr) -> Quotient:
    """The factors with positive and with negative exponents."""
    above = sympy.Mul(*(b**n for b, n in powers.items() if not n.is_negative))
    below = sympy.Mul(*(b**-n for b, n in powers.items() if n.is_negative))
    return above * sympy.exp(guarded.expand(exponential)), below


def _is_regular(expression: sympy.Expr, variables: Variables) -> bool:
    """True if an expression is made of whole powers and functions that are regular everywhere."""
    if expression.is_Symbol or not expression.has(*variables):
        return True
    if expression.is_Pow and not isinstance(expression, sympy.exp):
        is_whole = expression.exp.is_Integer and expression.exp > 0
        return is_whole and _is_regular(expression.base, variables)
    if not (expression.is_Add or expression.is_Mul or isinstance(expression, _REGULAR)):
        return False
    return all(_is_regular(part, variables) for part in expression.args)


def _is_continuous(expression: sympy.Expr, variables: Variables) -> bool:
    """True if an expression is continuous wherever it is finite, and can be written in the notation of models."""
    if expression.has(sympy.I, sympy.nan, sympy.zoo, sympy.oo):
        return False
    functions = {f.func for f in expression.atoms(sympy.Function) if f.has(*variables)}
    rows = notation.ROWS.items()
    smooth = {kind for kind, row in rows if not row.poles and row.jumps != "zero"}
    return functions <= smooth and not _jumping(expression, variables)
