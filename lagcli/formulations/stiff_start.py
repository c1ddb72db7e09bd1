"""Starts of a stiff run: on the slow motion, where the spring already pulls as the row did."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.linear import decompositions
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.start import initial, projection
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

MOST_STEPS, ARRIVED = 60, 1e-15  # Newton's steps to the slow start, and the part of its size that is rounding


class NoSlowStartError(ValueError):
    """No configuration was found in which the row is stretched so far."""


@dataclasses.dataclass(frozen=True, slots=True)
class StiffRow:
    """The row that becomes a spring: its number, and its multiplier and that one's rate at the start."""

    index: int
    multiplier: float
    rate: float


def stretched(numeric: NumericSystem, start: State, row: StiffRow, k: float) -> tuple[Floats, Floats]:
    """q and v (n,) with f = -lambda/k and df/dt = -lambda'/k of the row, all other independent rows.

    Of such configurations that nearest to the start in the mass metric, of velocities those nearest to the ones there:
    what the row does not concern stays. numeric: with the row. Raises `NoSlowStartError`.
    """
    metric = initial.metric_at(numeric, start)
    offset = -row.multiplier / k
    q, size = start.q, float(np.abs(start.q).max(initial=0.0)) or 1.0
    for _ in range(MOST_STEPS):
        f, B = _surface(numeric, start, q, row.index, offset)
        # The nearest point: q - q0 is a combination of the rows where it ends.
        step = MetricRows(B, metric).correction(f + LocalRows(B).times(start.q - q))
        moved = start.q + step - q
        if not np.isfinite(moved).all():
            raise NoSlowStartError
        q = q + moved
        if float(np.abs(moved).max(initial=0.0)) <= ARRIVED * size:
            break
    for _ in range(2):  # a nearest point is found to the root of rounding; the rows are satisfied to rounding
        f, B = _surface(numeric, start, q, row.index, offset)
        q = q + MetricRows(B, metric).correction(f)
    left, B = _surface(numeric, start, q, row.index, offset)
    if not float(np.max(np.abs(left) / LocalRows(B).divisors, initial=0.0)) <= 1e-9 * max(size, abs(offset)):
        raise NoSlowStartError
    return q, _velocity(numeric, dataclasses.replace(start, q=q), row, k)


def _surface(
    numeric: NumericSystem, start: State, q: Floats, index: int, offset: float
) -> tuple[Floats, Sparse]:
    values, B = numeric.holonomic(start.t, q, start.p)
    f = np.array(values).ravel()
    f[index] -= offset
    return f, B


def _velocity(numeric: NumericSystem, start: State, row: StiffRow, k: float) -> Floats:
    B, b = numeric.rows(start.t, start.q, start.v, start.p)
    wanted = np.array(b).ravel()
    wanted[row.index] += row.rate / k
    return projection.velocity(start.v, B, wanted, initial.metric_at(numeric, start))


def frequency(numeric: NumericSystem, start: State, index: int) -> float:
    """omega/sqrt(k) of the swing of the row: B_i P B_i^T, with P the inverse of M on what the other rows leave free."""
    B = numeric.rows(start.t, start.q, start.v, start.p)[0]
    dense = np.array(MetricRows(B, _metric(numeric, start)).dense)
    lengths = LocalRows(_metric(numeric, start).whitened(B)).norms
    others = np.delete(dense, index, axis=0)
    own = dense[index] * lengths[index]
    return float(np.linalg.norm(decompositions.residual(others.T, own)))


def _metric(numeric: NumericSystem, start: State) -> Metric:
    return initial.metric_at(numeric, start)
