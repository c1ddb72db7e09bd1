"""Moves a configuration or velocity onto the constraints, in the mass-weighted norm, also from far.

Near the surface the integrator's own compiled projection does this at every step; this room serves the start
(`--assemble`), and the walk over the surface on which degrees of freedom are counted.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.compiled import NumericSystem
from lagcli.compiled.position_rows import PositionRows
from lagcli.frozen import frozen
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.start import initial

Floats = npt.NDArray[np.float64]


class ProjectionParameters:
    """The way onto the constraints; lengths are parts of the size of the configuration.

    The tests are of `tests/unit/test_numbers_of_projection.py` and `tests/unit/test_start_thresholds.py`.
    """

    __slots__ = ()

    most_steps: int = 200
    """Steps of a descent from far. `test_a_descent_has_two_hundred_steps` fails at 20 and 2000."""
    most_halvings: int = 30
    """Halvings of one of them. `test_a_step_of_a_descent_is_damped_thirty_times` fails at 3 and 300."""
    refinements: int = 60
    """Newton's steps to the nearest point. `test_sixty_steps_lead_to_the_nearest_point` fails at 6 and
    600."""
    arrived: float = 1e-14
    """The residual at which a descent ends. `test_a_descent_ends_at_fourteen_digits` fails at 1e-15 and
    1e-13."""
    rounding: float = 1e-10
    """The residual at which it may stall by rounding. `test_a_descent_may_stall_at_rounding` fails at 1e-11 and
    1e-9."""
    converged: float = 1e-13
    """The residual at which a few Newton steps have come close enough to tell that they square the residual.
    `test_newton_from_beside_a_double_root_only_halves_the_distance` fails at 1e-12."""
    nearest: float = 1e-12
    """The part of the way along the surface at which a point is the nearest one.
    `test_the_nearest_point_is_found_to_twelve_digits` fails at 1e-13 and 1e-11."""
    nearby_steps: int = 8
    """If the rows are independent, Newton's steps from nearby square the residual: so many reach rounding.
    `test_newton_from_beside_a_double_root_only_halves_the_distance` fails at 1 and 80."""
    first_damping: float = 1e-3
    """Damping, on rows of length one: where it begins. `test_a_step_of_a_descent_is_damped_thirty_times`
    fails at 0.0001 and 0.01."""
    stronger: float = 4.0
    """The factor by which it grows if a step goes up. `test_a_step_of_a_descent_is_damped_thirty_times` fails
    at 0.4 and 40."""
    weaker: float = 8.0
    """The factor by which it wanes if a step goes down. `test_damping_wanes_by_eight_down_to_nine_digits`
    fails at 0.8 and 80."""
    last_damping: float = 1e-9
    """The damping below which it is dropped. `test_damping_wanes_by_eight_down_to_nine_digits` fails at 1e-10
    and 1e-8."""
    slow_steps: int = 20
    """A descent ends where so many steps have left more than `slow` of the residual: others go round a bend
    in fewer. `test_a_descent_that_is_slow_for_twenty_steps_ends` fails at 2 and 200."""
    slow: float = 0.8
    """That part of the residual. `test_a_descent_that_is_slow_for_twenty_steps_ends` fails at 0.08 and 8."""


PARAMETERS = ProjectionParameters()


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

    def descend(self, q: Floats, to_the_end: bool = False) -> Reached:
        """A point of the surface from far, or else where the sum of (f_i / |B_i|)^2 is locally least.

        Gauss-Newton steps, damped as by Levenberg and Marquardt where they do not lead down: in the metric, with
        rows of length one, so that neither units nor the scale of a row count. A search gives up where steps are
        small; to_the_end: it goes on, and what is given is its last point.
        """
        damping = 0.0
        passed = np.inf
        f, entries = self.values(q)
        B = self.matrix(entries)
        best = self._reached(q, f, B)
        for taken in range(PARAMETERS.most_steps):
            progress.require_time()
            if best.is_on or not _are_finite(f, entries):
                break
            rows = MetricRows(B, self._metric)
            before = float(np.linalg.norm(f / rows.lengths))
            if taken % PARAMETERS.slow_steps == 0:
                if before > PARAMETERS.slow * passed and not to_the_end:
                    break
                passed = before
            for _ in range(PARAMETERS.most_halvings):
                step = rows.correction(f, damping)
                after, entries = self.values(q + step)
                length = (
                    float(np.linalg.norm(after / rows.lengths)) if _are_finite(after, entries) else np.inf
                )
                if length < before:
                    break
                damping = max(PARAMETERS.stronger * damping, PARAMETERS.first_damping)
            else:
                break
            q, f, B = q + step, after, self.matrix(entries)
            damping = damping / PARAMETERS.weaker if damping > PARAMETERS.last_damping else 0.0
            here = self._reached(q, f, B)
            best = here if to_the_end or here.is_on or here.worst <= best.worst else best
        # The last steps stall at rounding; that is as far as doubles go.
        size = max(initial.size(q), initial.size(best.q))
        return dataclasses.replace(best, is_on=best.is_on or best.worst <= PARAMETERS.rounding * size)

    def _reached(self, q: Floats, f: Floats, B: Sparse) -> Reached:
        rows = LocalRows(B)
        if not _are_finite(f, rows.values):
            return Reached(q, np.full(f.size, np.inf), False)
        residuals = np.abs(f) / rows.divisors
        return Reached(
            q, residuals, bool(np.max(residuals, initial=0.0) <= PARAMETERS.arrived * initial.size(q))
        )

    def residual(self, q: Floats) -> float:
        """Largest |f_i| / |B_i|."""
        f, B = self.rows(q)
        rows = LocalRows(B)
        if not _are_finite(f, rows.values):
            return float("inf")
        return float(np.max(np.abs(f) / rows.divisors, initial=0.0))

    def nearby(self, q: Floats) -> Floats | None:
        """The point of the surface that a few full Newton steps reach, each squaring a small residual, or None.

        None from nearby shows that the surface is singular there: its rows are dependent on it and independent
        beside it, and Newton's steps only halve the distance.
        """
        size = initial.size(q)
        for _ in range(PARAMETERS.nearby_steps):
            if self.residual(q) <= PARAMETERS.converged * size:
                return q
            f, entries = self.values(q)
            if not _are_finite(f, entries):
                return None
            q = q + MetricRows(self.matrix(entries), self._metric).correction(f)
        return None

    def refined(self, q: Floats, q0: Floats, steps: int = PARAMETERS.refinements) -> Floats:
        """The point of the surface nearest to q0 in the metric, from a point q of it, in so many steps at most.

        Gauss-Newton on the condition q - q0 = -M^-1 B^T mu at the point itself; where it does not contract, the point
        with the smaller distance is kept.
        """
        best = q
        size = initial.size(q0)
        for _ in range(steps):
            f, B = self.rows(q)
            step = MetricRows(B, self._metric).correction(f + LocalRows(B).times(q0 - q))
            reached = self.descend(q0 + step)
            new = reached.q
            if not reached.is_on or (
                self._metric.length(new - q0)
                >= self._metric.length(best - q0) * (1 + 1e-12) + PARAMETERS.nearest * size
            ):
                break
            moved = float(np.abs(new - q).max(initial=0.0))
            best = q = new
            if moved <= PARAMETERS.nearest * size:
                break
        return best


def velocity(v: Floats, B: Sparse, b: Floats, metric: Metric) -> Floats:
    """The nearest v with B v + b = 0 in the metric. Shapes (n,), (C, n), (C,).

    Where the rows contradict each other the result leaves a residual.
    """
    rows = MetricRows(B, metric)
    for _ in range(2):  # the second pass removes the rounding of the first
        v = v + rows.correction(LocalRows(B).times(v) + b)
    return v


def _are_finite(f: Floats, entries: Floats) -> bool:
    return bool(np.isfinite(f).all() and np.isfinite(entries).all())
