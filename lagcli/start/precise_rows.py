"""The rank of rows at a state in sixty digits: doubles do not tell nearly dependent rows from dependent ones.

A model is written in decimals: with d = 1e-8 the rows x = 0 and x + d y = 0 are independent. The state has to be a
point of the surface to forty digits, as it is written or after a move that is far shorter than the rows are from
dependent ones.
"""

from __future__ import annotations

import dataclasses
import decimal
from collections.abc import Sequence
from decimal import Decimal
from functools import cached_property

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import NumericSystem, multiprecision, program
from lagcli.compiled.program import Program
from lagcli.linear import decompositions, independent_rows, metric_rows, rank, surface
from lagcli.linear.metric_rows import MetricRows, Sparse
from lagcli.linear.surface import InDigits, Point
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.start import initial
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]
Numbers = list[Decimal]
ZERO = Decimal(0)


class PreciseRowsParameters:
    """Numbers of ranks in many digits. The tests are of `tests/unit/test_precise_rows.py`."""

    __slots__ = ()

    digits: int = 60
    """Digits of the arithmetic. `test_a_sum_that_differs_from_one_in_the_ninth_digit_has_more_than_six` fails at 6."""
    zero: Decimal = Decimal("1e-40")
    """What is left below this of a row of length one, or of f as a part of the coordinates, vanishes.
    `test_a_state_is_on_the_surface_to_forty_digits` fails at 1e-41 and 1e-39."""
    movable: float = 1e-10
    """Where rows are farther than this from dependent ones a state beside the surface is moved onto it.
    `test_a_state_is_moved_where_rows_are_clear_to_ten_digits` fails at 1e-11 and 1e-9."""
    clear: float = 1e-3
    """The part of that distance, over the size of the coordinates, by which it may be moved.
    `test_a_move_is_far_shorter_than_the_way_to_dependent_rows` fails at 1e-4 and 1e-2."""
    most: int = 12_000
    """Entries of all rows, dense: of more nothing is looked at, as time grows with the square of their number.
    `test_rows_of_many_entries_are_looked_at_in_doubles` fails at 1 200 and 120 000."""


PARAMETERS = PreciseRowsParameters()


