"""The reference integrator: Gragg, Bulirsch and Stoer's extrapolation of the midpoint rule.

E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., sec. II.9. Autonomous
systems. It shares neither its formulas nor its linear algebra with what is measured.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Rate = Callable[[Floats], Floats]

COLUMNS = 12
# Of the change by the last column; what stays is less. The most that rounding may leave.
TOLERANCE, ROUNDING = 1e-16, 1e-15


def solve(rate: Rate, start: Floats, duration: float) -> Floats:
    """The state at `duration`."""
    y, t, h = start, 0.0, duration / 4
    while t < duration:
        h = min(h, duration - t)
        new, columns = _step(rate, y, h)
        if new is None:
            h /= 2
            continue
        t = duration if h == duration - t else t + h
        y = new
        h *= 1.5 if columns < COLUMNS - 3 else 1.0 if columns < COLUMNS - 1 else 0.8
    return y


def _step(rate: Rate, y: Floats, h: float) -> tuple[Floats | None, int]:
    """The state after h and the columns it took, or None where they do not converge."""
    slope = rate(y)
    row: list[Floats] = []
    previous = np.inf
    for column in range(COLUMNS):
        parts = 2 * (column + 1)
        last, row = row, [_midpoint(rate, (y, slope), h, parts)]
        for k in range(column):
            ratio = (parts / (parts - 2 * (k + 1))) ** 2
            row.append(row[k] + (row[k] - last[k]) / (ratio - 1))
        if column < 3:
            continue
        change = float(np.max(np.abs(row[-1] - row[-2]) / np.maximum(1.0, np.abs(row[-1]))))
        if change < TOLERANCE:
            return row[-1], column + 1
        # Columns that no longer come nearer have met rounding, or the step is too long.
        if change >= previous:
            return (last[-1] if previous < ROUNDING else None), column + 1
        previous = change
    return None, COLUMNS


def _midpoint(rate: Rate, start: tuple[Floats, Floats], h: float, parts: int) -> Floats:
    y, slope = start
    d = h / parts
    before, here = y, y + d * slope
    for _ in range(parts - 1):
        before, here = here, before + 2 * d * rate(here)
    return 0.5 * (here + before + d * rate(here))
