"""All points of a problem with one coordinate and no rows, by intervals: each has one zero of the force, or none.

Where neither is seen, as at a pole, a kink, a double zero or in a flat tail, a piece stays undecided; what is found
elsewhere is found all the same.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from mpmath import iv

from lagcli import doubles
from lagcli.compiled.program import Program
from lagcli.expression.enclosures import Enclosures, NoBounds, NoValue
from lagcli.smoothness import sides
from lagcli.statics import newton, refine
from lagcli.statics.all_zeros import Completeness
from lagcli.statics.point_search import PointSearch
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import RestEquations


class BranchingParameters:
    """Numbers of the enclosure of all zeros of one unknown.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py`.
    """

    __slots__ = ()

    most_boxes: int = 4000
    """Intervals that are looked at; what is left is undecided.
    `test_four_thousand_intervals_are_looked_at` fails at 400 and 40000."""
    shells: int = 7
    """Shells round zero, each ten times wider, which share the intervals: one size of things, ten, up to a million.
    `test_all_zeros_of_one_unknown_lie_within_a_million_sizes` fails at 6 and 8."""
    uneven: float = 1.0371
    """The end of the first shell in sizes of things, and so those of all: no decimal number is one, for there zeros
    are likely. `test_all_zeros_of_one_unknown_lie_within_a_million_sizes` fails at 0.10371 and 10.371."""
    together: float = 100.0
    """Narrow intervals side by side that are one piece. `test_a_hundred_narrow_intervals_are_one_piece` fails at 10
    and 1000."""
    most_named: int = 4
    """Undecided pieces that a sentence names. `test_four_undecided_pieces_are_named` fails at 0 and 40."""
    digits: int = 20
    """Decimal digits of the intervals: more than a double has, so that roundings are no reason to halve one.
    `test_intervals_have_twenty_digits` fails at 2 and 200."""


PARAMETERS = BranchingParameters()


Floats = npt.NDArray[np.float64]
Piece = tuple[float, float]


@dataclasses.dataclass(slots=True)
class LinePieces:
    """LinePieces of the line with one zero each, and undecided ones; there is none elsewhere."""

    isolated: list[Piece] = dataclasses.field(default_factory=list)
    undecided: list[Piece] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True, slots=True)
class _Force:
    """The force and its slope by intervals."""

    program: Program
    numbers: tuple[float, ...]

    def __call__(self, x: iv.mpf) -> tuple[iv.mpf, iv.mpf]:
        """The force and its slope over an interval. Raises `NoBounds`."""
        numbers = [iv.mpf(number) for number in self.numbers]
        value, slope = self.program.run([[x], numbers], iv.mpf, Enclosures(iv).result)
        return value, slope


def complete(search: PointSearch, is_angle: bool) -> Completeness:
    """Put the zeros that intervals enclose in the place of the points of a search, but where a piece is undecided; and
    say whether all are known."""
    problem = search.problem
    if len(problem.times) > 1:
        return Completeness(False, "the equations hold t")
    force = _Force(problem.slope_program(), (problem.t, *problem.p.tolist()))
    digits = iv.dps
    iv.dps = PARAMETERS.digits
    try:
        pieces = _pieces(force, search, is_angle)
        narrowed = [_narrowed(force, piece) for piece in pieces.isolated]
    finally:
        iv.dps = digits
    equations = RestEquations(problem, (), search.scales)
    points = []
    for x in narrowed:
        rounded = refine.settled(equations, newton.NewtonEnd(np.array([x]), 0.0, 0.0))
        points.append(
            EquilibriumPoint(search.wrapped_angles(np.array([x])), problem.nothing, (), rounded.residual)
        )
    own = list(_merged(pieces.undecided))
    agrees = search.settle(
        {(): points}, lambda q: not any(_is_inside(search, float(q[0]), piece) for piece in own)
    )
    for low, high in own:
        if np.isfinite([low, high]).all():
            search.take(refine.reached(problem, np.array([(low + high) / 2]), (), search.scales))
    if own:
        is_narrow = all(abs(low + high) == np.inf or high - low <= _width(search, low) for low, high in own)
        return Completeness(False, _undecided(own), is_narrow, is_told=True)
    if not agrees:
        return Completeness(False, "intervals and the search disagree")
    return Completeness(
        True,
        "that there are no others is proved by intervals: each piece of the line has one of them, or none",
        is_told=True,
    )


def _undecided(pieces: list[Piece]) -> str:
    """A sentence on pieces that are undecided."""
    named = [
        f"near {(low + high) / 2:.6g}" if high - low <= doubles.ROOT else f"from {low:.3g} to {high:.3g}"
        for low, high in sorted(pieces, key=lambda piece: abs(piece[0] + piece[1]))[: PARAMETERS.most_named]
    ]
    more = "" if len(pieces) <= PARAMETERS.most_named else " and elsewhere"
    return f"intervals decide everywhere but {', '.join(named)}{more}: a pole, a kink, a double zero or a flat tail"


def _merged(pieces: list[Piece]) -> Iterator[Piece]:
    """LinePieces that touch, as one."""
    current: Piece | None = None
    for low, high in sorted(pieces):
        if current is not None and low <= current[1]:
            current = current[0], max(high, current[1])
            continue
        if current is not None:
            yield current
        current = low, high
    if current is not None:
        yield current


def _is_inside(search: PointSearch, x: float, piece: Piece) -> bool:
    turns = (-2 * np.pi, 0.0, 2 * np.pi) if search.options.angles[0] else (0.0,)
    near = _width(search, x) / PARAMETERS.together
    return any(piece[0] - near <= x + turn <= piece[1] + near for turn in turns)


def _width(search: PointSearch, x: float) -> float:
    """The width of some intervals that are not halved further, side by side."""
    return PARAMETERS.together * doubles.ZERO * (search.scales.length + abs(x))


def _narrowed(force: _Force, piece: Piece) -> float:
    """The zero in a piece on which the force rises or falls, to rounding."""
    low, high = piece
    if low < 0 < high and 0 in force(iv.mpf(0))[0]:
        return 0.0
    left = force(iv.mpf(low))[0].a > 0

    def is_before(x: Floats) -> bool:
        value = force(iv.mpf(float(x)))[0]
        return 0 not in value and bool((value.a > 0) == left)

    while math.nextafter(low, high) < high:  # beside zero there are more doubles than an interval is halved
        low, high = map(float, sides.bracket(is_before, low, high))
    return high


def _pieces(force: _Force, search: PointSearch, is_angle: bool) -> LinePieces:
    """All pieces, from the middle outward: a whole turn, or shells as far as the force has no zero beyond."""
    found = LinePieces()
    if is_angle:
        # The ends lie at no point where a zero is likely, and overlap: none is lost between them.
        turn = (-np.pi + 0.0123 - doubles.VALUE, np.pi + 0.0123 + doubles.VALUE)
        _search(force, [turn], found, PARAMETERS.most_boxes, search.scales.length)
        return found
    length, left = search.scales.length, PARAMETERS.most_boxes
    ends = [length * PARAMETERS.uneven * 10.0**k for k in range(PARAMETERS.shells)]
    for k, end in enumerate(ends):
        shell = [(-end, end)] if not k else [(-end, -ends[k - 1]), (ends[k - 1], end)]
        left -= _search(force, shell, found, left // (PARAMETERS.shells - k), length)
    for end, tail in ((ends[-1], (ends[-1], np.inf)), (-ends[-1], (-np.inf, -ends[-1]))):
        if not _has_no_zero(force, end, iv.mpf(list(tail))):
            found.undecided.append(tail)
    return found


def _search(force: _Force, begun: list[Piece], found: LinePieces, boxes: int, length: float) -> int:
    """Halve pieces as long as they are undecided; the number that was looked at."""
    waiting = deque(begun)
    count = 0
    while waiting and count < boxes:
        count += 1
        low, high = waiting.popleft()
        middle = low + (high - low) * 0.4871
        try:
            value, slope = force(iv.mpf([low, high]))
        except NoValue:
            continue
        except NoBounds:
            if low < 0 < high:
                middle = 0.0  # where poles and kinks are likely
        else:
            if 0 not in value:
                continue
            if 0 not in slope:
                changes = _changes(force, low, high)
                if changes is not None:
                    found.isolated += [(low, high)] if changes else []
                    continue
        if high - low < doubles.ZERO * (length + abs(low)) or not low < middle < high:
            found.undecided.append((low, high))
        else:
            waiting += [(low, middle), (middle, high)]
    found.undecided += waiting
    return count


def _changes(force: _Force, low: float, high: float) -> bool | None:
    """True if the force changes its sign between two ends; None where it is not determined at one."""
    try:
        ends = [force(iv.mpf(x))[0] for x in (low, high)]
    except NoBounds:
        return None
    if not all(map(_is_determined, ends)):
        return None
    return bool((ends[0].a > 0) != (ends[1].a > 0))


def _has_no_zero(force: _Force, end: float, tail: iv.mpf) -> bool:
    """True if the force has one sign beyond an end: by its bounds, or as it grows away from zero there."""
    try:
        value, slope = force(tail)
        if _is_determined(value):
            return True
        at_end = force(iv.mpf(end))[0]
    except NoValue:
        return True
    except NoBounds:
        return False
    if not _is_determined(at_end) or not _is_determined(slope):
        return False
    return bool((slope.a > 0) == ((at_end.a > 0) == (end > 0)))


def _is_determined(value: iv.mpf) -> bool:
    return bool(value.a == value.a and value.b == value.b and 0 not in value)
