"""The dimension of f = 0 by second derivatives, where the rank of B is below the codimension on all of it.

A stress is a combination omega of rows with omega B = 0. On f = 0, omega . f = 0 says of a direction u in which
the surface can be left that u^T H u = 0, with H = sum omega_i Hess f_i on ker B: where H is positive semidefinite,
u lies in its kernel K, and the dimension is at most dim K. It is that if a manifold Y with tangent K lies in f = 0 and
the stress goes on along it. The deflated system

    G(q, w) = (f(q), B(q)^T w, W^T (w - omega)) = 0,    W (s, s - r) all stresses at the point,

holds both, and its derivatives have a kernel that is K in q and nothing in w. Where all of G vanishes on what
independent ones of its equations cut out (`manifold`), that is Y, and f = 0 is Y near the point: at y of Y,
omega(y) . f(y + u) + c |f(y + u)|^2 is positive for small u across Y and c large, and zero where f is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli import doubles
from lagcli.analysis.codimension import manifold
from lagcli.analysis.codimension.scaled_equations import ScaledPart
from lagcli.arrays import Floats
from lagcli.linear import rank, surface

# The factor by which the weight of the barrier grows; the part of an eigenvalue to which it is known well enough; the
# fall of the barrier at which Newton's steps end.
GROWTH, SUFFICIENT, DECREMENT = 8.0, 0.3, 1e-3


def dimension(part: ScaledPart, count: int, times: Sequence[float]) -> int | None:
    """The dimension of f = 0 at the begin of the part, whose rows have this rank there, or None if not proved."""
    t = part.state.t
    _, B = part.at(part.begin, t)
    rows = rank.space(B)
    if rows.value != count:
        return None
    # A stress whose second derivatives are positive on ker B but for a kernel, the one that all stresses have in
    # common: along Y stresses go on, and all vanish.
    stresses, tangent = rows.dependences.T, rows.kernel
    d, m = stresses.shape[1], tangent.shape[1]
    forms = np.array([tangent.T @ part.hessian(part.begin, t, w) @ tangent for w in stresses.T])
    # Stresses of which the forms differ: of redundant rows they do not.
    differing = rank.space(forms.reshape(d, m * m), is_whole=False)
    if not differing.value:
        return None
    basis = differing.basis.reshape(-1, m, m)
    across = rank.space(basis.reshape(-1, m))
    c = None if across.value is None else definite_combination(across.basis @ basis @ across.basis.T)
    if c is None:
        return None
    stress = stresses @ (differing.combinations.T @ (c / differing.sigma[: differing.low]))
    stress, kernel = stress / np.linalg.norm(stress), m - across.low
    n, k = len(part.coordinates), len(part.rows)

    def deflated(z: Floats, t: float) -> tuple[Floats, Floats]:
        """G (k + n + d,) at z = (x, w) in scaled coordinates (n + k,), and its derivatives."""
        x, w = z[:n], z[n:]
        f, B = part.at(x, t)
        G = np.concatenate([f, B.T @ w, stresses.T @ (w - stress)])
        H = part.hessian(x, t, w)
        return G, np.block([[B, np.zeros((k, k))], [H, B.T], [np.zeros((d, n)), stresses.T]])

    begin = np.concatenate([part.begin, stress])
    found = manifold.along(deflated, part.rounding, begin, t, begin.size - kernel)
    if found is None:
        return None
    # The start is on the manifold, in its coordinates.
    F, J = deflated(begin, t)
    there = found.reached(begin - rank.space(J, is_whole=False).step(F), t)
    off = doubles.SUM + surface.PARAMETERS.roundings * part.rounding
    if there is None or np.abs((there - begin)[:n]).max(initial=0.0) > off:
        return None
    return kernel if found.satisfies_all(begin, t, times) else None


def definite_combination(matrices: Floats) -> Floats | None:
    """c (k,) of length at most one with sum c_k H_k positive definite, for H (k, m, m) of norm about one, or None. The
    largest t such that H(c) - t I is positive semidefinite, H(c) = sum c_k H_k with |c| <= 1, is found by Newton's
    method on the barrier -log det(H(c) - t I) - log(1 - |c|^2) - weight t, as the weight grows: a convex problem, so
    that what is not found does not exist."""
    k, m, _ = matrices.shape
    if m == 0 or k == 0:
        return None
    x, weight = np.append(np.zeros(k), -1.0), 1.0
    for _ in range(60):
        x = _centered(matrices, x, weight)
        gap = (m + 1) / weight
        if x[-1] > doubles.ROOT and gap < SUFFICIENT * x[-1]:
            return x[:-1]
        if x[-1] + gap < doubles.ROOT:
            return None
        weight *= GROWTH
    return None


def _centered(matrices: Floats, x: Floats, weight: float) -> Floats:
    """The minimum of the barrier, from a point inside."""
    here = _barrier(matrices, x, weight)
    for _ in range(surface.PARAMETERS.newton_steps):
        assert here is not None
        value, gradient, hessian = here
        step = -np.linalg.solve(hessian, gradient)
        decrement = -float(step @ gradient)
        if decrement < DECREMENT:
            break
        factor = 1.0
        for _ in range(surface.PARAMETERS.most_halvings):
            there = _barrier(matrices, x + factor * step, weight)
            if there is not None and there[0] <= value - 0.25 * factor * decrement:
                break
            factor /= 2
        else:
            break
        x, here = x + factor * step, there
    return x


def _barrier(matrices: Floats, x: Floats, weight: float) -> tuple[float, Floats, Floats] | None:
    """The barrier at x = (c, t) with its gradient and its second derivatives, or None outside."""
    c, t = x[:-1], float(x[-1])
    room = 1.0 - float(c @ c)
    matrix = np.tensordot(c, matrices, 1) - t * np.eye(matrices.shape[1])
    if room <= 0.0:
        return None
    eigenvalues, vectors = np.linalg.eigh(matrix)
    if eigenvalues[0] <= 0.0:
        return None
    inverse = (vectors / eigenvalues) @ vectors.T
    along = np.einsum("ij,kjl->kil", inverse, matrices)
    gradient = np.append(2 * c / room - np.einsum("kii->k", along), np.trace(inverse) - weight)
    hessian = np.empty((x.size, x.size))
    hessian[:-1, :-1] = np.einsum("kij,lji->kl", along, along) + 4 * np.outer(c, c) / room**2
    hessian[:-1, :-1] += 2 / room * np.eye(c.size)
    hessian[:-1, -1] = hessian[-1, :-1] = -np.einsum("kij,ji->k", along, inverse)
    hessian[-1, -1] = np.sum(inverse**2)
    return float(-weight * t - np.log(eigenvalues).sum() - np.log(room)), gradient, hessian
