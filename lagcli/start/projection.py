"""Moves a configuration or velocity onto the constraints, in the mass-weighted norm, also from far, and reaches other
points of the surface: what holds at generic points (ranks, derived flags) is looked for at them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.compiled.bound_function import PositionRows
from lagcli.equations.system import System
from lagcli.frozen import frozen
from lagcli.linear import decompositions, metric_rows, rank, surface
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.linear.surface import Linearized
from lagcli.start import initial
from lagcli.start.initial import State
from lagcli.start.precise_rows import PreciseRows


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
        return float(np.max(self.residuals, initial=0.0)) if np.isfinite(self.residuals).all() else np.inf


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
        return self._rows.matrix(entries)

    @cached_property
    def _rows(self) -> PositionRows:
        return PositionRows(self._numeric.holonomic, self._t, self._p, self._only)

    def at(self, q: Floats) -> Linearized | None:
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
    """The nearest v (n,) with B v + b = 0 in the metric. Where rows (C, n) contradict each other a residual is left,
    and where they are nearly dependent, unless `is_whole`: then what sets them apart counts too, down to rounding."""
    rows = MetricRows(B, metric)
    for _ in range(2):  # the second pass removes the rounding of the first
        residual = LocalRows(B).times(v) + b
        v = v + (rows.whole_correction(residual, doubles.VALUE) if is_whole else rows.correction(residual))
    return v


def consistent(system: System, numeric: NumericSystem, state: State, metric: Metric) -> tuple[State, bool]:
    """A state with the velocity nearest to its own that satisfies its rows, and whether one was found; in many digits
    where doubles find none, as the rows are too nearly dependent for them."""
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


class SamplePointParameters:
    """Points of the surface beside a start; lengths are parts of the size of the configuration.
    The tests are of `tests/unit/test_numbers_of_starts.py`."""

    __slots__ = ()

    points: int = 4
    """How many there are, besides the start (`test_four_points_are_reached_by_walks_of_three_steps`)."""
    step: float = 0.2
    """The length of a step of a walk (`test_four_points_are_reached_by_walks_of_three_steps`)."""
    offset: float = 1e-2
    """How far aside is beside (`test_a_gradient_vanishes_beside_what_it_is_a_hundredth_aside`)."""


PARAMETERS = SamplePointParameters()
# Of random steps: the same in every run.
SEED = 20061


def surface_at(numeric: NumericSystem, state: State) -> Surface:
    """The surface at the time and parameters of a state, with the metric there."""
    return Surface(numeric, state.t, state.p, initial.metric_at(numeric, state))


def along(
    numeric: NumericSystem,
    state: State,
    rows: list[int],
    later: float = 0.0,
    points: int = PARAMETERS.points,
    step: float = PARAMETERS.step,
) -> list[State]:
    """The start, and `points` of the surface that random steps along the kernel of some rows reach, each projected.
    later: by how much the time may move on at each; step: as a part of the size of the configuration."""
    random = np.random.default_rng(SEED)
    found = [state]
    for _ in range(points):
        here: State | None = found[-1]
        for _ in range(3):
            here = None if here is None else _tangent_step(numeric, here, rows, step, random)
        if here is None:
            break
        if later:
            there = dataclasses.replace(here, t=here.t + later * random.random())
            q = surface_at(numeric, there).nearby(here.q)
            if q is not None and is_finite(numeric, there := dataclasses.replace(there, q=q)):
                here = there
        found.append(here)
    return found


def _tangent_step(
    numeric: NumericSystem, here: State, rows: list[int], length: float, random: np.random.Generator
) -> State | None:
    """The point after one random step along the kernel of the rows, as long as the curvature allows."""
    B = numeric.rows(here.t, here.q, here.v, here.p)[0][rows, :]
    if len(rows) > metric_rows.PARAMETERS.dense:
        u = random.standard_normal(here.q.size)
        direction = u + MetricRows(B, initial.metric_at(numeric, here)).correction(LocalRows(B).times(u))
    else:
        tangent = rank.null_basis(decompositions.unit(np.array(B)))
        direction = np.asarray(tangent @ random.standard_normal(tangent.shape[1]))
    largest = float(np.abs(direction).max(initial=0.0))
    if largest == 0.0:
        return here
    size, reached = initial.size(here.q), surface_at(numeric, here)

    def meet(q: Floats) -> Floats | None:
        there = reached.nearby(q)
        is_known = there is not None and is_finite(numeric, dataclasses.replace(here, q=there))
        return there if is_known else None

    q = surface.walk(meet, here.q, length * size * direction / largest, size)
    return None if q is None else dataclasses.replace(here, q=q)


def plain_rows(numeric: NumericSystem, point: State) -> MetricRows:
    """All rows at a point as doubles have them, and their digits for a rank that these do not tell."""
    B = numeric.rows(point.t, point.q, point.v, point.p)[0]
    return MetricRows(B, initial.metric_at(numeric, point), PreciseRows(numeric, point).rank)


def rows(numeric: NumericSystem, point: State) -> MetricRows:
    """All rows at a point of the surface; one whose gradient vanishes on it is zero, whatever rounding leaves of it."""

    def rows_at(q: Floats) -> LocalRows:
        return LocalRows(numeric.rows(point.t, q, point.v, point.p)[0])

    B, flat = rows_at(point.q).B, vanishing(rows_at, point)
    if not flat.any():
        return plain_rows(numeric, point)
    keep = ca.DM(np.where(flat, 0.0, 1.0))
    return MetricRows(ca.mtimes(ca.diag(keep), B), initial.metric_at(numeric, point))


def vanishing(rows_at: Callable[[Floats], LocalRows], point: State) -> npt.NDArray[np.bool_]:
    """The rows, as a function of q, whose gradients vanish at a point but for rounding."""
    direction = decompositions.generic_direction(point.q.size, SEED)
    off = rows_at(point.q + PARAMETERS.offset * initial.size(point.q) * direction)
    with np.errstate(invalid="ignore"):  # a row may have no value aside
        return np.asarray(rows_at(point.q).norms <= doubles.ZERO * off.norms)


def is_finite(numeric: NumericSystem, point: State) -> bool:
    """True if rows and inertia are finite at a point."""
    B = numeric.rows(point.t, point.q, point.v, point.p)[0]
    M = numeric.inertia(point.t, point.q, point.v, point.p)
    return bool(np.isfinite(B.nonzeros()).all() and np.isfinite(M.nonzeros()).all())
