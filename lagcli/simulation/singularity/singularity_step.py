"""Singular configurations on the way: where rows become dependent at an instant, and the motion goes through.

At a crossing of the branches of a constraint surface (a parallelogram linkage with its rods in line) S = B M^-1 B^T is
singular, while the motion on its own branch stays smooth: one step of collocation leads across with the instant, which
`singularity_monitor` predicts, in its middle, where no node lies. Where other rows would lose nothing there these are
taken.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.compiled.bound_function import BoundFunction
from lagcli.compiled.selection import Selection
from lagcli.linear import independent_rows, rank
from lagcli.linear.metric_rows import LocalRows, MetricRows
from lagcli.simulation.run_state.statistics import RankDrop
from lagcli.simulation.scheme import collocation
from lagcli.simulation.singularity.singularity_monitor import PARAMETERS as MONITOR
from lagcli.simulation.singularity.singularity_monitor import SMALLEST_ANGLE, Prediction
from lagcli.start.initial import State, metric_at

# The root of the smallest angle at a time in a step.
Root = Callable[[float], float]


class SingularStepParameters:
    """Parts are of no unit; a distance delta is the angle between rows, in radians. The tests are of
    `tests/physics/test_contacts_at_poles.py` and `tests/physics/test_crossing.py` and
    `tests/unit/test_numbers_of_steps.py`."""

    __slots__ = ()

    nodes: int = 10
    """Gauss nodes of the step, even: none lies in the middle, where the instant is.
    `test_the_double_four_bar_goes_through_ten_crossings_at_every_tolerance`."""
    roundoff: float = 1e-13
    """The part of sizes that a step of these nodes loses by rounding. `test_steps_agree_to_amplified_rounding`."""
    amplified_roundoff: float = 2e-17
    """The rounding of forces close to dependent rows, over delta**3. `test_steps_agree_to_amplified_rounding`."""
    centered: float = 0.04
    """It may be off by this part of the time up to it. `test_an_instant_is_found_until_it_is_centered`."""
    most_centerings: int = 6
    """Looks for the instant before an ordinary step goes on. `test_an_instant_is_looked_for_six_times`."""
    parts: tuple[float, ...] = (0.5, 0.13, 0.35, 0.04, 0.22)
    """Where the instant may lie in a step: in its middle, or between the first nodes.
    `test_a_crossing_soon_after_the_start`."""
    too_close: float = 0.03
    """The angle (rad) below which a step begins so close. `test_all_distances_are_tried_from_close_by`."""
    looks: tuple[float, ...] = (0.15, 0.02, 0.001)
    """Parts, and twice these, of twice the time up to the instant, where the smallest angle beside it is read, about
    the zero found before; the last where rows can be followed so close: what a cubic leaves out falls with the fourth
    power. `test_the_instant_is_read_closer_and_closer`, `test_the_smallest_angle_is_a_line_through_zero`,
    `test_a_contact_whose_multiplier_has_a_pole_opens_there`."""
    bent: float = 0.1
    """The smallest angle is a line through zero, but for this part. `test_the_smallest_angle_is_a_line_through_zero`,
    `test_a_crossing_soon_after_the_start`."""
    zero_steps: int = 6
    """Newton's steps for it: each doubles the digits. `test_the_zero_of_a_cubic_is_found_to_rounding`."""
    along_step: tuple[float, ...] = (0.02, 0.2, 0.4, 0.6, 0.8, 0.9)
    """Parts of the time to the instant, and behind it. `test_the_smallest_angle_falls_all_the_way`."""
    halvings: int = 30
    """At most so often. `test_a_step_from_a_singular_start_is_halved`."""
    same_velocity: float = 1e-5
    """The velocities of such a step at its begin are those of the start to this part.
    `test_a_step_from_a_singular_start_has_its_velocities`,
    `test_a_start_at_a_crossing_goes_on_along_the_branch_of_its_velocities`."""


PARAMETERS = SingularStepParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Point:
    """The begin of a step: t, y and y' (2n + 1,), the parameters p, and `step_tolerance.of_steps`."""

    t: float
    y: Floats
    k: Floats
    p: Floats
    tolerance: Floats

    def state(self, t: float, y: Floats) -> State:
        """The state that y (2n + 1,) holds, at a time."""
        n = y.size // 2
        return State(t, y[:n], y[n : 2 * n], self.p)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SingularStep:
    """A step across an instant at which rows are dependent, and what they lose there."""

    step: collocation.Step
    instant: float
    loss: RankDrop

    @property
    def width(self) -> float:
        """The width of the part of the step around the instant that has it in the middle; of the whole step where it
        begins."""
        before, after = self.instant - self.step.t, self.step.t + self.step.h - self.instant
        return 2 * min(before, after) if before > 0 else self.step.h

    @property
    def is_start(self) -> bool:
        """True if the run begins at the instant."""
        return self.instant == self.step.t

    @property
    def middle(self) -> Floats:
        """The state at the instant."""
        return self.step.state((self.instant - self.step.t) / self.step.h)


