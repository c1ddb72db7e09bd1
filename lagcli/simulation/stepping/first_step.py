"""The first step of a run, from the times in which positions, velocities and accelerations change by their sizes.

As in Hairer, Norsett, Wanner, Solving ODEs I, sec. II.4, but that no size is one of a unit.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lagcli.compiled.bound_function import BoundFunction

Floats = npt.NDArray[np.float64]

# Where nothing moves and the scale of time is unknown: of the unit of time, or of the time itself.
REST, REST_OF_TIME = 1e-6, 1e-10
# A step advances the time, which is a double, by so many of its roundings at least.
ROUNDINGS = 256
# A look ahead by this part of the shortest of the times that are known at the start.
LOOK = 1e-3
# Speeds that are less than this part of those that the accelerations make of rest are rounding.
SLOW = 1e-8
# Accelerations that are this part of what the forces alone would make are the rounding of forces that balance.
BALANCED = 1e-13
# The error of a step of this part of the shortest time, to the power of its order, is about as large as it may be.
PART = 0.01


def first_step(rhs: BoundFunction, k: Floats, sizes: Floats, tolerance: Floats, order: int) -> float:
    """The length of the first step from where `rhs` stands on its arrays (t, y, p), with k = y'(t, y) (2n + 1,),
    `parts.Sizes.packed` there (n + 3,), `step_tolerance.of_steps` (6,) and the order of the method.

    One evaluation of `rhs` is used, whose arguments are left as they were. The end of the run plays no part in it.
    """
    t = float(rhs.arguments[0][0])
    n = k.size // 2
    units, (q, v, forced) = sizes[:n], sizes[n:].tolist()
    rtol, resting = float(tolerance[0]), float(tolerance[4])

    def size(accelerations: Floats) -> float:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is asked for below
            return float(np.abs(accelerations / units).max(initial=0.0))

    a = size(k[n : 2 * n])
    v = v if v > SLOW * math.sqrt(q * a) else 0.0
    if not v and a <= BALANCED * max(forced, resting):
        a = max(forced, resting)
    times = [_ratio(q, v), _ratio(v, a), math.sqrt(_ratio(q, a))]
    known = min((time for time in times if 0.0 < time < math.inf), default=0.0)
    step = max(REST, REST_OF_TIME * abs(t))
    if known:
        later = _ahead(rhs, k, LOOK * known)
        turned = _ratio(a, size(later[n : 2 * n] - k[n : 2 * n]) / (LOOK * known))
        if math.isfinite(turned):
            known = min(known, turned or known)
        step = known * (PART * rtol) ** (1.0 / order)
    return max(step, ROUNDINGS * math.ulp(t))


def _ratio(size: float, rate: float) -> float:
    return size / rate if rate > 0.0 else math.inf


def _ahead(rhs: BoundFunction, k: Floats, h: float) -> Floats:
    """y' (2n + 1,) after a step of Euler's."""
    t_cell, y_cells, _ = rhs.arguments
    t, y = float(t_cell[0]), y_cells.copy()
    t_cell[0], y_cells[:] = t + h, y + h * k
    rhs.trigger()
    t_cell[0], y_cells[:] = t, y
    return rhs.results[0]
