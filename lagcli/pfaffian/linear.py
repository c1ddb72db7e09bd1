"""Linear systems over the constants: which constant combinations of given columns of functions vanish
identically.
"""

from collections.abc import Sequence
from functools import reduce
from typing import Any

import sympy
from sympy.polys.matrices import DomainMatrix

from lagcli.pfaffian import tower

Columns = Sequence[Sequence[sympy.Expr]]


def null_vectors(columns: Columns, parameters: frozenset[sympy.Symbol]) -> list[tuple[sympy.Expr, ...]]:
    """A basis of the constants c (rational functions of the parameters) with sum_l c_l columns[l][e] = 0 for
    all e.

    Found by comparing coefficients in the normal form. The last entry of a vector that is not zero is 1.
    Raises `tower.NoNormalFormError`.
    """
    basis = tower.Tower([entry for column in columns for entry in column])
    table = [tower.elements(basis, column) for column in columns]
    fixed = tuple(g for g in basis.letters if _meaning(basis, g).free_symbols <= parameters)
    rows: list[list[Any]] = []
    for equation in zip(*table, strict=True):
        rows += _coefficient_rows(basis, equation, fixed)
    domain = sympy.QQ.frac_field(*fixed) if fixed else sympy.QQ
    if not rows:
        size = len(columns)
        return [tuple(sympy.Integer(int(i == j)) for j in range(size)) for i in range(size)]
    entries = [[domain.from_sympy(sympy.sympify(c)) for c in row] for row in rows]
    vectors = DomainMatrix(entries, (len(rows), len(columns)), domain).to_sparse().nullspace().to_Matrix()
    return [_scaled([basis.spoken(c) for c in vectors.row(n)]) for n in range(vectors.rows)]


def _scaled(vector: list[sympy.Expr]) -> tuple[sympy.Expr, ...]:
    last = next(c for c in reversed(vector) if c != 0)
    return tuple(sympy.cancel(c / last) for c in vector)


def _meaning(basis: tower.Tower, letter: sympy.Symbol) -> sympy.Expr:
    return basis.meaning.get(letter, letter)


def _coefficient_rows(
    basis: tower.Tower, equation: Sequence[Any], fixed: tuple[sympy.Symbol, ...]
) -> list[list[Any]]:
    """One row for each monomial in the letters that are not constant; entries are expressions in `fixed`."""
    below = reduce(lambda a, b: a.lcm(b), (e.denom for e in equation), basis.ring.one)
    above = [basis.remainder(e.numer * below.exquo(e.denom)) for e in equation]
    constant = [g in fixed for g in basis.letters]
    rows: dict[tuple[int, ...], list[Any]] = {}
    for column, polynomial in enumerate(above):
        for powers, number in polynomial.terms():
            key = tuple(0 if c else p for p, c in zip(powers, constant, strict=True))
            factor = sympy.QQ.to_sympy(number)
            for g, p, c in zip(basis.letters, powers, constant, strict=True):
                factor = factor * g**p if c and p else factor
            row = rows.setdefault(key, [sympy.Integer(0)] * len(equation))
            row[column] = row[column] + factor
    return list(rows.values())
