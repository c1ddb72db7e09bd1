"""The kind of a point of rest: the bordered Hessian, restricted to the directions the rows leave (D.25).

A contact that touches and carries nothing holds nothing, but one may not pass it. The sign of u^T H u on the cone of
what is left decides (strict copositivity), and not the eigenvalues of H: on x >= 0, y >= 0 nothing is less than
x y + x^2 + y^2 - 3 x y / 2 at 0.

Where gradients depend on each other many multipliers balance a point. To first order a function falls along no allowed
direction, B d = 0 and G d >= 0, where there are multipliers of contacts >= 0 (Farkas), and rises along none where there
are some <= 0. Of second order it falls along d where the curvature of the Lagrangian does for all such multipliers, if
these are bounded; it is a minimum where it rises for one of them along all d (Ben-Tal, J. Optim. Theory Appl. 31 (1980)
143).
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator
from typing import Literal

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.contact import complementarity
from lagcli.linear import decompositions, rank
from lagcli.statics import flat_directions, precise_zeros, refine, rest_equations
from lagcli.statics.flat_directions import FlatVerdict
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import RestEquations, Scales
from lagcli.statics.static_problem import StaticProblem

Kind = Literal["minimum", "maximum", "saddle", "isolated", "degenerate"]
# All sets of so many contacts that carry nothing are gone through.
MOST_WEAK = 8


@dataclasses.dataclass(frozen=True, slots=True)
class PointType:
    """kind and index (negative directions) are None without a potential, or where the rank of the equality rows is
    undecided; unique: whether lambda is, None where the rank does not say; rank: of the equality rows; freedom: what
    these leave; is_regular: all curvatures are known and none vanishes, so that no other point is near."""

    kind: Kind | None
    index: int | None
    unique: bool | None
    rank: int
    freedom: int
    is_regular: bool = False


def classify(
    problem: StaticProblem,
    point: EquilibriumPoint,
    scales: Scales,
    has_potential: bool,
    along: Floats | None = None,
    is_exact: bool = False,
) -> tuple[PointType, EquilibriumPoint]:
    """The type of a point, and the point: one where curvatures vanish is told to more digits.

    along (n, d): the directions of a continuum, across which the type is told; is_exact: the point is known to
    rounding, and is not moved. Contacts that carry a force count as rows: one that pushes is a wall of a minimum, one
    that pulls of a maximum. Those that touch and carry nothing leave a cone of directions.
    """
    values = problem.at(problem.t, point.q, point.lam)
    B, G = decompositions.unit(values.B), decompositions.unit(values.G[list(point.closed)])
    equalities, rows = rank.space(B, is_whole=False), rank.space(np.vstack([B, G]), is_whole=False)
    freedom = problem.n - equalities.low
    is_unique = None if rows.value is None else rows.value == len(rows.left)
    plain = PointType(None, None, is_unique, equalities.low, freedom)
    if not has_potential or equalities.value is None:
        return plain, point
    if freedom == 0:
        return dataclasses.replace(plain, kind="isolated", index=0, is_regular=True), point
    along = np.zeros((problem.n, 0)) if along is None else along
    shared = _of_one_sign(problem, point, scales)
    held, walls = shared.point, (shared.pushes, shared.pulls)
    values, carry = problem.at(problem.t, held.q, held.lam), carrying(problem, held, scales)
    Z = rank.null_basis(np.vstack([B, decompositions.unit(values.G[list(carry)]), along.T]))
    if (decided := _of_many_multipliers(problem, shared, scales, Z)) is not None:
        is_alone = decided[0] == "isolated" and not along.size
        return dataclasses.replace(plain, kind=decided[0], index=decided[1], is_regular=is_alone), point
    # Rows and columns of H are measured by what they hold: signs stay, units go.
    H = np.asarray(-Z.T @ values.K @ Z)
    units, widest = np.ones(len(H)), float(np.abs(H).max(initial=0.0))
    if widest > 0:
        units = np.sqrt(np.maximum(np.abs(H).max(axis=1), 1e-6 * widest))
        H = H / units[:, None] / units[None, :]
    largest = float(np.abs(H).max(initial=0.0))
    if not decompositions.is_symmetric(H):
        return plain, point
    curvatures, axes = np.linalg.eigh((H + H.T) / 2)
    idle = [k for k in refine.touching(problem, point, scales) if k not in carry]
    if shared.are_many:  # contacts that may not be passed: the others follow from those that carry
        parts = np.abs(decompositions.unit(values.G[idle]) @ Z).max(axis=1, initial=0.0)
        idle = [k for k, part in zip(idle, parts.tolist(), strict=True) if part > rank.PARAMETERS.small]
    ways = Z @ (axes / units[:, None])
    ways /= np.linalg.norm(ways, axis=0)
    slopes = np.abs(np.einsum("ij,ik,kj->j", ways, values.K, ways))
    floor = scales.force / scales.length
    is_doubtful = np.abs(curvatures) <= rest_equations.SETTLED * largest
    terms = rest_equations.SETTLED * float(np.abs(values.K).max())
    is_doubtful |= slopes <= max(terms, rest_equations.SMALL * floor)
    bare = dataclasses.replace(held, closed=carry)
    is_known = np.abs(curvatures) > rest_equations.FLAT * largest
    signs = (np.sign(curvatures) * is_known * (slopes.max(initial=0.0) > doubles.ZERO * floor))[is_doubtful]
    verdict, is_whole = _of_doubtful(problem, bare, scales, (ways[:, is_doubtful], along), signs, is_exact)
    away = np.abs(verdict.point.q - point.q) / np.maximum(np.abs(point.q), scales.length)
    if is_exact and (away > 10 * doubles.VALUE).any():  # derivatives vanish at another point
        verdict = _of_signs(bare, signs)
    if idle and verdict.is_odd:  # along one of two opposite directions a contact is in the way
        verdict = dataclasses.replace(verdict, rises=False, falls=False)
    sure = curvatures[:0] if is_whole else curvatures[~is_doubtful]
    up, down = int((sure > 0).sum()) + verdict.up, int((sure < 0).sum()) + verdict.down
    weak = decompositions.unit(values.G[idle]) @ Z / units
    if len(idle) < 2 or not np.isfinite(weak).all():  # one may be left along a direction or against it
        is_strict = verdict.is_strict or not verdict.flat
        kind = _kind(up > 0 or verdict.rises, down > 0 or verdict.falls, is_strict, *walls)
        index = down + (verdict.flat if verdict.is_strict and verdict.falls else 0)
    else:
        kind, index = _kind_on_cone((H + H.T) / 2, weak, (up, down), walls)
    found = dataclasses.replace(plain, kind=kind, index=index, is_regular=not (verdict.flat or along.size))
    lam = point.lam if shared.are_many else verdict.point.lam
    return found, dataclasses.replace(verdict.point, closed=point.closed, lam=lam)


def _of_doubtful(
    problem: StaticProblem,
    point: EquilibriumPoint,
    scales: Scales,
    directions: tuple[Floats, Floats],
    signs: Floats,
    is_exact: bool,
) -> tuple[FlatVerdict, bool]:
    """The verdict on directions (n, k) whose curvatures may vanish, beside those of a continuum (n, d), and whether
    it is one on all directions: by many digits, by higher derivatives where rows are of positions alone, nothing
    depends on t and the model is not large, or else by the signs (k,) of the curvatures."""
    doubtful, along = directions
    if doubtful.shape[1]:
        x = np.concatenate([point.q, point.lam[problem.acting(point.closed)]])
        found = precise_zeros.signs(RestEquations(problem, point.closed, scales), x)
        if found is not None and found[2] == along.shape[1]:
            return FlatVerdict(point, *found[:2]), True
        is_small = not problem.is_large and len(problem.times) == 1
        if is_small and is_holonomic(problem, point):
            basis = decompositions.orthonormal(doubtful)[0]
            return flat_directions.judged(problem, point, scales, (basis, along), is_exact), False
    return _of_signs(point, signs), False


def _of_signs(point: EquilibriumPoint, signs: Floats) -> FlatVerdict:
    """The verdict that the signs (k,) of curvatures give."""
    up, down = int((signs > 0).sum()), int((signs < 0).sum())
    return FlatVerdict(point, up, down, len(signs) - up - down)


def is_holonomic(problem: StaticProblem, point: EquilibriumPoint) -> bool:
    """True if what the rows leave is what the conditions leave."""
    values = problem.at(problem.t, point.q, point.lam)
    return unit_rank(np.vstack([values.B, values.dc])) == unit_rank(values.dc)


def unit_rank(rows: Floats) -> int:
    """The rank of rows, each measured by its length."""
    return rank.space(decompositions.unit(rows), is_whole=False).low


def _kind(rises: bool, falls: bool, is_strict: bool, pushes: bool, pulls: bool) -> Kind:
    rises, falls = rises or pushes, falls or pulls
    if rises and falls:
        return "saddle"
    if not is_strict or not (rises or falls):
        return "degenerate"
    return "minimum" if rises else "maximum"


def _kind_on_cone(
    H: Floats, weak: Floats, counts: tuple[int, int], walls: tuple[bool, bool]
) -> tuple[Kind, int]:
    """The kind and the index where only directions u with weak u >= 0 are allowed; counts: the positive and negative
    curvatures of H, which decide where contacts are too many to be gone through."""
    (up, down), flat = counts, rest_equations.FLAT * float(np.abs(H).max(initial=0.0))
    if len(weak) > MOST_WEAK:
        is_definite = len(H) in counts
        return _kind(up > 0, down > 0, True, *walls) if is_definite else "degenerate", down
    found = extremes(H, weak)
    if found is None:
        return _kind(False, False, True, *walls) if any(walls) else "isolated", 0
    least, greatest = found
    rises, falls = greatest > flat, least < -flat
    return _kind(rises, falls, least > flat or greatest < -flat, *walls), down if falls else 0


def extremes(H: Floats, G: Floats) -> tuple[float, float] | None:
    """The least and the greatest u^T H u of all u of length one with G u >= 0, None where only u = 0 is left: at
    eigenvectors of H (d, d) on the faces of the cone, on which some of the rows G (k, d), which are few, are zero."""
    lengths, small = np.linalg.norm(G, axis=1), rank.PARAMETERS.small
    rows = G[lengths > small] / lengths[lengths > small, None]
    found: list[float] = []
    for size in range(len(rows) + 1):
        for on in itertools.combinations(range(len(rows)), size):
            face = rank.null_basis(rows[list(on)])
            if not face.shape[1]:
                continue
            values, vectors = np.linalg.eigh(face.T @ H @ face)
            above = rows @ (face @ vectors)
            inside = (above >= -small).all(axis=0) | (above <= small).all(axis=0)
            found += values[inside].tolist()
    return (min(found), max(found)) if found else None


# Multipliers, where those of contacts are not the only ones


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _SharedMultipliers:
    """The point with multipliers of which those of contacts have one sign, if there are such; pushes, pulls: whether
    the function rises, and falls, along an allowed direction to first order; are_many: other multipliers balance it
    too, and those of `point` are a choice; are_told: not where numbers leave it open whether there are some."""

    point: EquilibriumPoint
    pushes: bool
    pulls: bool
    are_many: bool = False
    are_told: bool = True


def carrying(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> tuple[int, ...]:
    """The closed contacts that carry a force, by their numbers."""
    signs = _signs(problem, point, scales)
    return tuple(k for k, sign in zip(point.closed, signs.tolist(), strict=True) if sign)


def _signs(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> Floats:
    """The signs of the forces of the closed contacts, 0 of what is rounding."""
    push = point.lam[[problem.C + k for k in point.closed]] * scales.contacts[list(point.closed)]
    return np.asarray(np.sign(push) * (np.abs(push) > _no_force(problem, point, scales)))


def _no_force(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> float:
    F = problem.at(problem.t, point.q, point.lam).F
    return doubles.ZERO * max(scales.force, float(np.abs(F).max(initial=0.0)))


def _of_one_sign(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> _SharedMultipliers:
    """The multipliers of one sign at a point."""
    own = _signs(problem, point, scales)
    plain = _SharedMultipliers(point, bool((own > 0).any()), bool((own < 0).any()))
    touching = refine.touching(problem, point, scales)
    values = problem.at(problem.t, point.q, point.lam)
    rows = values.rows(touching)
    unit, lengths = decompositions.unit(rows), decompositions.lengths(rows)
    if not own.any() or rank.space(unit, is_whole=False).low == len(rows):
        return plain
    limit = _no_force(problem, point, scales)
    balanced: dict[int, Floats] = {}
    for sign in (1, -1):
        columns = np.vstack([unit[: problem.C], -unit[: problem.C], sign * unit[problem.C :]]).T
        weights = complementarity.weights(columns, -values.F)
        if weights is None:
            return dataclasses.replace(plain, are_told=False)
        if np.abs(values.F + columns @ weights).max() <= limit:
            of_rows = weights[: problem.C] - weights[problem.C : 2 * problem.C]
            balanced[sign] = np.concatenate([of_rows, sign * weights[2 * problem.C :]]) / lengths
    if not balanced:
        return _SharedMultipliers(point, True, True)
    lam = problem.whole(touching, balanced[1 if 1 in balanced else -1])
    chosen = dataclasses.replace(point, lam=lam, closed=touching)
    return _SharedMultipliers(chosen, -1 not in balanced, 1 not in balanced, are_many=True)


def _of_many_multipliers(
    problem: StaticProblem, shared: _SharedMultipliers, scales: Scales, Z: Floats
) -> tuple[Kind, int] | None:
    """The kind and the index along directions Z (n, d) where curvatures are not the same for all multipliers; None
    where one choice of them gives these."""
    if not shared.are_told:
        return "degenerate", 0
    if not Z.shape[1]:
        return None if shared.pushes or shared.pulls else ("isolated", 0)
    if not shared.are_many:
        return None
    point, limit = shared.point, _no_force(problem, shared.point, scales)

    def curvature(lam: Floats) -> Floats:
        H = -Z.T @ problem.at(problem.t, point.q, lam).K @ Z
        return np.asarray((H + H.T) / 2)

    def turns(curvatures: list[Floats], limit: float) -> int:
        """The number of directions, among the axes of curvatures (d, d), along which all of these are negative."""
        if not curvatures:
            return 0
        axes = np.hstack([np.linalg.eigh(H)[1] for H in curvatures])
        most = np.max([np.einsum("ij,ik,kj->j", axes, H, axes) for H in curvatures], axis=0)
        return min(int((most < -limit).sum()), len(axes))

    own = curvature(point.lam)
    values = problem.at(problem.t, point.q, point.lam)
    rows = values.rows(point.closed)
    unit = decompositions.unit(rows)
    dependences = rank.space(unit).dependences / decompositions.lengths(rows)
    nothing = doubles.ZERO * max(float(np.abs(own).max()), scales.force / scales.length)
    added = (problem.whole(point.closed, lam) for lam in dependences)
    bent = [curvature(point.lam + lam * np.abs(values.F).max()) - own for lam in added]
    if all(np.abs(each).max() <= nothing for each in bent):
        return None
    known: dict[int, list[Floats]] = {1: [], -1: []}
    for sign, is_met in ((1, not shared.pulls), (-1, not shared.pushes)):
        if is_met and len(point.closed) <= MOST_WEAK:
            known[sign] = [sign * curvature(lam) for lam in _vertices(problem, point, sign, limit)]
        if any(np.linalg.eigvalsh(H)[0] > nothing for H in known[sign]):
            kind = _kind(sign > 0, sign < 0, True, shared.pushes, shared.pulls)
            return kind, 0 if sign > 0 else Z.shape[1]
    # They are unbounded where weights >= 0 of contacts, with any of the equality rows, sum to nothing.
    columns = np.vstack([unit[: problem.C], -unit[: problem.C], unit[problem.C :]]).T
    of_contacts = np.concatenate([np.zeros(2 * problem.C), np.ones(len(rows) - problem.C)])
    target = np.append(np.zeros(len(columns)), 1.0)
    left = complementarity.residual(np.vstack([columns, of_contacts]), target)
    if left is None or float(np.linalg.norm(left)) <= doubles.ZERO:
        return _kind(False, False, False, shared.pushes, shared.pulls), 0
    falling = turns(known[1], nothing)
    rises, falls = shared.pushes or turns(known[-1], nothing) > 0, shared.pulls or falling > 0
    return _kind(rises, falls, rises and falls, shared.pushes, shared.pulls), falling


def _vertices(problem: StaticProblem, point: EquilibriumPoint, sign: int, limit: float) -> Iterator[Floats]:
    """The corners of the multipliers of which those of contacts have a sign: of independent gradients."""
    values, C = problem.at(problem.t, point.q, point.lam), problem.C
    for size in range(len(point.closed) + 1):
        for held in itertools.combinations(point.closed, size):
            rows = values.rows(held)
            own = rank.space(decompositions.unit(rows), is_whole=False)
            if own.low < C + size:
                continue
            lam = own.weights(-values.F) / decompositions.lengths(rows)
            is_met = np.abs(values.F + rows.T @ lam).max() <= limit
            if is_met and (sign * lam[C:] * decompositions.lengths(rows)[C:] >= -limit).all():
                yield problem.whole(held, lam)
