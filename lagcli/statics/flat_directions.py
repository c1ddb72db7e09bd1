"""The directions along which curvatures vanish: the first derivatives that do not vanish there decide (D.25).

With N (n, k) the flat directions, q and lambda of a point beside the one in question follow from xi by

    F + B^T lambda = N rho,    c = 0,    N^T (q - q_0) = xi,    grad phi(xi) = -rho

(Lyapunov, Schmidt), and the type of the point is that of phi at 0 together with the curvatures across (the splitting
lemma of Gromoll and Meyer). On rays xi = s u these are power series of s; a coefficient is zero by the rounding of its
own terms. A degenerate point, found to a part of its digits, is moved to where the last derivative that should vanish
does.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from math import comb

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.equations.power_series import PowerSeries, UnderflowError, constant
from lagcli.linear import decompositions, rank
from lagcli.statics import power_signs
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import LENGTHS, RestEquations, Scales
from lagcli.statics.static_problem import StaticProblem


class FlatParameters:
    """Numbers of the series. The tests are of `tests/unit/test_numbers_of_statics.py`."""

    __slots__ = ()

    orders: int = 16
    """Powers of the function that are looked at, half of them first.
    `test_a_power_of_sixteen_decides_and_one_of_seventeen_does_not` fails at 15 and 160."""
    kept: float = 0.1
    """The part of a curvature that a third derivative may change on the way to the zero: beside a double zero it is
    a half. `test_a_curvature_beside_a_double_zero_is_none` fails at 0.01 and 1."""
    degree: int = 8
    """The powers of three flat directions or more of which all monomials are told apart, by as many rays.
    `test_an_eighth_power_of_four_is_told_and_a_tenth_is_not` fails at 4 and 12."""


PARAMETERS = FlatParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FlatVerdict:
    """The verdict of directions that may be flat on a function at a point, which is told to more digits.

    up, down: how many have a curvature, by its sign; flat: how many have none. Along some of these the function rises,
    or falls, is_strict: along all; order: of the derivatives that say so, or 0; is_odd: opposite directions differ.
    """

    point: EquilibriumPoint
    up: int
    down: int
    flat: int = 0
    rises: bool = False
    falls: bool = False
    is_strict: bool = False
    order: int = 0
    is_odd: bool = False


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Expansion:
    """rho (rays, k, orders) on rays u (rays, k), and what is rounding of it."""

    rays: Floats
    rho: Floats
    rounding: Floats

    @property
    def forms(self) -> tuple[Floats, Floats]:
        """The coefficients of s^1, s^2, ... of phi on each ray (rays, orders), and their roundings."""
        powers = np.arange(1, self.rho.shape[2] + 1)
        along = np.einsum("ij,ijk->ik", self.rays, self.rho)
        rounding = np.einsum("ij,ijk->ik", np.abs(self.rays), self.rounding)
        return -along / powers, rounding / powers

    def vanishes(self, below: int) -> bool:
        """True if the powers below this one of phi are rounding."""
        return bool((np.abs(self.rho[:, :, : below - 1]) <= self.rounding[:, :, : below - 1]).all())


class FlatEquations:
    """The equations about a point with `basis` (n, k), its flat directions, set apart; `along` (n, d): of a continuum,
    which stay as they are; is_exact: the point is known to rounding, and not moved."""

    is_exact = False

    def __init__(
        self, problem: StaticProblem, closed: tuple[int, ...], scales: Scales, basis: Floats, along: Floats
    ) -> None:
        self._problem, self._closed, self.scales = problem, list(closed), scales
        self.basis, self._all = basis, np.hstack([basis, along])
        self._acting = problem.acting(closed)

    def on(self, axis: Floats) -> FlatEquations:
        """The equations with one direction (k,) of the flat ones set apart, the others staying as they are."""
        others = self.basis @ rank.null_basis(axis[None])
        apart = [self.basis @ axis[:, None], np.hstack([others, self._all[:, self.basis.shape[1] :]])]
        return FlatEquations(self._problem, tuple(self._closed), self.scales, *apart)

    def settled(self, q: Floats, lam: Floats) -> tuple[Floats, Floats]:
        """q (n,) and lambda (C + K,) with the equations across satisfied; lambda is made anew, for Newton's steps leave
        rounding of the largest forces they met."""
        n, rest = q.size, RestEquations(self._problem, tuple(self._closed), self.scales)
        # What is below the rounding of lengths is zero, so that its powers, and lambda of them, are no underflow.
        least = doubles.EPS * self.scales.length
        q = np.where(np.abs(q) <= least, 0.0, q)
        balancing = rest.multipliers(q)
        lam = lam if balancing is None else rest.all_multipliers(balancing[0])
        for _ in range(2):
            residual, _, inverse = self._linear(q, lam)
            step = -inverse @ residual
            q, lam = q + step[:n], lam.copy()
            lam[self._acting] += step[n : n + len(self._acting)]
        return np.where(np.abs(q) <= least, 0.0, q), lam

    def _linear(self, q: Floats, lam: Floats) -> tuple[Floats, Floats, Floats]:
        """The residual, its gradient by (q, lambda, rho), and the inverse (unknowns, equations) of that."""
        values = self._problem.at(self._problem.t, q, lam)
        G, g = values.G[self._closed], values.g[self._closed]
        rows, slopes, N = values.rows(self._closed), np.vstack([values.dc, G]), self._all
        m, r, k = len(rows), len(slopes), N.shape[1]
        nothing = np.zeros((r + k, m + k))
        A = np.block([[values.K, rows.T, -N], [slopes, nothing[:r]], [N.T, nothing[r:]]])
        # Forces are measured by their terms: far from all sources they may be tiny, and still none is zero.
        terms = self._residual(np.concatenate([q, lam[self._acting]])[:, None], self._sizes(q, lam)[:, None])
        unit = 1.0 if terms is None else float(terms[1][: q.size].max(initial=0.0)) or 1.0
        if unit < doubles.TINY:
            raise UnderflowError
        across, down = np.ones(A.shape[1]), np.ones(A.shape[0])
        across[q.size :], down[: q.size] = unit, 1 / unit
        for _ in range(2):
            down /= decompositions.lengths(A * down[:, None] * across)
            across /= decompositions.lengths((A * down[:, None] * across).T)
        inverse = decompositions.pseudo_inverse(A * down[:, None] * across)
        # Entries of rounding are none: what is zero by structure would be divided by the unit of force.
        inverse[np.abs(inverse) <= doubles.SUM * np.abs(inverse).max()] = 0.0
        residual = np.concatenate([values.F + rows.T @ lam[self._acting], values.c, g, np.zeros(k)])
        return residual, A, np.asarray(across[:, None] * inverse * down)

    def expanded(self, q: Floats, lam: Floats, rays: Floats, orders: int) -> _Expansion | None:
        """The forces along the flat directions; None where an operation has no series."""
        _, gradient, inverse = self._linear(q, lam)
        if not np.isfinite(inverse).all():
            return None
        n, count, k = q.size, self._all.shape[1], rays.shape[1]
        first = np.concatenate([q, lam[self._acting]])
        known = first.size
        rho, terms = np.zeros((2, len(rays), count, orders))
        for ray, own, own_terms in zip(rays, rho, terms, strict=True):
            x, sizes = np.zeros((2, known, orders + 1))
            x[:, 0], sizes[:, 0] = first, self._sizes(q, lam)
            x[:n, 1] = self.basis @ ray  # the tangent: what is missing of it is solved for
            sizes[:n, 1] = np.abs(self.basis) @ np.abs(ray)
            for order in range(orders):
                found = self._residual(x[:, : order + 1], sizes[:, : order + 1])
                if found is None:
                    return None
                left, size = found
                solved, spread = -inverse @ left, np.abs(inverse) @ size
                if order:
                    x[:, order] += solved[:known]
                    spread += np.abs(inverse) @ (np.abs(gradient) @ np.abs(solved))
                    sizes[:, order] += np.abs(solved[:known]) + spread[:known]
                own[:, order], own_terms[:, order] = solved[known:], spread[known:]
        return _Expansion(rays, rho[:, :k], doubles.SUM * terms[:, :k])

    def _sizes(self, q: Floats, lam: Floats) -> Floats:
        """The sizes of the unknowns: of coordinates no less than that of things."""
        return np.concatenate([np.maximum(np.abs(q), self.scales.length), np.abs(lam[self._acting])])

    def _residual(self, x: Floats, sizes: Floats) -> tuple[Floats, Floats] | None:
        """The last coefficient of the equations where (q, lambda) are series (unknowns, orders), and the sizes of its
        terms; None where an operation has none."""
        problem, count = self._problem, x.shape[1]
        fixed = [constant(value, count) for value in (problem.t, *problem.p.tolist())]
        unknowns = [PowerSeries(*pair) for pair in zip(x, sizes, strict=True)]
        function = problem.balance_series(tuple(self._closed))
        found = function.at([unknowns, fixed], count, doubles.SUM)[0]
        if any(each.known < count for each in found):
            return None
        last = np.zeros((2, len(found) + self._all.shape[1]))
        last[:, : len(found)] = [[each.c[-1] for each in found], [each.size[-1] for each in found]]
        return last[0], last[1]


def judged(
    problem: StaticProblem,
    point: EquilibriumPoint,
    scales: Scales,
    directions: tuple[Floats, Floats],
    is_exact: bool = False,
) -> FlatVerdict:
    """The verdict of directions (n, k) that may be flat, beside those of a continuum (n, d); is_exact: the point is
    known to rounding, and not moved.

    As long as they do not vanish together to the same power the steepest is set aside: it has a curvature.
    """
    up = down = 0
    basis, along = directions
    try:
        while 0 < basis.shape[1] <= 4:
            equations = FlatEquations(problem, point.closed, scales, basis, along)
            equations.is_exact = is_exact
            q, lam = equations.settled(point.q, point.lam)
            # The second derivatives of phi on its axes, and their rounding
            k = basis.shape[1]
            H, nothing = np.zeros((k, k)), 0.0
            if (found := equations.expanded(q, lam, np.eye(k), 2)) is not None:
                H, nothing = -found.rho[:, :, 1], float(found.rounding[:, :, 1].max())
            curvatures, axes = np.linalg.eigh((H + H.T) / 2)
            steepest = int(np.argmax(np.abs(curvatures)))
            is_clear = bool(abs(curvatures[steepest]) > nothing)
            least, most = _changes(equations, (q, lam), axes[:, steepest]) if is_clear else (np.inf, np.inf)
            if most > PARAMETERS.kept:  # it may be none: higher powers are looked at before it is believed
                plain = FlatVerdict(point, up, down, k)
                verdict = _of_powers(equations, (q, lam), _rays(k), plain)
                if verdict is not None or least > PARAMETERS.kept:
                    return verdict or plain
            is_up = bool(curvatures[steepest] > 0)
            up, down = up + is_up, down + (not is_up)
            basis = basis @ np.delete(axes, steepest, axis=1)
    except UnderflowError:
        return FlatVerdict(point, 0, 0, directions[0].shape[1])
    return FlatVerdict(point, up, down, basis.shape[1])


def balanced(
    problem: StaticProblem, point: EquilibriumPoint, scales: Scales, basis: Floats
) -> tuple[Floats, Floats] | None:
    """q (n,) and lambda (C + K,) where forces along flat directions (n, k) are rounding of their terms, a step of
    Newton's away at the most; None at a zero by underflow, as where a function comes so close to its limit that doubles
    do not differ: such a point is none."""
    if not basis.size:
        return point.q, point.lam
    equations = FlatEquations(problem, point.closed, scales, basis, np.zeros((problem.n, 0)))
    rays = np.eye(basis.shape[1])
    try:
        q, lam = equations.settled(point.q, point.lam)
        found = equations.expanded(q, lam, rays, 2)
        if found is None or found.vanishes(2):
            return point.q, point.lam
        forces, slopes = found.rho[0, :, 0], found.rho[:, :, 1].T
        shift = -decompositions.least_squares(slopes, forces)
        if not np.linalg.norm(shift) <= scales.length:
            return None
        q, lam = equations.settled(q + basis @ shift, lam)
        found = equations.expanded(q, lam, rays, 2)
    except UnderflowError:
        return None
    return (q, lam) if found is not None and found.vanishes(2) else None


def _changes(equations: FlatEquations, begin: tuple[Floats, Floats], axis: Floats) -> tuple[float, float]:
    """The part of the curvature along a direction (k,) that the third derivative changes on the way to the zero
    (Kantorovich), and what it may be where the force is rounding: beside a degenerate point it is half or more."""
    found = equations.on(axis).expanded(*begin, np.ones((1, 1)), 3)
    if found is None:
        return 0.0, 0.0
    (force, curvature, change), nothing = (part[0] for part in found.forms)
    with np.errstate(divide="ignore"):
        share = 3 * (abs(change) + nothing[2]) / (2 * curvature**2)
    return max(0.0, abs(force) - nothing[0]) * share, (abs(force) + nothing[0]) * share


def _of_powers(
    equations: FlatEquations, begin: tuple[Floats, Floats], rays: Floats, verdict: FlatVerdict
) -> FlatVerdict | None:
    """The verdict of the powers beyond the second; None where that does not vanish, or none is seen."""
    known, few = None, rays[:: max(1, len(rays) // PARAMETERS.orders)]
    for orders in (PARAMETERS.orders // 2, PARAMETERS.orders):
        found = equations.expanded(*begin, few, orders)
        if found is None:
            break
        for other in itertools.chain([begin], _moved_along_axes(equations, begin, found)):
            known = _of_first_power(equations, other, rays, orders, verdict) or known
            if known is not None and known.order:
                return known
        forms, rounding = (part[:, 1] for part in found.forms)
        if known is None and (np.abs(forms) > rounding).any():
            break
    return known


def _of_first_power(
    equations: FlatEquations, begin: tuple[Floats, Floats], rays: Floats, orders: int, verdict: FlatVerdict
) -> FlatVerdict | None:
    """The verdict of the first power that does not vanish, and of those beyond it; None where there is no such one."""
    few = rays[:: max(1, len(rays) // PARAMETERS.orders)]
    found = equations.expanded(*begin, few, orders)
    if found is None:
        return None
    for power in range(orders, 2, -1):
        moved = _moved(equations, begin, found, power)
        if moved is not None:
            break
    else:
        return None
    q, lam, found = moved
    forms, rounding = (part[:, power - 1] for part in found.forms)
    known = dataclasses.replace(
        _at(verdict, q, lam), rises=bool((forms > rounding).any()), falls=bool((forms < -rounding).any())
    )
    if power % 2 or (known.rises and known.falls):
        return _of_signs(known, found, power)
    sizes, axes = decompositions.axes(found.rho[:, :, power - 1])
    # Where it lies along the last axis, this form does not tell.
    if sizes[-1] <= rank.PARAMETERS.large * sizes[0] and not equations.is_exact:
        settled = _moved_along(equations, (q, lam), axes[-1])
        if settled is None:
            return known
        q, lam = settled
    expanded = equations.expanded(q, lam, rays, orders)
    if expanded is None or not expanded.vanishes(power):
        return known
    return _of_signs(_at(verdict, q, lam), expanded, power)


def _at(verdict: FlatVerdict, q: Floats, lam: Floats) -> FlatVerdict:
    return dataclasses.replace(verdict, point=dataclasses.replace(verdict.point, q=q, lam=lam))


def _moved_along_axes(
    equations: FlatEquations, begin: tuple[Floats, Floats], found: _Expansion
) -> Iterator[tuple[Floats, Floats]]:
    """q and lambda moved along the axes of one form after another: a form that hardly depends on one of them, as x^4
    of x^4 + y^6, does not tell where that vanishes."""
    if equations.basis.shape[1] == 1 or equations.is_exact:
        return
    for power in range(3, found.rho.shape[2] + 1):
        axes, there = decompositions.axes(found.rho[:, :, power - 1])[1], begin
        for axis in (*axes, *axes):
            there = _moved_along(equations, there, axis) or there
        if there is not begin:
            yield there


def _moved_along(
    equations: FlatEquations, begin: tuple[Floats, Floats], axis: Floats
) -> tuple[Floats, Floats] | None:
    """q and lambda moved along one direction to where the powers of phi vanish on it; None where they do not."""
    own = equations.on(axis)
    found = own.expanded(*begin, np.ones((1, 1)), PARAMETERS.orders)
    if found is None:
        return None
    tried = (_moved(own, begin, found, power) for power in range(PARAMETERS.orders, 2, -1))
    return next((each[:2] for each in tried if each is not None), None)


def _moved(
    equations: FlatEquations, begin: tuple[Floats, Floats], found: _Expansion, power: int
) -> tuple[Floats, Floats, _Expansion] | None:
    """q and lambda where all powers of phi below one vanish and this one does not, with the powers there; or None."""
    (q, lam), n = begin, len(begin[0])
    size, last, way = equations.scales.length, np.inf, 0.0
    for _ in range(0 if equations.is_exact else 6):  # each doubles the digits
        forms, rounding = (part[:, power - 1] for part in found.forms)
        if (np.abs(forms) <= rounding).all():
            return None
        # With phi = P(xi - delta) the next lower form is -delta . grad P.
        lower = found.forms[0][:, power - 2]
        shift = decompositions.least_squares(found.rho[:, :, power - 1], lower)
        length = float(np.linalg.norm(shift))
        way += length
        if not way <= LENGTHS.near * size:
            return None
        if length >= last / 2 or length == 0.0:
            break
        q, lam = equations.settled(q + equations.basis @ shift, lam)
        expanded = equations.expanded(q, lam, found.rays, power)
        if expanded is None:
            return None
        found, last = expanded, length
    forms, rounding = (part[:, power - 1] for part in found.forms)
    if not found.vanishes(power) or (np.abs(forms) <= rounding).all():
        return None
    return q[:n], lam, found


def _rays(k: int) -> Floats:
    """Directions (rays, k) of length one, no two of them opposite."""
    if k == 1:
        return np.ones((1, 1))
    if k == 2:
        angles = np.pi * (np.arange(2 * PARAMETERS.orders) + 0.2871) / (2 * PARAMETERS.orders)
        return np.column_stack([np.cos(angles), np.sin(angles)])
    count = max(4 * PARAMETERS.orders, comb(PARAMETERS.degree + k - 1, k - 1))
    drawn = np.random.default_rng(3).standard_normal((count, k))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=1, keepdims=True))


def _of_signs(verdict: FlatVerdict, found: _Expansion, power: int) -> FlatVerdict:
    """The verdict of the first form that does not vanish, and of those beyond it."""
    above, below = power_signs.of_powers(found.rays, *found.forms, power)
    both = above | below
    is_strict = both.is_decided and both.rises != both.falls
    order = power if is_strict or (both.rises and both.falls) else 0
    is_odd = power % 2 == 1 or above != below
    return dataclasses.replace(
        verdict, rises=both.rises, falls=both.falls, is_strict=is_strict, order=order, is_odd=is_odd
    )
