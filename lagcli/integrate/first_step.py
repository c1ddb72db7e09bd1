"""The first step of a run, from the sizes of y, y' and y''.

Hairer, Norsett, Wanner, Solving ODEs I, sec. II.4.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from lagcli.integrate import dop853
from lagcli.integrate.call import Call

Floats = npt.NDArray[np.float64]

# Where nothing moves and the scale of time is unknown: of the unit of time, or of the time itself.
REST, REST_OF_TIME = 1e-6, 1e-10


def first_step(rhs: Call, k: Floats, tolerance: Floats) -> float:
    """The length of the first step from where `rhs` stands on its arrays (t, y, p), with k = y'(t, y) (2n + 1,) and
    tolerance (rtol, atol).

    One evaluation of `rhs` is used, whose arguments are left as they were. The end of the run plays no part in it.
    """
    t_cell, y_cells, _ = rhs.arguments
    t, y = float(t_cell[0]), y_cells.copy()
    at_rest = max(REST, REST_OF_TIME * abs(t))
    scale = tolerance[1] + np.abs(y) * tolerance[0]

    def norm(u: Floats) -> float:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is asked for below
            return float(np.sqrt(np.mean((u[:-1] / scale[:-1]) ** 2))) if u.size > 1 else 0.0

    d0, d1 = norm(y), norm(k)
    # A start at the origin moves by a hundredth of the tolerance.
    h0 = (0.01 * max(d0, 1.0) / d1 if d1 >= 1e-5 else 0.0) or at_rest
    t_cell[0], y_cells[:] = t + h0, y + h0 * k
    rhs.trigger()
    d2 = norm(rhs.results[0] - k) / h0
    t_cell[0], y_cells[:] = t, y
    if not math.isfinite(d2):
        return at_rest
    steepest = max(d1, d2)
    h1 = max(at_rest, h0 * 1e-3) if steepest <= 1e-15 else (0.01 / steepest) ** (1.0 / dop853.ORDER)
    return min(100 * h0, h1)
