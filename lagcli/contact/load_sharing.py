"""A load that rows hold together: how it is shared where that is not determined, and which shares are not.

Rows of length one A (k, m), and x = A^T mu, of which the first may pull and the others only push, mu >= 0. Where rows
are dependent other mu may do, as the legs of a table. Of all of them the shortest is given: the same split as among
equality rows (`compiled.selection`), of those that push.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.contact import least_distance
from lagcli.contact.least_distance import Floats
from lagcli.linear import rank

Flags = npt.NDArray[np.bool_]


def shared(A: Floats, mu: Floats, pulling: int = 0) -> tuple[Floats, Flags]:
    """The shortest mu with the same A^T mu, >= 0 after the first `pulling`; and which entries are the same in all."""
    count = mu.size
    if not count or (count == 1 and A.any()):
        return mu, np.ones(count, dtype=bool)
    found = rank.space(A, is_whole=A.shape[1] < count)
    if found.low == count:
        return mu, np.ones(count, dtype=bool)
    free = found.exact_dependences.T
    if free.shape[1]:
        mu = _shortest(mu, free, pulling)
    return mu, ~_varies(found.dependences.T, mu, pulling)


def _shortest(mu: Floats, free: Floats, pulling: int) -> Floats:
    """The shortest mu + free z >= 0, `free` (k, d) orthonormal: that of a mu without a part in them, and then the
    shortest z that makes it push."""
    least = mu - free @ (free.T @ mu)
    lengths = np.linalg.norm(free, axis=1)
    rows = lengths > doubles.ZERO
    rows[:pulling] = False
    # Rounding must not make two shares that can only be zero contradict each other.
    bounds = -least[rows] - 16 * doubles.EPS * float(np.linalg.norm(mu))
    try:
        z = least_distance.shortest(free[rows] / lengths[rows, None], bounds / lengths[rows]).x
    except (least_distance.ContradictoryRows, least_distance.UndecidedRows):
        # One share alone is possible, and rounding leaves none.
        return mu
    mu = least + free @ z
    mu[pulling:] = np.maximum(mu[pulling:], 0.0)
    return mu


def _varies(free: Floats, mu: Floats, pulling: int) -> Flags:
    """The shares that change along a direction of `free` (k, d) in which none that only pushes becomes
    negative.

    Shares that are zero may only grow. Of directions that leave all others as they are every one is looked for in
    which one of those grows; with all found, the shares that can be positive change in any direction that leaves the
    rest at zero.
    """
    free = free * (np.linalg.norm(free, axis=1) > doubles.ZERO)[:, None]
    positive = mu > doubles.ZERO * np.abs(mu).max(initial=0.0)
    positive[:pulling] = True
    for row in np.flatnonzero(~positive):
        if positive[row]:
            continue
        # A direction z with (free z)_row = 1 and (free z)_zero >= 0: none if some weights >= 0 of the rows at zero
        # sum to minus this row (Farkas).
        zero = np.flatnonzero(~positive)
        left = least_distance.residual(free[zero].T, -free[row])
        if left is not None and np.linalg.norm(left) > rank.PARAMETERS.large:
            positive[zero] |= free[zero] @ -left > doubles.ZERO
    rest = free[~positive]
    if rest.shape[0]:
        free = free @ rank.null_basis(rest)
    return np.asarray(positive & (np.linalg.norm(free, axis=1) > rank.PARAMETERS.large))
