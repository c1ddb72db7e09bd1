"""Tell if equations of which some follow from the others at a point do so at finite distances around.

F = 0 are E equations in N unknowns, of rank r at z0. With A (r, E) of that rank on the range of dF, A F = 0 cuts
out a manifold of dimension N - r through z0, and F = 0 lies in it: if all of F vanishes at random points of it some way
off, F = 0 is the manifold. And the codimensions that are proved so at points nearby, around a singular one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lagcli import doubles
from lagcli.analysis.codimension.scaled_equations import ScaledPart
from lagcli.arrays import Floats
from lagcli.linear import decompositions, metric_rows, rank, surface
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.linear.surface import Linearized
from lagcli.start import initial, precise_rows, projection

# The first try of a step; by which factor values may be larger than those at the begin.
STEP, WRITTEN = 0.5, 100.0
# Of random directions: a fixed one, so that the verdict does not change.
SEED = 20061

# F (E,) and dF/dz (E, N) at z and t; values that are not finite where a law has none.
Equations = Callable[[Floats, float], tuple[Floats, Floats]]


class Look:
    """Equations F (E,) at a point with the lengths of their gradients (E,), and those that cut out the manifold.

    left: what Newton's method leaves of these, where others are sums of many.
    """

    def __init__(self, F: Floats, lengths: Floats, chosen: Linearized, left: float = 0.0) -> None:
        self.F, self.lengths, self.chosen, self.left = F, lengths, chosen, left
        self.is_finite = bool(np.isfinite(F).all() and np.isfinite(lengths).all() and chosen.is_finite)

    def tangent(self, direction: Floats) -> Floats:
        """The part of a direction along the manifold."""
        return direction + self.chosen.rows.correction(self.chosen.local.times(direction))


class Manifold:
    """Chosen equations near z0, which cut out a manifold to walk on: `look` gives all of them at a point and time."""

    def __init__(self, look: Callable[[Floats, float], Look], rounding: float) -> None:
        self.look, self.rounding = look, rounding

    def reached(self, z: Floats, t: float) -> Floats | None:
        """The point of the manifold that Newton's method reaches from z, or None."""

        def at(z: Floats) -> Linearized | None:
            here = self.look(z, t)
            return here.chosen if here.is_finite else None

        return surface.nearby(at, z)

    def step(self, z: Floats, t: float, direction: Floats) -> Floats | None:
        """A point of the manifold about a step away along the tangent part of a direction, or None."""
        along = self.look(z, t).tangent(direction)
        largest = float(np.abs(along).max(initial=0.0))
        if largest <= rank.PARAMETERS.large:  # nowhere to go: the manifold is a point
            return z
        return surface.walk(lambda there: self.reached(there, t), z, STEP * along / largest)

    def satisfies_all(self, z: Floats, t: float, times: Sequence[float]) -> bool:
        """True if all equations vanish on the manifold around a point of it, and at other times, as far as steps lead
        and rounding lets it be seen."""
        random = np.random.default_rng(SEED)
        off = float(np.abs(self.look(z, t).F).max(initial=0.0))
        if self._fails_far(z, t, random.standard_normal(z.size)):
            return False
        for time in (t, t, t, *times):
            here = self.reached(z, time)
            for taken in range(4):
                if here is not None and taken:
                    here = self.step(here, time, random.standard_normal(z.size))
                if here is None:
                    return False
                # They vanish, but for rounding and for what they are off at the begin.
                look = self.look(here, time)
                most = min(doubles.VALUE + WRITTEN * max(off, look.left), doubles.ZERO)
                limit = most + surface.PARAMETERS.roundings * self.rounding
                if not np.abs(look.F).max(initial=0.0) <= limit < rank.PARAMETERS.small:
                    return False
        return True

    def _fails_far(self, z: Floats, t: float, direction: Floats) -> bool:
        """True if some equations do not vanish at points of the manifold far along a straight line from z."""
        along = self.look(z, t).tangent(direction)
        largest = float(np.abs(along).max(initial=0.0))
        if largest <= rank.PARAMETERS.large:
            return False
        for size in 10.0 ** np.arange(1, 5):  # what is small over a unit is not over many
            point = z + size * along / largest
            there = self.reached(point, t)
            if there is None or np.abs(there - point).max() > STEP:
                return False  # it is curved: what Newton's method finds may be another branch
            look = self.look(there, t)
            distance = np.abs(look.F) / np.maximum(look.lengths, 1.0)
            if distance.max(initial=0.0) > doubles.ZERO + surface.PARAMETERS.roundings * size * self.rounding:
                return True
        return False


