"""The partial derivative of an expression, without SymPy's detours where it is plain arithmetic."""

from __future__ import annotations

import functools

import sympy

# From so many terms on they are looked up by the symbols in them.
MANY = 12


def slope(value: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """dvalue/dx, x a symbol."""
    if value == x:
        return sympy.Integer(1)
    if not value.args or (not value.is_Add and x not in value.free_symbols):
        return sympy.Integer(0)
    if value.is_Add:
        terms = value.args if len(value.args) < MANY else _terms(value).get(x, ())
        return sympy.Add(*(slope(term, x) for term in terms))
    if value.is_Mul:
        terms = []
        for place, factor in enumerate(value.args):
            inner = slope(factor, x)
            if inner != 0:
                terms.append(sympy.Mul(*value.args[:place], inner, *value.args[place + 1 :]))
        return sympy.Add(*terms)
    if value.is_Pow and x not in value.exp.free_symbols:
        return value.exp * value.base ** (value.exp - 1) * slope(value.base, x)
    return sympy.diff(value, x)


@functools.lru_cache(maxsize=128)
def _terms(value: sympy.Expr) -> dict[sympy.Expr, list[sympy.Expr]]:
    """The terms of a long sum by the symbols they hold: it is differentiated by each of them."""
    found: dict[sympy.Expr, list[sympy.Expr]] = {}
    for term in value.args:
        for symbol in term.free_symbols:
            found.setdefault(symbol, []).append(term)
    return found
