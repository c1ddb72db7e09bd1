"""The period of a motion, or of the linear equations along it.

Two instants are the same where velocities and all entries of the linear equations are: places may have moved on, as an
angle does that has turned once.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lagcli.linearization.reference import PLACES

Floats = npt.NDArray[np.float64]
Signature = Callable[[float], Floats]

# Times that are looked at in a span, and spans as parts of the time allowed, the shortest first.
TIMES = 400
SPANS = (1e-3, 1e-2, 1e-1, 1.0)
# A return is one that comes this near, as a part of the way between.
CLOSED = 1e-7
# Roundings of the time at which a return is found.
REFINEMENTS = 60


def of(signature: Signature, longest: float) -> float | None:
    """The period T of a function of time, T <= longest / (1 + the last of PLACES), or None where it has none.

    A return of its value is looked for by its way through the plane across its first direction, and what comes back
    must do so at other instants too.
    """
    for span in SPANS:
        times = np.linspace(0.0, span * longest / 2, TIMES)
        values = np.array([signature(t) for t in times])
        size = np.abs(values - values[0]).max(axis=0)
        if not size.any() or not np.isfinite(values).all():
            continue
        found = _first(signature, times, values, float(size.max()))
        if found is not None:
            return found
    return None


def _first(signature: Signature, times: Floats, values: Floats, size: float) -> float | None:
    """The first return among sampled values."""
    # A generic instant: at the first one a derivative may vanish.
    begin = int(PLACES[1] * len(times))
    here, ahead = values[begin], values[begin + 1] - values[begin - 1]
    along = (values - here) @ ahead
    for k in range(begin + 1, len(times) - 1):
        if along[k] < 0 <= along[k + 1]:
            at = _root(lambda t: float((signature(t) - here) @ ahead), times[k], times[k + 1])
            T = at - times[begin]
            again = (times[int(part * (len(times) - 1))] for part in PLACES[:3])
            if np.abs(signature(at) - here).max() <= CLOSED * size and all(
                np.abs(signature(t + T) - signature(t)).max() <= CLOSED * size for t in again
            ):
                return float(T)
    return None


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    from scipy import optimize

    if function(low) == 0:
        return low
    return float(optimize.brentq(function, low, high, xtol=1e-300, rtol=4e-15, maxiter=REFINEMENTS))
