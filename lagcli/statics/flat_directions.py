"""The directions along which curvatures vanish: the first derivatives that do not vanish there decide (D.25).

With N (n, k) the flat directions, q and lambda of a point beside the one in question follow from xi by

    F + B^T lambda = N rho,    c = 0,    N^T (q - q_0) = xi,    grad phi(xi) = -rho

(Lyapunov, Schmidt), and the type of the point is that of phi at 0 together with the curvatures across (the splitting
lemma of Gromoll and Meyer). On rays xi = s u these are power series of s; a coefficient is zero by the rounding of its
own terms. A degenerate point, found to a part of its digits, is moved to where the last derivative that should vanish
does. x (n + rows,) is q with the multipliers of the rows that act, as in `RestEquations`.
"""

from __future__ import annotations

import dataclasses
from math import comb

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.equations.power_series import UnderflowError
from lagcli.linear import decompositions, rank
from lagcli.statics import power_signs
from lagcli.statics.rest_equations import LENGTHS, EquilibriumPoint, RestEquations


class FlatParameters:
    """Numbers of the series. The tests are of `tests/unit/test_numbers_of_statics.py`."""

    __slots__ = ()

    orders: int = 16
    """Powers of the function that are looked at, half of them first; of three directions or more as many rays are drawn
    as tell all monomials of half of them apart.
    `test_a_power_of_sixteen_decides_and_one_of_seventeen_does_not` fails at 15 and 160."""
    kept: float = 0.1
    """The part of a curvature that a third derivative may change on the way to the zero: beside a double zero it is
    a half. `test_a_curvature_beside_a_double_zero_is_none` fails at 0.01 and 1."""


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
    """rho (rays, k, orders) on rays u (rays, k), and what is rounding of it; forms: the coefficients of s^1, s^2, ...
    of phi on each ray (rays, orders), and their roundings."""

    rays: Floats
    rho: Floats
    rounding: Floats
    forms: tuple[Floats, Floats]

    def vanishes(self, below: int) -> bool:
        """True if the powers below this one of phi are rounding."""
        return bool((np.abs(self.rho[:, :, : below - 1]) <= self.rounding[:, :, : below - 1]).all())


