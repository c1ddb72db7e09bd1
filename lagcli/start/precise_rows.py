"""The rank of rows at a state in sixty digits: doubles do not tell nearly dependent rows from dependent ones.

With d = 1e-8 the rows x = 0 and x + d y = 0 are independent. The state has to be a point of the surface to forty
digits, as it is written or after a move that is far shorter than the rows are from dependent ones.
"""

from __future__ import annotations

import dataclasses
import decimal
from collections.abc import Sequence
from decimal import Decimal
from functools import cached_property

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem, multiprecision, program
from lagcli.compiled.program import Program
from lagcli.linear import decompositions, independent_rows, metric_rows, rank, surface
from lagcli.linear.metric_rows import MetricRows, Sparse
from lagcli.linear.surface import InDigits, Point
from lagcli.smoothness.sized_function import SizedFunction
from lagcli.start import initial
from lagcli.start.initial import State

Numbers = list[Decimal]
ZERO = Decimal(0)


class PreciseRowsParameters:
    """Numbers of ranks in many digits. The tests are of `tests/unit/test_precise_rows.py`."""

    __slots__ = ()

    digits: int = 60
    """Digits of the arithmetic (`test_a_sum_that_differs_from_one_in_the_ninth_digit_has_more_than_six`)."""
    zero: Decimal = Decimal("1e-40")
    """What is left below this of a row of length one, or of f as a part of the coordinates, vanishes
    (`test_a_state_is_on_the_surface_to_forty_digits`)."""
    movable: float = 1e-10
    """Where rows are farther than this from dependent ones a state beside the surface is moved onto it
    (`test_a_state_is_moved_where_rows_are_clear_to_ten_digits`)."""
    clear: float = 1e-3
    """The part of that distance, over the size of the coordinates, by which it may be moved
    (`test_a_move_is_far_shorter_than_the_way_to_dependent_rows`)."""
    most: int = 12_000
    """Entries of all rows, dense, as time grows with the square of their number
    (`test_rows_of_many_entries_are_looked_at_in_doubles`)."""


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
            if B is None:
                return None
            n = self._state.q.size
            unit = [_measured(row, n) for row in B]
            return min(len(eliminated(unit, n, PARAMETERS.zero)[0]), clear.size)

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
                    with_bias = _RowsAtPoint(self._program, there, numbers, s).with_bias()
                except multiprecision.NotFinite:
                    return None
                given = [_measured(row, q.size) for row in with_bias]
                pivots, left = eliminated(given, q.size, PARAMETERS.zero)
                largest = max((abs(row[-1]) for row in given), default=ZERO)
                # A combination of the rows may be a number alone.
                is_none = any(abs(row[-1]) > PARAMETERS.zero * largest for row in left)
                if is_none or (found and len(pivots) != len(found[0])):
                    return None
                rows: dict[int, Numbers] = {}
                for column, pivot in reversed(pivots):
                    row = [a / pivot[column] for a in pivot]
                    for other, after in rows.items():
                        row = [a - row[other] * b for a, b in zip(row, after, strict=True)]
                    rows[column] = row
                found.append(rows)
        here, beside_it = (np.array(list(rows.values()), dtype=float) for rows in found)
        # All that holds beside the state follows from what holds there.
        following = beside_it[:, list(found[0])] @ here
        if not (np.abs(beside_it - following) <= doubles.ROOT * np.abs(here).max(initial=0.0)).all():
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
    """The rank of many rows that are nearly dependent as those of a very long structure in bending; None where they are
    not.

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
        rows = self.at(self.q)[1]
        return [[*row, b] for row, b in zip(rows, self._values(self.q)[-len(rows) :], strict=True)]

    def rows_on_surface(self, rows: MetricRows, independent: int, least: float) -> list[Numbers] | None:
        """The rows at the point, if it is one of the surface, or at the point next to it, if the rank is the same
        there; independent: how many rows are in doubles, least: how far they are from dependent ones."""
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


def eliminated(
    rows: list[Numbers], n: int, nothing: Decimal
) -> tuple[list[tuple[int, Numbers]], list[Numbers]]:
    """Rows with a pivot each in one of the first n columns, the largest that was left and more than `nothing`, with
    zeros in those of the rows above; and the rows that are left over."""
    left = [list(row) for row in rows]
    done: list[tuple[int, Numbers]] = []
    free = list(range(n))
    while free and left:
        i, j = max(((i, j) for i in range(len(left)) for j in free), key=lambda at: abs(left[at[0]][at[1]]))
        if abs(left[i][j]) <= nothing:
            break
        pivot = left.pop(i)
        free.remove(j)
        done.append((j, pivot))
        for row in left:
            if row[j]:
                factor = row[j] / pivot[j]
                for column in (*free, *range(n, len(row))):
                    row[column] -= factor * pivot[column]
                row[j] = ZERO
    return done, left


def following(rows: Sequence[Numbers]) -> list[int]:
    """The rows that follow from rows before them, each measured by its largest entry."""
    independent: list[tuple[int, Numbers]] = []
    found = []
    for i, row in enumerate(rows):
        rest = _measured(row, len(row))
        for column, pivot in independent:
            rest = [a - rest[column] * b for a, b in zip(rest, pivot, strict=True)]
        largest = max(range(len(rest)), key=lambda j: abs(rest[j]), default=0)
        if not rest or abs(rest[largest]) <= PARAMETERS.zero:
            found.append(i)
        else:
            independent.append((largest, [a / rest[largest] for a in rest]))
    return found


def _measured(row: Numbers, n: int) -> Numbers:
    """A row over the largest of its first n entries, if they are not zero."""
    size = max(map(abs, row[:n]), default=ZERO) or Decimal(1)
    return [a / size for a in row]