def across(
    numeric: NumericSystem, project: BoundFunction, here: Point, predicted: Prediction
) -> SingularStep | Selection | None:
    """The step across what is predicted, or other independent rows to go on with, or None: an ordinary step goes on.
    project: `NumericSystem.project` on arrays (t, y, p) of its own. Other rows are taken where those at hand become
    dependent and others do not. A step that begins close to the instant is long beyond it, for rounding is amplified
    close to it."""
    parts = PARAMETERS.parts if predicted.angle < PARAMETERS.too_close else PARAMETERS.parts[:1]
    placed = (_placed(project, here, predicted, part) for part in parts)
    found, begin = next((each for each in placed if each is not None), None), here.state(here.t, here.y)
    if found is None:
        return _others(numeric, begin)
    step, instant = found
    there = here.state(instant, step.state((instant - step.t) / step.h))
    others = _others(numeric, there)
    if others is not None:
        return others
    lost = loss(numeric, begin, there, here.tolerance[0])
    return SingularStep(step, instant, lost) if lost is not None else None


def away(numeric: NumericSystem, project: BoundFunction, here: Point, h: float) -> SingularStep | None:
    """The first step, of length h or shorter, from a singular configuration along the branch that the velocities
    choose; None where no smooth motion has them."""
    start = here.state(here.t, here.y)
    for _ in range(PARAMETERS.halvings):
        step = _start(project, here, h)
        if step is not None:
            lost = loss(numeric, here.state(here.t + h, step.state(1.0)), start, here.tolerance[0])
            units = np.array(numeric.sizes(start.t, start.q, start.v, start.p)).ravel()[: start.v.size]
            off = float((np.abs(step.slope(0.0)[: start.v.size] - start.v) / units).max())
            is_along = off <= PARAMETERS.same_velocity * float((np.abs(start.v) / units).max())
            return SingularStep(step, here.t, lost) if lost is not None and is_along else None
        h /= 2
    return None


def _others(numeric: NumericSystem, state: State) -> Selection | None:
    """Other independent rows, where those at hand are close to dependent ones at a state and others are not."""
    if not numeric.selection.dependencies or numeric.closed_rows:
        return None
    rows = MetricRows(numeric.rows(state.t, state.q, state.v, state.p)[0], metric_at(numeric, state))
    return independent_rows.elsewhere(numeric.selection, rows, numeric.holonomic.size1_out(0))


def _placed(
    project: BoundFunction, here: Point, predicted: Prediction, part: float
) -> tuple[collocation.Step, float] | None:
    """The step with the instant at this part of it, where no node is near, and the instant; None where it is not right
    to the tolerance."""
    t, y, k, tolerance = here.t, here.y, here.k, here.tolerance
    instant, rtol = predicted.instant, tolerance[0]
    step = collocation.rising(t, y, (instant - t) / part, k)
    for _ in range(PARAMETERS.most_centerings):
        h = (instant - t) / part
        if not t + h / 64 > t:
            return None
        better = collocation.improved(project, step, h, PARAMETERS.nodes, rtol)
        if better is None:
            return None
        step = better
        root = functools.partial(_root, project, step, predicted.component)
        found = _instant(root, instant, 2 * part * h)
        if found is None:
            return None
        if abs(found[0] - instant) <= PARAMETERS.centered * part * h:
            if not _is_only_one(root, step, found[0]):
                return None
            fewer = collocation.improved(project, step, h, MONITOR.fewer_nodes, rtol)
            closest = float(np.abs(collocation.gauss(PARAMETERS.nodes)[0] - part).min())
            delta = found[1] * h * closest / predicted.most
            agree = fewer is not None and _agree(project, (step, fewer), tolerance, delta)
            return (step, found[0]) if agree else None
        instant = found[0]
    return None


def _start(project: BoundFunction, here: Point, h: float) -> collocation.Step | None:
    """A step from a start at which rows are dependent, or None where h is too long or no motion goes on smoothly."""
    t, y, tolerance = here.t, here.y, here.tolerance
    n = y.size // 2
    guess = collocation.rising(t, y, h, np.concatenate([y[n : 2 * n], np.zeros(n + 1)]))
    step, fewer = (
        collocation.improved(project, guess, h, count, tolerance[0])
        for count in (PARAMETERS.nodes, MONITOR.fewer_nodes)
    )
    if step is None or fewer is None:
        return None
    delta = _root(project, step, SMALLEST_ANGLE, t + h * float(collocation.gauss(PARAMETERS.nodes)[0][0]))
    return step if delta > 0 and _agree(project, (step, fewer), tolerance, delta) else None


