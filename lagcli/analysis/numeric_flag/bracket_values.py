"""Random values of brackets at one point, in many digits where the rows are few enough, else in doubles; the growth of
the distribution by them, and the derived flag that follows.

Growth vector: dim D plus the ranks of brackets of 2, 3, ... fields. Derived flag: brackets of all that is there (D.3).
In many digits the point of the surface is met to as many.
"""

from __future__ import annotations

import copy
import dataclasses
import decimal
import itertools
from collections.abc import Callable
from decimal import Decimal
from functools import cached_property

import numpy as np

from lagcli import doubles, progress
from lagcli.analysis.numeric_flag import evaluation_point, spans
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.analysis.numeric_flag.spans import DigitSample, Limits, Span
from lagcli.compiled import lie_brackets, multiprecision, program
from lagcli.compiled.lie_brackets import LEAF, Shape
from lagcli.compiled.multiprecision import Number
from lagcli.compiled.program import Program
from lagcli.linear import surface
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.linear.surface import InDigits

# In doubles.
ROUGH_ZERO, ROUGH_SURE = Decimal("1e-13"), Decimal("1e-8")
# What longer brackets are made of is no smaller than this part of the terms of short ones.
DEEPER = 1e-4
# Random components are whole numbers up to this, so that one random bracket stands for all.
LETTERS = 10**6
# Multiplications beyond which no bracket is computed.
LARGEST = 4_000_000
SEED = 20062


class BracketValues:
    """Random values of brackets on the independent differential rows of a point.

    is_decimal: as in `Exact`. limits: other ones than those of the digits. Raises `spans.Undecided`.
    """

    def __init__(
        self, point: EvaluationPoint, deadline: float, is_decimal: bool, limits: Limits | None = None
    ) -> None:
        if point.all.low != len(point.independent):
            raise spans.Undecided("which of so many rows depend on others is not known")
        self.point, self._deadline, self._is_decimal = point, deadline, is_decimal
        self.count = len(point.differential)
        self._random = np.random.default_rng(SEED)
        self.exact = in_digits(point, is_decimal)
        # Multiplications of one bracket, in doubles five for a component of x
        self._length = 5 * point.block.size if self.exact is None else self.exact.length
        self.digits = 16 if self.exact is None else DIGITS
        usual = Limits(ROUGH_ZERO, ROUGH_SURE) if self.exact is None else Limits(ZERO, SURE)
        # A point may be off the orbit, where a value that should vanish may be so large.
        off = Decimal(evaluation_point.OFF * point.error)
        self._limits = Limits((limits or usual).zero, max((limits or usual).sure, off))

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
            spans.require_time(self._deadline)
            work = _work(shape) * self._length
            if work > LARGEST:
                raise spans.Undecided(f"brackets of {lie_brackets.leaves(shape)} fields are too large")
            progress.reckon(work * progress.PARAMETERS.entry)
            sample = self._sample(shape)
            if not span.add(sample):
                break
            added.append(sample)
        return added

    def _sample(self, shape: Shape) -> DigitSample:
        point = self.point
        U = self._random.integers(-LETTERS, LETTERS, (point.block.size, lie_brackets.leaves(shape)))
        if self.exact is not None:
            return self.exact.bracket(shape, U.T.tolist())
        # In doubles: at x moved by rounding the size is seen, but where all is rounding.
        function, fields = self._brackets.values(shape), U / LETTERS * point.sizes[:, None]
        neighbour = point.x + doubles.VALUE * point.sizes * self._random.standard_normal(point.x.size)
        here, there = (np.array(function(x, point.p, fields)).ravel() for x in (point.x, neighbour))
        terms = point.terms[point.differential] * (1.0 if lie_brackets.leaves(shape) == 2 else DEEPER)
        sizes = np.maximum(np.maximum(np.abs(here), np.abs(there - here) / doubles.VALUE), terms)
        if not np.isfinite(sizes).all():
            raise spans.Undecided("a bracket is not finite")
        return DigitSample([Decimal(a) for a in here.tolist()], [Decimal(a) for a in sizes.tolist()])

    @cached_property
    def _brackets(self) -> lie_brackets.Brackets:
        return lie_brackets.Brackets(self.point.block, self.point.independent)