class FlatEquations:
    """The equations about a point with `basis` (n, k), its flat directions, set apart; `along` (n, d): of a continuum,
    which stay as they are; is_exact: the point is known to rounding, and not moved."""

    def __init__(
        self, equations: RestEquations, basis: Floats, along: Floats, is_exact: bool = False
    ) -> None:
        self.equations, self.basis, self.is_exact = equations, basis, is_exact
        self._all = np.hstack([basis, along])

    def on(self, axis: Floats) -> FlatEquations:
        """The equations with one direction (k,) of the flat ones set apart, the others staying as they are."""
        others = self.basis @ rank.null_basis(axis[None])
        along = np.hstack([others, self._all[:, self.basis.shape[1] :]])
        return FlatEquations(self.equations, self.basis @ axis[:, None], along)

    def settled(self, x: Floats, change: Floats | float = 0.0) -> Floats:
        """x, with q changed, where the equations across are satisfied; lambda anew: steps leave rounding of forces."""
        n = self.equations.problem.n
        # What is below the rounding of lengths is zero, so that its powers, and lambda of them, are no underflow.
        least = doubles.EPS * self.equations.scales.length
        q = x[:n] + change
        q = np.where(np.abs(q) <= least, 0.0, q)
        balancing = self.equations.multipliers(q)
        x = np.concatenate([q, x[n:] if balancing is None else balancing[0]])
        for _ in range(2):
            residual, _, inverse = self._linear(x)
            x = x - (inverse @ residual)[: x.size]
        return np.concatenate([np.where(np.abs(x[:n]) <= least, 0.0, x[:n]), x[n:]])

    def _linear(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """The residual, its gradient by (q, lambda, rho), and the inverse (unknowns, equations) of that."""
        equations, problem, N = self.equations, self.equations.problem, self._all
        q, lam = x[: problem.n], x[problem.n :]
        values = problem.at(problem.t, q, equations.all_multipliers(lam))
        rows, slopes = values.rows(equations.contacts), np.vstack([values.dc, values.G[equations.contacts]])
        m, r, k = len(rows), len(slopes), N.shape[1]
        nothing = np.zeros((r + k, m + k))
        A = np.block([[values.K, rows.T, -N], [slopes, nothing[:r]], [N.T, nothing[r:]]])
        # Forces are measured by their terms: far from all sources they may be tiny, and still none is zero.
        terms = self._last_terms(x[:, None], equations.sizes(x)[:, None])
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
        residual = [values.F + rows.T @ lam, values.c, values.g[equations.contacts], np.zeros(k)]
        return np.concatenate(residual), A, np.asarray(across[:, None] * inverse * down)

    def expanded(self, begin: Floats, rays: Floats, orders: int) -> _Expansion | None:
        """The forces along the flat directions; None where an operation has no series."""
        _, gradient, inverse = self._linear(begin)
        if not np.isfinite(inverse).all():
            return None
        n, known, k = self.equations.problem.n, begin.size, rays.shape[1]
        rho, terms = np.zeros((2, len(rays), self._all.shape[1], orders))
        for ray, own, own_terms in zip(rays, rho, terms, strict=True):
            x, sizes = np.zeros((2, known, orders + 1))
            x[:, 0], sizes[:, 0] = begin, self.equations.sizes(begin)
            x[:n, 1] = self.basis @ ray  # the tangent: what is missing of it is solved for
            sizes[:n, 1] = np.abs(self.basis) @ np.abs(ray)
            for order in range(orders):
                found = self._last_terms(x[:, : order + 1], sizes[:, : order + 1])
                if found is None:
                    return None
                left, size = found
                solved, spread = -inverse @ left, np.abs(inverse) @ size
                if order:
                    x[:, order] += solved[:known]
                    spread += np.abs(inverse) @ (np.abs(gradient) @ np.abs(solved))
                    sizes[:, order] += np.abs(solved[:known]) + spread[:known]
                own[:, order], own_terms[:, order] = solved[known:], spread[known:]
        rho, rounding, powers = rho[:, :k], doubles.SUM * terms[:, :k], np.arange(1, orders + 1)
        along = np.einsum("ij,ijk->ik", rays, rho)
        of_rounding = np.einsum("ij,ijk->ik", np.abs(rays), rounding)
        return _Expansion(rays, rho, rounding, (-along / powers, of_rounding / powers))

    def _last_terms(self, x: Floats, sizes: Floats) -> tuple[Floats, Floats] | None:
        """The last coefficient of the equations of series x (unknowns, orders), and the sizes of its terms; or None."""
        found = self.equations.series(x, sizes, doubles.SUM)
        if any(each.known < x.shape[1] for each in found):
            return None
        last = np.zeros((2, len(found) + self._all.shape[1]))
        last[:, : len(found)] = [[each.c[-1] for each in found], [each.size[-1] for each in found]]
        return last[0], last[1]


def judged(
    equations: RestEquations,
    point: EquilibriumPoint,
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
            flat = FlatEquations(equations, basis, along, is_exact)
            x = flat.settled(equations.of_point(point))
            # The second derivatives of phi on its axes, and their rounding
            k = basis.shape[1]
            H, nothing = np.zeros((k, k)), 0.0
            if (found := flat.expanded(x, np.eye(k), 2)) is not None:
                H, nothing = -found.rho[:, :, 1], float(found.rounding[:, :, 1].max())
            curvatures, axes = np.linalg.eigh((H + H.T) / 2)
            steepest = int(np.argmax(np.abs(curvatures)))
            least = most = np.inf
            if abs(curvatures[steepest]) > nothing:
                # The part of the curvature that the third derivative changes on the way to the zero (Kantorovich), and
                # what it may be where the force is rounding: beside a degenerate point it is half or more.
                least = most = 0.0
                if (found := flat.on(axes[:, steepest]).expanded(x, np.ones((1, 1)), 3)) is not None:
                    (force, curvature, change), rounding = (part[0] for part in found.forms)
                    with np.errstate(divide="ignore"):
                        share = 3 * (abs(change) + rounding[2]) / (2 * curvature**2)
                    least = max(0.0, abs(force) - rounding[0]) * share
                    most = (abs(force) + rounding[0]) * share
            if most > PARAMETERS.kept:  # it may be none: higher powers are looked at before it is believed
                plain = FlatVerdict(point, up, down, k)
                verdict = _of_powers(flat, x, plain)
                if verdict is not None or least > PARAMETERS.kept:
                    return verdict or plain
            is_up = bool(curvatures[steepest] > 0)
            up, down = up + is_up, down + (not is_up)
            basis = basis @ np.delete(axes, steepest, axis=1)
    except UnderflowError:
        return FlatVerdict(point, 0, 0, directions[0].shape[1])
    return FlatVerdict(point, up, down, basis.shape[1])


def balanced(equations: RestEquations, point: EquilibriumPoint, basis: Floats) -> EquilibriumPoint | None:
    """The point where forces along flat directions (n, k) are rounding of their terms, a Newton step away at most.
    None at a zero by underflow, as where a function comes so close to its limit that doubles do not differ."""
    if not basis.size:
        return point
    flat = FlatEquations(equations, basis, np.zeros((len(basis), 0)))
    rays = np.eye(basis.shape[1])
    try:
        x = flat.settled(equations.of_point(point))
        found = flat.expanded(x, rays, 2)
        if found is None or found.vanishes(2):
            return point
        forces, slopes = found.rho[0, :, 0], found.rho[:, :, 1].T
        shift = -decompositions.least_squares(slopes, forces)
        if not np.linalg.norm(shift) <= equations.scales.length:
            return None
        x = flat.settled(x, basis @ shift)
        found = flat.expanded(x, rays, 2)
    except UnderflowError:
        return None
    return equations.placed(point, x) if found is not None and found.vanishes(2) else None


def _of_powers(flat: FlatEquations, begin: Floats, verdict: FlatVerdict) -> FlatVerdict | None:
    """The verdict of the powers beyond the second; None where that does not vanish, or none is seen."""
    known, most, k = None, PARAMETERS.orders, flat.basis.shape[1]
    # Directions (rays, k) of length one, no two of them opposite
    if k == 1:
        rays = np.ones((1, 1))
    elif k == 2:
        angles = np.pi * (np.arange(2 * most) + 0.2871) / (2 * most)
        rays = np.column_stack([np.cos(angles), np.sin(angles)])
    else:
        count = max(4 * most, comb(most // 2 + k - 1, k - 1))
        rays = np.random.default_rng(3).standard_normal((count, k))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    few = rays[:: max(1, len(rays) // most)]
    for orders in (most // 2, most):
        found = flat.expanded(begin, few, orders)
        if found is None:
            break
        # At the point; then moved along the axes of one form after another: a form that hardly depends on one of them,
        # as x^4 of x^4 + y^6, does not tell where that vanishes.
        for power in (0, *(range(3, orders + 1) if k > 1 and not flat.is_exact else ())):
            x = begin
            if power:
                axes = decompositions.axes(found.rho[:, :, power - 1])[1]
                for axis in (*axes, *axes):
                    moved = _moved_along(flat, x, axis)
                    x = x if moved is None else moved
                if x is begin:
                    continue
            known = _of_first_power(flat, x, (few, rays), orders, verdict) or known
            if known is not None and known.order:
                return known
        forms, rounding = (part[:, 1] for part in found.forms)
        if known is None and (np.abs(forms) > rounding).any():
            break
    return known


def _of_first_power(
    flat: FlatEquations, x: Floats, rays: tuple[Floats, Floats], orders: int, verdict: FlatVerdict
) -> FlatVerdict | None:
    """The verdict of the first power that does not vanish, by few rays, and of those beyond, by all; or None."""
    found = flat.expanded(x, rays[0], orders)
    if found is None:
        return None
    for power in range(orders, 2, -1):
        moved = _moved(flat, x, found, power)
        if moved is not None:
            break
    else:
        return None
    x, found = moved
    forms, rounding = (part[:, power - 1] for part in found.forms)
    rises, falls = bool((forms > rounding).any()), bool((forms < -rounding).any())
    point = flat.equations.placed(verdict.point, x)
    if not (power % 2 or (rises and falls)):
        known = dataclasses.replace(verdict, point=point, rises=rises, falls=falls)
        sizes, axes = decompositions.axes(found.rho[:, :, power - 1])
        # Where it lies along the last axis, this form does not tell.
        if sizes[-1] <= rank.PARAMETERS.large * sizes[0] and not flat.is_exact:
            settled = _moved_along(flat, x, axes[-1])
            if settled is None:
                return known
            x = settled
        found = flat.expanded(x, rays[1], orders)
        if found is None or not found.vanishes(power):
            return known
        point = flat.equations.placed(verdict.point, x)
    above, below = power_signs.of_powers(found.rays, *found.forms, power)
    both = above | below
    is_strict = both.is_decided and both.rises != both.falls
    order = power if is_strict or (both.rises and both.falls) else 0
    is_odd = power % 2 == 1 or above != below
    return FlatVerdict(
        point, verdict.up, verdict.down, verdict.flat, both.rises, both.falls, is_strict, order, is_odd
    )


def _moved_along(flat: FlatEquations, x: Floats, axis: Floats) -> Floats | None:
    """x moved along one direction to where the powers of phi vanish on it; None where they do not."""
    own = flat.on(axis)
    found = own.expanded(x, np.ones((1, 1)), PARAMETERS.orders)
    if found is None:
        return None
    tried = (_moved(own, x, found, power) for power in range(PARAMETERS.orders, 2, -1))
    return next((each[0] for each in tried if each is not None), None)


def _moved(flat: FlatEquations, x: Floats, found: _Expansion, power: int) -> tuple[Floats, _Expansion] | None:
    """x where all powers of phi below one vanish and this one does not, with the powers there; or None."""
    last, way = np.inf, 0.0
    for _ in range(0 if flat.is_exact else 6):  # each doubles the digits
        forms, rounding = (part[:, power - 1] for part in found.forms)
        if (np.abs(forms) <= rounding).all():
            return None
        # With phi = P(xi - delta) the next lower form is -delta . grad P.
        shift = decompositions.least_squares(found.rho[:, :, power - 1], found.forms[0][:, power - 2])
        length = float(np.linalg.norm(shift))
        way += length
        if not way <= LENGTHS.near * flat.equations.scales.length:
            return None
        if length >= last / 2 or length == 0.0:
            break
        x = flat.settled(x, flat.basis @ shift)
        expanded = flat.expanded(x, found.rays, power)
        if expanded is None:
            return None
        found, last = expanded, length
    forms, rounding = (part[:, power - 1] for part in found.forms)
    if not found.vanishes(power) or (np.abs(forms) <= rounding).all():
        return None
    return x, found