def _agree(
    project: BoundFunction, steps: tuple[collocation.Step, collocation.Step], tolerance: Floats, delta: float
) -> bool:
    """True if two steps agree to the tolerance, or to rounding at a distance delta from dependent rows."""
    step = steps[0]
    new, other = (each.state(1.0)[:-1] for each in steps)
    rtol, atol = tolerance[:2]
    own = np.maximum(np.abs(step.y[:-1]), np.abs(new))
    collocation.projected(project, step.t + step.h, step.state(1.0))
    n = new.size // 2
    sizes = collocation.sizes_of(project.results[3])[:-1]
    # Rounding of positions shows in velocities, the more the shorter the step.
    sizes[n:] = np.maximum(sizes[n:], sizes[:n] / step.h)
    rounding = min(doubles.ZERO, max(PARAMETERS.roundoff, PARAMETERS.amplified_roundoff / delta**3))
    allowed = np.maximum(atol + rtol * own, rounding * sizes)
    return bool((np.abs(new - other) <= allowed).all())


def _instant(root: Root, instant: float, width: float) -> tuple[float, float] | None:
    """The instant at which the smallest angle vanishes within a width around a guess, and the slope of its root there;
    None where it does not vanish in a line."""
    *looks, closest = PARAMETERS.looks
    for offset in looks:
        looked = _beside(root, instant, offset, width)
        if looked is None:
            return None
        taus, roots, zero, slope = looked
        instant += zero
    if np.any(np.abs(roots - abs(slope) * np.abs(taus - zero)) > PARAMETERS.bent * roots):
        return None
    looked = _beside(root, instant, closest, width)
    if looked is not None:
        instant += looked[2]
    return instant, abs(slope)


def _beside(
    root: Root, instant: float, offset: float, width: float
) -> tuple[Floats, Floats, float, float] | None:
    """Times beside an instant (4,), roots of the smallest angle there, and the zero between them with its slope;
    None where there is none."""
    offsets = np.array([offset, 2 * offset]) * width
    taus = np.concatenate([-offsets[::-1], offsets])
    roots = np.array([root(instant + tau) for tau in taus])
    signed = roots * np.sign(-taus)
    if not (np.isfinite(roots).all() and signed[1] > 0 > signed[2]):
        return None
    zero, slope = _zero(taus, signed)
    return (taus, roots, zero, slope) if abs(zero) < taus[2] else None


def _zero(x: Floats, y: Floats) -> tuple[float, float]:
    """Zero of the cubic through four points (x, y) near a falling line, and its slope there; nan if it does not fall.
    Newton's method on divided differences. Roots from a companion matrix would be as inexact as the cubic term is
    small, by 1e-10 where it is rounding only, and different from one linear algebra library to the next."""
    first = np.diff(y) / np.diff(x)
    second = np.diff(first) / (x[2:] - x[:-2])
    third = (second[1] - second[0]) / (x[3] - x[0])
    # Newton's form on the nodes x[1], x[2], x[0], x[3].
    cubic, factor = np.polynomial.Polynomial([y[1]]), np.polynomial.Polynomial([1.0])
    for coefficient, node in zip((first[1], second[0], third), (x[1], x[2], x[0]), strict=True):
        factor = factor * np.polynomial.Polynomial([-node, 1.0])
        cubic = cubic + coefficient * factor
    derivative = cubic.deriv()
    zero = float(x[1] - y[1] / first[1])
    for _ in range(PARAMETERS.zero_steps):
        slope = float(derivative(zero))
        if not slope < 0:  # far from a line
            return math.nan, slope
        zero -= float(cubic(zero)) / slope
    return zero, slope


def _is_only_one(root: Root, step: collocation.Step, instant: float) -> bool:
    """True if the smallest angle falls to the instant all the way and rises all the way after it: there is no other."""
    for begin, end in ((step.t, instant), (step.t + step.h, instant)):
        roots = [root(begin + x * (end - begin)) for x in PARAMETERS.along_step]
        if not all(after < before for before, after in itertools.pairwise(roots)):
            return False
    return True


def _root(project: BoundFunction, step: collocation.Step, component: int, at: float) -> float:
    """The root of the smallest angle on the surface at a time in a step."""
    if collocation.projected(project, at, step.state((at - step.t) / step.h)) is None:
        return math.nan
    return math.sqrt(max(0.0, project.results[2][component]))


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
    before: a state of the same motion at which rows have their lengths; rtol: relative error of positions."""
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
        weights = np.abs(rows.weakest[1])
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
