"""The measure of the error of a step: relative to the state, and to the sizes of the motion or to `atol`.

Without `atol` a component near zero is held to a part of the size of the motion: of the speeds there are, of what they
and the forces do in a step. These scale with the units of length, time and mass and of each coordinate, so that the
same motion takes the same steps in all of them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.model.model import Simulation

Floats = npt.NDArray[np.float64]


class ToleranceParameters:
    """From the tolerances of a run to those of a step; parts are of no unit.

    None was moved to see which test fails: that is not known.
    """

    __slots__ = ()

    tightening: float = 100.0
    """Errors of steps add up over a run, and what is promised is about the result: the scheme is held to a
    hundredth of the tolerance asked for."""
    finest: float = 1e-14
    """The tightest tolerance of a step: below it its error estimate is rounding."""
    default: float = 1e-13
    """The absolute tolerance of a run without `atol`, as a part of the size of the motion."""
    below: float = 1e-2
    """Of a step it is no more than this part of the relative one."""
    least: float = 1e-16
    """And no less than this: rounding."""
    rounding: float = 1e-17
    """A part of the size of positions that their own rounding makes invisible: in a step it moves velocities by as
    much, divided by its length. It is below the spacing of doubles, for forces do not change by themselves in a
    step."""
    tiny: float = 1e-300
    """For what is divided by, so that zero over zero is zero."""


PARAMETERS = ToleranceParameters()
# In a step the estimate of the error of W may be so many tolerances of a step: it is far above the error, and W swings
# twice as fast as the motion, so that a bound near 1 would integrate W again in every step of a smooth drive.
COARSE_WORK = 300.0
# Numbers of a tolerance; the unit of rounding.
COUNT, UNIT = 6, 2**-53


def of_steps(settings: Simulation, balanced: float = 0.0, blurred: float = 0.0) -> Floats:
    """(rtol, atol, part, rounding, balanced, blurred): the error of a step is compared with rtol |y| + atol, plus these
    parts of sizes. Either atol or the parts are zero. balanced: the acceleration of `RestingForces`, the rounding of
    which is allowed; blurred: that of the rounding of the forces, at the start of the run; 0 where it does
    not count.
    """
    rtol = max(settings.rtol / PARAMETERS.tightening, min(settings.rtol, PARAMETERS.finest))
    tightened = rtol / settings.rtol
    if settings.atol is not None:
        return np.array([rtol, settings.atol * tightened, 0.0, 0.0, balanced, blurred])
    part = max(PARAMETERS.least, min(PARAMETERS.default * tightened, PARAMETERS.below * rtol))
    return np.array([rtol, 0.0, part, PARAMETERS.rounding, balanced, blurred])


def absolute(settings: Simulation, size: float) -> float:
    """The absolute tolerance of a run for values of this size, such as the largest position or the largest speed."""
    return PARAMETERS.default * size if settings.atol is None else settings.atol


def sentence(settings: Simulation) -> str:
    """The tolerances of a run, for its account."""
    if settings.atol is None:
        return f"rtol {settings.rtol:g}, atol {PARAMETERS.default:g} of the sizes of the motion"
    return f"rtol {settings.rtol:g}, atol {settings.atol:g}"
