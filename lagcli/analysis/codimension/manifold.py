"""Tell if equations of which some follow from the others at a point do so at finite distances around.

F = 0 are E equations in N unknowns, of rank r at z0. With A (r, E) of that rank on the range of dF, A F = 0 cuts
out a manifold of dimension N - r through z0, and F = 0 lies in it. Random points of the manifold are sought, some
way off: if all of F vanishes there but for rounding, F = 0 is the manifold.
"""

from __future__ import annotations

import abc
from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lagcli.analysis.codimension.scaled_equations import Equations, ScaledPart
from lagcli.linear import decompositions, metric_rows, rank
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows

Floats = npt.NDArray[np.float64]


class ManifoldParameters:
    """Walks over a manifold; lengths are in units of the scaled coordinates, values of scaled equations.

    The tests are of `tests/unit/test_analysis_thresholds.py` and `tests/unit/test_numbers_of_codimension.py`.
    """

    __slots__ = ()

    walks: int = 3
    """Walks over the surface at the start's time. `test_three_walks_of_three_steps_are_made_over_a_manifold`
    fails at 0 and 30."""
    steps: int = 3
    """Steps of each. `test_three_walks_of_three_steps_are_made_over_a_manifold` fails at 0 and 30."""
    step: float = 0.5
    """The first try of a step. `test_a_step_over_a_manifold_is_halved_five_times` fails at 0.05 and 5."""
    halvings: int = 5
    """Its halvings. `test_a_step_over_a_manifold_is_halved_five_times` fails at 0 and 50."""
    newton_steps: int = 12
    """Back to the manifold. `test_twelve_newton_steps_lead_back_to_a_manifold` fails at 1 and 120."""
    solved: float = 1e-12
    """The largest value that Newton's method leaves. `test_a_point_is_on_a_manifold_to_twelve_digits` fails
    at 1e-13 and 1e-11."""
    vanishes: float = 1e-11
    """The largest value that is rounding on a manifold that the equations follow; one that does not vanish is of
    the size of a power of the step. `test_a_row_that_follows_vanishes_to_rounding` fails at 1e-10."""
    off: float = 1e-9
    """The most that counts as rounding where numbers written to some digits leave more, from the begin on.
    `test_rows_that_are_off_at_the_start_do_not_follow` fails at 1e-10 and 1e-8."""
    roundings: int = 64
    """Roundings of the coordinates that a value may hold. `test_values_may_hold_some_roundings` fails at 6 and 640."""
    written: float = 100.0
    """By which factor values may be larger than those at the begin.
    `test_a_start_in_decimals_leaves_more_than_rounding` fails at 10."""
    far: tuple[float, ...] = (1e1, 1e2, 1e3, 1e4)
    """Far steps where the manifold is as flat: what is small over a unit is not over many.
    `test_a_row_that_follows_does_so_far_along_a_straight_line` fails without the last."""
    hidden: float = 1e-7
    """Rounding as large as this hides what does not vanish. `test_rounding_may_hide_a_row_that_does_not_follow`
    fails at 1e-6."""


PARAMETERS = ManifoldParameters()
# Of random directions: a fixed one, so that the verdict does not change.
SEED = 20061


class Look(Protocol):
    """Equations F (E,) at a point, those of them that cut out the manifold, and its directions there."""

    F: Floats
    is_finite: bool
    rest: Floats
    """A F (r,)."""

    @property
    def lengths(self) -> Floats:
        """The lengths of the gradients (E,)."""
        ...

    def shortest(self) -> Floats | None:
        """The shortest step with A dF step = A F, or None where their gradients are dependent."""
        ...

    def tangent(self, direction: Floats) -> Floats:
        """The part of a direction along the manifold."""
        ...


class _DenseLook:
    """A dense, as are the derivatives J (E, N)."""

    def __init__(self, F: Floats, J: Floats, A: Floats) -> None:
        self.F, self._J, self._A = F, J, A
        self.is_finite = bool(np.isfinite(F).all() and np.isfinite(J).all())
        self.rest = A @ F

    @property
    def lengths(self) -> Floats:
        return np.asarray(np.linalg.norm(self._J, axis=1))

    def shortest(self) -> Floats | None:
        Q, R = decompositions.orthonormal((self._A @ self._J).T)
        if np.abs(np.diag(R)).min(initial=1.0) < rank.PARAMETERS.small:
            return None
        return np.asarray(Q @ np.linalg.solve(R.T, self.rest))

    def tangent(self, direction: Floats) -> Floats:
        Q, _ = decompositions.orthonormal((self._A @ self._J).T)
        return np.asarray(direction - Q @ (Q.T @ direction))


class _SparseLook:
    """A takes some of the equations as they are, and the derivatives J (E, N) are sparse."""

    def __init__(self, F: Floats, J: LocalRows, chosen: list[int]) -> None:
        self.F, self._J, self._chosen = F, J, chosen
        self.is_finite = bool(np.isfinite(F).all() and np.isfinite(J.values).all())
        self.rest = F[chosen]

    @property
    def lengths(self) -> Floats:
        return self._J.norms

    @cached_property
    def _rows(self) -> MetricRows:
        B = self._J.B[self._chosen, :]
        return MetricRows(B, Metric.unit(int(B.shape[1])))

    def shortest(self) -> Floats | None:
        step = -self._rows.correction(self.rest, metric_rows.PARAMETERS.shift)
        return step if np.isfinite(step).all() else None

    def tangent(self, direction: Floats) -> Floats:
        across = self._J.times(direction)[self._chosen]
        return direction + self._rows.correction(across, metric_rows.PARAMETERS.shift)


