"""Singular points: on the surface nearby the rank of B is higher, as off the position where a linkage lies flat."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.analysis.codimension import manifold
from lagcli.analysis.codimension.scaled_equations import ScaledPart
from lagcli.linear import decompositions, rank, surface
from lagcli.linear.metric import Metric
from lagcli.linear.surface import Linearized
from lagcli.start import sample_points

Floats = npt.NDArray[np.float64]


class BranchParameters:
    """Random steps from a point where rows are dependent; lengths are in units of the scaled coordinates.

    The tests are of `tests/unit/test_analysis_thresholds.py` and `tests/unit/test_numbers_of_codimension.py`.
    """

    __slots__ = ()

    points: int = 16
    """Points sought. `test_points_of_a_surface_are_sought_by_walks_and_steps_of_several_sizes` fails at 1 and
    160."""
    walks: int = 4
    """Those of them that are reached by walks of several steps.
    `test_points_of_a_surface_are_sought_by_walks_and_steps_of_several_sizes` fails at 0 and 40."""
    steps: int = 3
    """Steps of these. `test_points_of_a_surface_are_sought_by_walks_and_steps_of_several_sizes` fails at 0
    and 30."""
    closer: int = 4
    """Steps are 1, 1/2, ... of it by turns, in so many sizes: a branch that bends away is seen close by only.
    `test_points_of_a_surface_are_sought_by_walks_and_steps_of_several_sizes` fails at 0 and 40."""


PARAMETERS = BranchParameters()
# Of random directions: a fixed one, so that the verdict does not change.
SEED = 20062


class _SlowConvergence(Exception):
    """Newton's method comes to the surface, but slowly: what is there is not regular."""


def codimensions(part: ScaledPart, times: Sequence[float]) -> set[int | None]:
    """The codimensions at points of the surface that random steps reach from the begin; None where one is not
    proved, as where several branches meet of which one is not regular anywhere, or where most steps come nowhere.
    Where time enters they are at later times: the start may be special for its time too."""
    found: set[int | None] = set()
    failed = 0
    random = np.random.default_rng(SEED)
    for point in range(PARAMETERS.points):
        z: Floats | None = part.begin
        t = times[point % len(times)] if times else part.state.t
        size = sample_points.PARAMETERS.step / 2 ** (point % PARAMETERS.closer)
        try:
            for _ in range(PARAMETERS.steps if point < PARAMETERS.walks else 1):
                z = None if z is None else _step(part, z, t, random, size)
        except _SlowConvergence:
            return {None}
        if z is None:
            failed += 1
        else:
            found.add(_at(part.moved(z, t), [time for time in times if time > t]))
        if None in found or len(found) > 1 or failed > PARAMETERS.points // 2:
            return {None}
    return found


def _at(part: ScaledPart, times: Sequence[float]) -> int | None:
    """The codimension at a point, or None."""
    _, J = part.at(part.begin, part.state.t)
    count = rank.space(decompositions.unit(J)).value
    if count is None:
        return None
    return count if count == len(part.rows) or manifold.is_regular(part, count, times) else None


def _step(part: ScaledPart, z: Floats, t: float, random: np.random.Generator, size: float) -> Floats | None:
    """A random step along the kernel of B, back to the surface where Newton's method squares the residual.

    Raises `_SlowConvergence`.
    """
    _, J = part.at(z, t)
    tangent = rank.null_basis(decompositions.unit(J))
    direction = tangent @ random.standard_normal(tangent.shape[1])
    largest = float(np.abs(direction).max(initial=0.0))
    step = size * direction / largest if largest > 0 else direction
    return surface.walk(lambda there: _nearby(part, there, t), z, step)


def _nearby(part: ScaledPart, z: Floats, t: float) -> Floats | None:
    """The point that Newton's steps reach, each squaring a small residual, or None. Raises `_SlowConvergence`."""

    def at(z: Floats) -> Linearized | None:
        F, J = part.entries_at(z, t)
        here = Linearized(F, J.B, Metric.unit(z.size), rounding=part.rounding)
        return here if here.is_finite else None

    end = surface.approach(at, z)
    if end is not None and end.creeps:
        raise _SlowConvergence
    return end.x if end is not None and end.is_met else None
