"""M^-1 and S^-1 = (B M^-1 B^T)^-1 by sparse L D L^T factors, written out operation by operation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

Solve = Callable[[Any], Any]


def solver(matrix: Any) -> Solve:
    """x -> matrix^-1 x for a symmetric positive definite matrix, by its sparse factors."""
    n = matrix.shape[0]
    if n == 0:
        return lambda right: right
    if matrix.sparsity().is_diag():
        inverse = ca.diag(1 / ca.diag(matrix))
        return lambda right: ca.mtimes(inverse, right)
    D, LT, order = ca.ldl(matrix)
    return lambda right: ca.ldl_solve(right, D, LT, order)


@dataclasses.dataclass(frozen=True, slots=True)
class Factors:
    """The solvers of M and of S = B M^-1 B^T."""

    inertia: Solve
    schur: Solve


def factors(M: Any, B: Any) -> Factors:
    """The solvers for given M (n, n) and B (C, n)."""
    solve_M = solver(M)
    return Factors(solve_M, solver(B @ solve_M(B.T)))


def operations(M: Any, B: Any) -> float:
    """Multiplications that one factorization of S takes, counted from its fill."""
    S = B @ solver(M)(B.T) if not M.sparsity().is_diag() else B @ B.T
    pattern = S.sparsity()
    if pattern.size1() == 0:
        return 0.0
    LT, _ = pattern.ldl()
    # Row k of L has as many entries as column k of L^T; eliminating it touches their pairs.
    entries = np.diff(np.asarray(LT.T.colind(), dtype=float))
    return float(np.sum((entries + 1) ** 2))
