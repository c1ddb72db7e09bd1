"""Vector fields that annihilate a Pfaffian system: a frame of its kernel, by elimination in the normal form.

The forms become theta_a = d(x_p) - sum_j solved[a][j] d(x_j), p the a-th pivot and j the free variables, and the
fields X_j = d/dx_j + sum_a solved[a][j] d/dx_p. For a completely integrable system the fields commute, and phi is
a first integral exactly where X_j(phi) = 0 for all j (Frobenius).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy
from sympy.polys.fields import FracElement

from lagcli.pfaffian.exact import guarded, normal_form, zero_test
from lagcli.pfaffian.forms import form as forms


@dataclass(frozen=True, slots=True)
class KernelFrame:
    """C independent forms in n variables, solved for the differentials of C of them: pivots (C,), free (n - C,):
    indices of variables; solved (C, n - C). is_sure: no divisor vanishes without being known to."""

    variables: tuple[sympy.Symbol, ...]
    parameters: tuple[sympy.Symbol, ...]
    pivots: tuple[int, ...]
    free: tuple[int, ...]
    solved: tuple[tuple[sympy.Expr, ...], ...]
    is_sure: bool

    def rates(self, phi: sympy.Expr) -> list[sympy.Expr]:
        """X_j(phi) for every free variable; shape (n - C,)."""
        slopes = [forms.partial(phi, self.variables[p]) for p in self.pivots]
        found = []
        for column, j in enumerate(self.free):
            terms = (row[column] * s for row, s in zip(self.solved, slopes, strict=True))
            found.append(sum(terms, forms.partial(phi, self.variables[j])))
        return found

    def row(self, a: int) -> tuple[sympy.Expr, ...]:
        """The coefficients (n,) of theta_a."""
        entries = [sympy.Integer(0)] * len(self.variables)
        entries[self.pivots[a]] = sympy.Integer(1)
        for j, value in zip(self.free, self.solved[a], strict=True):
            entries[j] = -value
        return tuple(entries)


def of(
    rows: Sequence[Sequence[sympy.Expr]],
    variables: tuple[sympy.Symbol, ...],
    parameters: tuple[sympy.Symbol, ...],
    last: Sequence[sympy.Symbol] = (),
) -> KernelFrame:
    """The frame of the rows (C, n) that do not depend on the others; variables `last` become pivots only where no other
    can. Raises `NoAnswerError`."""

    def size(element: FracElement) -> int:
        return len(element.numer.terms()) + len(element.denom.terms()) + sum(map(sum, element.numer.monoms()))

    basis = normal_form.NormalForm([a for row in rows for a in row])
    table = [[basis.element(a) for a in row] for row in rows]
    waiting = list(range(len(rows)))
    pivots: list[int] = []
    done: list[int] = []
    while waiting:
        choices = [
            (variables[k] in last, size(table[i][k]), -k, i, k)
            for i in waiting
            for k in range(len(variables))
            if k not in pivots and table[i][k] != 0
        ]
        if not choices:
            break
        *_, i, k = min(choices, key=lambda c: c[:4])
        waiting.remove(i)
        table[i] = [basis.reduced(a / table[i][k]) if a else a for a in table[i]]
        for other in (*waiting, *done):
            head = table[other][k]
            if head != 0:
                pairs = zip(table[other], table[i], strict=True)
                table[other] = [basis.reduced(a - head * b) if b else a for a, b in pairs]
        pivots.append(k)
        done.append(i)
    free = tuple(k for k in range(len(variables)) if k not in pivots)
    order = sorted(range(len(pivots)), key=lambda a: pivots[a])
    solved = tuple(tuple(basis.expression(-table[done[a]][k]) for k in free) for a in order)
    return KernelFrame(
        variables, parameters, tuple(pivots[a] for a in order), free, solved, basis.independent
    )


def belongs(
    frame: KernelFrame,
    rows: Sequence[Sequence[sympy.Expr]],
    deadline: float,
    surface: tuple[sympy.Expr, ...] = (),
) -> bool:
    """True if it is proved that the frame is that of the rows: every row annihilates its fields, and the rows have its
    rank, on the surface too."""
    size = len(frame.pivots)
    if size == 0:
        return False
    for row in () if frame.is_sure else rows:
        for column, j in enumerate(frame.free):
            terms = (row[p] * s[column] for p, s in zip(frame.pivots, frame.solved, strict=True))
            if zero_test.is_zero(sum(terms, row[j]), deadline).truth is not zero_test.Truth.YES:
                return False
    if frame.is_sure and not surface:
        return True
    matrix = [[row[p] for p in frame.pivots] for row in rows]
    return has_rank(matrix, size, deadline, surface)


def has_rank(
    matrix: Sequence[Sequence[sympy.Expr]], size: int, deadline: float, surface: tuple[sympy.Expr, ...] = ()
) -> bool:
    """True if the matrix with `size` rows or columns is proved to have that rank at generic points of the surface."""
    chosen = sympy.Matrix([list(row) for row in matrix])
    if not chosen.rows == chosen.cols == size:
        # Its determinant is the sum of the squares of all minors (Cauchy, Binet).
        chosen = chosen * chosen.T if chosen.rows == size else chosen.T * chosen
        if chosen.rows != size:
            return False
    determinant = guarded.call(chosen.det, method="berkowitz")
    return zero_test.is_zero(determinant, deadline, surface).truth is zero_test.Truth.NO
