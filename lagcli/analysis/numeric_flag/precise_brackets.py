"""Brackets in many digits, at a point of the surface that is met to as many (D.3)."""

from __future__ import annotations

import copy
import decimal
from collections.abc import Callable
from decimal import Decimal
from functools import cached_property

import numpy as np

from lagcli.analysis.numeric_flag import undecided
from lagcli.analysis.numeric_flag.evaluation_point import EvaluationPoint
from lagcli.analysis.numeric_flag.span import DigitSample
from lagcli.compiled import lie_brackets, multiprecision, program
from lagcli.compiled.lie_brackets import LEAF, Shape
from lagcli.compiled.multiprecision import Number
from lagcli.compiled.program import Program
from lagcli.linear import surface
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.linear.surface import InDigits

# Values in the first precision; a coarser one shows the size of what cancelled, and so what is rounding.
DIGITS, FEWER = 60, 30
CONTEXTS = ((FEWER, decimal.ROUND_UP),)
MORE_CONTEXTS = ((FEWER - 1, decimal.ROUND_DOWN), (FEWER + 1, decimal.ROUND_HALF_EVEN))
ZERO, SURE = Decimal("1e-40"), Decimal("1e-12")
# Operations of the elimination that are written out.
FILL = 20_000

Field = list[Number]


class Exact:
    """The rows at one point as written-out programs.

    is_decimal: a parameter 0.1 is a tenth, as it was written, and not the double next to it.
    Raises `lie_brackets.TooMuchFill`, `multiprecision.Unknown`, and `undecided.Undecided`.
    """

    def __init__(self, point: EvaluationPoint, is_decimal: bool) -> None:
        if point.rows.is_large:
            raise lie_brackets.TooMuchFill
        block, self._point = point.block, point
        order = lie_brackets.pivots(point.A[point.independent, :], FILL)
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
        self._x = self._refined([self._read(a) for a in point.x.tolist()], holonomic)

    def bracket(self, shape: Shape, U: list[list[int]]) -> DigitSample:
        """Values on the independent differential rows, of a bracket of fields of scaled components U (leaves, N)."""
        columns = [self._plain(column) for column in U]
        return self._sampled(lambda one: one._value(shape, one._x, columns, 1))

    def rows_along(self, u: list[int], w: list[Decimal]) -> DigitSample:
        """All rows (s + m,) along the field of scaled components u (N,) and of values w."""
        return self._sampled(lambda one: one._rows(self._plain(u), w))

    def _rows(self, u: list[Decimal], w: list[Decimal]) -> list[Decimal]:
        field = self._run(self._field, [self._x, self._p, u, w])
        return self._run(self._along, [self._x, self._p, field])

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

    def _refined(self, x: list[Decimal], code: Program) -> list[Decimal]:
        """The point with f = 0 of the independent holonomic rows to all digits, moved in the coordinates."""
        block, point = self._point.block, self._point
        n, s = len(block.columns), len(block.holonomic)
        holonomic = [i for i in point.independent if i < s]
        if not holonomic:
            return x
        rows = MetricRows(point.plain[holonomic, :n], Metric.unit(n))
        goal = Decimal(10) ** (5 - DIGITS) * (max((abs(a) for a in x[:n]), default=Decimal(0)) or 1)
        every = list(range(len(holonomic)))

        def at(q: surface.Point) -> InDigits:
            f = self._run(code, [[*q, *x[n:]], self._p])
            return InDigits([f[i] for i in holonomic], rows, every, rows.lengths, goal)

        q = surface.nearby(at, np.array(x[:n]))
        if q is None:
            raise undecided.Undecided("no point of the surface was found in many digits")
        return [*q, *x[n:]]

    def _run(self, code: Program, inputs: list[list[Number]]) -> list[Number]:
        try:
            return multiprecision.run(code, inputs, self._read)
        except multiprecision.NotFinite:
            raise undecided.Undecided("a bracket is not finite") from None


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