class PreciseRows:
    """The rows of a system at a state, looked at when they are asked for."""

    def __init__(self, numeric: NumericSystem, state: State) -> None:
        self._numeric, self._state = numeric, state

    def rank(self, rows: MetricRows, numbers: Sequence[int]) -> int | None:
        """The rank of rows with these numbers in the system; `rows` are the same in doubles. None where these leave no
        doubt, and where it is not known in so many digits. Of many rows doubles tell it (`rank_of_many`)."""
        if rows.is_large:
            f = np.array(self._numeric.holonomic(self._state.t, self._state.q, self._state.p)[0]).ravel()
            holonomic = [k for k, i in enumerate(numbers) if i < f.size]
            return rank_of_many(
                rows, holonomic, f[[numbers[k] for k in holonomic]], initial.size(self._state.q)
            )
        sigma = decompositions.singular_values(rows.dense)
        clear = sigma[sigma > doubles.SUM]
        if not clear.size or clear.min() > rank.PARAMETERS.large:
            return None  # others are rounding: there is no doubt, and nothing is written out
        if self._program is None:
            return None
        is_constant = not ca.depends_on(self._symbols[1][list(numbers), :], self._symbols[0])
        with decimal.localcontext(prec=PARAMETERS.digits):
            try:
                point = _RowsAtPoint(
                    self._program, self._state, numbers, self._numeric.holonomic.size1_out(0)
                )
                if is_constant:
                    B: list[Numbers] | None = point.at(point.q)[1]  # the same everywhere
                else:
                    B = point.rows_on_surface(rows, clear.size, float(clear.min()))
            except multiprecision.NotFinite:
                return None
            return None if B is None else min(len(_eliminated(B, len(B[0]) if B else 0)[0]), clear.size)

    def solved(self) -> tuple[Sparse, Floats] | None:
        """Rows R (r, n) and c (r,) with R v + c = 0 where all rows hold, B v + b = 0, each solved for a rate of its
        own: what sets nearly dependent rows apart has all its digits. None where no velocity satisfies them, where it
        would be another beside the state by the rounding of its coordinates, and where digits are not known."""
        if self._program is None:
            return None
        q = self._state.q
        beside = q + doubles.EPS * initial.size(q) * decompositions.generic_direction(q.size, 0)
        numbers, s = range(self._numeric.rows.size1_out(0)), self._numeric.holonomic.size1_out(0)
        found: list[dict[int, Numbers]] = []
        with decimal.localcontext(prec=PARAMETERS.digits):
            for there in (self._state, dataclasses.replace(self._state, q=beside)):
                try:
                    rows = _solved(_RowsAtPoint(self._program, there, numbers, s).with_bias(), q.size)
                except multiprecision.NotFinite:
                    return None
                if rows is None or (found and len(rows) != len(found[0])):
                    return None
                found.append(rows)
        here, other = (np.array(list(rows.values()), dtype=float) for rows in found)
        # All that holds beside the state follows from what holds there.
        following = other[:, list(found[0])] @ here
        if not (np.abs(other - following) <= doubles.ROOT * np.abs(here).max(initial=0.0)).all():
            return None
        return metric_rows.of_dense(here[:, :-1]), here[:, -1]

    @cached_property
    def _symbols(self) -> tuple[ca.SX, ca.SX, ca.SX, list[ca.SX]]:
        """q, B (C, n) and b (C,), and all inputs of the rows."""
        t, q, v, p = inputs = [
            ca.SX.sym(name, self._numeric.rows.size1_in(i)) for i, name in enumerate("tqvp")
        ]
        return q, *self._numeric.rows(t, q, v, p), inputs

    @cached_property
    def _program(self) -> Program | None:
        """f (s,), all rows (C n,) and b (C,) written out; None where they are too large, or hold functions that are
        not known in many digits."""
        if self._numeric.rows.numel_out(0) > PARAMETERS.most:
            return None
        _, B, b, inputs = self._symbols
        t, q, _, p = inputs
        f = self._numeric.holonomic(t, q, p)[0]
        found = program.written_out(
            SizedFunction("precise", inputs, [ca.densify(ca.vertcat(f, ca.vec(B.T), b))])
        )
        try:
            multiprecision.require_known(found)
        except multiprecision.Unknown:
            return None
        return found


def rank_of_many(rows: MetricRows, holonomic: list[int], f: Floats, size: float) -> int | None:
    """The rank of many rows, of which some are near to dependent ones and none is as near as a surface that is singular
    leaves them: those of a very long structure in bending. None where that is not so.

    All others have to follow from a few rows near them to far more digits than these are apart, and the point to stand
    on the surface, f (s,) of the `holonomic` ones, within a part of that distance.
    """
    least = rank.PARAMETERS.small
    count = rows.above(least)
    if count == rows.above(rank.PARAMETERS.large):
        return None
    chosen = independent_rows.independent(rows, count)
    if not independent_rows.follow_from_few(rows, chosen):
        return None
    place = {k: j for j, k in enumerate(holonomic)}
    on = [k for k in chosen if k in place]
    if on:
        moved = rows.take(on).correction(f[[place[k] for k in on]])
        if not float(np.abs(moved).max(initial=0.0)) <= PARAMETERS.clear * least * size:
            return None
    return count


