"""A Pfaffian form omega = sum_k A_k dx_k in real symbols, the left side of one differential constraint (D.2), with its
derivatives away from kinks; and a block of them, with the holonomic rows they meet (D.6 as forms)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import reduce
from itertools import combinations
from typing import TypeVar, cast

import sympy

from lagcli import memory

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Form:
    """omega = sum_k coefficients[k] d(variables[k]); both of shape (n,).

    variables: coordinates, and time last where it occurs; parameters: constants of unknown value.
    """

    name: str
    variables: tuple[sympy.Symbol, ...]
    coefficients: tuple[sympy.Expr, ...]
    parameters: tuple[sympy.Symbol, ...] = ()

    def active(self) -> tuple[int, ...]:
        """Indices of the variables that have a coefficient or occur in one."""
        used: set[sympy.Basic] = set().union(*(a.free_symbols for a in self.coefficients))
        return tuple(i for i, x in enumerate(self.variables) if x in used or self.coefficients[i] != 0)

    @property
    def simplest(self) -> int:
        """The index of the simplest coefficient that is not zero."""
        candidates = [i for i, a in enumerate(self.coefficients) if a != 0]
        return min(candidates, key=lambda i: (self.coefficients[i].count_ops(), i))

    def with_values(self, values: Mapping[sympy.Symbol, sympy.Expr]) -> Form:
        return Form(self.name, self.variables, tuple(a.xreplace(values) for a in self.coefficients))

    def curl(self, i: int, j: int) -> sympy.Expr:
        """The component (d omega)_ij = dA_j/dx_i - dA_i/dx_j, not simplified."""
        x, a = self.variables, self.coefficients
        return partial(a[j], x[i]) - partial(a[i], x[j])

    def curls(self) -> Iterator[sympy.Expr]:
        """The components of d omega for i < j, one after the other."""
        return (self.curl(i, j) for i, j in combinations(range(len(self.variables)), 2))

    def wedge(self) -> dict[tuple[int, int, int], sympy.Expr]:
        """All components (omega ^ d omega)_ijk for i < j < k, not simplified."""
        triples = combinations(range(len(self.variables)), 3)
        return {(i, j, k): self.wedge_component(i, j, k) for i, j, k in triples}

    def wedge_component(self, i: int, j: int, k: int) -> sympy.Expr:
        """A_i (d omega)_jk + A_j (d omega)_ki + A_k (d omega)_ij; alternating in i, j, k."""
        a = self.coefficients
        return a[i] * self.curl(j, k) + a[j] * self.curl(k, i) + a[k] * self.curl(i, j)


@dataclass(frozen=True, slots=True)
class PfaffianBlock:
    """C forms omega_i = sum_k rows[i][k] d(variables[k]) on the surface where every f of `surface` vanishes.

    names (C,): of the forms; variables (n,), parameters: as of a form; surface (s,): of the holonomic rows. Forms that
    share no coordinate, directly or through holonomic rows, are classified apart: their derived flags add up.
    """

    names: tuple[str, ...]
    variables: tuple[sympy.Symbol, ...]
    rows: tuple[tuple[sympy.Expr, ...], ...]
    parameters: tuple[sympy.Symbol, ...] = ()
    surface: tuple[sympy.Expr, ...] = ()

    @property
    def has_kinks(self) -> bool:
        """True if |u| occurs, as it does in plain rows for min, max and sign too."""
        return any(has_kinks(a) for row in (*self.rows, self.surface) for a in row)

    def form(self, i: int) -> Form:
        return Form(self.names[i], self.variables, self.rows[i], self.parameters)

    def with_values(self, values: Mapping[sympy.Symbol, sympy.Expr]) -> PfaffianBlock:
        rows = tuple(tuple(a.xreplace(values) for a in row) for row in self.rows)
        surface = tuple(f.xreplace(values) for f in self.surface)
        return PfaffianBlock(self.names, self.variables, rows, (), surface)


@memory.remembered(4096)
def partial(expression: sympy.Expr, x: sympy.Symbol) -> sympy.Expr:
    """The partial derivative away from kinks: d|u| = |u|/u du."""
    derivative = sympy.diff(expression, x)
    if derivative.has(sympy.sign, sympy.DiracDelta):
        derivative = derivative.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))
        derivative = derivative.replace(sympy.sign, lambda u: sympy.Abs(u) / u)
    return derivative


def in_symbols(value: T, symbols: Mapping[sympy.Symbol | str, sympy.Symbol | str]) -> T:
    """What is made of expressions, names, rows of them and such objects, with other symbols and names in place of its
    own."""

    def renamed(part: object) -> object:
        if isinstance(part, sympy.Basic):
            return part.xreplace(symbols)
        if isinstance(part, tuple):
            return tuple(map(renamed, part))
        if isinstance(part, dict):
            return {renamed(key): renamed(one) for key, one in part.items()}
        if is_dataclass(part) and not isinstance(part, type):
            return replace(part, **{each.name: renamed(getattr(part, each.name)) for each in fields(part)})
        return symbols.get(part, part) if isinstance(part, str) else part

    return cast("T", renamed(value))


def has_kinks(expression: sympy.Expr) -> bool:
    """True if |u| occurs in a plain expression."""
    return bool(expression.has(sympy.Abs))


def plain(coefficient: sympy.Expr) -> sympy.Expr:
    """Rational numbers, min, max and sign in terms of |u|, |u v| as |u| |v|, roots of roots made single."""

    def is_nested(e: sympy.Basic) -> bool:
        return bool(e.is_Pow and e.exp == sympy.Rational(1, 2) and e.base.is_number and e.base.has(sympy.Pow))

    if coefficient.has(sympy.Float):
        coefficient = sympy.nsimplify(coefficient, rational=True)
    if coefficient.has(sympy.Min, sympy.Max):
        coefficient = coefficient.replace(
            sympy.Min, lambda *u: reduce(lambda a, b: (a + b - sympy.Abs(a - b)) / 2, u)
        )
        coefficient = coefficient.replace(
            sympy.Max, lambda *u: reduce(lambda a, b: (a + b + sympy.Abs(a - b)) / 2, u)
        )
    coefficient = coefficient.replace(sympy.sign, lambda u: sympy.Abs(u) / u)
    coefficient = coefficient.replace(sympy.Abs, lambda u: sympy.Mul(*map(sympy.Abs, sympy.Mul.make_args(u))))
    return coefficient.replace(is_nested, sympy.sqrtdenest)


def moduli(rows: Sequence[Sequence[sympy.Expr]]) -> list[sympy.Abs]:
    """All |u| in the rows, in an order of their own."""
    return sorted({m for row in rows for e in row for m in e.atoms(sympy.Abs)}, key=str)


def kink_sides(
    rows: Sequence[Sequence[sympy.Expr]], kinks: Sequence[sympy.Abs]
) -> list[list[list[sympy.Expr]]]:
    """The rows with u and with -u for each |u| of some: y + |y| is constant where y < 0."""
    sides = [[list(row) for row in rows]]
    for modulus in kinks:
        signed = [{modulus: sign * modulus.args[0]} for sign in (1, -1)]
        sides = [[[e.xreplace(u) for e in row] for row in side] for side in sides for u in signed]
    return sides
