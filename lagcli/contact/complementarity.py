"""The linear complementarity problem of contacts, solved as the shortest vector that satisfies their inequalities.

0 <= Lambda and S Lambda - h >= 0, one of the two zero for each contact, with S = G~ G~^T: the conditions for the
shortest x with G~ x >= h, x = G~^T Lambda (the principle of Gauss). S is never formed, which would square digits away.
Of all Lambda that do where rows are dependent the shortest is given, as among equality rows (`compiled.selection`).
"""

from __future__ import annotations

import contextlib
import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.contact import least_distance
from lagcli.linear import rank


class ComplementarityParameters:
    """Rounding that decides about a contact. The tests are of `tests/unit/test_numbers_of_contacts.py`."""

    __slots__ = ()

    safe: float = 8.0
    """Roundings of a bound or of a speed after an impact that are none (`test_a_bound_may_be_eight_roundings_off`)."""


PARAMETERS = ComplementarityParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Complementary:
    """x (m,) = G~^T Lambda; multipliers: Lambda (k,); slack: G~ x - h (k,), 0 where Lambda > 0; holds: the contacts
    with no slack to rounding; unique: Lambda_j is the same in all solutions."""

    x: Floats
    multipliers: Floats
    slack: Floats
    holds: Flags
    unique: Flags


def solve(rows: Floats, bounds: Floats, rounding: Floats | float = 0.0) -> Complementary:
    """0 <= Lambda, G~ G~^T Lambda - h >= 0, complementary; rows G~ (k, m), bounds h (k,) known to `rounding` (k,).

    Of all solutions that with the least sum of Lambda_i^2 |G~_i|^2; of a row of zeros Lambda is 0. Raises
    `ContradictoryRows` with the rows of which not all can hold, `UndecidedRows`.
    """
    count = bounds.size
    lengths = np.asarray(np.linalg.norm(rows, axis=1))
    if not (np.isfinite(lengths).all() and np.isfinite(bounds).all()):
        raise least_distance.UndecidedRows("not finite")
    allowed = PARAMETERS.safe * np.broadcast_to(np.asarray(rounding, dtype=float), count)
    empty = lengths == 0
    against = np.flatnonzero(empty & (bounds > allowed))
    if against.size:
        raise least_distance.ContradictoryRows((int(against[0]),))
    full = np.flatnonzero(~empty)
    scale = lengths[full]
    unit, h = rows[full] / scale[:, None], bounds[full] / scale
    try:
        found = least_distance.shortest(unit, h)
    except least_distance.ContradictoryRows as error:
        raise least_distance.ContradictoryRows(tuple(int(full[row]) for row in error.rows)) from None
    left = np.where(found.mu > 0, 0.0, unit @ found.x - h)
    tight = left <= doubles.ZERO * (float(np.linalg.norm(found.x)) + np.abs(h)) + allowed[full] / scale
    share, same = shared(unit[tight], found.mu[tight])

    multipliers, slack = np.zeros(count), -bounds.astype(float)
    holds = empty & (bounds >= -allowed)
    unique = ~holds
    multipliers[full[tight]] = share / scale[tight]
    slack[full] = left * scale
    holds[full] = tight
    unique[full[tight]] = same
    return Complementary(found.x, multipliers, slack, holds, unique)


def shared(A: Floats, mu: Floats, pulling: int = 0) -> tuple[Floats, Flags]:
    """The shortest mu with the same A^T mu, of rows of length one A (k, m), >= 0 after the first `pulling`; and which
    entries are the same in all."""
    count = mu.size
    if not count or (count == 1 and A.any()):
        return mu, np.ones(count, dtype=bool)
    found = rank.space(A, is_whole=A.shape[1] < count)
    if found.low == count:
        return mu, np.ones(count, dtype=bool)
    free = found.exact_dependences.T
    if free.shape[1]:
        # The shortest mu + free z >= 0: that of a mu without a part in them, and then the shortest z that makes it push
        shortest = mu - free @ (free.T @ mu)
        lengths = np.linalg.norm(free, axis=1)
        rows = lengths > doubles.ZERO
        rows[:pulling] = False
        # Rounding must not make two shares that can only be zero contradict each other.
        bounds = -shortest[rows] - 16 * doubles.EPS * float(np.linalg.norm(mu))
        # Where one share alone is possible rounding may leave none: that of mu.
        with contextlib.suppress(least_distance.ContradictoryRows, least_distance.UndecidedRows):
            z = least_distance.shortest(free[rows] / lengths[rows, None], bounds / lengths[rows]).x
            mu = shortest + free @ z
            mu[pulling:] = np.maximum(mu[pulling:], 0.0)
    # The shares that change along a direction of `free` (k, d) in which none that only pushes becomes negative. Of the
    # shares that are zero those are sought that can grow; the rest stays at zero.
    free = found.dependences.T
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
    return mu, ~np.asarray(positive & (np.linalg.norm(free, axis=1) > rank.PARAMETERS.large))