class Walked(abc.ABC):
    """A F = 0 near z0, a manifold to walk on."""

    rounding: float

    @abc.abstractmethod
    def look(self, z: Floats, t: float) -> Look:
        """The equations at a point."""

    def reached(self, z: Floats, t: float) -> Floats | None:
        """The point of the manifold that Newton's method reaches from z, or None."""
        limit = PARAMETERS.solved + PARAMETERS.roundings * self.rounding
        for _ in range(PARAMETERS.newton_steps):
            here = self.look(z, t)
            if not here.is_finite:
                return None
            if np.abs(here.rest).max(initial=0.0) <= limit:
                return z
            step = here.shortest()
            if step is None:
                return None
            z = z - step
        return None

    def step(self, z: Floats, t: float, direction: Floats) -> Floats | None:
        """A point of the manifold about a step away along the tangent part of a direction, or None."""
        along = self.look(z, t).tangent(direction)
        largest = float(np.abs(along).max(initial=0.0))
        if largest <= rank.PARAMETERS.large:  # nowhere to go: the manifold is a point
            return z
        for halving in range(PARAMETERS.halvings):
            size = PARAMETERS.step / 2**halving
            there = self.reached(z + size * along / largest, t)
            if there is not None and size / 2 < np.abs(there - z).max() < 2 * size:
                return there
        return None

    def holds_all(self, z: Floats, t: float, off: float) -> bool:
        """True if all equations vanish at a point, but for rounding and for what they are off at the begin."""
        F = self.look(z, t).F
        limit = (
            min(PARAMETERS.vanishes + PARAMETERS.written * off, PARAMETERS.off)
            + PARAMETERS.roundings * self.rounding
        )
        return bool(np.abs(F).max(initial=0.0) <= limit) and limit < PARAMETERS.hidden

    def fails_far(self, z: Floats, t: float, direction: Floats) -> bool:
        """True if some equations do not vanish at points of the manifold far along a straight line from z."""
        along = self.look(z, t).tangent(direction)
        largest = float(np.abs(along).max(initial=0.0))
        if largest <= rank.PARAMETERS.large:
            return False
        for size in PARAMETERS.far:
            point = z + size * along / largest
            there = self.reached(point, t)
            if there is None or np.abs(there - point).max() > PARAMETERS.step:
                return False  # it is curved: what Newton's method finds may be another branch
            look = self.look(there, t)
            distance = np.abs(look.F) / np.maximum(look.lengths, 1.0)
            if distance.max(initial=0.0) > PARAMETERS.off + PARAMETERS.roundings * size * self.rounding:
                return True
        return False


class Manifold(Walked):
    """A F = 0 with a matrix `chosen` A (r, E)."""

    def __init__(self, equations: Equations, chosen: Floats) -> None:
        self._equations, self._chosen = equations, chosen

    @property
    def rounding(self) -> float:  # type: ignore[override]
        """The amount by which rounding moves values of F near zero."""
        return self._equations.rounding

    def look(self, z: Floats, t: float) -> Look:
        """The equations at a point."""
        return _DenseLook(*self._equations.at(z, t), self._chosen)


class LargeManifold(Walked):
    """Some of the rows of a large part, by their numbers there."""

    def __init__(self, part: ScaledPart, chosen: list[int]) -> None:
        self._part, self._chosen, self.rounding = part, chosen, part.rounding

    def look(self, z: Floats, t: float) -> Look:
        """The rows at a point."""
        return _SparseLook(*self._part.entries_at(z, t), self._chosen)


def along(equations: Equations, z: Floats, t: float, count: int) -> Manifold | None:
    """The manifold of `count` equations chosen at z, or None where no gap shows them to be so many."""
    _, J = equations.at(z, t)
    if not np.isfinite(J).all():
        return None
    found = rank.space(J)
    return Manifold(equations, found.combinations) if found.value == count else None


def _of_many(part: ScaledPart, chosen: list[int]) -> LargeManifold | None:
    """The manifold of those rows of a large part, or None where no gap shows its rank to be their number."""
    _, J = part.entries_at(part.begin, part.state.t)
    if not np.isfinite(J.values).all():
        return None
    rows = MetricRows(J.B, Metric.unit(int(J.B.shape[1])))
    return LargeManifold(part, chosen) if rank.estimate(rows).value == len(chosen) else None


def satisfies_all(found: Walked, z: Floats, t: float, times: Sequence[float]) -> bool:
    """True if all equations vanish on the manifold around a point of it, and at other times.

    Where a step cannot be made, or rounding is too large to see it, that is not shown.
    """
    random = np.random.default_rng(SEED)
    off = float(np.abs(found.look(z, t).F).max(initial=0.0))
    if found.fails_far(z, t, random.standard_normal(z.size)):
        return False
    for time in (*([t] * PARAMETERS.walks), *times):
        here = found.reached(z, time)
        if here is None or not found.holds_all(here, time, off):
            return False
        for _ in range(PARAMETERS.steps):
            here = found.step(here, time, random.standard_normal(z.size))
            if here is None or not found.holds_all(here, time, off):
                return False
    return True


def is_regular(part: ScaledPart, count: int, times: Sequence[float], independent: Sequence[int] = ()) -> bool:
    """True if rows of this rank at their begin cut out a surface of that codimension, and do so at other times. Of a
    large part as many `independent` ones are given.

    Then some of them cut it out and the others vanish on it, and the multiplier rule (D.13-D.22) holds: there are
    multipliers for the force that the surface needs, though not single ones.
    """
    t = part.state.t
    if not part.coordinates:  # 0 = 0, the empty component of a vector equation
        return all(not part.at(part.begin, time)[0].any() for time in (t, *times))
    found = _of_many(part, list(independent)) if part.is_large else along(part, part.begin, t, count)
    return found is not None and satisfies_all(found, part.begin, t, times)
