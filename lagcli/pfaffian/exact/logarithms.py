"""Logarithms of products of powers of each other: log(x y) is log(x) + log(y) where all three have values."""

from __future__ import annotations

from collections.abc import Iterable

import sympy

from lagcli.pfaffian.exact import guarded

# Longer arguments, and more of them, are not factored.
MAX_OPERATIONS, MAX_LOGARITHMS = 40, 12


def dependent(arguments: Iterable[sympy.Expr]) -> dict[sympy.Expr, sympy.Expr]:
    """The logarithms of arguments that are products of powers of simpler ones, and of a positive rational number.

    Arguments of logarithms are positive where these have values, so that there the sums are the same.
    """
    listed = sorted(set(arguments), key=lambda a: (a.count_ops(), str(a)))
    if not 2 <= len(listed) <= MAX_LOGARITHMS or any(a.count_ops() > MAX_OPERATIONS for a in listed):
        return {}
    powers, numbers = zip(*(_factored(a) for a in listed), strict=True)
    columns = sorted(set().union(*powers), key=str)
    table = [[own.get(f, 0) for f in columns] for own in powers]
    kept: list[int] = []
    found = {}
    for k, row in enumerate(table):
        weights = _weights([table[i] for i in kept], row)
        if weights is None:
            kept.append(k)
            continue
        rest = numbers[k] / sympy.Mul(*(numbers[i] ** w for i, w in zip(kept, weights, strict=True)))
        if rest.is_Rational and rest.is_positive:
            terms = (w * sympy.log(listed[i]) for i, w in zip(kept, weights, strict=True))
            found[listed[k]] = sympy.Add(sympy.log(rest), *terms)
    return found


def _factored(argument: sympy.Expr) -> tuple[dict[sympy.Expr, int], sympy.Rational]:
    """The irreducible factors with their powers, and the number before them."""
    found: dict[sympy.Expr, int] = {}
    number = sympy.Integer(1)
    for part, sign in zip(sympy.fraction(guarded.together(argument)), (1, -1), strict=True):
        constant, factors = guarded.factor_list(part)
        number *= constant**sign
        for f, n in factors:
            found[f] = found.get(f, 0) + sign * n
    return found, number


def _weights(rows: list[list[int]], row: list[int]) -> list[sympy.Rational] | None:
    """w with sum_i w_i rows_i = row, or None; the rows are independent."""
    if not rows:
        return None
    A = sympy.Matrix(rows).T
    w = guarded.call((A.T * A).inv) * A.T * sympy.Matrix(row)
    return list(w) if A * w == sympy.Matrix(row) else None
