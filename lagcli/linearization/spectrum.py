"""The freedoms that rows leave, and all eigenvalues and shapes of small deviations in them, by dense algebra.

With Z a basis of ker B, dq = Z x, and N one of ker A Z:  x' = N w - G x,  G = (A Z)^+ D Z,  and Z^T (M dq'' + C dq' +
K dq) = 0 along N. Z is orthonormal in the metric of M, and N in the plain one, so that N^T Z^T M Z N = 1.

Where energy is kept and nothing turns, w^2 are eigenvalues of a symmetric matrix; where a gyroscopic term is added to
a minimum, i w are those of a skew one. Else the eigenvalues are those of the state matrix; a real part that rounding
may have made is taken as none. Zeros are taken out by rank: chains at zero blur them to the root of rounding.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.arrays import Complex, Floats
from lagcli.linear import decompositions, rank
from lagcli.linearization.linearized import Linear

# Of the terms of an entry of K, in what is left of them.
STIFFNESS_ROUNDOFF = 2e-13
# The rounding of an eigenvalue is no more than this part of the largest, however ill-conditioned it is.
MOST_ROUNDOFF = 1e-7


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


def freedoms(linear: Linear, terms: Floats) -> Freedoms:
    """The free coordinates; terms (n, n): the sizes of what entries of K are sums of. Raises `NoFreedomsError`."""
    M, C, K, B, A, D = (getattr(linear, name).toarray() for name in "MCKBAD")
    L = np.linalg.cholesky((M + M.T) / 2)
    # In y = L^T dq the metric is the plain one. First a basis of the cyclic coordinates alone that B leaves free
    white = np.linalg.solve(L, B.T).T
    columns = np.flatnonzero(linear.cyclic)
    first = np.zeros((len(L), 0))
    if columns.size:
        free = rank.null_basis(decompositions.unit(B[:, columns]))
        first = decompositions.orthonormal(L.T[:, columns] @ free)[0]
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
    # N, the kernel of A Z, and G; without differential rows a basis of its own would only turn the coordinates
    m = Z.shape[1]
    N, G = np.eye(m), np.zeros((m, m))
    if len(A_Z):
        found = _decided(A_Z)
        left = found.dependences @ D_Z
        # A size of frequencies, beside which D may be rounding
        rate = float(max(np.abs(C_Z).max(initial=0.0), np.abs(K_Z).max(initial=0.0) ** 0.5))
        if np.abs(left).max(initial=0.0) > rank.PARAMETERS.small * max(np.abs(D_Z).max(initial=0.0), rate):
            raise NoFreedomsError(
                "the differential rows are dependent there, and hold small deviations of positions to more than they"
                " say"
            )
        N, G = found.kernel if found.low else N, found.step(D_Z)
    return Freedoms(Z, N, G, K_Z, C_Z, c, noise)


def _decided(rows: Floats) -> rank.RowSpace:
    """What rows of length one span. Raises `NoFreedomsError` where their rank is undecided."""
    found = rank.space(rows)
    if found.value is None:
        raise NoFreedomsError(
            "the rank of the rows is undecided there, which is too near to where they are dependent"
        )
    return found


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Spectrum:
    """Eigenvalues other than zero (k,) with the deviations dq (n, k) that belong to them, of each conjugate pair both;
    zeros: how many eigenvalues are zero; still (n, j): deviations that belong to them; freedoms: m, those of
    positions; is_definite: whether the quadratic form of K is positive; is_conservative: whether K is symmetric, C
    skew and all rows are holonomic."""

    values: Complex
    shapes: Complex
    zeros: int
    still: Floats
    freedoms: int
    is_definite: bool
    is_conservative: bool


def compute(free: Freedoms) -> Spectrum:
    """All eigenvalues of linear equations."""
    c = free.cyclic
    K, C = free.K[c:, c:], free.C
    is_symmetric = _near(free.K - free.K.T, free.K)
    is_skew = _near(C + C.T, C, _size(K) ** 0.5)
    m, k = free.N.shape
    is_conservative = m == k and is_symmetric and is_skew
    squares, modes = np.linalg.eigh((K + K.T) / 2)
    least = max(floor(len(K)) * float(np.abs(squares).max(initial=0.0)), free.noise)
    is_definite = not c and bool((squares > least).all())
    if is_conservative and _size(C) <= doubles.ZERO * _size(K) ** 0.5:  # K x = w^2 x
        moving = np.abs(squares) > least
        roots = np.sqrt(-squares[moving].astype(complex))
        own = free.Z[:, c:] @ modes
        values, shapes = np.concatenate([roots, -roots]), np.tile(own[:, moving].astype(complex), 2)
        still = np.hstack([free.Z[:, :c], own[:, ~moving]])
    elif is_conservative and is_definite:
        # x'' + C x' + K x = 0 with C skew and K positive: in (K^(1/2) x, x') the matrix is skew.
        root = modes * np.sqrt(squares) @ modes.T
        skew = np.block([[np.zeros((m, m)), root], [-root, -(C - C.T) / 2]])
        # i S is Hermitian: S y = i w y with -w an eigenvalue of it.
        negative, states = np.linalg.eigh(1j * skew)
        values, shapes = -1j * negative, free.Z @ np.linalg.solve(root, states[:m])
        still = np.zeros((len(free.Z), 0))
    else:
        from scipy import linalg

        # The state matrix of (x, w / rate) without the cyclic x; the rate is a size of eigenvalues.
        N, G = free.N, free.G
        along = N.T @ (free.C - G) if G.size else N.T @ free.C
        stiffness, damping = N.T @ free.K - along @ G, along @ N
        rate = max(float(np.sqrt(_size(stiffness))), _size(damping)) or 1.0
        top = np.hstack([-G[c:, c:], rate * N[c:]])
        S = np.vstack([top, np.hstack([-stiffness[:, c:] / rate, -damping])])
        found = deflate(S, free.noise / rate)
        values, left, right = linalg.eig(found.rest, left=True, right=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            condition = 1 / np.abs(np.einsum("ij,ij->j", left.conj(), right))
        scale = float(np.linalg.norm(found.rest, 2)) if found.rest.size else 0.0
        blur = scale * np.fmin(floor(len(S)) * condition, MOST_ROUNDOFF)
        blur = np.where(np.isfinite(blur), blur, scale * MOST_ROUNDOFF)
        values = np.where(np.abs(values.real) <= blur, 1j * values.imag, values)
        values = np.where(np.abs(values.imag) <= 0, values.real + 0j, values)
        shapes = np.zeros((len(free.Z), 0), dtype=complex)
        if values.size:
            states = found.full_vectors(values, right)
            x, w = states[: m - c], states[m - c :]
            missing = (rate * N[:c] @ w - G[:c, c:] @ x) / values if c else np.zeros((0, x.shape[1]))
            shapes = np.asarray(free.Z @ np.vstack([missing, x]))
        still = np.hstack([free.Z[:, :c], free.Z[:, c:] @ found.null[: m - c]])
    return Spectrum(values, shapes, m + k - values.size, still, m, is_definite, is_conservative)


def _size(matrix: Floats) -> float:
    return float(np.linalg.norm(matrix, 2)) if matrix.size else 0.0


def _near(difference: Floats, matrix: Floats, beside: float = 0.0) -> bool:
    return _size(difference) <= doubles.ZERO * max(_size(matrix), beside)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class WithoutZeros:
    """S x = 0 for x in `null` (n, k), bases of the generalized null space; `rest` (m, m) has the other eigenvalues,
    in the orthonormal basis `others` (n, m); `coupling` (k, m): S others = others rest + null coupling, step by step
    in `steps`."""

    zeros: int
    null: Floats
    rest: Floats
    steps: tuple[tuple[Floats, Floats, Floats], ...]

    def full_vectors(self, values: Complex, vectors: Complex) -> Complex:
        """Eigenvectors of S (n, m) from those (m, m) of `rest` with their values, none of which is zero."""
        for null, others, coupling in reversed(self.steps):
            vectors = null @ (coupling @ vectors / values) + others @ vectors
        return vectors


def floor(n: int) -> float:
    """The part of its largest singular value that is zero in a matrix of n rows."""
    return doubles.SUM * max(n, 8)


def deflate(S: Floats, noise: float = 0.0) -> WithoutZeros:
    """S (n, n) without its zero eigenvalues; noise: singular values that are none."""
    rest, steps, found, into = S, [], [], np.eye(len(S))
    least = max(floor(len(S)) * float(np.linalg.norm(S, 2)), noise) if S.size else 0.0
    while len(rest):
        sigma, Vt = decompositions.axes(rest)
        nullity = int((sigma <= least).sum())
        if not nullity:
            break
        null, others = Vt[len(rest) - nullity :].T, Vt[: len(rest) - nullity].T
        steps.append((null, others, null.T @ rest @ others))
        found.append(into @ null)
        into = into @ others
        rest = others.T @ rest @ others
    null_space = np.hstack(found) if found else np.zeros((len(S), 0))
    return WithoutZeros(null_space.shape[1], null_space, rest, tuple(steps))
