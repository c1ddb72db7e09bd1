"""The growth of a distribution by brackets, and the derived flag that follows.

Growth vector: dim D plus the ranks of brackets of 2, 3, ... fields. Derived flag: brackets of all that is there.
"""

from __future__ import annotations

import dataclasses

from lagcli.analysis.numeric_flag.bracket_values import BracketValues
from lagcli.analysis.numeric_flag.span import DigitSample, Span
from lagcli.compiled import lie_brackets
from lagcli.compiled.lie_brackets import LEAF, Shape


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


def of(values: BracketValues, count: int | None = None) -> Growth:
    """Brackets of 2, 3, ... fields until a level brings nothing new, or of so many levels."""
    span, levels, shape = values.span(), list[list[DigitSample]](), LEAF
    while span.rank < values.count and (count is None or len(levels) < count):
        shape = (LEAF, shape)
        added = values.extend(span, shape, values.count)
        if not added and count is None:
            break
        levels.append(added)
    return Growth(span, tuple(levels))


def derived(values: BracketValues, growth: Growth) -> tuple[tuple[int, ...], Span]:
    """The dimensions of I, I', ... to zero or to the first that repeats, and the span that showed them.

    They fall by brackets of all fields found so far, until the rank is that of the end.
    """
    end, span = growth.span.rank, values.span()
    extra = [values.count]
    shapes: list[Shape] = [LEAF]
    new: list[Shape] = [LEAF]
    level: Shape = LEAF
    while span.rank < end:
        level = (LEAF, level)
        added = [span.add(sample) for sample in growth.levels[len(extra) - 1]]
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
