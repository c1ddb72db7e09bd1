"""The linear complementarity problem of contacts, solved as the shortest vector that satisfies their inequalities.

0 <= Lambda and S Lambda - h >= 0, one of the two zero for each contact, with S = G~ G~^T: the conditions for the
shortest x with G~ x >= h, x = G~^T Lambda (the principle of Gauss). S is never formed, which would square digits away.
Of all Lambda that do where rows are dependent the shortest is given, as among equality rows (`compiled.selection`).

The shortest x with A x >= h is A^T mu, mu >= 0 that of the least squares of (A^T; h^T) mu against (0, ..., 0, 1)
(Lawson and Hanson, Solving Least Squares Problems, ch. 23). From the rows that it names x and mu are solved anew to
rounding, and checked: `scipy.optimize.nnls` has given wrong answers for dependent columns, which contacts have (scipy
issues 21630, 25389). Another order of the columns, and another method, give other proposals.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.linear import decompositions, rank


class ComplementarityParameters:
    """Rounding that decides about a contact. The tests are of `tests/unit/test_numbers_of_contacts.py`."""

    __slots__ = ()

    safe: float = 8.0
    """Roundings of a bound or of a speed after an impact that are none (`test_a_bound_may_be_eight_roundings_off`)."""
    none_left: float = 1e-8
    """A least squares distance, of rows of length one, below which no vector will do, as it would be 1e8 times as long
    as h (`test_no_vector_will_do_where_it_would_be_eight_digits_longer`)."""


PARAMETERS = ComplementarityParameters()


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
        x, mu = _on(A[closed], h[closed])
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


def _on(A: Floats, h: Floats) -> tuple[Floats, Floats]:
    """The shortest x with A x = h, and mu with x = A^T mu, of independent rows; with one step of refinement."""
    Q, R = decompositions.orthonormal(A.T)
    try:
        x, mu = np.zeros(A.shape[1]), np.zeros(h.size)
        for _ in range(2):
            part = np.linalg.solve(R.T, h - A @ x)
            x, mu = x + Q @ part, mu + np.linalg.solve(R, part)
    except np.linalg.LinAlgError as error:
        raise UndecidedRows("rows too near dependent ones") from error
    return x, mu


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


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Complementary:
    """x (m,) = G~^T Lambda; multipliers: Lambda (k,); slack: G~ x - h (k,), 0 where Lambda > 0; holds: the contacts
    with no slack to rounding; unique: Lambda_j is the same in all solutions."""

    x: Floats
    multipliers: Floats
    slack: Floats
    holds: Flags
    unique: Flags


def solve(rows: Floats, bounds: Floats, rounding: Floats | float = 0.0) -> Complementary:
    """0 <= Lambda, G~ G~^T Lambda - h >= 0, complementary; rows G~ (k, m), bounds h (k,) known to `rounding` (k,).

    Of all solutions that with the least sum of Lambda_i^2 |G~_i|^2; of a row of zeros Lambda is 0. Raises
    `ContradictoryRows` with the rows of which not all can hold, `UndecidedRows`.
    """
    count = bounds.size
    lengths = np.asarray(np.linalg.norm(rows, axis=1))
    if not (np.isfinite(lengths).all() and np.isfinite(bounds).all()):
        raise UndecidedRows("not finite")
    allowed = PARAMETERS.safe * np.broadcast_to(np.asarray(rounding, dtype=float), count)
    empty = lengths == 0
    against = np.flatnonzero(empty & (bounds > allowed))
    if against.size:
        raise ContradictoryRows((int(against[0]),))
    full = np.flatnonzero(~empty)
    scale = lengths[full]
    unit, h = rows[full] / scale[:, None], bounds[full] / scale
    try:
        found = shortest(unit, h)
    except ContradictoryRows as error:
        raise ContradictoryRows(tuple(int(full[row]) for row in error.rows)) from None
    left = np.where(found.mu > 0, 0.0, unit @ found.x - h)
    tight = left <= doubles.ZERO * (float(np.linalg.norm(found.x)) + np.abs(h)) + allowed[full] / scale
    share, same = shared(unit[tight], found.mu[tight])

    multipliers, slack = np.zeros(count), -bounds.astype(float)
    holds = empty & (bounds >= -allowed)
    unique = ~holds
    multipliers[full[tight]] = share / scale[tight]
    slack[full] = left * scale
    holds[full] = tight
    unique[full[tight]] = same
    return Complementary(found.x, multipliers, slack, holds, unique)


def shared(A: Floats, mu: Floats, pulling: int = 0) -> tuple[Floats, Flags]:
    """The shortest mu with the same A^T mu, of rows of length one A (k, m), >= 0 after the first `pulling`; and which
    entries are the same in all."""
    count = mu.size
    if not count or (count == 1 and A.any()):
        return mu, np.ones(count, dtype=bool)
    found = rank.space(A, is_whole=A.shape[1] < count)
    if found.low == count:
        return mu, np.ones(count, dtype=bool)
    free = found.exact_dependences.T
    if free.shape[1]:
        # The shortest mu + free z >= 0: that of a mu without a part in them, and then the shortest z that makes it push
        least = mu - free @ (free.T @ mu)
        lengths = np.linalg.norm(free, axis=1)
        rows = lengths > doubles.ZERO
        rows[:pulling] = False
        # Rounding must not make two shares that can only be zero contradict each other.
        bounds = -least[rows] - 16 * doubles.EPS * float(np.linalg.norm(mu))
        # Where one share alone is possible rounding may leave none: that of mu.
        with contextlib.suppress(ContradictoryRows, UndecidedRows):
            z = shortest(free[rows] / lengths[rows, None], bounds / lengths[rows]).x
            mu = least + free @ z
            mu[pulling:] = np.maximum(mu[pulling:], 0.0)
    # The shares that change along a direction of `free` (k, d) in which none that only pushes becomes negative. Of the
    # shares that are zero those are sought that can grow; the rest stays at zero.
    free = found.dependences.T
    free = free * (np.linalg.norm(free, axis=1) > doubles.ZERO)[:, None]
    positive = mu > doubles.ZERO * np.abs(mu).max(initial=0.0)
    positive[:pulling] = True
    for row in np.flatnonzero(~positive):
        if positive[row]:
            continue
        # A direction z with (free z)_row = 1 and (free z)_zero >= 0: none if some weights >= 0 of the rows at zero
        # sum to minus this row (Farkas).
        zero = np.flatnonzero(~positive)
        left = residual(free[zero].T, -free[row])
        if left is not None and np.linalg.norm(left) > rank.PARAMETERS.large:
            positive[zero] |= free[zero] @ -left > doubles.ZERO
    rest = free[~positive]
    if rest.shape[0]:
        free = free @ rank.null_basis(rest)
    return mu, ~np.asarray(positive & (np.linalg.norm(free, axis=1) > rank.PARAMETERS.large))
