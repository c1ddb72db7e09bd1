"""The kind of a point of rest: the bordered Hessian, restricted to the directions the rows leave (D.25).

A contact that touches and carries nothing holds nothing, but one may not pass it: the sign of u^T H u on the cone of
what is left decides (strict copositivity), and not eigenvalues: on x >= 0, y >= 0 nothing is less than x y + x^2 + y^2
at 0.

Where gradients depend on each other many multipliers balance a point. To first order a function falls along no allowed
direction, B d = 0 and G d >= 0, where there are multipliers of contacts >= 0 (Farkas), and rises along none where some
are <= 0. It falls along d where the curvature does for all such multipliers, if these are bounded; it is a minimum
where it rises for one of them along all d (Ben-Tal, J. Optim. Theory Appl. 31 (1980) 143).
"""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.contact import complementarity
from lagcli.linear import decompositions, rank
from lagcli.statics import flat_directions, precise_zeros, rest_equations, static_problem
from lagcli.statics.flat_directions import FlatVerdict
from lagcli.statics.rest_equations import EquilibriumPoint, RestEquations

Kind = Literal["minimum", "maximum", "saddle", "isolated", "degenerate"]
# All sets of so many contacts that carry nothing are gone through.
MOST_WEAK = 8


@dataclasses.dataclass(frozen=True, slots=True)
class PointType:
    """kind and index (negative directions) are None without a potential, or where the rank of the equality rows is
    undecided; unique: whether lambda is, None where the rank does not say; is_regular: all curvatures are known and
    none vanishes, so that no other point is near."""

    kind: Kind | None
    index: int | None
    unique: bool | None
    is_regular: bool = False


def classify(
    equations: RestEquations,
    point: EquilibriumPoint,
    has_potential: bool,
    along: Floats | None = None,
    is_exact: bool = False,
) -> tuple[PointType, EquilibriumPoint]:
    """The type of a point, and the point: one where curvatures vanish is told to more digits.

    along (n, d): the directions of a continuum, across which the type is told; is_exact: the point is known to
    rounding, and is not moved. Contacts that carry a force count as rows: one that pushes is a wall of a minimum, one
    that pulls of a maximum. Those that touch and carry nothing leave a cone of directions.
    """
    problem, scales = equations.problem, equations.scales
    values = problem.at(problem.t, point.q, point.lam)
    B, G = decompositions.unit(values.B), decompositions.unit(values.G[list(point.closed)])
    equalities, rows = rank.space(B, is_whole=False), rank.space(np.vstack([B, G]), is_whole=False)
    is_unique = None if rows.value is None else rows.value == len(rows.left)
    plain = PointType(None, None, is_unique)
    if not has_potential or equalities.value is None:
        return plain, point
    if equalities.low == problem.n:
        return dataclasses.replace(plain, kind="isolated", index=0, is_regular=True), point
    along = np.zeros((problem.n, 0)) if along is None else along
    shared = _of_one_sign(equations, point)
    held, walls = shared.point, (shared.pushes, shared.pulls)
    values, carry = problem.at(problem.t, held.q, held.lam), carrying(equations, held)
    Z = rank.null_basis(np.vstack([B, decompositions.unit(values.G[list(carry)]), along.T]))
    if (decided := _of_many_multipliers(equations, shared, Z)) is not None:
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
    idle = [k for k in equations.touching(point) if k not in carry]
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
    is_known = np.abs(curvatures) > rest_equations.FLAT * largest
    signs = (np.sign(curvatures) * is_known * (slopes.max(initial=0.0) > doubles.ZERO * floor))[is_doubtful]
    bare = dataclasses.replace(held, closed=carry)
    verdict, is_whole = _of_doubtful(
        equations.closing(carry), bare, (ways[:, is_doubtful], along), signs, is_exact
    )
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
        kind, index = kind_on_cone((H + H.T) / 2, weak, (up, down), walls)
    found = dataclasses.replace(plain, kind=kind, index=index, is_regular=not (verdict.flat or along.size))
    lam = point.lam if shared.are_many else verdict.point.lam
    return found, dataclasses.replace(verdict.point, closed=point.closed, lam=lam)


