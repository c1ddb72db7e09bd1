"""The two sides of a point: what jumps, what ends, and what grows without bound, by one test and one set of limits. How
far off they are looked at depends on how well the point is known, which they know who ask."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats


class SideParameters:
    """The limits of what differs on two sides. The tests are of `tests/unit/test_numbers_of_rows.py`."""

    __slots__ = ()

    stays: float = 0.3
    """A jump is this part of the change from farther off, or more, and what grows as much has a pole
    (`test_what_draws_near_as_the_distance_shrinks_is_no_jump`)."""
    grows: float = 10.0
    """A pole grows by more than this as the distance shrinks (`test_a_pole_grows_by_more_than_ten`)."""
    farther: float = 100.0
    """How far off farther is (`test_a_root_across_a_switch_is_no_jump`, `test_a_small_jump_on_a_slope_is_one`)."""


PARAMETERS = SideParameters()


def differ(near: Floats, far: Floats, least: Floats) -> Flags:
    """True where a change over next to nothing, above `least`, is a jump; far: the change from farther off."""
    with np.errstate(invalid="ignore", over="ignore"):
        stays = (near > PARAMETERS.stays * far) & (PARAMETERS.stays * near < far)
        return np.asarray(np.isfinite(near) & (near > least) & stays)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Sides:
    """Values (k,) at four points on a way through one: far before, near before, near after and far after. part: of
    themselves by which they must differ; rounding: a difference below this, (k,) or of all, is none."""

    values: tuple[Floats, ...]
    rounding: Floats | float = 0.0
    part: float = doubles.ROOT

    def jumps(self) -> Flags:
        """True for those with another value on the other side, however near that is."""
        a, b, c, d = self.values
        with np.errstate(invalid="ignore", over="ignore"):
            least = np.maximum(self.part * np.maximum(np.abs(b), np.abs(c)), self.rounding)
            # Of an even function the ends are alike, and it changes on either side.
            least = np.maximum(least, PARAMETERS.stays * np.ptp(np.array(self.values), axis=0))
            return differ(np.abs(c - b), np.abs(d - a), least)

    def ends(self) -> Flags:
        """True for those with a value before and none after."""
        a, b, _, d = (np.isfinite(x) for x in self.values)
        return np.asarray(a & b & ~d)

    def grows(self) -> Flags:
        """True for those that grow beyond any bound."""
        a, b, c, d = map(np.abs, self.values)
        with np.errstate(invalid="ignore"):
            return np.asarray((b > PARAMETERS.grows * a) & ~(c < PARAMETERS.grows * d) & (a > 0))


def bracket(
    is_before: Callable[[Floats], Flags | bool],
    low: Floats | float,
    high: Floats | float,
    narrow: float = 0.0,
) -> tuple[Floats, Floats]:
    """The parts (K,) of K ways, or () of one, between which each changes, by halves of those given: as near as so small
    a part of themselves. is_before: tells of a part of each if it lies before the change."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    for _ in range(60):  # an interval of the size of its ends has 53 bits
        if (high - low <= narrow * np.maximum(np.abs(low), np.abs(high))).all():
            break
        middle = np.asarray((low + high) / 2)
        before = is_before(middle)
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return low, high


def beside(low: Floats, high: Floats) -> tuple[Floats, ...]:
    """The four parts of a way, as of `Sides`, beside a change between two."""
    near, far = doubles.ZERO, PARAMETERS.farther * doubles.ZERO
    return low - far, low - near, high + near, high + far


def value_jumps(values: tuple[Floats, ...]) -> Flags:
    """True for values (k,) at four points, as of `Sides`, that jump, and not their slopes alone."""
    return Sides(values, part=doubles.ZERO).jumps()
