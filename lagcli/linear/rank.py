"""Rank of constraint rows by a gap in their singular values; no gap means undecided. Rows are taken in the mass metric
(B M^-1/2) and normalized: scales of rows and units of mass do not matter."""

from __future__ import annotations

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.frozen import frozen
from lagcli.linear import decompositions, metric_rows
from lagcli.linear.metric_rows import MetricRows


class RankParameters:
    """Singular values of rows of length one. The start is on the surface to rounding, 1e-16, and where rows are
    dependent on a surface but not beside it the rest they show is its square root. The tests are of
    `tests/unit/test_numbers_of_rows.py`."""

    __slots__ = ()

    large: float = 3e-6
    """Singular values above this count. `test_singular_values_count_or_are_rounding_with_a_gap`."""
    small: float = 1e-7
    """Singular values below this are rounding; between the two is undecided.
    `test_singular_values_count_or_are_rounding_with_a_gap`."""


PARAMETERS = RankParameters()


@frozen
class Rank:
    """The rank lies between `low` and `high`; `dependences` are the left null vectors beyond `low` (d, C).

    Of rows too many to be looked at densely it is one vector, in which all that depend on others take part.
    """

    low: int
    high: int
    dependences: Floats

    @property
    def value(self) -> int | None:
        """The rank, or None where no gap separates the singular values."""
        return self.low if self.low == self.high else None


class RowSpace:
    """What rows A (C, n) of about length one span: the rank is between `low` and `high`, and `low` of them are taken.

    left (C, k), sigma (min(C, n),), right (k', n): singular vectors and values, k = C and k' = n where they are whole.
    value: the rank, or None where no gap separates the singular values.
    basis (low, n), kernel (n, n - low): orthonormal bases of what the rows span and, where `right` is whole, of what
    they leave. combinations (low, C), dependences (C - low, C): orthonormal combinations of rows that are independent
    and, where `left` is whole, that vanish.
    """

    def __init__(self, left: Floats, sigma: Floats, right: Floats) -> None:
        self.left, self.sigma, self.right = left, sigma, right
        low, self.high = (
            int(np.count_nonzero(sigma > size)) for size in (PARAMETERS.large, PARAMETERS.small)
        )
        self.low, self.value = low, low if low == self.high else None
        self.basis, self.kernel = right[:low], right[low:].T
        self.combinations, self.dependences = left[:, :low].T, left[:, low:].T

    @property
    def exact_dependences(self) -> Floats:
        """Those (d, C) of the dependences that vanish to rounding."""
        return self.left[:, int(np.count_nonzero(self.sigma > doubles.VALUE)) :].T

    def step(self, b: Floats) -> Floats:
        """The shortest x (n,) or (n, k) with A x = b (C,) or (C, k), by least squares if it must."""
        found = (self.combinations @ b).T / self.sigma[: self.low]
        return np.asarray(self.basis.T @ found.T)

    def weights(self, u: Floats) -> Floats:
        """The shortest w (C,) with A^T w = u (n,), by least squares if it must."""
        return np.asarray((self.basis @ u / self.sigma[: self.low]) @ self.combinations)

    def weights_of_step(self, b: Floats) -> Floats:
        """The weights (C,) of `step`, x = A^T w."""
        return np.asarray((self.combinations @ b / self.sigma[: self.low] ** 2) @ self.combinations)


def space(rows: Floats, is_whole: bool = True) -> RowSpace:
    """What rows (C, n) of about length one span; is_whole: with what they leave, and what vanishes of them."""
    return RowSpace(*np.linalg.svd(rows, full_matrices=is_whole))


def multipliers(rows: Floats, force: Floats, lengths: Floats) -> Floats:
    """lambda (C,) with rows^T lambda = force and the least sum of (lambda_i length_i)^2; 0 of rows of no length.

    rows (C, n), force (n,), lengths (C,) in the metric in which the sum is least.
    """
    divisors = np.where(lengths > 0, lengths, np.inf)
    return np.asarray(space(rows / divisors[:, None], is_whole=False).weights(force) / divisors)


def pseudo_inverse(rows: Floats) -> Floats:
    """The inverse (..., n, m) of Moore and Penrose of rows (..., m, n), each measured by its largest singular value."""
    return np.asarray(np.linalg.pinv(rows, rcond=PARAMETERS.large), dtype=float)


def estimate(rows: MetricRows) -> Rank:
    """Rank of C rows, by the clearer of two metrics: extreme ratios of masses blur the mass metric, and not the plain
    one. Where doubles show fewer independent rows than there are, more digits decide, if they are to be had."""
    found = _rank(rows)
    if found.low == rows.count:
        return found
    plain = _rank(rows.plain())
    found = plain if plain.low > found.low else found
    exact = rows.rank_in_digits
    if exact is None or exact < found.low:
        return found
    if rows.is_large:
        return Rank(exact, exact, found.dependences[: int(exact < rows.count)])
    return Rank(exact, exact, found.dependences[exact - found.low :])


def _rank(rows: MetricRows) -> Rank:
    if rows.are_independent:
        return Rank(rows.count, rows.count, np.zeros((0, rows.count)))
    if rows.is_large:
        large = rows.above(PARAMETERS.large)
        dependences = rows.weakest[1][None] if large < rows.count else np.zeros((0, rows.count))
        return Rank(large, rows.above(PARAMETERS.small), dependences)
    if rows.count > metric_rows.PARAMETERS.most_dense:  # with one vector of weights
        thin = space(rows.dense, is_whole=False)
        weights = np.random.default_rng(0).standard_normal(rows.count)
        weights -= thin.combinations.T @ (thin.combinations @ weights)
        return Rank(thin.low, thin.high, weights[None])
    # The left vectors are wanted whole; of the right ones there may be many more.
    found = space(rows.dense, is_whole=rows.dense.shape[1] < rows.count)
    return Rank(found.low, found.high, found.dependences)


def nearest_dependence(rows: MetricRows) -> tuple[float, Floats]:
    """The smallest singular value of rows, their distance from dependent ones, in the clearer of two metrics, and the
    combination (C,) of rows of length one that comes closest to zero."""
    found = []
    for each in (rows, rows.plain()):
        sizes, left = decompositions.column_axes(each.dense)
        found.append((float(sizes[-1]), left[:, -1]))
    return max(found, key=lambda one: one[0])


def is_near(rows: MetricRows) -> bool:
    """True if doubles alone do not tell that rows are independent."""
    if rows.are_independent or rows.is_large:
        return False
    return nearest_dependence(rows)[0] <= PARAMETERS.large


def null_basis(rows: Floats) -> Floats:
    """An orthonormal basis of the kernel of rows (C, n) of about length one, shape (n, n - rank)."""
    return space(rows).kernel


def row_basis(rows: Floats) -> Floats:
    """An orthonormal basis (r, n) of what rows (C, n) of about length one span."""
    return space(rows, is_whole=False).basis


def participants(null_vector: Floats) -> list[int]:
    """The rows that take part in a dependence."""
    weights = np.abs(null_vector)
    return [int(i) for i in np.flatnonzero(weights > doubles.ROOT * weights.max(initial=1.0))]