def _of_doubtful(
    equations: RestEquations,
    point: EquilibriumPoint,
    directions: tuple[Floats, Floats],
    signs: Floats,
    is_exact: bool,
) -> tuple[FlatVerdict, bool]:
    """The verdict on directions (n, k) whose curvatures may vanish, beside those of a continuum (n, d), and whether
    it is one on all directions: by many digits, by higher derivatives where rows are of positions alone, nothing
    depends on t and the model is not large, or else by the signs (k,) of the curvatures."""
    problem, (doubtful, along) = equations.problem, directions
    up, down = int((signs > 0).sum()), int((signs < 0).sum())
    plain = FlatVerdict(point, up, down, len(signs) - up - down)
    if not doubtful.shape[1]:
        return plain, False
    found = precise_zeros.signs(equations, equations.of_point(point))
    if found is not None and found[2] == along.shape[1]:
        return FlatVerdict(point, *found[:2]), True
    if problem.is_large or len(problem.times) > 1 or not is_holonomic(equations, point):
        return plain, False
    basis = decompositions.orthonormal(doubtful)[0]
    verdict = flat_directions.judged(equations, point, (basis, along), is_exact)
    away = np.abs(verdict.point.q - point.q) / np.maximum(np.abs(point.q), equations.scales.length)
    if is_exact and (away > 10 * doubles.VALUE).any():  # derivatives vanish at another point
        return plain, False
    return verdict, False


def is_holonomic(equations: RestEquations, point: EquilibriumPoint) -> bool:
    """True if what the rows leave is what the conditions leave."""
    values = equations.problem.at(equations.problem.t, point.q, point.lam)
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


def kind_on_cone(
    H: Floats, weak: Floats, counts: tuple[int, int], walls: tuple[bool, bool]
) -> tuple[Kind, int]:
    """The kind and the index where only directions u with weak u >= 0 are allowed, H (d, d), weak (k, d); counts: the
    positive and negative curvatures of H, which decide where contacts are too many to be gone through.

    The least and the greatest u^T H u of all u of length one are at eigenvectors of H on the faces of the cone.
    """
    (up, down), flat = counts, rest_equations.FLAT * float(np.abs(H).max(initial=0.0))
    if len(weak) > MOST_WEAK:
        return _kind(up > 0, down > 0, True, *walls) if len(H) in counts else "degenerate", down
    lengths, small = np.linalg.norm(weak, axis=1), rank.PARAMETERS.small
    rows = weak[lengths > small] / lengths[lengths > small, None]
    found: list[float] = []
    for on in static_problem.subsets(range(len(rows))):
        face = rank.null_basis(rows[list(on)])
        if face.shape[1]:
            values, vectors = np.linalg.eigh(face.T @ H @ face)
            above = rows @ (face @ vectors)
            inside = (above >= -small).all(axis=0) | (above <= small).all(axis=0)
            found += values[inside].tolist()
    if not found:
        return _kind(False, False, True, *walls) if any(walls) else "isolated", 0
    rises, falls = max(found) > flat, min(found) < -flat
    return _kind(rises, falls, min(found) > flat or max(found) < -flat, *walls), down if falls else 0


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


def carrying(equations: RestEquations, point: EquilibriumPoint) -> tuple[int, ...]:
    """The closed contacts that carry a force, by their numbers."""
    signs, _ = _forces(equations, point)
    return tuple(k for k, sign in zip(point.closed, signs.tolist(), strict=True) if sign)


def _forces(equations: RestEquations, point: EquilibriumPoint) -> tuple[Floats, float]:
    """The signs of the forces of the closed contacts, 0 of what is rounding, and the force up to which they are it."""
    problem, scales = equations.problem, equations.scales
    F = problem.at(problem.t, point.q, point.lam).F
    limit = doubles.ZERO * max(scales.force, float(np.abs(F).max(initial=0.0)))
    push = point.lam[[problem.C + k for k in point.closed]] * scales.contacts[list(point.closed)]
    return np.asarray(np.sign(push) * (np.abs(push) > limit)), limit