@dataclasses.dataclass(frozen=True, slots=True)
class Growth:
    """Brackets [X, [X, ...]]: the span of all, and the samples that each level added."""

    span: Span
    levels: tuple[list[DigitSample], ...] = ()

    @property
    def ranks(self) -> tuple[int, ...]:
        """0 and the rank after each level."""
        return tuple(itertools.accumulate(map(len, self.levels), initial=0))


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
    """The dimensions of I, I', ... to zero or to the first that repeats, and the span that showed them. They fall by
    brackets of all fields found so far, until the rank is that of the end."""
    end, span = found.span.rank, values.span()
    extra = [values.count]
    shapes: list[Shape] = [LEAF]
    new: list[Shape] = [LEAF]
    level: Shape = LEAF
    while span.rank < end:
        level = (LEAF, level)
        added = [span.add(sample) for sample in found.levels[len(extra) - 1]]
        fresh: list[Shape] = [level] if any(added) else []
        # Brackets of two shapes of which one is new, short ones first.
        pairs = {(a, b) for i, b in enumerate(shapes) for a in shapes[: i + 1] if a in new or b in new}
        for shape in sorted(pairs, key=lambda shape: (lie_brackets.leaves(shape), str(shape))):
            if shape not in (level, (LEAF, LEAF)) and span.rank < end and values.extend(span, shape, end):
                fresh.append(shape)
        extra.append(values.count - span.rank)
        shapes, new = [*shapes, *fresh], fresh
    if extra[-1] > 0:
        extra.append(extra[-1])
    return tuple(extra), span


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


# Values in the first precision; a coarser one shows the size of what cancelled, and so what is rounding.
DIGITS = 60
CONTEXTS = ((30, decimal.ROUND_UP),)
MORE_CONTEXTS = ((29, decimal.ROUND_DOWN), (31, decimal.ROUND_HALF_EVEN))
ZERO, SURE = Decimal("1e-40"), Decimal("1e-12")

Field = list[Number]


