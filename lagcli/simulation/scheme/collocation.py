"""A step by Gauss collocation on the constraints: y' at the nodes is that of states projected on them.

The polynomial u of degree s with u' = y' at s nodes of Gauss (Hairer, Norsett, Wanner, Solving ODEs I, sec. II.7),
found by fixed-point iteration. Only the nodes are evaluated, and no node of an even number lies in the middle:
there the constraints may be singular, as long as the motion is smooth.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.polynomial import legendre

from lagcli import doubles, memory
from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction
from lagcli.linear import decompositions


class CollocationParameters:
    """The iteration for a step of Gauss, and when it has converged; parts are of no unit. The tests are of
    `tests/unit/test_numbers_of_schemes.py`."""

    __slots__ = ()

    most_iterations: int = 80
    """One that contracts by a half reaches rounding in 50. `test_an_iteration_is_given_up_after_eighty`."""
    part: float = 1e-3
    """It has converged where states change by this part, or by rounding.
    `test_an_iteration_ends_at_a_thousandth_of_the_tolerance`."""
    stalled: float = 1e-11
    """Where it contracts no more, states may change by this part.
    `test_an_iteration_that_stalls_ends_at_eleven_digits`."""
    depth: int = 10
    """Differences of iterates that are mixed, each a row of a problem. `test_ten_differences_of_iterates_are_mixed`."""


PARAMETERS = CollocationParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Step:
    """A step from t to t + h: y (2n + 1,) at its begin, y' at the nodes (s, 2n + 1); end: states[-1] projected."""

    t: float
    h: float
    y: Floats
    slopes: Floats

    def state(self, x: float) -> Floats:
        """u at the fraction x of the step."""
        return self.y + self.h * (_weights(len(self.slopes), x) @ self.slopes)

    def slope(self, x: float) -> Floats:
        """u' there."""
        values = legendre.legvander(np.array([2 * x - 1]), len(self.slopes) - 1)[0]
        return np.asarray((_terms(len(self.slopes)) @ values) @ self.slopes)


def rising(t: float, y: Floats, h: float, slope: Floats) -> Step:
    """A first guess of a step: one slope (2n + 1,) all along."""
    return Step(t, h, y, slope[None])


def improved(project: BoundFunction, guess: Step, h: float, count: int, rtol: float) -> Step | None:
    """The step from the begin of another, of length h with `count` nodes; None where the iteration does not converge or
    a state cannot be projected. project: `NumericSystem.project` on arrays (t, y, p)."""
    t, y = guess.t, guess.y
    nodes, A = gauss(count)
    slopes = np.array([guess.slope(x * h / guess.h) for x in nodes])
    converged = max(doubles.EPS, PARAMETERS.part * rtol)
    sizes = _sizes(project, t, y)
    before = np.inf
    states = y + h * (A @ slopes)
    mixing = _Mixing(sizes)
    for _ in range(PARAMETERS.most_iterations):
        for i, x in enumerate(nodes):
            rate = projected(project, t + x * h, states[i])
            if rate is None:
                return None
            slopes[i] = rate
        new = y + h * (A @ slopes)
        change = float((np.abs(new - states) / sizes).max())
        if change <= converged or (change > 0.5 * before and before <= PARAMETERS.stalled):
            return Step(t, h, y, slopes)
        before = min(change, before)
        states = mixing.next(states, new)
    return None


class _Mixing:
    """Anderson's acceleration of a fixed-point iteration x -> g(x): the combination of the last iterates whose change
    g(x) - x is least, mixed of their g(x) (Anderson, J. ACM 12 (1965) 547). Close to dependent rows the projection
    turns an error of a state into one of its slope as large as 1/h: the plain iteration then contracts slowly or not at
    all, whatever the length of the step."""

    def __init__(self, sizes: Floats) -> None:
        self._sizes = sizes
        self._values: list[Floats] = []
        self._changes: list[Floats] = []

    def next(self, x: Floats, g: Floats) -> Floats:
        """The next x after one with g(x)."""
        self._values, self._changes = (
            [*self._values[-PARAMETERS.depth :], (g / self._sizes).ravel()],
            [*self._changes[-PARAMETERS.depth :], ((g - x) / self._sizes).ravel()],
        )
        if len(self._values) == 1:
            return g
        changes, values = np.array(self._changes), np.array(self._values)
        differences = np.diff(changes, axis=0).T
        with np.errstate(over="ignore"):  # states that fly off are no solution, and are found out as such
            lengths = np.linalg.norm(differences, axis=0)
        lengths[lengths == 0] = 1.0
        weights = decompositions.least_squares(differences / lengths, changes[-1]) / lengths
        mixed = np.asarray(values[-1] - weights @ np.diff(values, axis=0)).reshape(g.shape)
        return np.asarray(mixed * self._sizes)


def _sizes(project: BoundFunction, t: float, y: Floats) -> Floats:
    """Sizes (2n + 1,) by which changes of y are judged: those of positions, of velocities and of an energy."""
    _trigger(project, t, y)
    # At a singular start no velocity is projected.
    n = y.size // 2
    packed = np.nan_to_num(project.results[3])
    packed[n : n + 2] = [np.abs(part / packed[:n]).max(initial=0.0) for part in (y[:n], y[n : 2 * n])]
    return sizes_of(packed)


def sizes_of(packed: Floats) -> Floats:
    """The sizes (2n + 1,) from `parts.Sizes.packed` (n + 3,)."""
    units, (q, v, a) = packed[:-3], packed[-3:].tolist()
    # What is at rest begins to move.
    speed = v or math.sqrt(q * a)
    return np.concatenate([(q or 1.0) * units, (speed or 1.0) * units, [speed**2 or 1.0]])


def projected(project: BoundFunction, t: float, y: Floats) -> Floats | None:
    """y' where a state lands on the constraints, or None where it does not."""
    _trigger(project, t, y)
    status = project.results[2]
    if not np.isfinite(status[-1]) or not status[0] <= doubles.ZERO:
        return None
    return project.results[1]


def _trigger(project: BoundFunction, t: float, y: Floats) -> None:
    at, state = project.arguments[:2]
    at[0], state[:] = t, y
    project.trigger()
    project.used += 1


@memory.remembered()
def gauss(count: int) -> tuple[Floats, Floats]:
    """Nodes (s,) in (0, 1), and A (s, s): integrals of the Lagrange polynomials up to the nodes."""
    nodes = (legendre.leggauss(count)[0] + 1) / 2
    return nodes, np.array([_weights(count, x) for x in nodes])


@memory.remembered(4096)
def _weights(count: int, x: float) -> Floats:
    """Integrals from 0 to x of the Lagrange polynomials of the nodes, (s,)."""
    return np.asarray(legendre.legval(2 * x - 1, _integrals(count)) / 2)


@memory.remembered()
def _integrals(count: int) -> Floats:
    """Integrals from -1 of the Lagrange polynomials of the nodes, in those of Legendre, (s + 1, s)."""
    return np.asarray(legendre.legint(_terms(count).T, lbnd=-1))


@memory.remembered()
def _terms(count: int) -> Floats:
    """Lagrange polynomials of the nodes, (s,), in those of Legendre on (-1, 1): l_j = sum_k (k + 1/2) w_j P_k(x_j)
    P_k."""
    nodes, weights = legendre.leggauss(count)
    return np.asarray(legendre.legvander(nodes, count - 1) * weights[:, None] * (np.arange(count) + 0.5))
