"""Rank of constraint rows by a gap in their singular values; no gap means undecided.

Rows are taken in the mass-weighted metric (B M^-1/2) and normalized, so that the answer depends neither on how
a row is scaled nor on units of mass.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lagcli.frozen import frozen
from lagcli.linear import metric_rows
from lagcli.linear.metric_rows import MetricRows

Floats = npt.NDArray[np.float64]


class RankParameters:
    """Singular values of rows of length one. The start is on the surface to rounding, 1e-16, and where rows
    are dependent on a surface but not beside it the rest they show is its square root.

    The tests are of `tests/unit/test_numbers_of_rows.py`.
    """

    __slots__ = ()

    large: float = 3e-6
    """Singular values above this count. `test_singular_values_count_or_are_rounding_with_a_gap` fails at 3e-7
    and 3e-5."""
    small: float = 1e-7
    """Singular values below this are rounding; between the two is undecided.
    `test_singular_values_count_or_are_rounding_with_a_gap` fails at 1e-8 and 1e-6."""
    weight: float = 1e-6
    """A row takes part in a dependence if its weight in the null vector is above this.
    `test_a_row_takes_part_in_a_dependence_with_six_digits` fails at 1e-7 and 1e-5."""


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


def estimate(rows: MetricRows) -> Rank:
    """Rank of C rows. It does not depend on the metric, so that the clearer of two metrics decides.

    The mass metric serves rows over lengths and angles; extreme ratios of masses blur it, and not the plain one. Where
    doubles show fewer independent rows than there are, more digits decide, if they are to be had.
    """
    found = _rank(rows)
    if found.low == rows.count:
        return found
    plain = _rank(rows.plain())
    found = plain if plain.low > found.low else found
    exact = rows.rank_in_digits
    if exact is None or exact < found.low:
        return found
    return Rank(exact, exact, found.dependences[exact - found.low :])


def _rank(rows: MetricRows) -> Rank:
    if rows.are_independent:
        return Rank(rows.count, rows.count, np.zeros((0, rows.count)))
    if rows.is_large:
        large = rows.above(PARAMETERS.large)
        dependences = rows.weakest[None] if large < rows.count else np.zeros((0, rows.count))
        return Rank(large, rows.above(PARAMETERS.small), dependences)
    if rows.count > metric_rows.PARAMETERS.most_dense:
        return _rank_of_many(rows)
    sigma = np.zeros(rows.count)
    # The left vectors are wanted whole; of the right ones there may be many more.
    wide = rows.dense.shape[1] >= rows.count
    left, found, _ = np.linalg.svd(rows.dense, full_matrices=not wide)
    sigma[: found.size] = found
    large, small = int((sigma > PARAMETERS.large).sum()), int((sigma > PARAMETERS.small).sum())
    if large == rows.count:
        return Rank(large, small, np.zeros((0, rows.count)))
    return Rank(large, small, left.T[large:])


def _rank_of_many(rows: MetricRows) -> Rank:
    """The rank of very many rows over few coordinates, with one vector of weights."""
    left, sigma, _ = np.linalg.svd(rows.dense, full_matrices=False)
    large = left[:, sigma > PARAMETERS.large]
    weights = np.random.default_rng(0).standard_normal(rows.count)
    weights -= large @ (large.T @ weights)
    return Rank(large.shape[1], int((sigma > PARAMETERS.small).sum()), weights[None])


def nearest_dependence(rows: MetricRows) -> tuple[float, Floats]:
    """The smallest singular value of rows, their distance from dependent ones, in the clearer of two metrics, and the
    combination (C,) of rows of length one that comes closest to zero."""
    found = []
    for each in (rows, rows.plain()):
        left, sigma, _ = np.linalg.svd(each.dense, full_matrices=False)
        found.append((float(sigma[-1]), left[:, -1]))
    return max(found, key=lambda one: one[0])


def is_near(rows: MetricRows) -> bool:
    """True if doubles alone do not tell that rows are independent."""
    if rows.are_independent or rows.is_large:
        return False
    return nearest_dependence(rows)[0] <= PARAMETERS.large


def null_basis(rows: Floats) -> Floats:
    """An orthonormal basis of the kernel of rows (C, n) of about length one, shape (n, n - rank)."""
    if rows.shape[0] == 0:
        return np.eye(rows.shape[1])
    _, sigma, Vt = np.linalg.svd(rows, full_matrices=True)
    return np.asarray(Vt[int((sigma > PARAMETERS.large).sum()) :].T)


def row_basis(rows: Floats) -> Floats:
    """An orthonormal basis (r, n) of what rows (C, n) of about length one span."""
    if rows.shape[0] == 0:
        return np.zeros((0, rows.shape[1]))
    _, sigma, Vt = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(Vt[: int((sigma > PARAMETERS.large).sum())])


def participants(null_vector: Floats) -> list[int]:
    """The rows that take part in a dependence."""
    weights = np.abs(null_vector)
    return [int(i) for i in np.flatnonzero(weights > PARAMETERS.weight * weights.max(initial=1.0))]
