"""Moves a configuration or velocity onto the constraints, in the mass-weighted norm, also from far.

Near the surface the integrator's own compiled projection does this at every step; this room serves the start
(`--assemble`), and the walk over the surface on which degrees of freedom are counted.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.compiled.bound_function import PositionRows
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.linear import metric_rows, surface
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.linear.surface import Linearized
from lagcli.start import initial
from lagcli.start.initial import State
from lagcli.start.precise_rows import PreciseRows

Floats = npt.NDArray[np.float64]


@frozen
class Reached:
    """The end of a descent: q (n,), and |f_i| / |B_i| of each row there; whether it is on the surface, or comes near
    to it further and further off alone."""

    q: Floats
    residuals: Floats
    is_on: bool
    recedes: bool = False

    @property
    def worst(self) -> float:
        """The largest of the residuals; infinite where they are not finite."""
        return (
            float(np.max(self.residuals, initial=0.0)) if np.isfinite(self.residuals).all() else float("inf")
        )


class Surface:
    """f = 0 at one time, with the metric of one configuration; of some of the rows where `only` numbers them."""

    def __init__(
        self, numeric: NumericSystem, t: float, p: Floats, metric: Metric, only: list[int] | None = None
    ) -> None:
        self._numeric, self._t, self._p, self._metric, self._only = numeric, t, p, metric, only

    def rows(self, q: Floats) -> tuple[Floats, Sparse]:
        """f (s,) and B (s, n), sparse."""
        f, entries = self.values(q)
        return f, self.matrix(entries)

    def values(self, q: Floats) -> tuple[Floats, Floats]:
        """f (s,) and the entries of B at q (n,), which `matrix` puts in their places."""
        return self._rows.values(q)

    def matrix(self, entries: Floats) -> Sparse:
        """B (s, n), sparse."""
        return self._rows.matrix(entries)

    @cached_property
    def _rows(self) -> PositionRows:
        return PositionRows(self._numeric.holonomic, self._t, self._p, self._only)

    def at(self, q: Floats) -> Linearized | None:
        """f and B at q, None where they are not finite."""
        f, entries = self.values(q)
        if not (np.isfinite(f).all() and np.isfinite(entries).all()):
            return None
        return Linearized(f, self.matrix(entries), self._metric, initial.size(q))

    def descend(self, q: Floats, to_the_end: bool = False) -> Reached:
        """See `surface.descend`: in the metric, with rows of length one, so that neither units nor the scale of a row
        count."""
        q, here = surface.descend(self.at, q, to_the_end)
        if here is None:
            return Reached(q, np.full(len(self.rows(q)[0]), np.inf), False)
        # The last steps stall at rounding; that is as far as doubles go.
        return Reached(q, here.residuals, here.distance <= doubles.ZERO)

    def nearby(self, q: Floats) -> Floats | None:
        """See `surface.nearby`. None from nearby shows that the surface is singular there."""
        return surface.nearby(self.at, q)

    def nearest(self, q: Floats, q0: Floats, steps: int = surface.PARAMETERS.nearest_steps) -> Floats:
        """The point of the surface nearest to q0 in the metric, from a point q of it, in so many steps at most."""

        def toward(q: Floats) -> Floats | None:
            here = self.at(q)
            if here is None:
                return None
            reached = self.descend(q0 + here.rows.correction(here.f + here.local.times(q0 - q)))
            return reached.q if reached.is_on else None

        return surface.nearest(toward, self._metric.length, q, q0, steps)


def velocity(v: Floats, B: Sparse, b: Floats, metric: Metric, is_whole: bool = False) -> Floats:
    """The nearest v with B v + b = 0 in the metric. Shapes (n,), (C, n), (C,).

    Where the rows contradict each other the result leaves a residual. So it may where they are nearly dependent, unless
    `is_whole`: then what sets them apart counts too, down to rounding.
    """
    rows = MetricRows(B, metric)
    for _ in range(2):  # the second pass removes the rounding of the first
        residual = LocalRows(B).times(v) + b
        v = v + (rows.whole_correction(residual, doubles.VALUE) if is_whole else rows.correction(residual))
    return v


def consistent(system: System, numeric: NumericSystem, state: State, metric: Metric) -> tuple[State, bool]:
    """A state with the velocity nearest to its own that satisfies its rows, and whether one was found.

    Where doubles find none, as the rows are too nearly dependent for them, it is sought in many digits: a row is a
    line, whatever it is multiplied by, and what sets it apart from others may be far below it.
    """
    there, is_found = _by_doubles(system, numeric, state, metric)
    solved = None if is_found else PreciseRows(numeric, state).solved()
    if solved is None:
        return there, is_found
    by_digits = dataclasses.replace(state, v=velocity(state.v, *solved, metric, is_whole=True))
    is_found = initial.residuals(system, numeric, by_digits).consistent
    return (by_digits if is_found else there), is_found


def needs_digits(system: System, numeric: NumericSystem, state: State) -> bool:
    """True if a velocity from rest that satisfies the rows at a state is found in many digits alone."""
    metric, rest = initial.metric_at(numeric, state), dataclasses.replace(state, v=np.zeros_like(state.v))
    is_found = _by_doubles(system, numeric, rest, metric)[1]
    return not is_found and consistent(system, numeric, rest, metric)[1]


def _by_doubles(system: System, numeric: NumericSystem, state: State, metric: Metric) -> tuple[State, bool]:
    """What `consistent` gives, by doubles: without the weakest rows, or else with them."""
    _, rows, b = initial.finite_rows(system, numeric, state)
    there = state
    for is_whole in (False, True):
        if is_whole and metric_rows.are_many(rows.count, state.q.size):
            break
        there = dataclasses.replace(state, v=velocity(state.v, rows.B, b, metric, is_whole))
        if initial.residuals(system, numeric, there).consistent:
            return there, True
    return there, False
