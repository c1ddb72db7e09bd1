"""M^-1 and S^-1 = (B M^-1 B^T)^-1 by sparse L D L^T factors, written out operation by operation."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

Solve = Callable[[ca.SX], ca.SX]


def solver(matrix: ca.SX) -> Solve:
    """x -> matrix^-1 x for a symmetric positive definite matrix, by its sparse factors."""
    return watched(matrix)[0]


def watched(matrix: ca.SX) -> tuple[Solve, ca.SX | float]:
    """The solver as `solver` makes it, with the smallest angle: the least pivot, each as a part of its diagonal entry.

    Of a Gram matrix a pivot over its entry is the square of the sine between a row and the rows before it.
    """
    n = matrix.shape[0]
    if n == 0:
        return (lambda right: right), 1.0
    if matrix.sparsity().is_diag():
        inverse = 1 / ca.diag(matrix)
        return (lambda right: _scaled(inverse, right)), 1.0
    D, LT, order = ca.ldl(matrix)
    parts = D / ca.diag(matrix)[order]
    return (lambda right: ca.ldl_solve(right, D, LT, order)), ca.mmin(parts)


def _scaled(factors: ca.SX, right: ca.SX) -> ca.SX:
    """Each row of a matrix, times its factor."""
    if right.shape[1] == 1:
        return factors * right
    rows = np.asarray(right.sparsity().row(), dtype=np.int64)
    if not rows.size:
        return right
    each = ca.vec(factors[rows.tolist()])  # CasADi takes of a single factor a line, not a column
    return ca.SX(right.sparsity(), each * ca.vec(right.nz[:]))


def operations(S: ca.SX) -> float:
    """Multiplications that one factorization of S takes, counted from its fill."""
    pattern = S.sparsity()
    if pattern.size1() == 0:
        return 0.0
    LT, _ = pattern.ldl()
    # Row k of L has as many entries as column k of L^T; eliminating it touches their pairs.
    entries = np.diff(np.asarray(LT.T.colind(), dtype=float))
    return float(np.sum((entries + 1) ** 2))
