"""The span of vectors of values in many digits, of which it is known how large the terms were that made them: a zero is
told from a value that is merely small. And the errors of a search that ends without a certain answer."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from decimal import Decimal

from lagcli import progress

NOTHING = Decimal(0)


@dataclasses.dataclass(frozen=True, slots=True)
class Limits:
    """Relative to its size a value below `zero` is zero, above `sure` not, between them nothing is decided."""

    zero: Decimal
    sure: Decimal


@dataclasses.dataclass(frozen=True, slots=True)
class DigitSample:
    """Values (m,) of one bracket, and the sizes (m,) of what they are made of."""

    values: list[Decimal]
    sizes: list[Decimal]

    @property
    def relative(self) -> list[Decimal]:
        """|values| in parts of their sizes."""
        return [abs(a) / size if size else NOTHING for a, size in zip(self.values, self.sizes, strict=True)]

    def without(self, other: DigitSample, index: int) -> DigitSample:
        """The part that is zero at an index, where the other is one."""
        part, size = self.values[index], self.sizes[index]
        mine = zip(self.values, self.sizes, other.values, other.sizes, strict=True)
        return DigitSample(
            [a - part * b for a, b in zip(self.values, other.values, strict=True)],
            [s + abs(part) * t + size * abs(b) for _, s, b, t in mine],
        )

    def over(self, index: int) -> DigitSample:
        """The multiple that is one at an index."""
        pivot, loss = self.values[index], self.relative[index]
        return DigitSample(
            [a / pivot for a in self.values],
            [(size + abs(a) / loss) / abs(pivot) for a, size in zip(self.values, self.sizes, strict=True)],
        )


class Span:
    """A span of vectors of values (m,), kept as vectors that are one at an index where the others are zero.

    error: the largest relative value that counted as zero; least: the smallest that did not.
    """

    def __init__(self, count: int, limits: Limits) -> None:
        self.count, self.limits = count, limits
        self.error, self.least = NOTHING, Decimal("inf")
        self._vectors: dict[int, DigitSample] = {}

    @property
    def rank(self) -> int:
        """The dimension."""
        return len(self._vectors)

    def add(self, sample: DigitSample) -> bool:
        """True if a sample brings something new. Raises `spans.AmbiguousRank`."""
        rest = sample
        for index, vector in self._vectors.items():
            rest = rest.without(vector, index)
        relative = [a if i not in self._vectors else NOTHING for i, a in enumerate(rest.relative)]
        index = max(range(self.count), key=relative.__getitem__)
        if self._is_zero(relative[index]):
            return False
        self.least = min(self.least, relative[index])
        new = rest.over(index)
        self._vectors = {i: vector.without(new, index) for i, vector in self._vectors.items()} | {index: new}
        return True

    def touches(self, weights: Sequence[Decimal]) -> bool:
        """True if a combination with weights (m,) is other than zero on the span. Raises `spans.AmbiguousRank`."""
        for vector in self._vectors.values():
            size = max((abs(w) * s for w, s in zip(weights, vector.sizes, strict=True)), default=NOTHING)
            value = sum((w * a for w, a in zip(weights, vector.values, strict=True)), NOTHING)
            if not self._is_zero(abs(value) / size if size else NOTHING):
                return True
        return False

    def _is_zero(self, relative: Decimal) -> bool:
        if relative <= self.limits.zero:
            self.error = max(self.error, relative)
            return True
        if relative < self.limits.sure:
            raise AmbiguousRank(float(relative))
        return False


def unit(count: int, i: int) -> list[Decimal]:
    """The vector (m,) that is one at an index."""
    return [Decimal(int(i == j)) for j in range(count)]


class Undecided(Exception):
    """The search cannot go on; the text says why."""


class AmbiguousRank(Undecided):
    """A value that counts neither as zero nor as certainly not zero."""

    def __init__(self, size: float) -> None:
        super().__init__(f"a bracket has the relative size {size:.1e}, neither zero nor certainly not")


def require_time(deadline: float) -> None:
    """Raise `Undecided` after a deadline of `progress.after`, `OverTime` where the time of the whole work is over."""
    progress.require_time()
    if progress.left(deadline) < 0:
        raise Undecided("the time limit ended the search for brackets")
