"""Continua of points of rest: their dimension at a point, and whether two points lie on one.

A ring of equilibria, a plane on which a ball lies anywhere, families that nonholonomic rows leave.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.statics import newton, refine
from lagcli.statics.rest_equations import RestEquations

Floats = npt.NDArray[np.float64]


class ContinuumParameters:
    """Numbers of continua of points; lengths are parts of the size of things.

    None was moved to see which test fails: that is not known.
    """

    __slots__ = ()

    flat: float = 1e-6
    """Singular values below this part of the largest may belong to a continuum; a step along it tells."""
    step: float = 1e-2
    """The length of that step: far above the digits of a point that is alone and degenerate."""
    off: float = 0.3
    """A step that ends this part of its length off the tangent has not gone along a continuum."""
    most_steps: int = 80
    """Steps of a walk from one point to another: sixteen sizes of things."""
    stride: float = 0.2
    """The longest step of a walk."""
    arrived: float = 1e-6
    """What is left of the way where a walk has arrived."""
    straight: tuple[float, ...] = (0.0917, 0.2371, 0.3719, 0.5113, 0.6547, 0.7829, 0.9137, 1.0)
    """Places on a straight way at which it is looked whether they are points of rest too; at no common period."""


PARAMETERS = ContinuumParameters()


def directions(equations: RestEquations, x: Floats) -> Floats:
    """An orthonormal basis (n, d) of the changes of q that keep all equations to first order."""
    found = equations(x)
    n = equations.problem.n
    if found is None:
        return np.zeros((n, 0))
    J = found[1]
    widths = np.linalg.norm(J, axis=0)
    widths[:n] = widths[:n].max(initial=0.0)
    widths = np.where(widths > 0, widths, 1.0)
    _, sigma, Vt = np.linalg.svd(J / widths)
    largest = float(sigma[0]) if sigma.size else 0.0
    flat = Vt[int((sigma > PARAMETERS.flat * largest).sum()) :] / widths
    moved = flat[:, :n].T
    if not moved.size:
        return np.zeros((n, 0))
    left, sizes, _ = np.linalg.svd(moved * widths[0], full_matrices=False)
    return np.asarray(left[:, sizes > 1e-6])


def dimension(equations: RestEquations, x: Floats) -> int:
    """The dimension of the continuum through a point, 0 for a point alone.

    A flat direction counts where a step along it ends at another point of rest.
    """
    basis = directions(equations, x)
    n, length = equations.problem.n, PARAMETERS.step * equations.scales.length
    least, passed = basis.shape[1], 0
    for direction in basis.T:
        ends = (stepped(equations, x, sign * length * direction) for sign in (1, -1))
        end = next((one for one in ends if one is not None), None)
        if end is None or not PARAMETERS.off * length < np.linalg.norm(end[:n] - x[:n]):
            continue
        passed += 1
        least = min(least, directions(equations, end).shape[1])
    return min(passed, int(least))


def stepped(equations: RestEquations, x: Floats, change: Floats) -> Floats | None:
    """The point of rest next to x with q changed; None where there is none near."""
    n = equations.problem.n
    predicted = x.copy()
    predicted[:n] += change
    begun = refine.begun(equations, predicted[:n])
    if begun is None or equations(begun) is None:
        return None
    end = newton.refined(equations, begun)
    near = np.linalg.norm(end.x[:n] - predicted[:n]) <= PARAMETERS.off * np.linalg.norm(change)
    settled = (
        end.step <= refine.PARAMETERS.settled and equations.unbalanced(end.x) <= refine.PARAMETERS.balanced
    )
    return end.x if near and settled else None


def _is_straight(equations: RestEquations, x: Floats, way: Floats) -> bool:
    """True if the continuum is flat along a way (n,) from x: all that was looked at on it rests."""
    n, size = equations.problem.n, equations.scales.length
    basis = directions(equations, x)
    if np.linalg.norm(way - basis @ (basis.T @ way)) > PARAMETERS.arrived * size:
        return False
    for part in PARAMETERS.straight:
        end = stepped(equations, x, part * way)
        if end is None or np.linalg.norm(end[:n] - x[:n] - part * way) > PARAMETERS.arrived * size:
            return False
    return True


def connected(equations: RestEquations, x: Floats, goal: Floats) -> bool:
    """True if a walk along the continuum through x comes to the configuration `goal` (n,)."""
    n, size = equations.problem.n, equations.scales.length
    before = np.inf
    for _ in range(PARAMETERS.most_steps):
        way = goal - x[:n]
        left = float(np.linalg.norm(way))
        if left <= PARAMETERS.arrived * size or _is_straight(equations, x, way):
            return True
        if left >= before * (1 - 1e-6):
            return False
        before = left
        basis = directions(equations, x)
        along = basis @ (basis.T @ way)
        length = float(np.linalg.norm(along))
        if length <= 1e-9 * left:
            return False
        for part in (1.0, 0.3, 0.1):
            there = stepped(equations, x, along * min(1.0, part * PARAMETERS.stride * size / length))
            if there is not None:
                break
        else:
            return False
        x = there
    return False
