"""The dimension of f = 0 by second derivatives, where the rank of B is below the codimension on all of it.

A stress is a combination omega of rows with omega B = 0. On f = 0, omega . f = 0 says of a direction u in which
the surface can be left that u^T H u = 0, with H = sum omega_i Hess f_i on ker B: where H is positive semidefinite,
u lies in its kernel K. So the dimension is at most dim K.

It is that if a manifold Y with tangent K lies in f = 0 and the stress goes on along it. The deflated system

    G(q, w) = (f(q), B(q)^T w, W^T (w - omega)) = 0,    W (s, s - r) all stresses at the point,

holds both, and its derivatives at the point have a kernel that is K in q and nothing in w. Where all of G vanishes
on what independent ones of its equations cut out (`manifold`), that is Y. Then f = 0 is Y near the point: at y of Y,
omega(y) . f(y + u) + c |f(y + u)|^2 is positive for small u across Y and c large, and zero where f is.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.analysis.codimension import definite, manifold
from lagcli.analysis.codimension.scaled_equations import ScaledPart
from lagcli.linear import rank as rank_limits

Floats = npt.NDArray[np.float64]

# Of second derivatives in scaled coordinates: below it they are the square root of the rounding of the start.
NOTHING, SOMETHING = 1e-6, 1e-5
# How far, in units of the scaled coordinates, the start may lie from where the stress balances: rounding. From
# farther off a small curve through the start, as x**2 + y**2 = 1e-10 x, looks like a point; smaller ones still do.
BALANCED = 1e-13


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Deflated:
    """G(z), z = (x, w) in scaled coordinates (m + k,), about a stress; `stresses` W (k, d)."""

    part: ScaledPart
    stress: Floats
    stresses: Floats

    def at(self, z: Floats, t: float) -> tuple[Floats, Floats]:
        """G (k + m + d,) and its derivatives (k + m + d, m + k)."""
        m = len(self.part.coordinates)
        x, w = z[:m], z[m:]
        f, B = self.part.at(x, t)
        G = np.concatenate([f, B.T @ w, self.stresses.T @ (w - self.stress)])
        H = self.part.hessian(x, t, w)
        k, d = self.stresses.shape
        return G, np.block([[B, np.zeros((k, k))], [H, B.T], [np.zeros((d, m)), self.stresses.T]])

    @property
    def begin(self) -> Floats:
        """z of the state."""
        return np.concatenate([self.part.begin, self.stress])

    @property
    def rounding(self) -> float:
        """The amount by which rounding moves values of G."""
        return self.part.rounding


def dimension(part: ScaledPart, rank: int, times: Sequence[float]) -> int | None:
    """The dimension of f = 0 at the begin of the part, whose rows have this rank there, or None if not proved."""
    t = part.state.t
    _, B = part.at(part.begin, t)
    left, _, right = np.linalg.svd(B)
    stresses, tangent = left[:, rank:], right[rank:].T
    held = _held(part, stresses, tangent)
    if held is None:
        return None
    stress, kernel = held
    deflated = Deflated(part, stress, stresses)
    found = manifold.along(deflated, deflated.begin, t, deflated.begin.size - kernel)
    if found is None or _shift(found, deflated, t) > BALANCED + manifold.ROUNDINGS * part.rounding:
        return None
    if not manifold.is_whole(found, deflated.begin, t, times):
        return None
    return kernel


def _shift(found: manifold.Manifold, deflated: Deflated, t: float) -> float:
    """The distance of the start from the manifold, in its coordinates; inf where Newton's method finds no way to it."""
    begin = deflated.begin
    F, J = deflated.at(begin, t)
    step = np.linalg.lstsq(J, F, rcond=rank_limits.SMALL)[0]
    there = found.reached(begin - step, t)
    if there is None:
        return math.inf
    return float(np.abs((there - begin)[: len(deflated.part.coordinates)]).max(initial=0.0))


def _held(part: ScaledPart, stresses: Floats, tangent: Floats) -> tuple[Floats, int] | None:
    """A stress whose second derivatives are positive on ker B but for a kernel, and the dimension of that, or None.

    The kernel is the one that all stresses have in common: along Y stresses go on, and all vanish.
    """
    d, m = stresses.shape[1], tangent.shape[1]
    forms = np.array([tangent.T @ part.hessian(part.begin, part.state.t, w) @ tangent for w in stresses.T])
    # Stresses of which the forms differ: of redundant rows they do not.
    mixed, sizes, basis = np.linalg.svd(forms.reshape(d, m * m), full_matrices=False)
    count = _clearly(sizes)
    if not count:
        return None
    basis = basis[:count].reshape(count, m, m)
    _, sigma, directions = np.linalg.svd(basis.reshape(count * m, m), full_matrices=True)
    across = _clearly(sigma)
    if across is None:
        return None
    held = directions[:across].T
    c = definite.combination(held.T @ basis @ held)
    if c is None:
        return None
    stress = stresses @ (mixed[:, :count] @ (c / sizes[:count]))
    return stress / np.linalg.norm(stress), m - across


def _clearly(sizes: Floats) -> int | None:
    """The number of sizes that are not zero, or None where that is not clear."""
    some, all_but_nothing = int((sizes > SOMETHING).sum()), int((sizes > NOTHING).sum())
    return some if some == all_but_nothing else None
