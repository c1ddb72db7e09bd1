"""Integrals and factors as a person would write them: products instead of sums of logarithms, no idle constants."""

import contextlib
from collections.abc import Callable, Sequence
from functools import reduce
from math import gcd, lcm

import sympy
from sympy.functions.elementary.trigonometric import TrigonometricFunction

from lagcli.pfaffian.exact import guarded, normal_form

# Operations up to which an expression is shortened at all, and by the slow tools; the few shortest are joined.
_SHORT = 400
_SMALL = 60
_FEW = 3
_HIGH = 12
"""Higher powers are left as logarithms: 37*log(x) + 121*log(y)."""


def shortest(expression: sympy.Expr, fine: bool = False) -> sympy.Expr:
    """The shortest of the usual ways to write the expression; `fine`: of the slow ones too, for what is shown."""
    tools: list[Callable[[sympy.Expr], sympy.Expr]] = []
    size = expression.count_ops()
    if size <= _SHORT:
        tools = [guarded.expand, guarded.factor, _normal]
        if fine and size <= _SMALL:
            tools.append(_collected)
            if expression.has(TrigonometricFunction):
                tools += [_trigonometric, _full_angles, _tangents]
            if expression.has(sympy.exp):
                tools.append(_hyperbolics)
        if size <= _SMALL and len(expression.atoms(sympy.exp)) > 1:
            tools.append(guarded.simplify)  # knows the hyperbolic functions
    return _best(expression, tools)


def _best(expression: sympy.Expr, tools: Sequence[Callable[[sympy.Expr], sympy.Expr]]) -> sympy.Expr:
    ways = [expression]
    for tool in tools:
        with contextlib.suppress(guarded.NoAnswerError):
            ways.append(guarded.attempt(tool, expression))
    few = sorted(dict.fromkeys(ways), key=sympy.count_ops)[:_FEW]
    return min((_joined(way) for way in few), key=_length)


def _length(expression: sympy.Expr) -> tuple[int, bool, int]:
    return sympy.count_ops(expression), expression.is_Add, len(str(expression))


def _joined(expression: sympy.Expr) -> sympy.Expr:
    """x*x**k as x**(k + 1), exp(x)*exp(y) as exp(x + y)."""
    deep = any(e.exp.free_symbols for e in expression.atoms(sympy.Pow) if not isinstance(e, sympy.exp))
    if deep or len(expression.atoms(sympy.exp)) > 1:
        return guarded.powsimp(expression, deep=deep)
    return expression


def _normal(expression: sympy.Expr) -> sympy.Expr:
    """The normal form with its irreducible factors, and with half angles where they are shorter."""
    basis = normal_form.NormalForm([expression])
    element = basis.element(expression)
    numbers = sympy.Integer(1)
    powers: dict[sympy.Expr, int] = {}
    for part, sign in ((element.numer, 1), (element.denom, -1)):
        content, factors = part.factor_list()
        numbers *= sympy.QQ.to_sympy(content) ** sign
        for factor, n in factors:
            base = basis.expression(factor)
            content, base = base.primitive()
            numbers *= content ** (sign * n)
            powers[base] = powers.get(base, 0) + sign * n
    return numbers * _half_angles(sympy.Mul(*(b**n for b, n in powers.items())))


def _trigonometric(expression: sympy.Expr) -> sympy.Expr:
    """Shortened by the addition theorems, if no multiples of angles come in."""
    found = guarded.trigsimp(expression)
    old, new = ({f.args[0] for f in e.atoms(TrigonometricFunction)} for e in (expression, found))
    return expression if any((v / u).is_Rational for v in new - old for u in old) else found