class _RowsAtPoint:
    """Some rows as functions of the coordinates, at the time and parameters of a state; s: the holonomic rows."""

    def __init__(self, written: Program, state: State, numbers: Sequence[int], s: int) -> None:
        self._program, self._numbers, self._s = written, numbers, s
        self._t, self.q, self._v, self._p = (
            [multiprecision.decimal_of(float(value)) for value in np.atleast_1d(values)]
            for values in (state.t, state.q, state.v, state.p)
        )

    def with_bias(self) -> list[Numbers]:
        """The rows at the point as it is written, each with its b last. Raises `multiprecision.NotFinite`."""
        values, n = self._values(self.q), len(self.q)
        biases = values[len(values) - (len(values) - self._s) // (n + 1) :]
        return [[*row, b] for row, b in zip(self.at(self.q)[1], biases, strict=True)]

    def rows_on_surface(self, rows: MetricRows, independent: int, least: float) -> list[Numbers] | None:
        """The rows at the point, if it is one of the surface; else at the point of it next to that, if it is so near
        that the rank is the same.

        independent: how many rows are in doubles, least: how far they are from dependent ones.
        """
        size = max(map(abs, self.q), default=ZERO) or Decimal(1)
        written = self.at(self.q)[1]
        holonomic = [k for k, i in enumerate(self._numbers) if i < self._s]
        lengths = np.array([float(max(map(abs, written[k]))) or 1.0 for k in holonomic])
        chosen = independent_rows.dependence(rows, independent, len(holonomic)).independent
        moving = [k for k in chosen if k < len(holonomic)]

        clear_rows = rows.take(moving)

        def at(q: Point) -> InDigits:
            f = self.at(list(q))[0]
            return InDigits(f, clear_rows, moving, lengths, PARAMETERS.zero * size)

        q = surface.nearby(at, np.array(self.q))
        if q is None:
            return None
        far = max((abs(a - b) for a, b in zip(q, self.q, strict=True)), default=ZERO)
        if not far:
            return written
        is_clear = least >= PARAMETERS.movable and far <= Decimal(PARAMETERS.clear * least) * size
        return self.at(list(q))[1] if is_clear else None

    def at(self, q: Numbers) -> tuple[Numbers, list[Numbers]]:
        """f of the holonomic ones, which come first, and all rows. Raises `multiprecision.NotFinite`."""
        values = self._values(q)
        s, n = self._s, len(q)
        return [values[i] for i in self._numbers if i < s], [
            values[s + i * n : s + (i + 1) * n] for i in self._numbers
        ]

    def _values(self, q: Numbers) -> Numbers:
        inputs = [self._t, q, self._v, self._p]
        return multiprecision.run(self._program, inputs, multiprecision.decimal_of)


def _solved(rows: list[Numbers], n: int) -> dict[int, Numbers] | None:
    """Rows, each over n coordinates with a number more, solved for as many coordinates as can be, by the numbers of
    these; None where a combination of the rows is a number alone."""
    pivots, left = _eliminated(rows, n)
    largest = max((abs(row[n]) / (max(map(abs, row[:n])) or 1) for row in rows), default=ZERO)
    if any(abs(row[n]) > PARAMETERS.zero * largest for row in left):
        return None
    found: dict[int, Numbers] = {}
    for column, pivot in reversed(pivots):
        row = [a / pivot[column] for a in pivot]
        for other, after in found.items():
            row = _without(row, other, after)
        found[column] = row
    return found


def _eliminated(rows: list[Numbers], n: int) -> tuple[list[tuple[int, Numbers]], list[Numbers]]:
    """Elimination with the largest pivots among the first n entries, each row measured by the largest of them: the rows
    with a pivot, after its column, and those of which nothing is left there."""
    left = [_over(row, max(map(abs, row[:n]), default=ZERO) or Decimal(1)) for row in rows]
    pivots = []
    while left:
        k = max(range(len(left)), key=lambda k: max(map(abs, left[k][:n]), default=ZERO))
        pivot = left[k]
        column = max(range(n), key=lambda j: abs(pivot[j]), default=0)
        if not n or abs(pivot[column]) <= PARAMETERS.zero:
            break
        pivots.append((column, left.pop(k)))
        left = [_without(row, column, pivot) for row in left]
    return pivots, left


def _without(row: Numbers, column: int, pivot: Numbers) -> Numbers:
    """A row without its entry in a column, by a multiple of another row."""
    part = row[column] / pivot[column]
    return [a - part * b for a, b in zip(row, pivot, strict=True)] if part else row


def following(rows: Sequence[Numbers]) -> list[int]:
    """The rows that follow from rows before them, each measured by its largest entry."""
    independent: list[tuple[int, Numbers]] = []
    found = []
    for i, row in enumerate(rows):
        rest = _over(row, max(map(abs, row), default=ZERO))
        for column, pivot in independent:
            rest = [a - rest[column] * b for a, b in zip(rest, pivot, strict=True)] if rest else rest
        largest = max(range(len(rest)), key=lambda j: abs(rest[j]), default=0)
        if not rest or abs(rest[largest]) <= PARAMETERS.zero:
            found.append(i)
        else:
            independent.append((largest, [a / rest[largest] for a in rest]))
    return found


def _over(row: Numbers, size: Decimal) -> Numbers:
    return [a / size for a in row] if size else []
