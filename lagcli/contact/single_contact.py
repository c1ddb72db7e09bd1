"""The impact of one contact, by its formula: Lambda = -(1 + e) dot g- / (G P G^T), with P the inverse of M that
equality rows leave."""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.contact.nonnegative import Floats

# Of the square of a row the equality rows leave this part at the least, or rounding is too large for the formula;
# and the response breaks them by no more than LEFT.
FREE, LEFT = 0.01, 1e-13


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Response:
    """The effect of an impulse 1 of a contact: velocities P G^T (n,), impulses of the equality rows (C,).

    square: G P G^T; free: G M^-1 G^T; left: what rounding leaves of the equality rows, as a part; terms: the sum of
    |G_i v_i| and |g_t| at the velocities at hand.
    """

    x: Floats
    of_equalities: Floats
    square: float
    free: float
    left: float
    terms: float

    @property
    def is_certain(self) -> bool:
        """True where the formula is as good as rounding."""
        return bool(0.0 < self.free < np.inf and self.square > FREE * self.free and self.left <= LEFT)
