"""Coordinates that a holonomic row gives as a function of the others are eliminated from a Pfaffian system.

f = c x + g = 0, where c is a constant and g does not hold x, is the graph x = -g/c: there the forms are forms in one
coordinate less, d(x) = -d(g)/c. On what is left of the surface an ellipse has an angle, and arguments of functions may
be constant.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations

import sympy

from lagcli import doubles
from lagcli.pfaffian.exact import guarded, time_limit, zero_test
from lagcli.pfaffian.forms import form as forms

Substitutions = dict[sympy.Symbol, sympy.Expr]

TIME = "t"
"""The name of time, which is never eliminated."""
_BUDGET = 20_000  # operations for the proof that a constant is not zero


def eliminated(
    block: forms.PfaffianBlock, parameters: Mapping[sympy.Symbol, sympy.Expr] | None = None
) -> tuple[forms.PfaffianBlock, Substitutions]:
    """The block on the graph of every f of the surface that is linear in a coordinate other than time, with a constant
    coefficient, and the values of the coordinates that are gone. The other f stay where they do not vanish there."""
    pending: dict[int, sympy.Expr] = dict(enumerate(block.surface))
    indices = {x: n for n, x in enumerate(block.variables)}
    holding: dict[sympy.Symbol, set[int]] = {}
    for n, f in pending.items():
        for x in f.free_symbols:
            holding.setdefault(x, set()).add(n)
    # The coordinates are solved for one after the other.
    steps: list[tuple[sympy.Symbol, sympy.Expr]] = []
    waiting = sorted(pending)
    while waiting:
        changed: set[int] = set()
        for n in waiting:
            found = _solution(pending[n], indices, parameters or {}) if n in pending else None
            if found is None:
                continue
            del pending[n]
            steps.append(found)
            x, value = found
            for other in sorted(holding.get(x, set()) & pending.keys()):
                pending[other] = _substituted(pending[other], {x: value})
                changed.add(other)
                for y in pending[other].free_symbols:
                    holding.setdefault(y, set()).add(other)
        waiting = sorted(changed & pending.keys())
    surface = [f for f in pending.values() if f != 0]
    if not steps:
        return dataclasses.replace(block, surface=tuple(surface)), {}
    values: Substitutions = {}
    for x, value in reversed(steps):  # a value holds coordinates that were eliminated after it
        values[x] = _substituted(value, values)
    remaining = tuple(x for x in block.variables if x not in values)
    rows = tuple(pulled_back(block.variables, row, values, remaining) for row in block.rows)
    left = tuple(_substituted(f, values) for f in surface)
    return dataclasses.replace(block, variables=remaining, rows=rows, surface=left), values


def pulled_back(
    variables: Sequence[sympy.Symbol],
    coefficients: Sequence[sympy.Expr],
    values: Mapping[sympy.Symbol, sympy.Expr],
    remaining: Sequence[sympy.Symbol],
) -> tuple[sympy.Expr, ...]:
    """The coefficients of the form sum_k coefficients[k] d(variables[k]) (n,) for the variables `remaining`, of which
    the others are functions, `values`."""
    total = dict.fromkeys(remaining, sympy.Integer(0))
    for x, a in zip(variables, coefficients, strict=True):
        if a == 0:
            continue
        coefficient = _substituted(a, values)
        if x not in values:
            total[x] += coefficient
            continue
        for y in values[x].free_symbols & total.keys():
            total[y] += coefficient * forms.partial(values[x], y)
    return tuple(_expanded(a) for a in total.values())


def _solution(
    f: sympy.Expr, indices: Mapping[sympy.Symbol, int], parameters: Mapping[sympy.Symbol, sympy.Expr]
) -> tuple[sympy.Symbol, sympy.Expr] | None:
    """(x, value) with f = 0 exactly where x = value, the shortest there is, or None; `indices`: of the coordinates."""
    # The constant coefficients of the coordinates in the linear terms of f, and the coordinates in the others
    slopes: dict[sympy.Symbol, sympy.Expr] = {}
    coupled: set[sympy.Symbol] = set()
    for term in sympy.Add.make_args(_expanded(f)):
        occurring = {x for x in term.free_symbols if x in indices}
        plain = [x for x in sympy.Mul.make_args(term) if x in occurring]
        rest = term / plain[0] if len(plain) == 1 and len(occurring) == 1 else term
        if rest.free_symbols & occurring:
            coupled |= occurring
        elif plain:
            slopes[plain[0]] = slopes.get(plain[0], sympy.Integer(0)) + rest
    candidates = []
    for x, slope in slopes.items():
        if x in coupled or x.name == TIME:
            continue
        if not slope.is_Rational:
            number = slope.xreplace(dict(parameters)).evalf()
            if number.is_number and abs(number) <= doubles.VALUE:
                continue
            finding = time_limit.answer(math.inf, partial(zero_test.is_zero, slope, math.inf), _BUDGET)
            if finding is None or finding.truth is not False:
                continue
        elif slope == 0:
            continue
        value = _expanded((slope * x - f) / slope)
        # A slope that is a number vanishes for no value of the parameters.
        candidates.append((not slope.is_Rational, value.count_ops(), -indices[x], x, value))
    return min(candidates, key=lambda c: c[:3])[3:] if candidates else None


def _substituted(expression: sympy.Expr, values: Mapping[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """The expression with the values put in, multiplied out."""
    replaced = {x: values[x] for x in expression.free_symbols if x in values}
    return _expanded(expression.xreplace(replaced)) if replaced else expression


def _expanded(expression: sympy.Expr) -> sympy.Expr:
    """Products of sums multiplied out, functions and roots left as they are."""
    return guarded.expand(expression, power_base=False, power_exp=False, log=False)


def in_angles(block: forms.PfaffianBlock) -> tuple[forms.PfaffianBlock, Substitutions]:
    """The block with an angle instead of two coordinates on every ellipse ((x - a)/A)**2 + ((y - b)/B)**2 = 1 with x
    and y that no other f holds: x = a + A cos(u), y = b + B sin(u), A and B constant. The second result gives the
    angles, their sines and their cosines in the coordinates of the block.
    """
    back: Substitutions = {}
    while (found := _own_ellipse(block)) is not None:
        f, (x, y), (u, v), (A, B) = found
        angle = sympy.Symbol(f"angle_{x}_{y}", real=True)
        values = {
            x: guarded.expand(x - u + A * sympy.cos(angle)),
            y: guarded.expand(y - v + B * sympy.sin(angle)),
        }
        remaining = [z for z in block.variables if z not in (x, y)]
        remaining.insert(len(remaining) - any(z.name == TIME for z in remaining), angle)
        rows = tuple(pulled_back(block.variables, row, values, remaining) for row in block.rows)
        left = tuple(g for g in block.surface if g is not f)
        block = dataclasses.replace(block, variables=tuple(remaining), rows=rows, surface=left)
        scale = guarded.gcd(A, B)  # of whatever sign: it turns the angle by pi
        across = sympy.atan2(v * guarded.cancel(A / scale), u * guarded.cancel(B / scale))
        back |= {sympy.cos(angle): u / A, sympy.sin(angle): v / B, angle: across}
    return block, back


Pair = tuple[sympy.Expr, sympy.Expr]


def _own_ellipse(block: forms.PfaffianBlock) -> tuple[sympy.Expr, Pair, Pair, Pair] | None:
    """(f, (x, y), (u, v), (A, B)) with f = k ((u/A)**2 + (v/B)**2 - 1), u = x - a and v = y - b."""

    def root(square: sympy.Expr) -> sympy.Expr | None:
        """One of the two square roots, if it is known to be real and not zero."""
        found = sympy.sqrt(square).replace(sympy.Abs, lambda length: length)
        known = not any(p.base.free_symbols and not p.exp.is_Integer for p in found.atoms(sympy.Pow))
        return found if known and square != 0 and not found.has(sympy.I) else None

    moving = set(block.variables)
    for f in block.surface:
        taken = {s for g in block.surface if g is not f for s in g.free_symbols}
        occurring = [x for x in block.variables if x in f.free_symbols and x.name != TIME and x not in taken]
        if not f.is_polynomial(*(moving & f.free_symbols)):
            continue
        for x, y in combinations(occurring, 2):
            slopes = sympy.diff(f, x, 2) / 2, sympy.diff(f, y, 2) / 2
            if any(s == 0 or s.free_symbols & moving for s in slopes) or sympy.diff(f, x, y) != 0:
                continue
            u, v = (guarded.expand(sympy.diff(f, z) / (2 * s)) for z, s in zip((x, y), slopes, strict=True))
            size = guarded.expand(slopes[0] * u**2 + slopes[1] * v**2 - f)
            A, B = (root(guarded.cancel(size / s)) for s in slopes)
            if A is not None and B is not None and not size.free_symbols & moving:
                return f, (x, y), (u, v), (A, B)
    return None


def with_constant_arguments(block: forms.PfaffianBlock) -> forms.PfaffianBlock:
    """The block with the arguments in its rows that are constant on the polynomial part of its surface replaced, as
    x**2 + y**2 by 1: to `normal_form` a function is a letter of its own, whatever the surface says of its argument."""
    polynomials = [f for f in block.surface if f.is_polynomial(*block.variables)]
    moving = {x for f in polynomials for x in f.free_symbols & set(block.variables)}
    if not moving or not any(a.has(sympy.Function, sympy.Pow) for row in block.rows for a in row):
        return block
    variables = [x for x in block.variables if x in moving]
    known: dict[sympy.Expr, sympy.Expr] = {}
    ideal: list[sympy.GroebnerBasis] = []

    def constant(u: sympy.Expr) -> sympy.Expr:
        """The argument, or what it is on the whole surface."""
        if not u.free_symbols & moving or not u.is_polynomial(*variables):
            return u
        if u not in known:
            try:
                if not ideal:
                    ideal.append(guarded.groebner(polynomials, *variables, order="grevlex"))
                rest = guarded.call(ideal[0].reduce, guarded.expand(u))[1]
            except guarded.SympyFailure:  # roots of parameters that are no field of constants
                rest = u
            known[u] = u if rest.free_symbols & moving else guarded.expand(rest)
        return known[u]

    def replaced(e: sympy.Expr) -> sympy.Expr:
        if not e.args or not e.free_symbols & moving:
            return e
        is_inner = isinstance(e, sympy.Function) or (e.is_Pow and not e.exp.is_Integer)
        parts = [constant(replaced(a)) if is_inner else replaced(a) for a in e.args]
        return e if tuple(parts) == e.args else e.func(*parts)

    return dataclasses.replace(block, rows=tuple(tuple(map(replaced, row)) for row in block.rows))
