"""Expressions of SymPy as operations by their names in a `Program`, for any arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import TypeVar

import sympy

from lagcli.pfaffian.forms import notation

T = TypeVar("T")
_SEVERAL = {sympy.Add: "add", sympy.Mul: "mul", sympy.Min: "fmin", sympy.Max: "fmax"}


def folded(
    e: sympy.Basic,
    leaf: Callable[[sympy.Basic], T],
    result: Callable[..., T],
    known: dict[sympy.Basic, T],
) -> T:
    """Found for an expression from what is found for its symbols and numbers, operands before results.

    known: what was found before, which grows; a function that the language does not have goes by its name in SymPy.
    """
    if e in known:
        return known[e]
    if not e.args:
        found = leaf(e)
    elif isinstance(e, sympy.Pow) and e.exp == sympy.Rational(1, 2):
        found = result("sqrt", folded(e.base, leaf, result, known))
    else:
        parts = [folded(part, leaf, result, known) for part in e.args]
        if type(e) in _SEVERAL:
            found = reduce(lambda a, b: result(_SEVERAL[type(e)], a, b), parts)
        elif isinstance(e, sympy.Pow):
            found = result("pow", *parts)
        else:
            row = notation.ROWS.get(type(e))
            found = result(e.func.__name__ if row is None else row.operation or row.name, *parts)
    known[e] = found
    return found
