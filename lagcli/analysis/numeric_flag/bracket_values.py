"""Random values of brackets at one point, in many digits where the rows are few enough, else in doubles; the growth of
the distribution by them, and the derived flag that follows.

Random brackets of a shape span what all brackets of that shape span. Growth vector: dim D plus the ranks of brackets
of 2, 3, ... fields. Derived flag: brackets of all that is there.
"""

from __future__ import annotations

import dataclasses
from decimal import Decimal
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lagcli import doubles, progress
from lagcli.analysis.numeric_flag import evaluation_point, precise_brackets, undecided
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.analysis.numeric_flag.precise_brackets import Exact
from lagcli.analysis.numeric_flag.span import DigitSample, Limits, Span
from lagcli.compiled import lie_brackets, multiprecision
from lagcli.compiled.lie_brackets import LEAF, Shape

Floats = npt.NDArray[np.float64]

# In doubles.
ROUGH_ZERO, ROUGH_SURE = Decimal("1e-13"), Decimal("1e-8")
# What longer brackets are made of is no smaller than this part of the terms of short ones.
DEEPER = 1e-4
# Random components are whole numbers up to this, so that one random bracket stands for all.
LETTERS = 10**6
# Multiplications beyond which no bracket is computed.
LARGEST = 4_000_000
# The same for a component of x in doubles.
DOUBLES = 5
SEED = 20062


class BracketValues:
    """Random values of brackets on the independent differential rows of a point.

    is_decimal: as in `Exact`. limits: other ones than those of the digits. Raises `undecided.Undecided`.
    """

    def __init__(
        self, point: EvaluationPoint, deadline: float, is_decimal: bool, limits: Limits | None = None
    ) -> None:
        if point.all.low != len(point.independent):
            raise undecided.Undecided("which of so many rows depend on others is not known")
        self.point, self._deadline, self._is_decimal = point, deadline, is_decimal
        self.count = len(point.differential)
        self._random = np.random.default_rng(SEED)
        self.exact = in_digits(point, is_decimal)
        self._length = DOUBLES * point.block.size if self.exact is None else self.exact.length
        self.digits = 16 if self.exact is None else precise_brackets.DIGITS
        usual = (
            Limits(ROUGH_ZERO, ROUGH_SURE)
            if self.exact is None
            else Limits(precise_brackets.ZERO, precise_brackets.SURE)
        )
        self._limits = _beyond(limits or usual, evaluation_point.PARAMETERS.off * point.error)

    def at(self, point: EvaluationPoint, limits: Limits) -> BracketValues:
        """The brackets at another point."""
        return BracketValues(point, self._deadline, self._is_decimal, limits)

    def span(self) -> Span:
        """An empty span for them."""
        return Span(self.count, self._limits)

    def extend(self, span: Span, shape: Shape, end: int) -> list[DigitSample]:
        """Random brackets of a shape into a span, until one brings nothing new or the rank is `end`."""
        added: list[DigitSample] = []
        while span.rank < end:
            undecided.require_time(self._deadline)
            work = _work(shape) * self._length
            if work > LARGEST:
                raise undecided.Undecided(f"brackets of {lie_brackets.leaves(shape)} fields are too large")
            progress.reckon(work * progress.PARAMETERS.entry)
            sample = self._sample(shape)
            if not span.add(sample):
                break
            added.append(sample)
        return added

    def _sample(self, shape: Shape) -> DigitSample:
        U = self._random.integers(-LETTERS, LETTERS, (self.point.block.size, lie_brackets.leaves(shape)))
        if self.exact is None:
            return self._rough(shape, U / LETTERS * self.point.sizes[:, None])
        return self.exact.bracket(shape, U.T.tolist())

    @cached_property
    def _brackets(self) -> lie_brackets.Brackets:
        return lie_brackets.Brackets(self.point.block, self.point.independent)

    def _rough(self, shape: Shape, U: Floats) -> DigitSample:
        """The values in doubles: at x moved by rounding the size is seen, but where all is rounding."""
        point, function = self.point, self._brackets.values(shape)
        neighbour = point.x + doubles.VALUE * point.sizes * self._random.standard_normal(point.x.size)
        here, there = (np.array(function(x, point.p, U)).ravel() for x in (point.x, neighbour))
        terms = point.terms[point.differential] * (1.0 if lie_brackets.leaves(shape) == 2 else DEEPER)
        sizes = np.maximum(np.maximum(np.abs(here), np.abs(there - here) / doubles.VALUE), terms)
        if not np.isfinite(sizes).all():
            raise undecided.Undecided("a bracket is not finite")
        return DigitSample([Decimal(a) for a in here.tolist()], [Decimal(a) for a in sizes.tolist()])


