"""The freedoms that rows leave, and the linear equations in them.

With Z a basis of ker B, dq = Z x, and N one of ker A Z:  x' = N w - G x,  G = (A Z)^+ D Z,  and Z^T (M dq'' + C dq' +
K dq) = 0 along N. Z is orthonormal in the metric of M, and N in the plain one, so that N^T Z^T M Z N = 1.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.linear import decompositions, rank
from lagcli.linearization.linearized import Linear

Floats = npt.NDArray[np.float64]

# Rows that are dependent, and their rates: what is left of them, as a part of their size.
HIDDEN = 1e-8
# Of the terms of an entry of K, in what is left of them.
STIFFNESS_ROUNDOFF = 2e-13


class NoFreedomsError(Exception):
    """Rows that do not tell the deviations they leave: a sentence why."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Freedoms:
    """The linear equations in free coordinates x (m,) and speeds w (k,): x' = N w - G x and

        w' = -K_N x - C_N x',    K_N = N^T K, C_N = N^T (C - G)

    Z (n, m): dq = Z x; the first `cyclic` of x occur nowhere: their columns in K and G are exactly zero. noise: squares
    of frequencies that rounding of the forces makes.
    """

    Z: Floats
    N: Floats
    G: Floats
    K: Floats
    C: Floats
    cyclic: int
    noise: float

    @property
    def is_holonomic(self) -> bool:
        """True if no differential row is left."""
        return bool(self.N.shape[0] == self.N.shape[1])

    @property
    def state_count(self) -> int:
        """The number of eigenvalues, m + k."""
        return sum(self.N.shape)

    def state_matrix(self) -> tuple[Floats, float]:
        """The matrix of (x, w / rate) without the cyclic x, and that rate, a size of eigenvalues."""
        N, G, c = self.N, self.G, self.cyclic
        along = N.T @ (self.C - G) if G.size else N.T @ self.C
        stiffness = N.T @ self.K - along @ G
        damping = along @ N
        size = max(float(np.sqrt(np.linalg.norm(stiffness, 2))) if stiffness.size else 0.0, 0.0)
        rate = max(size, float(np.linalg.norm(damping, 2)) if damping.size else 0.0) or 1.0
        top = np.hstack([-G[c:, c:], rate * N[c:]])
        return np.vstack([top, np.hstack([-stiffness[:, c:] / rate, -damping])]), rate

    def shapes(
        self, values: npt.NDArray[np.complex128], states: npt.NDArray[np.complex128]
    ) -> npt.NDArray[np.complex128]:
        """dq (n, j) of eigenvectors (., j) of `state_matrix` with their values, none of which is zero."""
        c, (m, _) = self.cyclic, self.N.shape
        x, w = states[: m - c], states[m - c :]
        _, rate = self.state_matrix()
        missing = (rate * self.N[:c] @ w - self.G[:c, c:] @ x) / values if c else np.zeros((0, x.shape[1]))
        return np.asarray(self.Z @ np.vstack([missing, x]))


def find(linear: Linear, terms: Floats) -> Freedoms:
    """The free coordinates of linear equations; terms (n, n): the sizes of what the entries of K are sums of.

    Raises `NoFreedomsError`.
    """
    M, C, K, B, A, D = (
        part.toarray() for part in (linear.M, linear.C, linear.K, linear.B, linear.A, linear.D)
    )
    L = np.linalg.cholesky((M + M.T) / 2)
    # In y = L^T dq the metric is the plain one.
    white = np.linalg.solve(L, B.T).T
    first = _cyclic_basis(linear.cyclic, B, L)
    rest = _decided(np.vstack([decompositions.unit(white), first.T])).kernel
    Z = np.linalg.solve(L.T, np.hstack([first, rest]))
    c = first.shape[1]
    K_Z, C_Z, A_Z, D_Z = Z.T @ K @ Z, Z.T @ C @ Z, A @ Z, D @ Z
    K_Z[:, :c] = 0.0
    D_Z[:, :c] = 0.0
    lengths = decompositions.lengths(np.linalg.solve(L, A.T).T)
    A_Z, D_Z = A_Z / lengths[:, None], D_Z / lengths[:, None]
    # The most that rounding of the entries of K makes of Z^T K Z
    inertia = linear.inertia[:, None]
    whitened = np.linalg.norm(terms / inertia / inertia.T, 2) if terms.size else 0.0
    noise = STIFFNESS_ROUNDOFF * float(whitened * np.linalg.norm(inertia * Z, 2) ** 2 if Z.size else 0.0)
    if np.abs(K_Z).max(initial=0.0) <= noise:
        K_Z[:] = 0.0
    rate = max(np.abs(C_Z).max(initial=0.0), np.abs(K_Z).max(initial=0.0) ** 0.5)
    N, G = _differential(A_Z, D_Z, float(rate))
    return Freedoms(Z, N, G, K_Z, C_Z, c, noise)


def _decided(rows: Floats) -> rank.RowSpace:
    """What rows of length one span. Raises `NoFreedomsError` where their rank is undecided."""
    found = rank.space(rows)
    if found.value is None:
        raise NoFreedomsError(
            "the rank of the rows is undecided there, which is too near to where they are dependent"
        )
    return found


def _differential(A: Floats, D: Floats, rate: float) -> tuple[Floats, Floats]:
    """N (m, k), the kernel of A (d, m), and G = A^+ D; rate: a size of frequencies, beside which D may be rounding."""
    m = A.shape[1]
    if not A.shape[0]:
        return np.eye(m), np.zeros((m, m))
    found = _decided(A)
    left = found.dependences @ D
    if np.abs(left).max(initial=0.0) > HIDDEN * max(np.abs(D).max(initial=0.0), rate):
        raise NoFreedomsError(
            "the differential rows are dependent there, and hold small deviations of positions to more than they say"
        )
    # Without rows that hold it, a basis of its own would only turn the coordinates.
    return found.kernel if found.low else np.eye(m), found.step(D)


def _cyclic_basis(cyclic: npt.NDArray[np.bool_], B: Floats, L: Floats) -> Floats:
    """An orthonormal basis (n, c) of L^T dq for the dq of cyclic coordinates alone that B leaves free."""
    columns = np.flatnonzero(cyclic)
    if not columns.size:
        return np.zeros((L.shape[0], 0))
    free = rank.null_basis(decompositions.unit(B[:, columns]))
    return decompositions.orthonormal(L.T[:, columns] @ free)[0]
