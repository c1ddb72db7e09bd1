"""The first place along a step at which one of many functions crosses zero.

The step is cut into pieces from left to right. A piece is done with a function as soon as bounds (`zero_bounds`) keep
it on its side; where they say that it leaves its side at one place alone, that place is found by Newton's method
within the bracket (the slopes are at hand, and it ends with the value itself at rounding); else the piece is cut, for
those functions alone. Of thousands of functions that stay clear of zero all are done after three evaluations.

The first cut is at the golden section, which no whole number of waves fits well: a wave as long as the step or
shorter that has an extreme at both ends has a slope there of 4 pi^2/sqrt(5), 17 times its height, at the least, and
is seen. What is narrower than the samples are apart and leaves no trace in values and slopes of three of them cannot
be seen by any search.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from lagcli.contact.zero_bounds import EPS, Flags, Floats, Piece, Sample

# x -> values (K,) and slopes dg/dx (K,) of all functions.
Values = Callable[[float], tuple[Floats, Floats]]

DOWN, BOTH, UP = -1, 0, 1
GOLDEN = (3 - 5**0.5) / 2
# A cut keeps this distance from both ends of its piece, and a piece this narrow has no inside.
MARGIN, NARROW = 0.1, 8 * EPS
# The most evaluations of one search.
MOST = 2000
# Newton's steps for one root; each halves the bracket at the least every other time.
MOST_STEPS = 130


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FirstCrossing:
    """The end of a search.

    x: the first place at which a function crosses zero in its direction, None where none does; `rows` cross there.
    ending: functions that arrive at zero at x = 1, to rounding, from their side, where none crosses before: what they
    do there the next step shows. unresolved: functions of which it is open what they do beyond `clear`, before which
    nothing crosses; then x is None.
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
    together: float = 0.0,
    most: int = MOST,
) -> FirstCrossing:
    """The first crossing of zero by functions of x in [0, 1], to double precision.

    noise: (K,) rounding of the values; a function within it is at zero. One crosses when it goes from its side to
    beyond the noise on the other: touching is none. direction: DOWN, UP or BOTH, one or (K,). A function that is at
    zero at x = 0 is on its side, and one that leaves there crosses at 0; unless it is not `armed` (one or (K,)),
    which says that it has crossed just there: then it must come back first. together: functions whose slope takes
    them over zero within this distance after the first cross with it. most: evaluations, after which functions are
    left unresolved. The ends are asked for once each; a caller that knows them hands them out from memory.
    """
    count = noise.size
    if not count:
        return FirstCrossing(None)
    search = _Search(values, np.asarray(noise, dtype=float), most)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        search.begin(np.broadcast_to(direction, count), np.broadcast_to(armed, count))
        return search.run(max(together, 4 * EPS))


