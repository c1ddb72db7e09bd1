"""States on both sides of a time at which functions of t switch: the same, or the velocities jump."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.linear.metric_rows import LocalRows
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

# Positions and velocities may differ by this part of their size, and by what they change in so many times the time.
SAME, LONGER = 1e-9, 16.0
# At three times the distance from a pole of this order rates are this part of what they are. Weaker ones change
# velocities by nothing that counts in a few roundings of the time.
ORDER = 0.25
POLE = 3.0**-ORDER


def is_same(
    before: tuple[Floats, Floats], after: tuple[Floats, Floats], dt: float, acceleration: float
) -> bool:
    """True if y (2n + 1,) of two pairs y, y' is the same on both sides but for the time dt between them; acceleration:
    the largest of the forces alone, for where these balance velocities are rounding."""
    (y, k), (new, k_new) = before, after
    n = y.size // 2
    for part, least in ((slice(0, n), 0.0), (slice(n, 2 * n), acceleration)):
        size = np.abs(y[part]).max(initial=0.0)
        rate = np.maximum(np.abs(k[part]), np.abs(k_new[part])).max(initial=least)
        if not np.abs(new[part] - y[part]).max(initial=0.0) <= SAME * size + LONGER * dt * rate:
            return False
    return True


def is_pole(rates: Sequence[Floats]) -> bool:
    """True if y' (2n + 1,) grows without bound towards a time, from its values nearby, three times, and nine times as
    far away."""
    n = rates[0].size // 2
    sizes = [float(np.abs(k[n : 2 * n]).max(initial=0.0)) for k in rates]
    return all(0.0 < far <= POLE * near for near, far in itertools.pairwise(sizes))


def violated(numeric: NumericSystem, state: State) -> tuple[int, ...]:
    """The rows that a state violates most: B v + b = 0, as a part of the largest there."""
    B, b = numeric.rows(state.t, state.q, state.v, state.p)
    rows = LocalRows(B)
    off = np.abs(rows.times(state.v) + np.array(b).ravel()) / rows.divisors
    return tuple(np.flatnonzero(off > 0.5 * off.max(initial=0.0)).tolist())
