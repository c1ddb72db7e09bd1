"""Bases of allowed and virtual displacements at a state (D.6, D.8, D.9)."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.linear import rank
from lagcli.linear.metric import Metric, NotDefiniteError
from lagcli.linear.metric_rows import LocalRows
from lagcli.start import initial, sample_points
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Bases:
    """Displacements dq with B dq + b dt = 0.

    virtual (n, n - rank): a basis for dt = 0, orthonormal in the mass metric, dq^T M dq = 1, or plainly, dq^T dq = 1,
    where some coordinates have no inertia (`metric`). allowed (n,): the shortest allowed displacement for dt = 1;
    adding any virtual one gives all of them. residual, allowed_residual: the largest |B_i dq| and |B_i dq + b_i| of
    them, for rows of length one and displacements of length one, or the size of b_i. rows: C.
    """

    rows: int
    rank: int
    metric: str
    virtual: Floats
    allowed: Floats
    residual: float
    allowed_residual: float
    is_certain: bool

    @property
    def dimension(self) -> int:
        """n - rank, the dimension of the virtual displacements: 3N - rank for Cartesian particles."""
        return int(self.virtual.shape[1])


def bases(numeric: NumericSystem, state: State) -> Bases:
    """The bases at a state that satisfies the rows."""
    rows = sample_points.rows(numeric, state)
    found = rank.rank(rows)
    metric, name = _metric(numeric, state)
    B, bias = numeric.rows(state.t, state.q, state.v, state.p)
    right = np.zeros((0, state.q.size))
    if rows.count:
        right = np.linalg.svd(rows.dense, full_matrices=True)[2][: found.low]
    # The rest of an orthonormal basis; in the metric it belongs to displacements M^-1/2 z.
    whole = np.linalg.svd(right, full_matrices=True)[2] if len(right) else np.eye(state.q.size)
    virtual = np.array([metric.unwhitened(z) for z in whole[len(right) :]]).reshape(-1, state.q.size).T
    b = np.array(bias).ravel()
    allowed = rows.correction(b) if rows.count and b.any() else np.zeros(state.q.size)
    plain = LocalRows(B)
    lengths = np.linalg.norm(virtual, axis=0)
    residual = max(
        (
            float(np.abs(plain.times(column) / plain.divisors).max(initial=0.0)) / length
            for column, length in zip(virtual.T, lengths, strict=True)
        ),
        default=0.0,
    )
    left = np.abs(plain.times(allowed) + b) / plain.divisors
    size = float((np.abs(b) / plain.divisors).max(initial=0.0)) or 1.0
    return Bases(
        rows.count,
        found.low,
        name,
        virtual,
        allowed,
        residual,
        float(left.max(initial=0.0)) / size,
        found.value is not None,
    )


def _metric(numeric: NumericSystem, state: State) -> tuple[Metric, str]:
    """The metric of `sample_points.rows`, and its name."""
    try:
        return Metric(numeric.inertia(state.t, state.q, state.v, state.p)), "mass"
    except NotDefiniteError:
        return initial.metric_at(numeric, state), "plain"