class _Search:
    """One search; functions are turned round so that all cross downwards."""

    def __init__(self, values: Values, noise: Floats, most: int) -> None:
        self._values, self._most = values, most
        self.noise = noise
        self.sign = np.ones(noise.size)
        self.evaluations = 0
        # Whether each function is on its side, at the left end of the piece that is looked at.
        self.up: Flags = np.ones(noise.size, dtype=bool)
        self.start = self.sample(0.0)

    def sample(self, x: float) -> Sample:
        self.evaluations += 1
        g, slope = self._values(x)
        return Sample(float(x), self.sign * g, self.sign * slope)

    def begin(self, direction: npt.NDArray[np.int_], armed: Flags) -> None:
        """Sides at the start."""
        start = self.start
        self.noise = np.where(armed, self.noise, np.maximum(self.noise, 2 * np.abs(start.g)))
        at_zero = np.abs(start.g) <= self.noise
        leaving = np.where(start.slope != 0, np.sign(start.slope), 1.0)
        both = np.where(at_zero, np.where(armed, -leaving, leaving), np.where(start.g > 0, 1.0, -1.0))
        self.sign = np.where(direction == DOWN, 1.0, np.where(direction == UP, -1.0, both))
        self.start = Sample(0.0, self.sign * start.g, self.sign * start.slope)
        spent = ~armed & (direction != BOTH)
        self.up = (self.start.g >= -self.noise) & ~spent

    def run(self, together: float) -> FirstCrossing:
        count = self.noise.size
        end = self.sample(1.0)
        piece = Piece(self.start, end, np.arange(count), np.zeros(count))
        pieces = [part.wary() for part in reversed(piece.cut(self.sample(GOLDEN), self.noise))]
        found: tuple[int, Sample] | None = None
        while pieces:
            piece = self.open_on(pieces.pop())
            if not piece.rows.size:
                continue
            crossing = self.crossing_in(piece)
            if crossing is not None:
                found = crossing
                rest = piece.ended(found[1]).among(piece.rows != found[0])
                pieces = [rest] if rest.width > 0 else []
            elif piece.width > NARROW:
                if self.evaluations >= self._most:
                    return self.unresolved(piece)
                pieces += reversed(piece.cut(self.sample(self.place(piece)), self.noise[piece.rows]))
        if found is None:
            ending = self.up & (np.abs(end.g) <= self.noise) & (self.start.g > self.noise)
            return FirstCrossing(None, ending=_numbers(ending), evaluations=self.evaluations)
        x = found[1].x
        return FirstCrossing(x, self.near(*found, together), clear=x, evaluations=self.evaluations)

    def open_on(self, piece: Piece) -> Piece:
        """Those functions that may leave their side in a piece in a way not yet known; sides change where they do."""
        bounds = piece.bounds()
        low, high = bounds.extent()
        slack = 2 * self.noise[piece.rows] + bounds.rounding()
        stays = np.where(self.up[piece.rows], low >= -slack, high <= slack)
        piece = piece.among(~stays)
        bounds, up = piece.bounds(), self.up[piece.rows]
        returns = ~up & (bounds.b3 > self.noise[piece.rows])
        if piece.width > NARROW:
            returns &= bounds.turns_once(up)
        self.up[piece.rows[returns]] = True
        return piece.among(~returns)

    def crossing_in(self, piece: Piece) -> tuple[int, Sample] | None:
        """A function that crosses in a piece, before those others of which this is known too or little after, and
        the place."""
        bounds, up = piece.bounds(), self.up[piece.rows]
        crosses = up & (bounds.b3 < -self.noise[piece.rows])
        if piece.width <= NARROW:
            return (int(piece.rows[crosses][0]), piece.right) if crosses.any() else None
        crosses &= bounds.turns_once(up)
        if not crosses.any():
            return None
        first = int(np.argmin(np.where(crosses, bounds.b0 / (bounds.b0 - bounds.b3), np.inf)))
        guess = piece.left.x + bounds.fall(first) * piece.width
        row = int(piece.rows[first])
        return row, self.root(row, piece.left, piece.right, guess)

    def root(self, row: int, left: Sample, right: Sample, x: float) -> Sample:
        """The one place between two samples at which a function leaves its side: Newton's steps within the bracket
        from a guess x; it is halved where they are no gain."""
        level = min(float(left.g[row]), 0.0)
        if left.g[row] <= 0 and left.slope[row] <= 0:
            return left
        low, high, noise = left.x, right.x, self.noise[row]
        last = before = high - low
        sample = right
        for _ in range(MOST_STEPS):
            sample = self.sample(x)
            value, slope = float(sample.g[row]) - level, float(sample.slope[row])
            low, high = (x, high) if value > 0 else (low, x)
            step = -value / slope if slope < 0 else np.inf
            if abs(step) <= EPS or (abs(value) <= noise and abs(step) > last / 2):
                break
            if not (low < x + step < high and abs(step) <= before / 2):
                step = (low + high) / 2 - x
            if high - low <= 2 * EPS:
                break
            before, last, x = last, abs(step), x + step
        return sample

    def place(self, piece: Piece) -> float:
        """The place of a cut: at the lowest place of a function that comes near zero, if that can be told."""
        u = piece.bounds().lowest(self.up[piece.rows])
        part = GOLDEN if u is None else min(max(u, MARGIN), 1 - MARGIN)
        return piece.left.x + part * piece.width

    def near(self, row: int, found: Sample, together: float) -> tuple[int, ...]:
        """The function that crosses at the place found, and those that do within a distance after it."""
        near = self.up & (found.slope < -2 * self.noise) & (found.g + together * found.slope <= self.noise)
        near[row] = True
        return _numbers(near)

    def unresolved(self, piece: Piece) -> FirstCrossing:
        rows = tuple(int(row) for row in piece.rows)
        return FirstCrossing(None, unresolved=rows, clear=piece.left.x, evaluations=self.evaluations)


def _numbers(flags: Flags) -> tuple[int, ...]:
    return tuple(int(row) for row in np.flatnonzero(flags))