def _of_one_sign(equations: RestEquations, point: EquilibriumPoint) -> _SharedMultipliers:
    """The multipliers of one sign at a point."""
    problem, touching = equations.problem, equations.touching(point)
    own, limit = _forces(equations, point)
    plain = _SharedMultipliers(point, bool((own > 0).any()), bool((own < 0).any()))
    values = problem.at(problem.t, point.q, point.lam)
    rows = values.rows(touching)
    unit, lengths = decompositions.unit(rows), decompositions.lengths(rows)
    if not own.any() or rank.space(unit, is_whole=False).low == len(rows):
        return plain
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
    equations: RestEquations, shared: _SharedMultipliers, Z: Floats
) -> tuple[Kind, int] | None:
    """The kind and index along Z (n, d) where curvatures differ by the choice of multipliers, else None."""
    if not shared.are_told:
        return "degenerate", 0
    if not Z.shape[1]:
        return None if shared.pushes or shared.pulls else ("isolated", 0)
    if not shared.are_many:
        return None
    problem, scales, point, C = equations.problem, equations.scales, shared.point, equations.problem.C

    def curvature(lam: Floats) -> Floats:
        H = -Z.T @ problem.at(problem.t, point.q, lam).K @ Z
        return np.asarray((H + H.T) / 2)

    own, values = curvature(point.lam), problem.at(problem.t, point.q, point.lam)
    rows = values.rows(point.closed)
    unit = decompositions.unit(rows)
    dependences = rank.space(unit).dependences / decompositions.lengths(rows)
    nothing = doubles.ZERO * max(float(np.abs(own).max()), scales.force / scales.length)
    added = (problem.whole(point.closed, lam) for lam in dependences)
    bent = [curvature(point.lam + lam * np.abs(values.F).max()) - own for lam in added]
    if all(np.abs(each).max() <= nothing for each in bent):
        return None
    # The curvatures for the corners of the multipliers of which those of contacts have a sign: of independent gradients
    known: dict[int, list[Floats]] = {1: [], -1: []}
    limit = _forces(equations, point)[1]
    for sign, is_met in ((1, not shared.pulls), (-1, not shared.pushes)):
        is_asked = is_met and len(point.closed) <= MOST_WEAK
        for held in static_problem.subsets(point.closed) if is_asked else ():
            corner = values.rows(held)
            space, lengths = (
                rank.space(decompositions.unit(corner), is_whole=False),
                decompositions.lengths(corner),
            )
            if space.low < len(corner):
                continue
            lam = space.weights(-values.F) / lengths
            is_balanced = np.abs(values.F + corner.T @ lam).max() <= limit
            if is_balanced and (sign * lam[C:] * lengths[C:] >= -limit).all():
                known[sign].append(sign * curvature(problem.whole(held, lam)))
        if any(np.linalg.eigvalsh(H)[0] > nothing for H in known[sign]):
            kind = _kind(sign > 0, sign < 0, True, shared.pushes, shared.pulls)
            return kind, 0 if sign > 0 else Z.shape[1]
    # They are unbounded where weights >= 0 of contacts, with any of the equality rows, sum to nothing.
    of_contacts = np.concatenate([np.zeros(2 * C), np.ones(len(rows) - C)])
    columns = np.vstack([unit[:C], -unit[:C], unit[C:]]).T
    target = np.append(np.zeros(len(columns)), 1.0)
    left = complementarity.residual(np.vstack([columns, of_contacts]), target)
    if left is None or float(np.linalg.norm(left)) <= doubles.ZERO:
        return _kind(False, False, False, shared.pushes, shared.pulls), 0
    # The number of directions, among the axes of curvatures (d, d), along which all of these are negative
    turns = {1: 0, -1: 0}
    for sign, each in known.items():
        if each:
            axes = np.hstack([np.linalg.eigh(H)[1] for H in each])
            most = np.max([np.einsum("ij,ik,kj->j", axes, H, axes) for H in each], axis=0)
            turns[sign] = min(int((most < -nothing).sum()), len(axes))
    rises, falls = shared.pushes or turns[-1] > 0, shared.pulls or turns[1] > 0
    return _kind(rises, falls, rises and falls, shared.pushes, shared.pulls), turns[1]
