"""A positive definite combination of symmetric matrices, if there is one.

The largest t such that H(c) - t I is positive semidefinite, H(c) = sum c_k H_k with |c| <= 1, is found by
Newton's method on the barrier -log det(H(c) - t I) - log(1 - |c|^2) - weight t, as the weight grows: a convex
problem, so that what is not found does not exist.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

# Of matrices of norm one: a smallest eigenvalue below this is no proof that it is positive.
DEFINITE = 1e-6
# The weight grows by this factor; at the weight w the largest t is known to (m + 1) / w.
GROWTH, CENTERINGS = 8.0, 60
SUFFICIENT = 0.3
NEWTON_STEPS, DECREMENT, HALVINGS = 50, 1e-3, 40


def combination(matrices: Floats) -> Floats | None:
    """c (k,) of length at most one with sum c_k H_k positive definite, for H (k, m, m) of norm about one."""
    k, m, _ = matrices.shape
    if m == 0 or k == 0:
        return None
    x, weight = np.append(np.zeros(k), -1.0), 1.0
    for _ in range(CENTERINGS):
        x = _centered(matrices, x, weight)
        gap = (m + 1) / weight
        if x[-1] > DEFINITE and gap < SUFFICIENT * x[-1]:
            return x[:-1]
        if x[-1] + gap < DEFINITE:
            return None
        weight *= GROWTH
    return None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Barrier:
    """The barrier with its derivatives by (c, t) at a point inside."""

    value: float
    gradient: Floats
    hessian: Floats


def _centered(matrices: Floats, x: Floats, weight: float) -> Floats:
    """The minimum of the barrier, from a point inside."""
    here = _barrier(matrices, x, weight)
    assert here is not None
    for _ in range(NEWTON_STEPS):
        step = -np.linalg.solve(here.hessian, here.gradient)
        decrement = -float(step @ here.gradient)
        if decrement < DECREMENT:
            break
        factor = 1.0
        for _ in range(HALVINGS):
            there = _barrier(matrices, x + factor * step, weight)
            if there is not None and there.value <= here.value - 0.25 * factor * decrement:
                break
            factor /= 2
        else:
            break
        x, here = x + factor * step, there
    return x


def _barrier(matrices: Floats, x: Floats, weight: float) -> _Barrier | None:
    """The barrier at x = (c, t), or None outside."""
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
    return _Barrier(float(-weight * t - np.log(eigenvalues).sum() - np.log(room)), gradient, hessian)
