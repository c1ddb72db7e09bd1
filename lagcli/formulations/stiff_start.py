"""Starts of a stiff run: on the slow motion, where the spring already pulls as the row did."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.linear import decompositions
from lagcli.linear.metric_rows import LocalRows, MetricRows
from lagcli.start import initial, projection
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]


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
    surface = _Stretched(numeric, start, row.index, -row.multiplier / k)
    reached = surface.descend(start.q)
    if not reached.is_on:
        raise NoSlowStartError
    q = surface.nearest(reached.q, start.q)
    here = surface.at(q)
    assert here is not None
    q = q + here.step()  # a stiff spring pulls with what a descent leaves
    return q, _velocity(numeric, dataclasses.replace(start, q=q), row, k)


class _Stretched(projection.Surface):
    """f = 0 but for one row, which is at a value of its own; with the metric at a state."""

    def __init__(self, numeric: NumericSystem, start: State, index: int, offset: float) -> None:
        super().__init__(numeric, start.t, start.p, initial.metric_at(numeric, start))
        self._index, self._offset = index, offset

    def values(self, q: Floats) -> tuple[Floats, Floats]:
        """f (s,) less the value, and the entries of B."""
        f, entries = super().values(q)
        f[self._index] -= self._offset
        return f, entries


def _velocity(numeric: NumericSystem, start: State, row: StiffRow, k: float) -> Floats:
    B, b = numeric.rows(start.t, start.q, start.v, start.p)
    wanted = np.array(b).ravel()
    wanted[row.index] += row.rate / k
    return projection.velocity(start.v, B, wanted, initial.metric_at(numeric, start))


def frequency(numeric: NumericSystem, start: State, index: int) -> float:
    """omega/sqrt(k) of the swing of the row: B_i P B_i^T, with P the inverse of M on what the other rows leave free."""
    B = numeric.rows(start.t, start.q, start.v, start.p)[0]
    metric = initial.metric_at(numeric, start)
    dense = np.array(MetricRows(B, metric).dense)
    lengths = LocalRows(metric.whitened(B)).norms
    others = np.delete(dense, index, axis=0)
    own = dense[index] * lengths[index]
    return float(np.linalg.norm(decompositions.residual(others.T, own)))
