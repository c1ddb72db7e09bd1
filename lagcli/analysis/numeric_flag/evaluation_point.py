"""The rows of a block at one point: their size, their ranks, which are independent, and the brackets of two fields."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import program, row_block
from lagcli.compiled.row_block import RowBlock
from lagcli.expression import term_sizes
from lagcli.linear import decompositions, independent_rows, metric_rows, rank
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import MetricRows
from lagcli.linear.rank import Rank
from lagcli.start import initial

# A value that vanishes on the orbit is less than this many times its size and how far the point is off.
OFF = 100.0
# Of random fields: the same in every run.
SEED = 20062


class EvaluationPoint:
    """The rows at one point x (N,): scaled, their ranks, which of them are independent of those before, and their
    brackets of two random fields.

    error: how far the point may lie off the orbit of the start, in parts of the way to it.
    """

    def __init__(self, block: RowBlock, x: Floats, p: Floats, error: float = 0.0) -> None:
        self.block, self.x, self.p, self.error = block, x, p, error
        A, _ = block.rows(x, p)
        self.is_finite = bool(np.isfinite(A.nonzeros()).all())
        if self.is_finite:
            # Differential rows that are rounding alone are zero: beside the point they are far larger, or their terms.
            s, row = len(block.holonomic), np.asarray(A.sparsity().row(), dtype=np.intp)
            direction = np.random.default_rng(SEED + 2).standard_normal(x.size)
            neighbour, _ = block.rows(x + doubles.ROOT * initial.size(x) * direction, p)
            values, others = (np.array(one.nonzeros(), dtype=float) for one in (A, neighbour))
            others = np.where(np.isfinite(others), others, values)
            largest, change = np.zeros(A.size1()), np.zeros(A.size1())
            np.maximum.at(largest, row, np.abs(values))
            np.maximum.at(change, row, np.abs(others - values) / doubles.ROOT)
            is_nothing = (largest > 0) & (largest <= doubles.SUM * change)
            if not metric_rows.are_many(*A.shape):
                terms = term_sizes.of(program.written_out(block.rows), [x, p])[: values.size]
                is_rounding = np.isfinite(terms) & (np.abs(values) <= doubles.SUM * terms)
                is_nothing |= (largest > 0) & (np.bincount(row[~is_rounding], minlength=largest.size) == 0)
            nothing = s + np.flatnonzero(is_nothing[s:])
            if nothing.size:
                A = A[:, :]  # a copy
                A[nothing.tolist(), :] = 0.0
            self.sizes = row_block.variable_sizes(A, block.kinds)
            self.plain, self.A = A, row_block.scaled(A, self.sizes)
            self.rows = MetricRows(self.A, Metric.unit(block.size), self.rank)

    def rank(self, rows: MetricRows, numbers: Sequence[int]) -> int | None:
        """The rank of rows with these numbers where the usual limits, of points that may lie on a singular surface,
        leave it open; None where it is not known better. Rows that are known to rounding count from a hundred of it."""
        holonomic = [k for k, i in enumerate(numbers) if i < len(self.block.holonomic)]
        if len(holonomic) == rows.count or not rows.take(holonomic).are_independent:
            return None
        sigma = decompositions.singular_values(rows.dense)
        if not ((sigma > doubles.VALUE) & (sigma <= rank.PARAMETERS.large)).any():
            return None
        # The part of a row of length one, at most, that is rounding of its terms, or what the point is off the orbit
        terms = term_sizes.of(program.written_out(self.block.rows), [self.x, self.p])[: self.plain.nnz()]
        entries = metric_rows.LocalRows(row_block.scaled(self.plain, self.sizes))
        scaled = terms * self.sizes[entries.column] / entries.divisors[entries.row]
        nothing = max(doubles.VALUE, doubles.SUM * float(scaled.max(initial=0.0)), OFF * self.error)
        sure = OFF * nothing
        if ((sigma > nothing) & (sigma <= sure)).any() or not np.isfinite(nothing):
            return None
        return int((sigma > sure).sum())

    @cached_property
    def all(self) -> Rank:
        """The rank of all rows."""
        return rank.estimate(self.rows)

    @cached_property
    def surface(self) -> Rank:
        """The rank of the holonomic rows."""
        return rank.estimate(self.rows.take(list(range(len(self.block.holonomic)))))

    @cached_property
    def still(self) -> Rank:
        """The rank of all rows without time."""
        n = len(self.block.columns)
        if not self.block.has_time:
            return self.all
        return rank.estimate(MetricRows(self.A[:, :n], Metric.unit(n), self.rank))

    @cached_property
    def independent(self) -> list[int]:
        """Rows that do not depend on rows before them."""
        return np.flatnonzero(~independent_rows.redundant(self.rows)).tolist()

    @property
    def dimension(self) -> int:
        """The dimension of the kernel D."""
        return self.block.size - self.all.low

    @property
    def differential(self) -> list[int]:
        """The differential ones of them, numbered from the first differential row."""
        s = len(self.block.holonomic)
        return [i - s for i in self.independent if i >= s]

    @property
    def ranks(self) -> tuple[int, int]:
        """The ranks of the holonomic rows and of all."""
        return self.surface.low, self.all.low

    def _in_kernel(self, u: Floats) -> Floats:
        """The field of D at this point nearest to u (N,), both in scaled coordinates."""
        is_plain = self.rows.is_large or self.rows.are_independent
        spanned = None if is_plain else rank.space(self.rows.dense, is_whole=False).right[: self.all.low]
        for _ in range(2):
            if spanned is None:
                u = u + self.rows.correction(np.array(self.A @ u).ravel())
            else:
                u = u - spanned.T @ (spanned @ u)
        return u

    @cached_property
    def least(self) -> float:
        """The smallest singular value that counts, of rows of length one; 1 of many rows."""
        if self.rows.is_large or not self.all.low:
            return 1.0
        return float(decompositions.singular_values(self.rows.dense)[self.all.low - 1])

    @property
    def first(self) -> int:
        """The rank of these brackets, the certain part of it."""
        return int((self.turning > max(doubles.ROOT, OFF * self.error)).sum())

    @cached_property
    def turning(self) -> Floats:
        """Singular values of the brackets on the independent rows, relative to the size of what they are made of."""
        differential = self.differential
        if not differential or self.dimension < 2:
            return np.zeros(0)
        random = np.random.default_rng(SEED)
        free = random.standard_normal((2 * len(differential) + 2, self.block.size))
        projected = np.array([self._in_kernel(u) for u in free]) * self.sizes
        pairs = [(a, b) for i, a in enumerate(projected) for b in projected[:i]]
        brackets = np.array([np.array(self.block.curl(self.x, self.p, *pair)).ravel() for pair in pairs])
        values, size = brackets.T[differential], self.terms[differential]
        with np.errstate(invalid="ignore"):  # looked for in the next line
            values = values / np.where(size > 0, size, 1.0)[:, None]
        if not np.isfinite(values).all():
            return np.zeros(0)
        return decompositions.singular_values(values) / math.sqrt(values.shape[1])

    @cached_property
    def terms(self) -> Floats:
        """The sizes (m,) of what d omega_i of fields of this size is made of, for the differential rows."""
        curl, random = program.written_out(self.block.curl), np.random.default_rng(SEED)
        fields = random.standard_normal((3, 2, self.block.size)) * self.sizes
        sizes = [term_sizes.of(curl, [self.x, self.p, Y, Z]) for Y, Z in fields]
        return np.asarray(np.max(sizes, axis=0))
