"""The measure of the error of a step: relative to the state, and to the sizes of the motion or to `atol`.

Without `atol` a component near zero has a tolerance that is a part of the speeds there are, and of what they and the
forces do in a step: these scale with the units, so that the same motion takes the same steps in all. Forces that
balance at a start at rest are looked at by themselves: nothing else has a size there, and their rounding is no error of
a step.
"""

from __future__ import annotations

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.compiled.bound_function import BoundFunction
from lagcli.equations.system import System
from lagcli.frozen import frozen_value
from lagcli.linear import decompositions
from lagcli.model.settings import Simulation
from lagcli.start import initial
from lagcli.start.initial import State

# Positions are moved by this part of their size.
BESIDE = 1e-3
# Forces that are less than this part of the terms that they are the sum of are stairs of rounding.
STAIRS = 1e-2


class ToleranceParameters:
    """From the tolerances of a run to those of a step; parts are of no unit. The tests are of
    `tests/unit/test_numbers_of_steps.py`."""

    __slots__ = ()

    tightening: float = 100.0
    """Errors of steps add up over a run: steps have this part. `test_steps_have_a_hundredth_of_the_tolerance`."""
    finest: float = 1e-14
    """The tightest of a step: below it its error is rounding. `test_a_step_has_fourteen_digits_at_most`."""
    default: float = 1e-13
    """That of a run without `atol`, of the size of the motion. `test_without_atol_thirteen_digits_are_asked_for`."""
    below: float = 1e-2
    """The absolute one of a step is this part of the relative one at most. `test_the_absolute_tolerance_has_bounds`."""
    least: float = 1e-16
    """And no less than this: rounding. `test_the_absolute_tolerance_has_bounds`."""
    rounding: float = 1e-17
    """The part of positions that their own rounding hides, and velocities over the length of a step; less than that of
    a double, for forces do not change by themselves. `test_rounding_of_positions_shows_in_velocities`."""
    stages: float = 16.0
    """An estimate of the error adds up the roundings of so many stages. `test_rounding_is_that_of_sixteen_stages`."""


PARAMETERS = ToleranceParameters()
# In a step the estimate of the error of W may be so many tolerances of a step: it is far above the error, and W swings
# twice as fast as the motion, so that a bound near 1 would integrate W again in every step of a smooth drive.
COARSE_WORK = 300.0
# Indices of a tolerance, those of them that are `blurred`; the unit of rounding.
COUNT, BLURRED, UNIT = 8, slice(5, 8), doubles.EPS / 2


def of_steps(settings: Simulation, balanced: float = 0.0) -> Floats:
    """(rtol, atol, part, rounding, balanced, blurred (3,)): the error of a step is compared with rtol |y| + atol, plus
    these parts of sizes. Without `atol` it is zero; with it `part` is, and `rounding` counts only where atol is below
    that of positions. balanced: the acceleration of `RestingForces`, whose rounding is allowed; blurred: positions,
    velocities and accelerations that are rounding of rows and forces, noted for each step where they count."""
    rtol = max(settings.rtol / PARAMETERS.tightening, min(settings.rtol, PARAMETERS.finest))
    tightened = rtol / settings.rtol
    if settings.atol is not None:
        known = settings.atol * tightened, 0.0, PARAMETERS.rounding
        return np.array([rtol, *known, balanced, 0.0, 0.0, 0.0])
    part = max(PARAMETERS.least, min(PARAMETERS.default * tightened, PARAMETERS.below * rtol))
    return np.array([rtol, 0.0, part, PARAMETERS.rounding, balanced, 0.0, 0.0, 0.0])


def absolute(settings: Simulation, size: float) -> float:
    """The absolute tolerance of a run for values of this size, such as the largest position or the largest speed."""
    return PARAMETERS.default * size if settings.atol is None else settings.atol


def sentence(settings: Simulation) -> str:
    """The tolerances of a run, for its account."""
    if settings.atol is None:
        return f"rtol {settings.rtol:g}, atol {PARAMETERS.default:g} of the sizes of the motion"
    return f"rtol {settings.rtol:g}, atol {settings.atol:g}"


@frozen_value
class RestingForces:
    """acceleration: that the largest term of h would make, 0 where the forces do not balance within h, in the units of
    `parts.Sizes`; energy: of the forces over the size of q. Both are 0 where the start moves."""

    acceleration: float
    energy: float


def resting_forces(system: System, numeric: NumericSystem) -> RestingForces:
    """The forces at the declared start."""
    state = initial.declared(system)
    t, q, v, p = state.t, state.q, state.v, state.p
    if not q.size or np.any(v):
        return RestingForces(0.0, 0.0)
    reach = BESIDE * (np.abs(q) + np.abs(q).max() + (not np.any(q)))
    elsewhere = q + reach * decompositions.generic_signs(q.size)
    moved = q.copy()
    sizes = BoundFunction(numeric.sizes, [np.array([t]), moved, v.copy(), p.copy()])
    sizes.trigger()
    length, here = sizes.results[0][[q.size, -1]].tolist()
    moved[:] = elsewhere
    sizes.trigger()
    beside = float(sizes.results[0][-1])
    if not here <= doubles.ZERO * beside:
        return RestingForces(0.0, here * length if np.isfinite(here) else 0.0)
    found = float(numeric.term_sizes(t, q, v, p)[-1])
    found = found if np.isfinite(found) else 0.0
    return RestingForces(found, found * length)


def is_blurred(numeric: NumericSystem, state: State, row_step: float) -> bool:
    """True where positions, velocities or accelerations at a state, or soon after it, are small beside the terms in t
    of the rows and forces that make them: they are known to the rounding of these."""
    if not (numeric.has_time and state.q.size):
        return False
    for t in (state.t, state.t + doubles.ROOT * row_step):
        given = t, state.q, state.v, state.p
        sizes, terms = np.array(numeric.state_roundings(*given))
        if ((sizes <= STAIRS * terms) & (terms > 0.0) & np.isfinite(terms)).any():
            return True
    return False
