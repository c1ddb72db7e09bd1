"""The constraint rows B (C, n) at one configuration: their size, their independence, and steps along them. Independent
rows answer by the sparse factors of their Gram matrix; only rows that may be dependent are made dense."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.linear import decompositions
from lagcli.linear.metric import Metric

Indices = npt.NDArray[np.intp]
Sparse = ca.DM  # a matrix of numbers
Digits = Callable[["MetricRows", Sequence[int]], int | None]


class MetricRowsParameters:
    """Rows of length one, and from where on their Gram matrix serves. The tests are of
    `tests/unit/test_numbers_of_rows.py`."""

    __slots__ = ()

    dense: int = 150
    """More rows than these, over more coordinates than these, are never looked at densely: their singular values would
    take minutes. `test_more_than_a_hundred_and_fifty_rows_are_many`."""
    most_dense: int = 3000
    """Of more rows over few coordinates not all dependences are given (72 MB). In `tests/unit/test_growth.py`
    `test_very_many_rows_over_few_coordinates_have_their_rank_by_a_thin_factorization`."""
    filled: float = 0.1
    """A Gram matrix with this part of its entries is factored faster as a dense one.
    `test_a_gram_matrix_of_which_a_tenth_is_filled_is_dense`."""
    hanging: float = 1e-2
    """A row hangs on a coordinate that no other row holds where the entry is this part of its length.
    `test_a_row_hangs_on_a_coordinate_of_its_own_by_a_hundredth`."""


PARAMETERS = MetricRowsParameters()
LENGTHS = np.finfo(float).smallest_subnormal, np.finfo(float).max  # the range of numbers


class LocalRows:
    """Rows B (C, n), a sparse CasADi matrix of numbers, by their entries."""

    def __init__(self, B: Sparse) -> None:
        self.B, self.count = B, int(B.shape[0])
        rows, columns = B.sparsity().get_triplet()
        self.row = np.asarray(rows, dtype=np.intp)
        self.column = np.asarray(columns, dtype=np.intp)
        self.values = np.array(B.nonzeros(), dtype=float)

    def finite(self) -> LocalRows:
        """The rows with 0 for entries that are not finite."""
        if np.isfinite(self.values).all():
            return self
        return self.with_values(np.where(np.isfinite(self.values), self.values, 0.0))

    def with_values(self, values: Floats) -> LocalRows:
        """Rows of the same pattern with other entries, in the order of `values`."""
        return LocalRows(ca.DM(self.B.sparsity(), ca.DM(values)))

    @cached_property
    def norms(self) -> Floats:
        """|B_i|, (C,); scaled before squaring, so that no coefficient is too large."""
        largest = np.zeros(self.count)
        np.maximum.at(largest, self.row, np.abs(self.values))
        scale = np.where((largest > 0) & np.isfinite(largest), largest, 1.0)
        with np.errstate(over="ignore", invalid="ignore"):  # entries that are not finite have been looked for
            return scale * np.sqrt(self._summed((self.values / scale[self.row]) ** 2))

    @property
    def divisors(self) -> Floats:
        """|B_i|, and 1 for a row that vanishes."""
        return np.where(self.norms > 0, self.norms, 1.0)

    def times(self, v: Floats) -> Floats:
        """B v, (C,)."""
        return self._summed(self.values * v[self.column])

    def combined(self, weights: Floats) -> Floats:
        """B^T weights, (n,)."""
        terms = self.values * weights[self.row]
        return np.asarray(np.bincount(self.column, terms, minlength=int(self.B.shape[1])), dtype=float)

    def blocks(self) -> list[tuple[Indices, Floats]]:
        """The rows that have coordinates in common, directly or by rows between them, and their entries, dense over the
        coordinates that they touch. A row with coordinates of its own is left out, one that vanishes is a block."""
        there = np.flatnonzero(self.values)
        row, column, values = self.row[there], self.column[there], self.values[there]
        pattern = ca.Sparsity.triplet(*self.B.shape, row.tolist(), column.tolist())
        _, order, firsts = ca.mtimes(pattern, pattern.T).scc()
        number = np.empty(self.count, dtype=np.intp)
        number[order] = np.repeat(np.arange(len(firsts) - 1), np.diff(firsts))
        by_block = np.argsort(number[row], kind="stable")
        ends = np.searchsorted(number[row][by_block], np.arange(len(firsts)))
        found: list[tuple[Indices, Floats]] = []
        for k in np.flatnonzero((np.diff(firsts) > 1) | (np.diff(ends) == 0)).tolist():
            rows = np.sort(np.array(order[firsts[k] : firsts[k + 1]], dtype=np.intp))
            taken = by_block[ends[k] : ends[k + 1]]
            touched, at = np.unique(column[taken], return_inverse=True)
            dense = np.zeros((rows.size, touched.size))
            dense[np.searchsorted(rows, row[taken]), at] = values[taken]
            found.append((rows, dense))
        return found

    def largest(self, sizes: Floats) -> Floats:
        """The largest of the sizes (n,) that each row touches with an entry that is not zero, (C,)."""
        found = np.zeros(self.count)
        touching = self.values != 0
        np.maximum.at(found, self.row[touching], sizes[self.column[touching]])
        return found

    def are_finite(self) -> Flags:
        """True where all entries of a row are finite, (C,)."""
        good = np.ones(self.count, dtype=bool)
        good[self.row[~np.isfinite(self.values)]] = False
        return good

    def _summed(self, entries: Floats) -> Floats:
        return np.asarray(np.bincount(self.row, weights=entries, minlength=self.count), dtype=float)


class MetricRows:
    """Rows in the mass metric, B M^-1/2, each of length one (a row that vanishes stays zero).

    unit: the rows, sparse (C, free); lengths: those they had in the metric, (C,), 1 for a row that vanishes.
    precise: the rank of the rows with some numbers by more digits, where doubles do not tell it, or None.
    """

    def __init__(self, B: Sparse, metric: Metric, precise: Digits | None = None) -> None:
        self._metric, self._B = metric, B
        self._precise, self._numbers = precise, list(range(B.shape[0]))
        rows = LocalRows(metric.whitened(B))
        sizes = np.ones(rows.count)
        is_lost = ~((rows.norms >= np.finfo(float).tiny) & np.isfinite(rows.norms))
        if is_lost.any() and (is_lost & ((plain := LocalRows(B)).norms > 0)).any():
            # Their own sizes and the inertia are beyond the range of numbers together, and not each.
            unit = ca.DM(B.sparsity(), ca.DM(plain.values / plain.divisors[plain.row]))
            rows = LocalRows(metric.whitened(unit))
            sizes = plain.divisors
        self._length_factors = sizes, rows.divisors
        with np.errstate(over="ignore"):
            self.lengths = np.clip(sizes * rows.divisors, *LENGTHS)
        self.unit: Sparse = ca.DM(rows.B.sparsity(), ca.DM(rows.values / rows.divisors[rows.row]))
        self.count = rows.count

    def take(self, indices: list[int]) -> MetricRows:
        """Some of the rows."""
        part = object.__new__(MetricRows)
        part._metric, part._B, part.lengths = self._metric, self._B[indices, :], self.lengths[indices]
        part.unit, part.count = self.unit[indices, :], len(indices)
        sizes, in_metric = self._length_factors
        part._length_factors = sizes[indices], in_metric[indices]
        part._precise, part._numbers = self._precise, [self._numbers[i] for i in indices]
        return part

    def plain(self) -> MetricRows:
        """The rows with the unit metric in place of the masses; what may not move may not move in it either."""
        return MetricRows(self._B, self._metric.plain())

    @cached_property
    def rank_in_digits(self) -> int | None:
        """The rank where it is known better than by the limits of its singular values, else None."""
        if self._precise is None:
            return None
        return self._precise(self, self._numbers)

    @cached_property
    def dense(self) -> Floats:
        """The rows as an array (C, free)."""
        return np.array(self.unit)

    @cached_property
    def _entries(self) -> LocalRows:
        return LocalRows(self.unit)

    @cached_property
    def _gram(self) -> ca.DM:
        return ca.mtimes(self.unit, self.unit.T)

    @cached_property
    def _factors(self) -> ca.Linsol:
        # Of a row that vanishes by structure the diagonal has an entry only by what is added to it.
        return ca.Linsol("gram", "ldl", (self._gram + ca.DM.eye(self.count)).sparsity())

    @cached_property
    def are_independent(self) -> bool:
        """True if the smallest singular value is certainly far above rounding."""
        if self.count == 0:
            return True
        if self.count > self.unit.shape[1] or 0 in self._entries.norms:
            return False
        if self.is_large and self._least_with_hanging() ** 2 > doubles.ZERO:
            return True
        return self.weakest[0] > doubles.ZERO

    def _least_with_hanging(self) -> float:
        """A lower bound of the smallest singular value, 0 where none is known, from rows that hang on a coordinate of
        their own and the rest: the particles of a rigid body on its base.

        With P the entries at own coordinates, X the others of these rows and R the rest, the inverse of
        [[P, X], [0, R]] is [[1/P, -X/(P R)], [0, 1/R]].
        """
        rows = self._entries
        holds = rows.values != 0
        alone = holds & (np.bincount(rows.column[holds], minlength=self.unit.shape[1])[rows.column] == 1)
        own = np.sqrt(np.bincount(rows.row[alone], rows.values[alone] ** 2, minlength=self.count))
        hanging = own > PARAMETERS.hanging
        rest = np.flatnonzero(~hanging)
        if rest.size > self.count / 2 or rest.size > PARAMETERS.dense:
            return 0.0
        least = 1.0
        if rest.size:
            others = self.take(rest.tolist())
            touched = np.unique(LocalRows(others.unit).column)
            least = float(decompositions.singular_values(np.array(others.unit[:, touched.tolist()]))[-1])
            if touched.size < rest.size or least == 0.0:
                return 0.0
        across = np.sqrt(self.count - rest.size)  # as long as X is at most, of rows of length one
        return float(1.0 / ((1.0 + across / least) / own[hanging].min() + 1.0 / least))

    @property
    def _is_filled(self) -> bool:
        """True if the Gram matrix is better looked at densely."""
        return self.count <= 4000 and self._gram.nnz() > PARAMETERS.filled * self.count**2  # 128 MB

    @cached_property
    def weakest(self) -> tuple[float, Floats]:
        """The smallest eigenvalue of the Gram matrix, the square of the singular value, and its vector (C,): where a
        combination of the rows nearly vanishes all that depend on one another take part in it."""
        # Exactly dependent rows would leave a zero to divide by; the shift is far below what is asked for.
        solve = self._repeated_solver(doubles.SUM)
        x = decompositions.generic_direction(self.count, 0)
        value = 0.0
        # Each step gains at least a digit unless others lie close to it, and then any of them will do.
        for _ in range(12):
            found = solve(x)
            length = float(np.linalg.norm(found))
            if not np.isfinite(length) or length == 0.0:
                return 0.0, x
            value, x = 1.0 / length, found / length
        return value, x

    def _solved(self, y: Floats, shift: float) -> Floats:
        """x with (Gram matrix + shift) x = y."""
        if self.is_large and self._is_filled:
            return np.asarray(np.linalg.solve(np.array(self._shifted(shift)), y))
        return np.array(self._factors.solve(self._shifted(shift), ca.DM(y))).ravel()

    def _repeated_solver(self, shift: float) -> Callable[[Floats], Floats]:
        """y -> x with (Gram matrix + shift) x = y, for one y after another."""
        # Of few rows an inverse costs less than one sparse factorization.
        if self.count <= 40 or (self.is_large and self._is_filled):
            try:
                inverse = np.linalg.inv(np.array(self._shifted(shift)))
            except np.linalg.LinAlgError:  # singular to the last digit, in spite of the shift
                return lambda y: np.full(self.count, np.inf)
            return lambda y: np.asarray(inverse @ y)
        return lambda y: self._solved(y, shift)

    def _shifted(self, shift: float) -> ca.DM:
        return self._gram + shift * ca.DM.eye(self.count) if shift else self._gram

    def above(self, size: float) -> int:
        """The number of singular values above a size: by Sylvester's law of inertia, from sparse factors."""
        if self.count == 0:
            return 0
        if self._is_filled:
            return int((self._singular_values > size).sum())
        shifted = self._gram - size**2 * ca.DM.eye(self.count)
        factors = ca.Linsol("inertia", "ldl", shifted.sparsity())
        factors.sfact(shifted)
        factors.nfact(shifted)
        return self.count - int(factors.neig(shifted))

    @cached_property
    def _singular_values(self) -> Floats:
        return decompositions.singular_values(self.dense)

    @property
    def is_large(self) -> bool:
        """True if the rows are too many to be looked at densely."""
        return are_many(self.count, self.unit.shape[1])

    def correction(self, residual: Floats, damping: float = 0.0) -> Floats:
        """The smallest step (n,) in the metric that solves B step = -residual, by least squares if it must.

        Damped it is shorter: that which makes |B step + residual|^2 / damping + |step|^2 least, for rows of length one.
        """
        weights, rows = self.weights(residual, damping), self._entries
        # Summed in the order of CasADi's product, without its conversions, which cost several times the sum.
        return -self._metric.unwhitened(rows.combined(weights))

    def whole_correction(self, residual: Floats, least: float = 0.0) -> Floats:
        """The step of `correction` with the weakest rows too, but for those within `least` of dependent ones."""
        sizes, in_metric = self._length_factors
        step = np.linalg.lstsq(self.dense, residual / sizes / in_metric, rcond=least)[0]
        return -self._metric.unwhitened(np.asarray(step, dtype=float))

    def weights(self, residual: Floats, damping: float = 0.0) -> Floats:
        """The weights (C,) of the rows of length one in -M^1/2 step, for the step of `correction`."""
        # One by one: their product may be beyond the range of numbers.
        sizes, in_metric = self._length_factors
        scaled = residual / sizes / in_metric
        if not scaled.any():
            return scaled  # nothing to solve: an exact start asks for no step, and an empty system needs no solver
        if damping > 0:
            return self._solved(scaled, damping)
        if self.are_independent or self.is_large:
            return self._solved(scaled, 0.0 if self.are_independent else doubles.SUM)
        if self.count > self.unit.shape[1]:
            sigma, left = decompositions.column_axes(self.dense)
            fixed = left[:, sigma > doubles.ROOT * sigma.max(initial=0.0)]
            return np.asarray(fixed @ ((fixed.T @ scaled) / sigma[: fixed.shape[1]] ** 2))
        return decompositions.least_squares(np.array(self._gram), scaled)


def are_many(count: int, coordinates: int) -> bool:
    """True if so many rows over so many coordinates are too many to be looked at densely."""
    return count > PARAMETERS.dense and coordinates > PARAMETERS.dense


def stacked(*blocks: Sparse) -> Sparse:
    """Rows, and others below them."""
    return ca.vertcat(*blocks)


def of_dense(rows: Floats) -> Sparse:
    """Rows (C, n) that are given densely."""
    return ca.DM(rows)


def sparse(
    rows: npt.NDArray[np.intp], columns: npt.NDArray[np.intp], values: Floats, shape: tuple[int, int]
) -> Sparse:
    """A matrix of this shape with values (z,) at rows and columns (z,)."""
    return ca.DM.triplet(rows.tolist(), columns.tolist(), ca.DM(values), *shape)
