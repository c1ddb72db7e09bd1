"""The first point along a step at which one of many functions crosses zero.

The step is cut into pieces from left to right, for one function after the other. A piece is done as soon as bounds
(`zero_bounds`) keep the function on its side; where they say that it leaves it at one point alone, that point is found
by Newton's method within the bracket; else it is cut. Of thousands of functions those that stay clear of zero are done
after three evaluations, all at once.

The first cut is at the golden section, which no whole number of waves fits well: a wave as long as the step or shorter
that has an extreme at both ends has a slope there of 4 pi^2/sqrt(5) times its height, at the least, and is seen. What
is narrower and leaves no trace in values and slopes of three samples cannot be seen by any search.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Generic, NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.contact import zero_bounds
from lagcli.contact.zero_bounds import Cubic, Ends, Number

# x -> values (K,) and slopes dg/dx (K,) of all functions.
Values = Callable[[float], tuple[Floats, Floats]]

DOWN, BOTH, UP = -1, 0, 1  # the direction of a crossing: the sign of its slope, 0 for either
GOLDEN = (3 - math.sqrt(5)) / 2  # the golden section of an interval


class ZeroSearchParameters:
    """The search for a first crossing. The tests are of `tests/unit/test_numbers_of_contacts.py`."""

    __slots__ = ()

    margin: float = 0.1
    """A cut keeps this part of its piece from both ends (`test_a_cut_keeps_a_tenth_from_the_ends_of_its_piece`)."""
    narrow: float = 8 * doubles.EPS
    """A piece of this part of the step has no inside (`test_a_jump_over_zero_is_found_to_a_few_roundings`)."""
    most_evaluations: int = 2000
    """Of one search (`test_a_search_that_never_ends_has_two_thousand_evaluations`)."""
    few: int = 8
    """So many functions are looked at one after the other from the start
    (`test_of_more_than_eight_functions_most_are_told_at_once`)."""


PARAMETERS = ZeroSearchParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FirstCrossing:
    """The end of a search.

    x: the first point at which functions, `rows`, cross zero in their direction, or None. ending: those that arrive at
    zero at x = 1, to rounding, where none crosses before. unresolved: those of which it is open what they do beyond
    `clear`, before which nothing crosses.
    """

    x: float | None
    rows: tuple[int, ...] = ()
    ending: tuple[int, ...] = ()
    unresolved: tuple[int, ...] = ()
    clear: float = 1.0
    evaluations: int = 0


def first_crossing(
    values: Values,
    noise: Floats,
    direction: npt.ArrayLike = DOWN,
    armed: npt.ArrayLike = True,
    most: int = PARAMETERS.most_evaluations,
) -> FirstCrossing:
    """The first crossing of zero by functions of x in [0, 1], to double precision.

    noise: (K,) rounding of the values; a function crosses when it goes from its side to beyond the noise on the other.
    direction: DOWN, UP or BOTH, one or (K,). A function at zero at x = 0 is on its side, and one that leaves there
    crosses at 0, unless it is not `armed` (one or (K,)): it has crossed just there, and must come back first. most:
    evaluations, after which functions are left unresolved.
    """
    if not noise.size:
        return FirstCrossing(None)
    search = _Search(values, np.asarray(noise, dtype=float), most)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        search.begin(direction, armed)
        return search.run()


class _Sample(NamedTuple, Generic[Number]):
    """Values g and slopes dg/dx at x: of all functions, (K,) each, or of one."""

    x: float
    g: Number
    slope: Number


_All = _Sample[Floats]


class _Piece(NamedTuple):
    """A piece of the step for one function, and the misfit about its cubic there."""

    left: _Sample[float]
    right: _Sample[float]
    misfit: float

    @property
    def width(self) -> float:
        return self.right.x - self.left.x

    @property
    def ends(self) -> Ends[float]:
        (a, g, slope), (b, end, end_slope) = self.left, self.right
        return g, (b - a) * slope, end, (b - a) * end_slope

    @property
    def cubic(self) -> Cubic[float]:
        return zero_bounds.cubic(self.ends)

    def cut(self, inner: _Sample[float], noise: float) -> list[_Piece]:
        """Both parts, the right one first."""
        c = (inner.x - self.left.x) / self.width
        misfit = zero_bounds.misfit(self.ends, c, (inner.g, self.width * inner.slope), noise)
        return [_Piece(inner, self.right, (1 - c) * misfit), _Piece(self.left, inner, c * misfit)]

    def with_least_misfit(self) -> _Piece:
        """The piece with no less misfit than a part of how much the cubic bends: one misfit may be small by chance."""
        least = zero_bounds.PARAMETERS.wary * zero_bounds.bend(self.cubic)
        return _Piece(self.left, self.right, max(self.misfit, least))


class _Search:
    """One search; functions are turned round so that all cross downwards."""

    def __init__(self, values: Values, noise: Floats, most: int) -> None:
        self._values, self._most = values, most
        self.noise = noise
        self.sign: Floats | None = None
        self.evaluations = 0
        # Whether each function is on its side at the start, and where those that are not were seen to come there.
        self.up: Flags = np.ones(noise.size, dtype=bool)
        self.rises: dict[int, float] = {}
        self.start = self.sample(0.0)

    def sample(self, x: float) -> _All:
        self.evaluations += 1
        g, slope = self._values(x)
        return _Sample(x, g, slope) if self.sign is None else _Sample(x, self.sign * g, self.sign * slope)

    def begin(self, direction: npt.ArrayLike, armed: npt.ArrayLike) -> None:
        start = self.start
        if direction is DOWN and armed is True:
            self.up = start.g >= -self.noise
            return
        direction, armed = np.broadcast_to(direction, start.g.size), np.broadcast_to(armed, start.g.size)
        self.noise = np.where(armed, self.noise, np.maximum(self.noise, 2 * np.abs(start.g)))
        at_zero = np.abs(start.g) <= self.noise
        leaving = np.where(start.slope != 0, np.sign(start.slope), 1.0)
        both = np.where(at_zero, np.where(armed, -leaving, leaving), np.where(start.g > 0, 1.0, -1.0))
        self.sign = np.where(direction == DOWN, 1.0, np.where(direction == UP, -1.0, both))
        self.start = _Sample(0.0, self.sign * start.g, self.sign * start.slope)
        spent = ~armed & (direction != BOTH)
        self.up = (self.start.g >= -self.noise) & ~spent

    def run(self) -> FirstCrossing:
        end, inner = self.sample(1.0), self.sample(GOLDEN)
        # Nothing beyond `stop` matters: there a function crosses, or it is open what one does.
        stop = end
        crossing: int | None = None
        unresolved: int | None = None
        for row in self.candidates(inner, end):
            if not stop.x > 0:
                break
            found = self.first_of(row, (inner, end), stop)
            if isinstance(found, float):
                stop, crossing, unresolved = self.sample(found), None, row
            elif found is not None:
                stop, crossing, unresolved = found, row, None
        if unresolved is not None:
            return FirstCrossing(None, unresolved=(unresolved,), clear=stop.x, evaluations=self.evaluations)
        if crossing is None:
            ending = self.up_at(1.0) & (np.abs(end.g) <= self.noise) & (self.start.g > self.noise)
            return FirstCrossing(None, ending=_numbers(ending), evaluations=self.evaluations)
        # Those whose slope takes them over zero within rounding after it cross with it.
        near = self.up_at(stop.x) & (stop.slope < -2 * self.noise)
        near &= stop.g + 4 * doubles.EPS * stop.slope <= self.noise
        near[crossing] = True
        return FirstCrossing(stop.x, _numbers(near), clear=stop.x, evaluations=self.evaluations)

    def candidates(self, inner: _All, end: _All) -> list[int]:
        """The functions that may leave their side, those first that seem to do so first."""
        rows = np.arange(self.noise.size) if self.noise.size <= PARAMETERS.few else self.open_rows(inner, end)
        if rows.size < 2:
            return [int(row) for row in rows]
        g = [each.g[rows] for each in (self.start, inner, end)]
        early = GOLDEN * g[0] / (g[0] - g[1])
        late = GOLDEN + (1 - GOLDEN) * g[1] / (g[1] - g[2])
        guess = np.where(g[1] < 0, early, np.where(g[2] < 0, late, 1.0))
        return [int(row) for row in rows[np.argsort(guess, kind="stable")]]

    def open_rows(self, inner: _All, end: _All) -> npt.NDArray[np.intp]:
        """The functions that are not kept on their side by the first three samples."""
        start = self.start
        whole = start.g, start.slope, end.g, end.slope
        misfit = zero_bounds.misfit(whole, GOLDEN, (inner.g, inner.slope), self.noise)
        stays = np.ones(self.noise.size, dtype=bool)
        for left, right in ((start, inner), (inner, end)):
            part = right.x - left.x
            cubic = zero_bounds.cubic((left.g, part * left.slope, right.g, part * right.slope))
            doubts = zero_bounds.largest(part * misfit, zero_bounds.PARAMETERS.wary * zero_bounds.bend(cubic))
            low, high = zero_bounds.extent(cubic, doubts)
            slack = 2 * self.noise + zero_bounds.rounding(cubic)
            stays &= np.where(self.up, low >= -slack, high <= slack)
        return np.flatnonzero(~stays)

    def first_of(self, row: int, samples: tuple[_All, _All], stop: _All) -> _All | float | None:
        """The first crossing of one function before or at a sample, or the point beyond which it is open; samples: at
        the first cut and at the end."""
        noise, up = float(self.noise[row]), bool(self.up[row])
        left, inner, right = (_of(each, row) for each in (self.start, *samples))
        pieces = [part.with_least_misfit() for part in _Piece(left, right, 0.0).cut(inner, noise)]
        if stop.x < right.x:
            last = _of(stop, row)
            pieces = [
                part if part.right.x <= stop.x else _Piece(part.left, last, part.misfit)
                for part in pieces
                if part.left.x < stop.x
            ]
        while pieces:
            piece = pieces.pop()
            cubic, misfit = piece.cubic, piece.misfit
            is_known, is_narrow = math.isfinite(sum(cubic) + misfit), piece.width <= PARAMETERS.narrow
            if is_known:
                low, high = zero_bounds.extent(cubic, misfit)
                slack = 2 * noise + zero_bounds.rounding(cubic)
                if low >= -slack if up else high <= slack:
                    continue
            if is_narrow or (is_known and zero_bounds.turns_once(cubic, misfit, up)):
                if not up and cubic[3] > noise:
                    up, self.rises[row] = True, piece.right.x
                    continue
                if up and cubic[3] < -noise:
                    return self.sample(piece.right.x) if is_narrow else self.root(row, piece)
            if not is_narrow:
                if self.evaluations + 1 >= self._most:
                    return piece.left.x
                pieces += piece.cut(_of(self.sample(_cut_point(piece, up)), row), noise)
        return None

    def root(self, row: int, piece: _Piece) -> _All:
        """The one point in a piece at which a function leaves its side: Newton's steps within the bracket from that
        of its cubic; it is halved where they are no gain."""
        left, right = piece.left, piece.right
        level = min(left.g, 0.0)
        if left.g <= 0 and left.slope <= 0:
            return self.start if left.x == 0.0 else self.sample(left.x)
        low, high, noise = left.x, right.x, float(self.noise[row])
        x = low + zero_bounds.fall(piece.cubic) * (high - low)
        last = before = high - low
        for _ in range(130):  # the bracket is halved at the least every other time
            sample = self.sample(x)
            value, slope = float(sample.g[row]) - level, float(sample.slope[row])
            low, high = (x, high) if value > 0 else (low, x)
            step = -value / slope if slope < 0 else math.inf
            if abs(step) <= doubles.EPS or (abs(value) <= noise and abs(step) > last / 2):
                break
            if not (low < x + step < high and abs(step) <= before / 2):
                step = (low + high) / 2 - x
            if high - low <= 2 * doubles.EPS:
                break
            before, last, x = last, abs(step), x + step
        return sample

    def up_at(self, x: float) -> Flags:
        """The functions on their side at x, before which none crosses."""
        up = self.up.copy()
        up[[row for row, point in self.rises.items() if point <= x]] = True
        return up


def _of(sample: _All, row: int) -> _Sample[float]:
    return _Sample(sample.x, float(sample.g[row]), float(sample.slope[row]))


def _cut_point(piece: _Piece, is_up: bool) -> float:
    """The point of a cut: at the lowest point of a function that comes near zero, if that is known."""
    u = zero_bounds.lowest(piece.cubic, piece.misfit, is_up)
    part = GOLDEN if u is None else min(max(u, PARAMETERS.margin), 1 - PARAMETERS.margin)
    return piece.left.x + part * piece.width


def _numbers(flags: Flags) -> tuple[int, ...]:
    return tuple(np.flatnonzero(flags).tolist())