def along(at: Equations, rounding: float, z: Floats, t: float, count: int) -> Manifold | None:
    """The manifold A F = 0 of `count` equations chosen at z, or None where no gap shows them to be so many; rounding
    moves values of F near zero by so much."""
    _, J = at(z, t)
    if not np.isfinite(J).all():
        return None
    found = rank.space(J)
    A = found.combinations

    def look(z: Floats, t: float) -> Look:
        F, J = at(z, t)
        B = metric_rows.of_dense(A @ J)
        return Look(
            F,
            np.asarray(np.linalg.norm(J, axis=1)),
            Linearized(A @ F, B, Metric.unit(z.size), rounding=rounding),
        )

    return Manifold(look, rounding) if found.value == count else None


def is_regular(part: ScaledPart, count: int, times: Sequence[float], independent: Sequence[int] = ()) -> bool:
    """True if rows of this rank at their begin cut out a surface of that codimension, and do so at other times: then
    the multiplier rule (D.13-D.22) holds. Of a large part as many `independent` rows are given."""
    t = part.state.t
    if not part.coordinates:  # 0 = 0, the empty component of a vector equation
        return all(not part.at(part.begin, time)[0].any() for time in (t, *times))
    if not part.is_large:
        found = along(part.at, part.rounding, part.begin, t, count)
        return found is not None and found.satisfies_all(part.begin, t, times)
    F, J = part.entries_at(part.begin, t)
    if not np.isfinite(J.values).all():
        return False
    rows = MetricRows(J.B, Metric.unit(int(J.B.shape[1])))
    known = rank.estimate(rows).value
    if known is None:
        known = precise_rows.rank_of_many(rows, list(range(rows.count)), F, initial.size(part.begin))
    chosen, rounding = list(independent), part.rounding

    def look(z: Floats, t: float) -> Look:
        F, J = part.entries_at(z, t)
        f = F[chosen]
        some = Linearized(f, J.B[chosen, :], Metric.unit(z.size), rounding=rounding)
        return Look(F, J.norms, some, float(np.abs(f).max(initial=0.0)))

    return known == len(chosen) and Manifold(look, rounding).satisfies_all(part.begin, t, times)


class _SlowConvergence(Exception):
    """Newton's method comes to the surface, but slowly: what is there is not regular."""


def codimensions(part: ScaledPart, times: Sequence[float]) -> set[int | None]:
    """The codimensions at points of the surface that random steps reach from the begin, at later times where time
    enters; None where one is not proved, as where a branch is not regular, or where most steps come nowhere."""

    def met(z: Floats) -> Floats | None:
        """The point that Newton's steps reach, each squaring a small residual, or None."""

        def at(z: Floats) -> Linearized | None:
            F, J = part.entries_at(z, t)
            here = Linearized(F, J.B, Metric.unit(z.size), rounding=part.rounding)
            return here if here.is_finite else None

        end = surface.approach(at, z)
        if end is not None and end.creeps:
            raise _SlowConvergence
        return end.x if end is not None and end.is_met else None

    found: set[int | None] = set()
    failed = 0
    random = np.random.default_rng(SEED + 1)
    for point in range(16):
        z = part.begin
        t = times[point % len(times)] if times else part.state.t
        # Four sizes by turns, the first of each a walk: a branch that bends away is seen close by only.
        size = projection.PARAMETERS.step / 2 ** (point % 4)
        for _ in range(3 if point < 4 else 1):
            # A random step along the kernel of B, and back to the surface.
            tangent = rank.null_basis(decompositions.unit(part.at(z, t)[1]))
            direction = tangent @ random.standard_normal(tangent.shape[1])
            largest = float(np.abs(direction).max(initial=0.0))
            step = size * direction / largest if largest > 0 else direction
            try:
                there = surface.walk(met, z, step)
            except _SlowConvergence:
                return {None}
            if there is None:
                failed += 1
                break
            z = there
        else:
            here = part.moved(z, t)
            count = rank.space(decompositions.unit(here.at(here.begin, t)[1])).value
            later = [time for time in times if time > t]
            is_proved = count is not None and (count == len(part.rows) or is_regular(here, count, later))
            found.add(count if is_proved else None)
        if None in found or len(found) > 1 or failed > 8:
            return {None}
    return found
