"""The shortest vector that satisfies linear inequalities (Lawson and Hanson, Solving Least Squares Problems, ch. 23).

The shortest x with A x >= h is A^T mu, mu >= 0 that of the least squares of (A^T; h^T) mu against (0, ..., 0, 1). From
the rows that it names x and mu are solved anew to rounding, and checked: `scipy.optimize.nnls` has given wrong answers
for dependent columns, which contacts have (scipy issues 21630, 25389). Another order of the columns, and another
method, give other proposals.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.linear import decompositions


class LeastDistanceParameters:
    """Shortest vectors under inequalities. The tests are of `tests/unit/test_numbers_of_contacts.py`."""

    __slots__ = ()

    none_left: float = 1e-8
    """A least squares distance, of rows of length one, below which no vector will do, as it would be 1e8 times as long
    as h (`test_no_vector_will_do_where_it_would_be_eight_digits_longer`)."""


PARAMETERS = LeastDistanceParameters()


class ContradictoryRows(ValueError):
    """Inequalities that no vector satisfies: a sum of the `rows`, with weights > 0, says 0 >= something positive."""

    def __init__(self, rows: tuple[int, ...]) -> None:
        super().__init__(f"rows {', '.join(map(str, rows))} contradict each other")
        self.rows = rows


class UndecidedRows(ArithmeticError):
    """Numbers that do not decide which of the inequalities hold: they are not finite, or too near dependent ones."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Shortest:
    """x (m,) = A^T mu, mu (k,) >= 0; A x >= h, with equality where mu > 0."""

    x: Floats
    mu: Floats


def shortest(A: Floats, h: Floats) -> Shortest:
    """The shortest x with A x >= h, of rows of length one A (k, m). Raises `ContradictoryRows`, `UndecidedRows`."""
    if not (np.isfinite(A).all() and np.isfinite(h).all()):
        raise UndecidedRows("not finite")
    largest = float(h.max(initial=0.0))
    if not largest > 0:
        return Shortest(np.zeros(A.shape[1]), np.zeros(h.size))
    if h.size == 1:
        return Shortest(A[0] * h[0], h.copy())
    count, n = A.shape
    factor = A.T if n <= count else decompositions.triangle(A.T)
    target = np.zeros(min(n, count) + 1)
    target[-1] = 1.0
    cause = None
    for weights in proposals(np.vstack([factor, h / largest]), target):
        if float(np.hypot(np.linalg.norm(weights @ A), weights @ h / largest - 1)) <= PARAMETERS.none_left:
            raise ContradictoryRows(tuple(np.flatnonzero(weights > doubles.ZERO * weights.max()).tolist()))
        try:
            return _settled(A, h, np.flatnonzero(weights > 0).tolist())
        except UndecidedRows as error:
            cause = error
    raise UndecidedRows("rows too near dependent ones") from cause


def _settled(A: Floats, h: Floats, closed: list[int]) -> Shortest:
    """x and mu of the rows that hold, solved to rounding; a row that rounding has put on the wrong side changes it."""
    for _ in range(2 * h.size + 10):
        # The shortest x with A x = h of those rows, x = A^T mu; with one step of refinement
        own, x, mu = A[closed], np.zeros(A.shape[1]), np.zeros(len(closed))
        Q, R = decompositions.orthonormal(own.T)
        try:
            for _ in range(2):
                part = np.linalg.solve(R.T, h[closed] - own @ x)
                x, mu = x + Q @ part, mu + np.linalg.solve(R, part)
        except np.linalg.LinAlgError as error:
            raise UndecidedRows("rows too near dependent ones") from error
        allowed = doubles.ZERO * (float(np.linalg.norm(x)) + np.abs(h))
        if mu.size and mu.min() < 0:
            del closed[int(np.argmin(mu))]
            continue
        short = A @ x - h + allowed
        short[closed] = 0.0
        if short.min() >= 0:
            whole = np.zeros(h.size)
            whole[closed] = mu
            return Shortest(x, whole)
        closed = sorted([*closed, int(np.argmin(short))])
    raise UndecidedRows("rows too near dependent ones")


def proposals(columns: Floats, target: Floats) -> Iterator[Floats]:
    """Weights w (k,) >= 0 that may be those of the least |columns w - target|, columns (m, k); each may be wrong."""
    from scipy import optimize

    most = 30 * columns.shape[1] + 100
    for order in (slice(None), slice(None, None, -1)):
        try:
            yield np.asarray(optimize.nnls(columns[:, order], target, maxiter=most)[0])[order]
        except RuntimeError:
            continue
    try:
        found = optimize.lsq_linear(columns, target, (0, np.inf), method="bvls", tol=doubles.EPS)
    except np.linalg.LinAlgError:
        return
    yield np.where(found.active_mask == 0, found.x, 0.0)


def weights(columns: Floats, target: Floats) -> Floats | None:
    """Weights w (k,) >= 0 of the least |target - columns w|, columns (m, k), proved by its conditions; None where no
    proposal meets them."""
    size = float(np.linalg.norm(target))
    for proposed in proposals(columns, target):
        gradient = columns.T @ (target - columns @ proposed)
        least = doubles.ZERO * size
        if (gradient <= least).all() and abs(float(proposed @ gradient)) <= least * size:
            return proposed
    return None


def residual(columns: Floats, target: Floats) -> Floats | None:
    """target - columns w (m,) for these weights."""
    least = weights(columns, target)
    return None if least is None else np.asarray(target - columns @ least)
