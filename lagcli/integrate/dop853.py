"""One step of DOP853 with projection, and its dense output, each as one compiled function.

Dormand and Prince 8(5,3); Hairer, Norsett, Wanner, Solving ODEs I, sec. II.5 (error estimate) and II.6 (dense
output of order 7). After the step the state is projected onto f = 0 and B v + b = 0; the derivative at the
landed state is the first stage of the next step.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.compile import NumericSystem
from lagcli.integrate import tableau

Floats = npt.NDArray[np.float64]

ORDER = 8
DENSE_ROWS = 7


@dataclasses.dataclass(frozen=True, slots=True)
class Scheme:
    """Compiled step and dense output.

    step(t, h, y, k, tolerance, p) -> y new, k new, (error, outcome of `land`), stages (2n + 1, 12)
    dense(t, h, y, y new, k new, stages, p) -> coefficients (2n + 1, 7)
    with k = y'(t, y), tolerance = (rtol, atol), error < 1 where the step may be accepted.
    """

    step: Any
    dense: Any


def scheme(numeric: NumericSystem) -> Scheme:
    """The scheme for a system."""
    return Scheme(_step(numeric), _dense(numeric))


def _mix(weights: Sequence[float], stages: Sequence[Any]) -> Any:
    return sum(w * k for w, k in zip(weights, stages, strict=True) if w)


def _sizes(numeric: NumericSystem) -> tuple[int, int]:
    return 2 * numeric.n + 1, numeric.rhs.size1_in(2)


def _step(numeric: NumericSystem) -> Any:
    size, parameters = _sizes(numeric)
    t, h = ca.MX.sym("t"), ca.MX.sym("h")
    y, k = ca.MX.sym("y", size), ca.MX.sym("k", size)
    tolerance, p = ca.MX.sym("tolerance", 2), ca.MX.sym("p", parameters)
    stages = [k]
    for s in range(1, tableau.STAGES):
        stages.append(numeric.rhs(t + tableau.C[s] * h, y + h * _mix(tableau.A[s], stages), p))
    new = y + h * _mix(tableau.B, stages)
    error = _error(y, new, h, stages, tolerance)
    landed, k_new, outcome = numeric.land(t + h, new, p)
    outputs = [landed, k_new, ca.vertcat(error, outcome), ca.horzcat(*stages)]
    return ca.Function("step", [t, h, y, k, tolerance, p], outputs)


def _error(y: Any, new: Any, h: Any, stages: Sequence[Any], tolerance: Any) -> Any:
    """Hairer's combination of the error estimates of order 5 and 3, over the largest component of (q, v).

    The largest component, and not the root mean square: a coordinate at rest then does not loosen the
    tolerance of the others, and a model takes the same steps however many idle coordinates it is written in.
    The work W does not steer the step: it is left out.
    """
    n2 = y.numel() - 1
    scale = tolerance[1] + tolerance[0] * ca.fmax(ca.fabs(y[:n2]), ca.fabs(new[:n2]))
    e5 = ca.mmax(ca.fabs(_mix(tableau.E5, stages)[:n2]) / scale)
    e3 = ca.mmax(ca.fabs(_mix(tableau.E3, stages)[:n2]) / scale)
    return h * e5 * e5 / ca.sqrt(e5 * e5 + 0.01 * e3 * e3 + 1e-300)


def _dense(numeric: NumericSystem) -> Any:
    size, parameters = _sizes(numeric)
    t, h = ca.MX.sym("t"), ca.MX.sym("h")
    y, new, k_new = (ca.MX.sym(name, size) for name in ("y", "new", "k_new"))
    K, p = ca.MX.sym("K", size, tableau.STAGES), ca.MX.sym("p", parameters)
    stages = [*ca.horzsplit(K), k_new]
    for extra, row in enumerate(tableau.A_DENSE):
        node = tableau.C[tableau.STAGES + 1 + extra]
        stages.append(numeric.rhs(t + node * h, y + h * _mix(row, stages), p))
    change = new - y
    rows = [change, h * stages[0] - change, 2 * change - h * (k_new + stages[0])]
    rows += [h * _mix(row, stages) for row in tableau.D_DENSE]
    return ca.Function("dense", [t, h, y, new, k_new, K, p], [ca.horzcat(*rows)])


def interpolate(y: Floats, coefficients: Floats, x: Floats) -> Floats:
    """States at the fractions x (k,) of a step from y (m,) with dense coefficients (m, 7); shape (k, m)."""
    result = np.zeros((x.size, y.size))
    for i in range(DENSE_ROWS - 1, -1, -1):
        result += coefficients[:, i]
        result *= x[:, None] if i % 2 == 0 else 1.0 - x[:, None]
    return result + y
