"""Invariant surfaces of a Pfaffian system: p with X_j(p) = K_j p, of which logarithmic integrals are made.

Candidates are factors of coefficients, of known integrals, and of an inverse multiplier V: theta_1 ^ ... ^ theta_C =
d(phi_1) ^ ... ^ d(phi_C)/V, X_j(V) = div_j V (G. Darboux, Bull. Sci. Math. 2, 1878; Jacobi's last multiplier is 1/V).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce

import numpy as np
import sympy

from lagcli.pfaffian import combinations
from lagcli.pfaffian import kernel_frame as frames
from lagcli.pfaffian.exact import guarded, normal_form
from lagcli.pfaffian.exact.guarded import SympyFailure

# Candidates taken, in the order of their letters: each is a column of a linear system.
MAX_FACTORS = 24
# Degrees of inverse multipliers, one after the other: a plane and a conic have 3, two conics 4.
_DEGREES = (2, 3, 4)


def factors(entries: Iterable[sympy.Expr], variables: Sequence[sympy.Symbol]) -> list[sympy.Expr]:
    """The letters of the entries and the irreducible factors of their numerators and denominators.

    Raises `normal_form.NoNormalFormError`.
    """
    listed = list(entries)
    basis = normal_form.NormalForm([*listed, *variables])
    return basis.surfaces(listed, variables)[:MAX_FACTORS]


def denominator(entries: Iterable[sympy.Expr]) -> sympy.Expr:
    """The least common denominator in the normal form. Raises `normal_form.NoNormalFormError`."""
    listed = list(entries)
    basis = normal_form.NormalForm(listed)
    parts = (basis.element(e).denom for e in listed)
    return basis.expression(reduce(lambda a, b: a.lcm(b), parts, basis.ring.one))


def angles(surfaces: Iterable[sympy.Expr], variables: Sequence[sympy.Symbol]) -> list[sympy.Expr]:
    """atan2(v, u) for each surface u**2 + v**2 = (u + i v)(u - i v) that is quadratic in a variable."""
    found = []
    for p in surfaces:
        for x in (x for x in variables if x in p.free_symbols and p.is_polynomial(*variables)):
            a, b, c = (guarded.Poly(p, x).coeff_monomial(x**n) for n in (2, 1, 0))
            if a == 0 or a.free_symbols & set(variables) or guarded.degree(p, x) != 2:
                continue
            # 4 a p = (2 a x + b)**2 + (4 a c - b**2)
            v = _square_root(guarded.expand(4 * a * c - b**2), variables)
            if v is not None:
                # Both without their common factor, with plain signs.
                u = guarded.expand(2 * a * x + b)
                common = guarded.gcd(v, u)
                parts = [guarded.cancel(e / common) for e in (v, u)]
                plain = (guarded.expand(-e if e.could_extract_minus_sign() else e) for e in parts)
                found.append(sympy.atan2(*plain))
                break
    return found


def _square_root(square: sympy.Expr, variables: Sequence[sympy.Symbol]) -> sympy.Expr | None:
    """v with v**2 = square, polynomial in the variables and not constant, or None."""
    constant, parts = guarded.factor_list(square)
    moving = set(variables)
    if not square.free_symbols & moving or any(n % 2 for f, n in parts if f.free_symbols & moving):
        return None
    for f, n in parts:
        constant *= 1 if f.free_symbols & moving else f**n
    if constant.is_negative:
        return None
    root = sympy.sqrt(constant).replace(sympy.Abs, lambda u: u)
    return root * sympy.Mul(*(f ** (n // 2) for f, n in parts if f.free_symbols & moving))


def multipliers(frame: frames.KernelFrame, letters: combinations.Alphabet) -> list[sympy.Expr]:
    """Inverse multipliers V: polynomials in the letters over the common denominator of the frame.

    Raises what the normal form raises, and `sampling.NoSampleError`.
    """
    below = denominator(e for row in frame.solved for e in row)
    weights = [d + r / below for d, r in zip(frame.divergences(), frame.rates(below), strict=True)]
    constants = combinations.constants_of(frame)

    def defects(w: sympy.Expr) -> list[sympy.Expr]:
        return [r - k * w for r, k in zip(frame.rates(w), weights, strict=True)]

    for degree in _DEGREES:
        if not letters.largest(degree):
            break
        chosen = [(), *letters.monomials(degree)]
        functions = letters.products(chosen)
        field = combinations.CombinationField(frame, weights, len(chosen))
        weight = np.array([field.sample.of(w) for w in weights])
        numbers = field.monomials(letters, chosen, weight)
        found = []
        for vector in combinations.null_vectors(numbers)[:4]:
            w = combinations.exact(vector, functions, defects, constants)
            if w is not None:
                found.append(w / below)
        if found:
            return found
    return []


def surfaces_of(functions: Iterable[sympy.Expr], variables: Sequence[sympy.Symbol]) -> list[sympy.Expr]:
    """Irreducible factors of rational functions, those that hold variables."""
    found: list[sympy.Expr] = []
    for e in functions:
        if e.atoms(sympy.log, sympy.atan2):
            continue
        try:
            for part in sympy.fraction(guarded.together(e)):
                found += [f for f, _ in guarded.factor_list(part)[1]]
        except SympyFailure:
            continue
    moving = set(variables)
    return [f for f in dict.fromkeys(found) if f.free_symbols & moving and not isinstance(f, sympy.exp)]
