"""The linear complementarity problem of contacts, solved as the shortest vector that satisfies their inequalities.

0 <= Lambda and S Lambda - h >= 0, one of the two zero for each contact, with S = G~ G~^T: the conditions for the
shortest x with G~ x >= h, x = G~^T Lambda (the principle of Gauss). S is never formed, so that digits are not squared
away, and x is unique even where Lambda is not.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.contact import least_distance, load_sharing
from lagcli.contact.least_distance import Floats
from lagcli.contact.load_sharing import Flags


class ComplementarityParameters:
    """Rounding that decides about a contact.

    The tests are of `tests/unit/test_numbers_of_contacts.py`.
    """

    __slots__ = ()

    safe: float = 8.0
    """The rounding of a sum, of bounds or of speeds after an impact, is allowed for this many times.
    `test_a_bound_may_be_eight_roundings_off` fails at 0.8 and 80."""


PARAMETERS = ComplementarityParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Complementary:
    """A solution, and what is known of it.

    x: (m,) = G~^T Lambda. multipliers: Lambda (k,). slack: G~ x - h (k,), 0 where Lambda > 0. holds: the contacts
    with no slack to rounding. unique: Lambda_j is the same in all solutions.
    """

    x: Floats
    multipliers: Floats
    slack: Floats
    holds: Flags
    unique: Flags


def solve(rows: Floats, bounds: Floats, rounding: Floats | float = 0.0) -> Complementary:
    """0 <= Lambda, G~ G~^T Lambda - h >= 0, complementary; rows G~ (k, m), bounds h (k,) known to `rounding` (k,).

    Where Lambda is not unique, of all solutions that with the least sum of Lambda_i^2 |G~_i|^2. A row of zeros holds
    nothing: its Lambda is 0 (and not unique where h is 0). Raises `ContradictoryRows` with the rows of which not all
    can hold, `UndecidedRows`.
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
    share, same = load_sharing.shared(unit[tight], found.mu[tight])

    multipliers, slack = np.zeros(count), -bounds.astype(float)
    holds = empty & (bounds >= -allowed)
    unique = ~holds
    multipliers[full[tight]] = share / scale[tight]
    slack[full] = left * scale
    holds[full] = tight
    unique[full[tight]] = same
    return Complementary(found.x, multipliers, slack, holds, unique)
