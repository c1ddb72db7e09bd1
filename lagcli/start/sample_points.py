"""Points of the constraint surface that are reached from the start.

What holds at generic points (ranks, derived flags) is looked for at them: the start may be special.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear import decompositions, generic_direction, metric_rows, rank
from lagcli.linear import surface as road
from lagcli.linear.metric_rows import LocalRows, MetricRows
from lagcli.start import initial
from lagcli.start.initial import State
from lagcli.start.precise_rows import PreciseRows

if TYPE_CHECKING:
    from lagcli.start.projection import Surface

Floats = npt.NDArray[np.float64]


class SamplePointParameters:
    """Points of the surface beside a start; lengths are parts of the size of the configuration.

    The tests are of `tests/unit/test_numbers_of_starts.py`.
    """

    __slots__ = ()

    points: int = 4
    """Points on the surface, besides the start. `test_four_points_are_reached_by_walks_of_three_steps` fails
    at 0 and 40."""
    walk_steps: int = 3
    """Steps of one walk. `test_four_points_are_reached_by_walks_of_three_steps` fails at 0 and 30."""
    step: float = 0.2
    """The length of a step. `test_four_points_are_reached_by_walks_of_three_steps` fails at 0.02 and 2."""
    offset: float = 1e-2
    """How far aside that is looked at. `test_a_gradient_vanishes_beside_what_it_is_a_hundredth_aside` fails
    at 0.001 and 0.1."""


PARAMETERS = SamplePointParameters()
# Of random steps: the same in every run.
SEED = 20061


def begin(system: System, numeric: NumericSystem) -> State:
    """The consistent state nearest to the declared one.

    Raises `diagnostics.ModelError` where there is none, and where the inertia has no finite value there.
    """
    from lagcli.start import assembly  # here, as a run from a consistent start needs none of it

    state = assembly.assemble(system, numeric, initial.declared(system), ()).state
    if not is_finite(numeric, state):
        initial.inertia(system, numeric, state)  # says of which coordinate
    return state


def surface(numeric: NumericSystem, state: State) -> Surface:
    """The surface at the time and parameters of a state, with the metric there."""
    from lagcli.start.projection import Surface

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

    `later`: the time moves on by up to this much at each point, where the surface goes on so long; step: the length of
    a step, in parts of the size of the configuration.
    """
    random = np.random.default_rng(SEED)
    found = [state]
    for _ in range(points):
        here: State | None = found[-1]
        for _ in range(PARAMETERS.walk_steps):
            here = None if here is None else _tangent_step(numeric, here, rows, step, random)
        if here is None:
            break
        if later:
            there = dataclasses.replace(here, t=here.t + later * random.random())
            q = surface(numeric, there).nearby(here.q)
            if q is not None and is_finite(numeric, there := dataclasses.replace(there, q=q)):
                here = there
        found.append(here)
    return found


def _tangent_step(
    numeric: NumericSystem, here: State, rows: list[int], length: float, random: np.random.Generator
) -> State | None:
    """The point after one random step along the kernel of the rows, as long as the curvature allows."""
    direction = _tangent(numeric, here, rows, random)
    largest = float(np.abs(direction).max(initial=0.0))
    if largest == 0.0:
        return here
    size, reached = initial.size(here.q), surface(numeric, here)

    def meet(q: Floats) -> Floats | None:
        there = reached.nearby(q)
        is_known = there is not None and is_finite(numeric, dataclasses.replace(here, q=there))
        return there if is_known else None

    q = road.walk(meet, here.q, length * size * direction / largest, size)
    return None if q is None else dataclasses.replace(here, q=q)


def _tangent(numeric: NumericSystem, here: State, rows: list[int], random: np.random.Generator) -> Floats:
    """A random direction in the kernel of the rows."""
    B = numeric.rows(here.t, here.q, here.v, here.p)[0][rows, :]
    if len(rows) > metric_rows.PARAMETERS.dense:
        u = random.standard_normal(here.q.size)
        return u + MetricRows(B, initial.metric_at(numeric, here)).correction(LocalRows(B).times(u))
    tangent = rank.null_basis(decompositions.unit(np.array(B)))
    return np.asarray(tangent @ random.standard_normal(tangent.shape[1]))


def plain_rows(numeric: NumericSystem, point: State) -> MetricRows:
    """All rows at a point as doubles have them, and their digits for a rank that these do not tell."""
    B = numeric.rows(point.t, point.q, point.v, point.p)[0]
    return MetricRows(B, initial.metric_at(numeric, point), PreciseRows(numeric, point))


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
    direction = generic_direction.direction(point.q.size, SEED)
    off = rows_at(point.q + PARAMETERS.offset * initial.size(point.q) * direction)
    with np.errstate(invalid="ignore"):  # a row may have no value aside
        return np.asarray(rows_at(point.q).norms <= doubles.ZERO * off.norms)


def is_finite(numeric: NumericSystem, point: State) -> bool:
    """True if rows and inertia are finite at a point."""
    B = numeric.rows(point.t, point.q, point.v, point.p)[0]
    M = numeric.inertia(point.t, point.q, point.v, point.p)
    return bool(np.isfinite(B.nonzeros()).all() and np.isfinite(M.nonzeros()).all())