class Exact:
    """The rows at one point as written-out programs.

    is_decimal: a parameter 0.1 is a tenth, as it was written, and not the double next to it.
    Raises `lie_brackets.TooMuchFill`, `multiprecision.Unknown`, and `spans.Undecided`.
    """

    def __init__(self, point: EvaluationPoint, is_decimal: bool) -> None:
        if point.rows.is_large:
            raise lie_brackets.TooMuchFill
        block, self._point = point.block, point
        order = lie_brackets.pivots(point.A[point.independent, :], 20_000)  # operations that are written out
        self._field = program.written_out(lie_brackets.expanded_field(block, point.independent, order))
        self._curl, self._along = program.written_out(block.curl), program.written_out(block.along)
        holonomic = program.written_out(block.surface)
        self.length = len(self._field.steps) + len(self._curl.steps)
        for one in (self._field, self._curl, self._along, holonomic):
            multiprecision.require_known(one)
        self._read = multiprecision.decimal_of if is_decimal else Decimal
        self._p = [self._read(a) for a in point.p.tolist()]
        self._sizes = [Decimal(size) for size in point.sizes.tolist()]
        self._nothing = [Decimal(0)] * len(point.differential)
        self._still = [Decimal(0)] * block.size
        self._x = [self._read(a) for a in point.x.tolist()]
        n, s = len(block.columns), len(block.holonomic)
        surface_rows = [i for i in point.independent if i < s]
        if surface_rows:
            # The point with f = 0 of these to all digits, moved in the coordinates
            q, rest = self._x[:n], self._x[n:]
            rows = MetricRows(point.plain[surface_rows, :n], Metric.unit(n))
            goal = Decimal(10) ** (5 - DIGITS) * (max((abs(a) for a in q), default=Decimal(0)) or 1)
            every = list(range(len(surface_rows)))

            def at(q: surface.Point) -> InDigits:
                f = self._run(holonomic, [[*q, *rest], self._p])
                return InDigits([f[i] for i in surface_rows], rows, every, rows.lengths, goal)

            met = surface.nearby(at, np.array(q))
            if met is None:
                raise spans.Undecided("no point of the surface was found in many digits")
            self._x = [*met, *rest]

    def bracket(self, shape: Shape, U: list[list[int]]) -> DigitSample:
        """Values on the independent differential rows, of a bracket of fields of scaled components U (leaves, N)."""
        columns = [self._plain(column) for column in U]
        return self._sampled(lambda one: one._value(shape, one._x, columns, 1))

    def rows_along(self, u: list[int], w: list[Decimal]) -> DigitSample:
        """All rows (s + m,) along the field of scaled components u (N,) and of values w."""

        def rows(one: Exact) -> list[Decimal]:
            field = one._run(one._field, [one._x, one._p, self._plain(u), w])
            return one._run(one._along, [one._x, one._p, field])

        return self._sampled(rows)

    @cached_property
    def _perturbed(self) -> Exact:
        """The brackets with numbers off as those may be that were computed in doubles, the start among them: it
        may stand for a point that no double hits (sin(x) = 0 at pi)."""
        other = copy.copy(self)
        other._p, other._read = (
            [multiprecision.perturbed(a) for a in self._p],
            multiprecision.perturbed_constant,
        )
        other._x = [multiprecision.perturbed(a) for a in self._x]
        return other

    def _sampled(self, values: Callable[[Exact], list[Decimal]]) -> DigitSample:
        """Values in many digits, with the sizes that fewer digits and perturbed numbers show."""
        exact = values(self)
        others = [
            (values(self._perturbed), 1 / multiprecision.PERTURBATION),
            *_in_contexts(lambda: values(self), CONTEXTS),
        ]
        sample = DigitSample(exact, _sizes(exact, others))
        # Where the coarser one happens to be exact, rounding in other directions is not.
        if any(ZERO < a < SURE for a in sample.relative):
            others += _in_contexts(lambda: values(self), MORE_CONTEXTS)
            return DigitSample(exact, _sizes(exact, others))
        return sample

    def _plain(self, column: list[int]) -> list[Decimal]:
        return [a * size for a, size in zip(column, self._sizes, strict=True)]

    def _value(self, shape: Shape, x: list[Number], columns: list[list[Decimal]], tag: int) -> list[Number]:
        """Values of a bracket at x; derivatives within belong to `tag` and those above."""
        one, other = shape
        split = lie_brackets.leaves(one)
        first, second = columns[:split], columns[split:]
        Y = self._of(one, x, first, tag)
        change = [[Decimal(0)] * len(self._nothing)] * 2
        if other == LEAF:
            Z = self._of(other, x, second, tag)
        else:
            w, change[0] = multiprecision.parts(
                self._value(other, multiprecision.moved(x, Y, tag), second, tag + 1), tag
            )
            Z = self._run(self._field, [x, self._p, self._still, w])
        if one != LEAF:
            _, change[1] = multiprecision.parts(
                self._value(one, multiprecision.moved(x, Z, tag), first, tag + 1), tag
            )
        curl = self._run(self._curl, [x, self._p, Y, Z])
        return [a - b - curl[i] for a, b, i in zip(*change, self._point.differential, strict=True)]

    def _of(self, shape: Shape, x: list[Number], columns: list[list[Decimal]], tag: int) -> Field:
        """The field of a shape at x."""
        if shape == LEAF:
            return self._run(self._field, [x, self._p, columns[0], self._nothing])
        return self._run(self._field, [x, self._p, self._still, self._value(shape, x, columns, tag)])

    def _run(self, code: Program, inputs: list[list[Number]]) -> list[Number]:
        try:
            return multiprecision.run(code, inputs, self._read)
        except multiprecision.NotFinite:
            raise spans.Undecided("a bracket is not finite") from None


def _in_contexts(
    values: Callable[[], list[Decimal]], contexts: tuple[tuple[int, str], ...]
) -> list[tuple[list[Decimal], Decimal]]:
    """Values in each precision and rounding, and one over that precision."""
    found = []
    for precision, rounding in contexts:
        with decimal.localcontext(prec=precision, rounding=rounding):
            found.append((values(), Decimal(10) ** precision))
    return found


def _sizes(exact: list[Decimal], others: list[tuple[list[Decimal], Decimal]]) -> list[Decimal]:
    """The size of each value, or of what it is made of."""
    return [
        max([abs(a), *(factor * abs(values[i] - a) for values, factor in others)])
        for i, a in enumerate(exact)
    ]
