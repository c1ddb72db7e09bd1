"""Tell if rows that come closer to dependent ones part again: a look ahead that costs a part of the search.

The square of the angle between rows is a parabola in time near its minimum: zero there where rows become dependent,
and more where they only come close.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

# Places at which a minimum is looked for after the first three, and how far beyond the instant foreseen it may lie.
LOOKS, FARTHEST = 4, 2.0
# A minimum of less than this part of the square as it is may be zero: a step so long is not exact.
SHALLOW = 0.01
# Rows at a smaller angle are searched at once: ordinary steps to where they may be dependent are not exact.
CERTAIN = 0.1
# Looks that are closer say nothing new.
CLOSE = 0.02


def is_dip(square: Callable[[float], float], now: float, ahead: float) -> bool:
    """True if the square of an angle, `now` at the beginning, has a minimum well above zero.

    square(h) is that after a time h, nan where it is not known: then nothing is; ahead: the time after which the angle
    is expected to vanish.
    """
    found = {0.0: now, ahead / 2: square(ahead / 2), ahead: square(ahead)}
    for _ in range(LOOKS):
        if not _all_above(found.values(), now):
            return False
        lowest = sorted(found, key=found.__getitem__)[:3]
        curve = np.polyfit(np.array(lowest) / ahead, [found[h] / now for h in lowest], 2)
        if not curve[0] > 0.0:
            break  # it falls no more, or not yet
        least = min(max(-curve[1] / (2 * curve[0]), 0.0), FARTHEST) * ahead
        if min(abs(least - h) for h in found) < CLOSE * ahead:
            break
        found[least] = square(least)
    return _all_above(found.values(), now)


def _all_above(squares: Iterable[float], now: float) -> bool:
    """True if all are well above zero; what is not known is not."""
    return all(square > SHALLOW * now for square in squares)
