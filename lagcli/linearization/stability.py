"""The verdict of linear equations on stability, as far as it goes.

Two theorems decide for the nonlinear motion: Lyapunov's first method (all eigenvalues left of the imaginary axis, or
one right of it) and that of Lagrange and Dirichlet (a strict minimum of an energy that is kept). Nothing else does.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.linearization.linearized import LinearizedFunctions, Reference
from lagcli.linearization.lowest import Lowest
from lagcli.linearization.reference import Steady
from lagcli.linearization.spectrum import Spectrum

Complex = npt.NDArray[np.complex128]
Floats = npt.NDArray[np.float64]

# The rounding of multipliers: the integration leaves 1e-9 of them over a period. At 1e-7
# `test_a_multiplier_leaves_the_unit_circle_by_more_than_the_rounding_of_a_period` of
# `tests/unit/test_numbers_of_linear_equations.py` fails.
UNIT = 1e-8
NO_FREEDOM = "no freedom is left: nothing can swing, and there are no modes"
MINIMUM = "the potential has a strict minimum there (Lagrange and Dirichlet)"


@dataclasses.dataclass(frozen=True, slots=True)
class StabilityVerdict:
    """Stable or not, or None where the linear equations do not decide; growth: the largest real part."""

    stable: bool | None
    growth: float
    reason: str


def verdict(
    functions: LinearizedFunctions, motion: Steady, found: Spectrum, is_minimum: bool | None = None
) -> StabilityVerdict:
    """The verdict on a reference motion whose linear equations do not depend on t.

    is_minimum: whether the potential has a strict minimum there by all derivatives that count, not by those of the
    linear equations alone, which are zero, or rounding, where curvatures vanish; None where that is not known.
    """
    if not found.values.size and not found.zeros:
        return StabilityVerdict(True, 0.0, NO_FREEDOM)
    growth = float(found.values.real.max(initial=0.0 if found.zeros else -np.inf))
    if growth > 0:
        return StabilityVerdict(False, growth, _growing(growth))
    if not found.zeros and growth < 0:
        return StabilityVerdict(
            True, growth, f"all small deviations die away, the slowest as exp({growth:.6g} t) (Lyapunov)"
        )
    is_strict = found.is_definite if is_minimum is None else is_minimum
    is_at_rest = motion.kind == "equilibrium" and found.is_conservative
    if is_at_rest and is_strict and functions.keeps_energy(motion.here):
        return StabilityVerdict(True, 0.0, MINIMUM)
    return StabilityVerdict(None, 0.0, _undecided(found))


def of_lowest(
    functions: LinearizedFunctions, here: Reference, found: Lowest, is_equilibrium: bool
) -> StabilityVerdict:
    """The verdict where only the lowest eigenvalues are known; growth: the largest real part of these."""
    growth = float(found.values.real.max()) if found.values.size else 0.0
    if growth > 0:
        return StabilityVerdict(False, growth, _growing(growth))
    if is_equilibrium and found.is_definite and functions.keeps_energy(here):
        return StabilityVerdict(True, 0.0, MINIMUM)
    if found.has_all_growing:
        return StabilityVerdict(
            None, 0.0, "no eigenvalue is to the right of the imaginary axis: terms left out decide"
        )
    return StabilityVerdict(None, growth, "only the lowest eigenvalues were looked at")


def of_multipliers(multipliers: Complex, T: float, is_autonomous: bool) -> StabilityVerdict:
    """The verdict on a motion with the period T; one multiplier of an autonomous motion is 1 and says nothing."""
    sizes = np.abs(multipliers)
    largest = float(sizes.max(initial=0.0))
    growth = float(np.log(largest) / T) if largest > 0 else -np.inf
    if largest > 1 + UNIT:
        return StabilityVerdict(
            False, growth, f"a small deviation is {largest:.6g} times as large a period later"
        )
    trivial = int(is_autonomous)
    rest = np.sort(sizes)[: sizes.size - trivial]
    if rest.max(initial=0.0) < 1 - UNIT:
        what = (
            "all small deviations but that along the motion die away"
            if trivial
            else "all small deviations die away"
        )
        return StabilityVerdict(True, growth if not trivial else 0.0, f"{what} (Andronov and Witt)")
    return StabilityVerdict(
        None, 0.0, "some multipliers lie on the unit circle and none outside: terms left out decide"
    )


def _growing(growth: float) -> str:
    return f"small deviations grow as exp({growth:.6g} t)"


def _undecided(found: Spectrum) -> str:
    if found.zeros:
        kinds = f"{found.zeros} eigenvalues are zero" if found.zeros > 1 else "one eigenvalue is zero"
        return f"{kinds}: along some deviations nothing brings back or drives away, and terms left out decide"
    if found.is_conservative and not found.is_definite:
        return (
            "all eigenvalues are imaginary without a minimum of the potential: gyroscopic terms hold it, and terms"
            " left out decide"
        )
    return "some eigenvalues are imaginary and none is to the right: terms left out decide"