def _tangents(expression: sympy.Expr) -> sympy.Expr:
    """In terms of tan(u) instead of sin(u) and cos(u), where no odd power of cos(u) is left."""
    tangent, cosine = sympy.Dummy("t"), sympy.Dummy("c")
    for u in sorted({f.args[0] for f in expression.atoms(sympy.sin)}, key=str):
        written = expression.xreplace({sympy.sin(u): tangent * cosine, sympy.cos(u): cosine})
        parts = [guarded.Poly(p, cosine) for p in sympy.fraction(guarded.cancel(written))]
        if any(n % 2 for p in parts for (n,) in p.monoms()) or written.has(u):
            continue
        above, below = (sum(a * (1 + tangent**2) ** (-n // 2) for (n,), a in p.terms()) for p in parts)
        expression = guarded.subs(guarded.cancel(above / below), tangent, sympy.tan(u))
    return expression


def _hyperbolics(expression: sympy.Expr) -> sympy.Expr:
    """exp(u) and exp(-u) by sinh(u) and cosh(u)."""
    exponents = {e.args[0] for e in expression.atoms(sympy.exp)}
    new: dict[sympy.Expr, sympy.Expr] = {}
    for u in sorted((u for u in exponents if -u in exponents and not u.could_extract_minus_sign()), key=str):
        new |= {sympy.exp(u): sympy.cosh(u) + sympy.sinh(u), sympy.exp(-u): sympy.cosh(u) - sympy.sinh(u)}
    return guarded.expand(guarded.expand(expression).xreplace(new)) if new else expression


def _full_angles(expression: sympy.Expr) -> sympy.Expr:
    """tan(u/2) as sin(u)/(1 + cos(u))."""
    plain = expression.replace(sympy.tan, lambda v: sympy.sin(2 * v) / (1 + sympy.cos(2 * v)))
    return _normal(plain.replace(lambda e: isinstance(e, sympy.exp), lambda e: sympy.exp(_normal(e.args[0]))))


def _collected(expression: sympy.Expr) -> sympy.Expr:
    """Terms with the same function or root together: (x + y)*sqrt(z) for x*sqrt(z) + y*sqrt(z)."""
    expanded = guarded.expand(expression)
    parts = [e for e in expanded.atoms(sympy.Function, sympy.Pow) if not (e.is_Pow and e.exp.is_Integer)]
    ways = [guarded.collect(expanded, part) for part in sorted(parts, key=str)]
    return min([expanded, *ways], key=_length)


def potential(
    phi: sympy.Expr, variables: tuple[sympy.Symbol, ...], given: frozenset[sympy.Expr] = frozenset()
) -> sympy.Expr:
    """The potential of an exact form: only an additive constant is free. log u becomes log |u|, which goes on where u <
    0, unless it is one of the functions `given` in the form."""
    phi = _without_constant(phi, variables)
    if phi.is_polynomial(*variables):
        ways = (guarded.expand(phi), guarded.factor(phi))
        short = min((w for w in ways if w.is_Mul or w is ways[0]), key=sympy.count_ops)
    else:
        short = shortest(phi, fine=True)
    return _both_sides(_with_atan2(_without_constant(short, variables), variables), given)


def _both_sides(phi: sympy.Expr, given: frozenset[sympy.Expr]) -> sympy.Expr:
    def turn(u: sympy.Expr) -> sympy.Expr:
        if sympy.log(u) in given:
            return sympy.log(u)
        base, n = u.args if u.is_Pow and u.exp.is_Integer else (u, 1)
        return n * sympy.log(base if base.is_nonnegative else sympy.Abs(base))

    return phi.replace(sympy.log, turn)


def integral(
    phi: sympy.Expr, variables: tuple[sympy.Symbol, ...], given: frozenset[sympy.Expr] = frozenset()
) -> sympy.Expr:
    """A simple function of phi: every function of a first integral is one. `given` as in `potential`."""
    phi = _exponentiated(_without_constant(phi, variables), variables)
    phi = factored = _without_constant(shortest(phi, fine=True), variables)
    if not (phi.is_Mul or phi.is_Pow):
        with contextlib.suppress(guarded.SympyFailure):
            factored = guarded.factor(phi)
        factored = shortest(factored)
    if factored.is_Mul or factored.is_Pow:
        phi = min((phi, _root_free(factored, variables)), key=_length)
    phi = _primitive(phi)
    # A quotient of sums with the simpler one, or one without zeros, below
    above, below = sympy.fraction(phi)
    if all(_has_sum(e) for e in (above, below)) and not below.is_positive:
        phi = below / above if above.is_positive or above.count_ops() < below.count_ops() else phi
    if phi.is_Add and phi.is_polynomial(*variables):
        phi = guarded.expand(phi)
    hyperbolic = [_primitive(_hyperbolic(way)) for way in (phi, factored)]
    ways = [phi, *hyperbolic, _half_angles(phi)]
    # A product with a sum in its denominator alone is turned upside down, also as a sum: 1/x - 1/y.
    above, below = sympy.fraction(phi)
    if below.free_symbols and _has_sum(below):
        turned = below / above
        sums = [guarded.expand(turned), guarded.expand(guarded.expand_trig(turned))]
        split = [_primitive(_without_constant(_joined(way), variables)) for way in sums]
        ways += split if _has_sum(above) else [turned, *split]
    return _both_sides(_with_atan2(_joined(_primitive(min(ways, key=_length))), variables), given)


def _has_sum(e: sympy.Expr) -> bool:
    return any(b.is_Add for b in e.as_powers_dict())


def ratio(above: sympy.Expr, below: sympy.Expr) -> sympy.Expr:
    """above/below, with common factors cancelled in the normal form."""
    best = _best(above / below, (_normal, guarded.factor))
    found = shortest(best) if best.is_Add or best.has(sympy.exp) else best
    for base, n in found.as_powers_dict().items():  # -1/(x + y) for 1/(-x - y)
        if base.is_Add and n.is_Integer and n < 0 and all(a.could_extract_minus_sign() for a in base.args):
            found = found / base**n * (-base) ** n * sympy.Integer(-1) ** n
    return found


def _without_constant(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    return phi.as_independent(*variables, as_Add=True)[1] if phi.is_Add else phi


def _exponentiated(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    """exp(phi/c) for phi = c log p + ..., so that logarithms become a product of powers."""
    logs: list[tuple[sympy.Expr, sympy.Expr]] = []
    rest: list[sympy.Expr] = []
    for term in sympy.Add.make_args(guarded.expand(phi, log=False)):
        constant, varying = term.as_independent(*variables, as_Add=False)
        if isinstance(varying, sympy.log):
            powers = varying.args[0].as_powers_dict().items()
            logs += [(constant * n, base) for base, n in powers if base.has(*variables)]
        else:
            rest.append(term)
    if not logs:
        return phi
    exponents = [guarded.cancel(c / logs[0][0]) for c, _ in logs]
    if all(n.is_Rational for n in exponents):
        scale = _turning_scale(exponents)
    else:
        scale = reduce(guarded.lcm, (sympy.fraction(n)[1] for n in exponents))
    exponents = [guarded.cancel(n * scale) for n in exponents]
    left = guarded.expand(sum(rest, sympy.Integer(0)) * scale / logs[0][0])
    high = any(n.is_Rational and abs(n) > _HIGH for n in exponents)
    if high or len(rest) > len(logs) + 1:  # few logarithms in a long sum stay there
        return sum((n * sympy.log(p) for n, (_, p) in zip(exponents, logs, strict=True)), left)
    product = sympy.Mul(*(p**n for n, (_, p) in zip(exponents, logs, strict=True)))
    if left.has(sympy.atan, sympy.atan2):  # an angle that runs on is easier to follow outside of exp
        varying = shortest(product).as_independent(*variables, as_Add=False)[1]
        return _both_sides(sympy.log(varying), frozenset()) + left
    return product * sympy.exp(left)


def coprime_scale(numbers: list[sympy.Rational]) -> sympy.Rational:
    """The positive factor that turns rational numbers into integers without common divisor."""
    above, below = gcd(*(int(n.p) for n in numbers)), lcm(*(int(n.q) for n in numbers))
    return sympy.Rational(below, above) if above else sympy.Integer(1)


def _turning_scale(numbers: list[sympy.Rational]) -> sympy.Rational:
    """The factor that also makes most of them positive."""
    is_turning = sum(1 if n > 0 else -1 for n in numbers) < 0
    return -coprime_scale(numbers) if is_turning else coprime_scale(numbers)


def _root_free(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    """A product of rational powers, raised so that the exponents are small integers; constants dropped."""
    factors = phi.as_independent(*variables, as_Add=False)[1].as_powers_dict()
    powers = {b: n for b, n in factors.items() if b is not sympy.E}
    if not all(n.is_Rational for n in powers.values()):
        return phi
    plain = [n for b, n in powers.items() if not isinstance(b, sympy.exp)]
    scale = _turning_scale(plain)
    raised = []
    for b, n in factors.items():
        is_exponential = isinstance(b, sympy.exp)
        raised.append(
            sympy.exp(guarded.expand(b.args[0] * (n * scale))) if is_exponential else b ** (n * scale)
        )
    return sympy.Mul(*raised)


def _hyperbolic(phi: sympy.Expr) -> sympy.Expr:
    """exp(2u) - 1 = 2 exp(u) sinh(u), exp(2u) + 1 = 2 exp(u) cosh(u)."""

    def turn(base: sympy.Expr) -> sympy.Expr:
        constant, rest = base.as_independent(*base.free_symbols, as_Add=True)
        if not isinstance(rest, sympy.exp) or constant not in (1, -1):
            return base
        u = rest.args[0] / 2
        return 2 * sympy.exp(u) * (sympy.cosh(u) if constant == 1 else sympy.sinh(u))

    return guarded.powsimp(phi.replace(lambda e: e.is_Add, turn)) if phi.has(sympy.exp) else phi


def _half_angles(phi: sympy.Expr) -> sympy.Expr:
    """sin(u), 1 + cos(u) and 1 - cos(u) in a product, two of them at least, by the angle u or u/2."""
    powers = phi.as_powers_dict()
    angles = {e.args[0] for b in powers for e in b.atoms(sympy.sin, sympy.cos)}
    for tangent in [b for b in powers if isinstance(b, sympy.tan) and 2 * b.args[0] in angles]:
        u, n = 2 * tangent.args[0], powers[tangent]
        phi = phi / tangent**n * sympy.sin(u) ** n * (1 + sympy.cos(u)) ** (-n)
    powers = phi.as_powers_dict()
    for u in sorted(angles, key=str):
        sine, plus, minus = sympy.sin(u), 1 + sympy.cos(u), 1 - sympy.cos(u)
        p, q, r = powers.get(sine, 0), powers.get(plus, 0), powers.get(minus, 0) + powers.get(-minus, 0)
        if sum(n != 0 for n in (p, q, r)) < 2 or not all(sympy.sympify(n).is_Integer for n in (p, q, r)):
            continue
        sign = sympy.Integer(-1) ** powers.get(-minus, 0)
        rest = sympy.Mul(*(b**n for b, n in powers.items() if b not in (sine, plus, minus, -minus)))
        above, below = p + 2 * r, p + 2 * q  # powers of sin(u/2) and cos(u/2)
        half = sign * sympy.Integer(2) ** (p + q + r)
        ways = [half * sympy.tan(u / 2) ** above * sympy.cos(u / 2) ** (above + below)]
        ways.append(half * sympy.sin(u / 2) ** above * sympy.cos(u / 2) ** below)
        if p % 2 == 0:
            ways.append(sign * minus ** (above // 2) * plus ** (below // 2))
        elif above + below == 0:
            ways = ways[:1]
        else:
            ways.append(sign * sine * minus ** ((above - 1) // 2) * plus ** ((below - 1) // 2))
        phi = min((rest * way for way in (sign * sine**p * plus**q * minus**r, *ways)), key=_length)
        powers = phi.as_powers_dict()
    return phi


def _primitive(phi: sympy.Expr) -> sympy.Expr:
    content, rest = phi.primitive() if phi.is_Add else phi.as_coeff_Mul(rational=True)
    if rest.is_Mul or rest.is_Pow:
        powers = rest.as_powers_dict()
        bases = ((b.primitive()[1] if b.is_Add and n.is_Rational else b, n) for b, n in powers.items())
        rest = sympy.Mul(*(b**n for b, n in bases))
    if rest.could_extract_minus_sign() and (-rest).count_ops() <= rest.count_ops():
        rest = -rest
    return rest if content != 0 else phi


def _with_atan2(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    """atan(y/x) jumps where x = 0; atan2(y, x) has the same differential and goes on. The later coordinate stands
    above: atan(x/y) is a constant less atan(y/x)."""

    def rank(e: sympy.Expr) -> int:
        return max((n for n, x in enumerate(variables) if x in e.free_symbols), default=-1)

    def turn(u: sympy.Expr) -> sympy.Expr:
        above, below = sympy.fraction(guarded.together(u))
        if rank(below) < 0:
            return sympy.atan(u)
        return sympy.atan2(above, below) if rank(above) >= rank(below) else -sympy.atan2(below, above)

    return phi.replace(sympy.atan, turn)