@dataclasses.dataclass(frozen=True, slots=True)
class Growth:
    """Brackets [X, [X, ...]]: the span of all, and the samples that each level added."""

    span: Span
    levels: tuple[list[DigitSample], ...] = ()

    @property
    def ranks(self) -> tuple[int, ...]:
        """0 and the rank after each level."""
        ranks = [0]
        for level in self.levels:
            ranks.append(ranks[-1] + len(level))
        return tuple(ranks)


def grown(values: BracketValues, count: int | None = None) -> Growth:
    """Brackets of 2, 3, ... fields until a level brings nothing new, or of so many levels."""
    span, levels, shape = values.span(), list[list[DigitSample]](), LEAF
    while span.rank < values.count and (count is None or len(levels) < count):
        shape = (LEAF, shape)
        added = values.extend(span, shape, values.count)
        if not added and count is None:
            break
        levels.append(added)
    return Growth(span, tuple(levels))


def derived(values: BracketValues, found: Growth) -> tuple[tuple[int, ...], Span]:
    """The dimensions of I, I', ... to zero or to the first that repeats, and the span that showed them.

    They fall by brackets of all fields found so far, until the rank is that of the end.
    """
    end, span = found.span.rank, values.span()
    extra = [values.count]
    shapes: list[Shape] = [LEAF]
    new: list[Shape] = [LEAF]
    level: Shape = LEAF
    while span.rank < end:
        level = (LEAF, level)
        added = [span.add(sample) for sample in found.levels[len(extra) - 1]]
        fresh: list[Shape] = [level] if any(added) else []
        for shape in _pairs(shapes, new):
            if shape not in (level, (LEAF, LEAF)) and span.rank < end and values.extend(span, shape, end):
                fresh.append(shape)
        extra.append(values.count - span.rank)
        shapes, new = [*shapes, *fresh], fresh
    if extra[-1] > 0:
        extra.append(extra[-1])
    return tuple(extra), span


def _pairs(shapes: list[Shape], new: list[Shape]) -> list[Shape]:
    """Brackets of two shapes of which one is new, short ones first."""
    found = {(a, b) for i, b in enumerate(shapes) for a in shapes[: i + 1] if a in new or b in new}
    return sorted(found, key=lambda shape: (lie_brackets.leaves(shape), str(shape)))


def _beyond(limits: Limits, off: float) -> Limits:
    """Limits at a point that may be off the orbit, where a value that should vanish may be so large."""
    return Limits(limits.zero, max(limits.sure, Decimal(off)))


def in_digits(point: EvaluationPoint, is_decimal: bool) -> Exact | None:
    """The rows in many digits, or None where they are too large for it or a function is not known in them."""
    try:
        return Exact(point, is_decimal)
    except (lie_brackets.TooMuchFill, multiprecision.Unknown):
        return None


def _work(shape: Shape, depth: int = 0) -> float:
    """Evaluations of the functions of the point, with derivatives so deep."""
    inner = sum(_work(part, depth + 1) for part in shape if part != LEAF)
    return 3.0**depth + inner + (_work(shape[0], depth) if shape[0] != LEAF else 0.0)
