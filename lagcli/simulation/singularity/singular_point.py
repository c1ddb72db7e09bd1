"""The loss at a singular configuration: the rank of the rows there, and whether the branches really meet."""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.linear import rank
from lagcli.linear.metric_rows import LocalRows, MetricRows
from lagcli.simulation.run_state.statistics import RankDrop
from lagcli.start.initial import State, metric_at

Floats = npt.NDArray[np.float64]

# Of more rows than these the singular values would take many seconds.
MOST_ROWS = 1500
# Singular values of unit rows, by the eigenvalues of their Gram matrix: what is below at the instant is lost. The
# instant is known to rounding only.
LOST = 1e-5
# Where branches meet, the part of f that has no gradient left vanishes like the square of the error of the position;
# where they only come close it is the square of their distance.
GAP_ROUNDOFF, ERRORS = 1e-13, 10.0
STRONG_STEPS = 3
# Of rows that are close to dependent ones those with this part of the largest weight are named.
PART = 1e-2
# Unit rows whose smallest singular value is larger are independent in themselves, whatever the masses.
INDEPENDENT = 0.1


def loss(numeric: NumericSystem, before: State, there: State, rtol: float) -> RankDrop | None:
    """The loss of the independent rows at a state; None where they lose nothing, or where the branches do not meet.

    before: a state of the same motion at which rows have their lengths; rtol: relative error of positions.
    """
    independent = list(numeric.selection.independent)
    holonomic = [i for i in independent if i < numeric.holonomic.size1_out(0)]
    if len(independent) > MOST_ROWS:
        return RankDrop(there.t, 1, tuple(independent))
    metric = metric_at(numeric, before)
    lengths = LocalRows(metric.whitened(_rows(numeric, before)[independent, :])).divisors
    q = there.q.copy()
    # f over the lengths of rows in the metric is a length in it.
    size = metric.length(q) or 1.0
    unit = ca.mtimes(ca.diag(ca.DM(1 / lengths)), metric.whitened(_rows(numeric, there)[independent, :]))
    squares, left = np.linalg.eigh(np.array(ca.densify(ca.mtimes(unit, unit.T))))
    strong = squares > LOST**2
    if strong.all():
        return None
    lost, other = left[:, ~strong], left[: len(holonomic), strong]
    for _ in range(STRONG_STEPS):
        f = np.array(numeric.holonomic(there.t, q, there.p)[0]).ravel()[holonomic] / lengths[: len(holonomic)]
        # Newton's steps along what is not lost leave what the lost rows say.
        stresses = left[:, strong] @ ((other.T @ f) / squares[strong])
        q = q - metric.unwhitened(np.array(ca.mtimes(unit.T, ca.DM(stresses))).ravel())
    gap = float(np.abs(lost[: len(holonomic)].T @ f).max(initial=0.0))
    if gap > size * max(GAP_ROUNDOFF, (ERRORS * rtol) ** 2):
        return None
    weights = np.abs(lost).max(axis=1)
    taking_part = np.flatnonzero(weights > LOST * weights.max())
    return RankDrop(there.t, int(lost.shape[1]), tuple(independent[i] for i in taking_part))


def closest(numeric: NumericSystem, state: State, is_alone: bool) -> tuple[int, ...]:
    """The independent rows that are closest to dependent ones at a state; is_alone: one row is, which vanishes."""
    independent = list(numeric.selection.independent)
    rows = MetricRows(_rows(numeric, state)[independent, :], metric_at(numeric, state))
    if is_alone:
        return (independent[int(np.argmin(rows.lengths))],)
    if rows.is_large:
        weights = np.abs(rows.weakest)
    else:
        weights = np.abs(rank.nearest_dependence(rows)[1])
    return tuple(independent[i] for i in np.flatnonzero(weights > PART * weights.max()))


def apart(numeric: NumericSystem, state: State) -> float | None:
    """The ratio of the largest inertia to the least, where the independent rows are so in themselves and only the mass
    metric brings them close to dependent ones; None where they are close to dependent ones without it."""
    independent = list(numeric.selection.independent)
    if len(independent) > MOST_ROWS:
        return None
    rows = _rows(numeric, state)[independent, :]
    unit = np.array(ca.densify(rows)) / LocalRows(rows).divisors[:, None]
    inertias = np.array(numeric.inertia(state.t, state.q, state.v, state.p)).diagonal()
    if not (np.isfinite(unit).all() and np.isfinite(inertias).all() and inertias.min() > 0):
        return None
    if np.linalg.eigvalsh(unit @ unit.T)[0] < INDEPENDENT**2:
        return None
    return float(inertias.max() / inertias.min())


def departed(numeric: NumericSystem, state: State, limit: float) -> tuple[int, ...]:
    """A row left out that a state violates by more than this part of its sizes, after the rows it followed from;
    none where all of them still follow."""
    B, b = numeric.rows(state.t, state.q, state.v, state.p)
    rows, f = LocalRows(B), np.array(numeric.holonomic(state.t, state.q, state.p)[0]).ravel()
    off = (
        np.abs(rows.times(state.v) + np.array(b).ravel())
        / rows.divisors
        / (np.abs(state.v).max(initial=0.0) or 1.0)
    )
    residuals = np.abs(f) / rows.divisors[: f.size] / (np.abs(state.q).max(initial=0.0) or 1.0)
    off[: f.size] = np.maximum(off[: f.size], residuals)
    for row, *others in numeric.selection.dependencies:
        if off[row] > limit:
            return (*others, row)
    return ()


def _rows(numeric: NumericSystem, state: State) -> ca.DM:
    B: ca.DM = numeric.rows(state.t, state.q, state.v, state.p)[0]
    return B
