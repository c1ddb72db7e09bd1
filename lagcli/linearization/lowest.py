"""The lowest modes of large systems, by sparse factors.

The rows stay beside the equations: (K - s M) x + B^T mu = M y, B x = 0 is solved with one factorization for all y, and
Lanczos steps with it find the w^2 next to the shift s. How many lie below a number is counted by the signs of the
pivots of K - s M + rho B^T B (Sylvester), so that none is missed, and negative ones are known.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Complex, Floats
from lagcli.linearization.linearized import Linear
from lagcli.smoothness import sides

if TYPE_CHECKING:
    from scipy import sparse


# Shift and weights of rows, as parts of the largest K_ii / M_ii.
SHIFT, STIFF = 1e-7, 1e5
# Eigenvalues that are asked for beyond those that are wanted, and rounds in which more are asked for.
SPARE, ROUNDS = 6, 3


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Lowest:
    """Eigenvalues s with Im s >= 0 (k,) next to zero and their deviations dq (n, k); count: of all eigenvalues;
    has_all_growing: no eigenvalue to the right of the imaginary axis is missing; is_definite: all w^2 are positive;
    is_complete: each is given as often as it occurs."""

    values: Complex
    shapes: Complex
    count: int
    has_all_growing: bool
    is_definite: bool
    is_complete: bool


class NotFoundError(Exception):
    """The iterations did not converge."""


def modes(linear: Linear, wanted: int) -> Lowest:
    """The lowest modes of linear equations. Raises `NotFoundError`."""
    K, C = linear.K, linear.C
    is_symmetric = abs(K - K.T).max() <= doubles.ZERO * abs(K).max() if K.nnz else True
    if is_symmetric and not linear.A.shape[0] and (not C.nnz or not abs(C).max()):
        return _of_energy(linear, wanted)
    return _of_states(linear, wanted)


def _of_energy(linear: Linear, wanted: int) -> Lowest:
    """The lowest modes of K x = w^2 M x with B x = 0."""
    from scipy import sparse
    from scipy.sparse import linalg

    K, M, B = (linear.K + linear.K.T) / 2, linear.M, _unit(linear.B)
    n, rank = K.shape[0], _rank(B)
    size = float(np.abs(K.diagonal() / M.diagonal()).max())
    if not size:
        raise NotFoundError

    def below(mu: float) -> int:
        """The number of w^2 below mu: the negative pivots of K - mu M + rho B^T B."""
        weight = STIFF * max(size, abs(mu)) * float(M.diagonal().max())
        return int((_pivots(K - mu * M + weight * (B.T @ B)) < 0).sum())

    negative = below(-doubles.VALUE * size)
    begin = np.random.default_rng(0).standard_normal(n)
    k = min(wanted + SPARE, n - rank - 1)
    sigma = -SHIFT * size
    if negative:
        low = -size
        while below(low):
            low *= 2
        least, _ = sides.bracket(lambda mu: not below(float(mu)), low, 0.0, narrow=1e-4)
        sigma = float(least) * (1 + 1e-3) - SHIFT * size
    # y -> x of (K - sigma M) x + B^T mu = y, B x = 0
    shifted = K - sigma * M
    for loose in (0.0, doubles.SUM / float(abs(shifted).max())):
        corner = [[shifted, B.T], [B, -loose * sparse.eye(B.shape[0])]] if B.shape[0] else [[shifted]]
        try:
            factors = linalg.splu(sparse.bmat(corner).tocsc())
        except RuntimeError:  # exactly singular: rows are dependent
            continue
        break
    else:
        raise NotFoundError

    def solve(y: Floats) -> Floats:
        return np.asarray(factors.solve(np.concatenate([y.ravel(), np.zeros(B.shape[0])]))[: y.size])

    inverse = linalg.LinearOperator((n, n), matvec=solve, dtype=float)
    for _ in range(ROUNDS):
        try:
            squares, x = linalg.eigsh(K, k, M, sigma, OPinv=inverse, v0=solve(M @ begin), tol=0)
        except linalg.ArpackNoConvergence:
            raise NotFoundError from None
        order = np.argsort(squares)
        squares, x = squares[order], x[:, order]
        # Of the last ones a copy may be missing: they are left out.
        last = squares[-1] - 1e-6 * abs(squares[-1])
        found = int((squares < last).sum())
        is_complete = found > 0 and below(last) == found
        if is_complete or k == n - rank - 1:
            break
        k = min(2 * k, n - rank - 1)
    count_chosen = min(wanted, found if is_complete else squares.size)
    squares, x = squares[:count_chosen], x[:, :count_chosen]
    squares = np.where(np.abs(squares) <= doubles.VALUE * size, 0.0, squares)
    roots = np.sqrt(-squares + 0j)
    is_definite = bool((squares > 0).all()) and not negative
    return Lowest(roots, x.astype(complex), 2 * (n - rank), True, is_definite, is_complete)


def _pivots(matrix: sparse.csc_array) -> Floats:
    """The pivots (n,) of a symmetric matrix."""
    matrix = matrix.tocsc()
    matrix.sort_indices()
    rows, columns = matrix.shape
    pattern = ca.Sparsity(int(rows), int(columns), matrix.indptr.tolist(), matrix.indices.tolist())
    return np.array(ca.ldl(ca.DM(pattern, matrix.data))[0]).ravel()


def _of_states(linear: Linear, wanted: int) -> Lowest:
    """The lowest modes of (dq, dv, dlambda) with q' = v, and the rows as they are."""
    from scipy import sparse
    from scipy.sparse import linalg

    M, C, K = linear.M, linear.C, linear.K
    n = M.shape[0]
    rows, one = sparse.vstack([linear.B, linear.A]), sparse.eye(n)
    constraints = sparse.vstack([linear.B, linear.D])
    slow = sparse.vstack([sparse.csc_array(linear.B.shape), linear.A])
    size = float(np.sqrt(np.abs(K.diagonal() / M.diagonal()).max())) or 1.0
    A = sparse.bmat([[None, one, None], [-K, -C, rows.T], [constraints, slow, None]]).tocsc()
    nothing = sparse.csc_array((rows.shape[0], rows.shape[0]))
    E = sparse.block_diag([one, M, nothing]).tocsc()
    sigma = SHIFT**0.5 * size
    factors = linalg.splu((A - sigma * E).tocsc())

    def applied(x: Floats) -> Floats:
        return np.asarray(factors.solve(E @ x))

    operator = linalg.LinearOperator(A.shape, matvec=applied, dtype=float)
    begin = applied(applied(applied(np.random.default_rng(0).standard_normal(A.shape[0]))))
    try:
        inverse, states = linalg.eigs(operator, 2 * wanted + SPARE, v0=begin, tol=0)
    except linalg.ArpackNoConvergence:
        raise NotFoundError from None
    values = sigma + 1 / inverse
    values = np.where(np.abs(values) <= SHIFT * size, 0.0, values)
    values = np.where(np.abs(values.real) <= 1e-10 * size, 1j * values.imag, values)
    chosen = np.flatnonzero(values.imag >= 0)
    chosen = chosen[np.argsort(np.abs(values[chosen]), kind="stable")][:wanted]
    count = 2 * n - 2 * _rank(_unit(linear.B)) - _rank(_unit(linear.A))
    return Lowest(values[chosen], states[:n, chosen], count, False, False, False)


def _unit(rows: sparse.csc_array) -> sparse.csc_array:
    """Rows (k, n) with length one."""
    from scipy import sparse

    lengths = np.sqrt(np.asarray((rows.multiply(rows)).sum(axis=1)).ravel())
    return sparse.csc_array(sparse.diags(1 / np.where(lengths > 0, lengths, 1.0)) @ rows)


def _rank(rows: sparse.csc_array) -> int:
    """The rank of rows of length one, by the pivots of their Gram matrix."""
    if not rows.shape[0]:
        return 0
    from scipy import sparse

    return int((_pivots(rows @ rows.T + 1e-13 * sparse.eye(rows.shape[0])) > 1e-10).sum())
