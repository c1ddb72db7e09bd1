"""Integrals and factors as a person would write them: products instead of sums of logarithms, no idle
constants.
"""

from functools import reduce
from math import gcd, lcm

import sympy

from lagcli.pfaffian import limit, tower

_SHORT = 400


def shortest(expression: sympy.Expr) -> sympy.Expr:
    """The shortest of the usual ways to write the expression."""
    ways = [expression]
    if expression.count_ops() <= _SHORT:
        tools = [sympy.expand, sympy.factor, sympy.cancel, sympy.trigsimp]
        if len(expression.atoms(sympy.exp)) > 1 and expression.count_ops() <= _SHORT // 8:
            tools.append(sympy.simplify)  # knows the hyperbolic functions
        for tool in tools:
            try:
                ways.append(sympy.powsimp(tool(expression)))
            except limit.FAILURES:
                continue
    return min(ways, key=_length)


def _length(expression: sympy.Expr) -> tuple[int, int]:
    return sympy.count_ops(expression), len(str(expression))


def potential(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    """The potential of an exact form: only an additive constant is free."""
    return _with_atan2(shortest(_without_constant(phi, variables)))


def integral(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    """A simple function of phi: every function of a first integral is one."""
    phi = _without_constant(phi, variables)
    phi = _exponentiated(phi, variables)
    phi = _without_constant(shortest(phi), variables)
    factored = phi if phi.is_Mul or phi.is_Pow else shortest(_factored(phi))
    phi = _root_free(factored, variables) if factored.is_Mul or factored.is_Pow else phi
    phi = _primitive(phi)
    return _with_atan2(min((phi, _primitive(_hyperbolic(phi)), _half_angles(phi)), key=_length))


def ratio(above: sympy.Expr, below: sympy.Expr) -> sympy.Expr:
    """above/below, with common factors cancelled in the normal form."""
    plain = above / below
    ways = [plain]
    try:
        basis = tower.Tower([above, below])
        ways.append(basis.expression(basis.reduced(basis.element(above) / basis.element(below))))
    except limit.FAILURES:
        pass
    return min((shortest(way) for way in ways), key=_length)


def _factored(phi: sympy.Expr) -> sympy.Expr:
    try:
        return sympy.factor(phi)
    except limit.FAILURES:
        return phi


def _without_constant(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    return phi.as_independent(*variables, as_Add=True)[1] if phi.is_Add else phi


def _exponentiated(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    """exp(phi/c) for phi = c log p + ..., so that logarithms become a product of powers."""
    logs: list[tuple[sympy.Expr, sympy.Expr]] = []
    rest: list[sympy.Expr] = []
    for term in sympy.Add.make_args(sympy.expand(sympy.expand_log(phi, force=True))):
        constant, varying = term.as_independent(*variables, as_Add=False)
        if isinstance(varying, sympy.log):
            logs.append((constant, varying.args[0]))
        else:
            rest.append(term)
    if not logs:
        return phi
    exponents = [sympy.cancel(c / logs[0][0]) for c, _ in logs]
    if all(n.is_Rational for n in exponents):
        scale = _scale(exponents)
    else:
        scale = reduce(sympy.lcm, (sympy.fraction(n)[1] for n in exponents))
    exponents = [sympy.cancel(n * scale) for n in exponents]
    left = sympy.expand(sum(rest, sympy.Integer(0)) * scale / logs[0][0])
    product = sympy.Mul(*(p**n for n, (_, p) in zip(exponents, logs, strict=True)))
    return product * sympy.exp(left)


def _scale(numbers: list[sympy.Rational]) -> sympy.Rational:
    """The factor that turns the numbers into integers without common divisor, most of them positive."""
    above, below = 0, 1
    for n in numbers:
        above, below = gcd(above, int(n.p)), lcm(below, int(n.q))
    if above == 0:
        return sympy.Integer(1)
    sign = -1 if sum(1 if n > 0 else -1 for n in numbers) < 0 else 1
    return sympy.Rational(sign * below, above)


def _root_free(phi: sympy.Expr, variables: tuple[sympy.Symbol, ...]) -> sympy.Expr:
    """A product of rational powers, raised so that the exponents are small integers; constants dropped."""
    factors = phi.as_independent(*variables, as_Add=False)[1].as_powers_dict()
    powers = {b: n for b, n in factors.items() if b is not sympy.E}
    if not all(n.is_Rational for n in powers.values()):
        return phi
    plain = [n for b, n in powers.items() if not isinstance(b, sympy.exp)]
    scale = _scale(plain) if plain else sympy.Integer(1)
    return sympy.Mul(*(_power(b, n * scale) for b, n in factors.items()))


def _power(base: sympy.Expr, n: sympy.Expr) -> sympy.Expr:
    return sympy.exp(sympy.expand(base.args[0] * n)) if isinstance(base, sympy.exp) else base**n


def _hyperbolic(phi: sympy.Expr) -> sympy.Expr:
    """exp(2u) - 1 = 2 exp(u) sinh(u), exp(2u) + 1 = 2 exp(u) cosh(u)."""

    def turn(base: sympy.Expr) -> sympy.Expr:
        constant, rest = base.as_independent(*base.free_symbols, as_Add=True)
        if not isinstance(rest, sympy.exp) or constant not in (1, -1):
            return base
        u = rest.args[0] / 2
        return 2 * sympy.exp(u) * (sympy.cosh(u) if constant == 1 else sympy.sinh(u))

    return sympy.powsimp(phi.replace(lambda e: e.is_Add, turn)) if phi.has(sympy.exp) else phi


def _half_angles(phi: sympy.Expr) -> sympy.Expr:
    """sin(u)/(1 + cos(u)) = tan(u/2) in a product."""
    powers = phi.as_powers_dict()
    for base, n in list(powers.items()):
        below = 1 + sympy.cos(base.args[0]) if isinstance(base, sympy.sin) else base
        if isinstance(base, sympy.sin) and powers.get(below) == -n:
            phi = phi / base**n * below**n * sympy.tan(base.args[0] / 2) ** n
    return phi


def _primitive(phi: sympy.Expr) -> sympy.Expr:
    content, rest = phi.primitive() if phi.is_Add else phi.as_coeff_Mul(rational=True)
    if rest.could_extract_minus_sign() and (-rest).count_ops() <= rest.count_ops():
        rest = -rest
    return rest if content != 0 else phi


def _with_atan2(phi: sympy.Expr) -> sympy.Expr:
    """atan(y/x) jumps where x = 0; atan2(y, x) has the same differential and goes on."""

    def turn(u: sympy.Expr) -> sympy.Expr:
        above, below = sympy.fraction(sympy.together(u))
        return sympy.atan2(above, below) if below.free_symbols else sympy.atan(u)

    return phi.replace(sympy.atan, turn)
