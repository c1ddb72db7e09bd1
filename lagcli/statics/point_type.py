"""The kind of a point of rest: the bordered Hessian, restricted to the directions the rows leave (D.25).

A contact that touches and carries nothing holds nothing, but one may not pass it. The sign of u^T H u on the cone of
what is left decides (strict copositivity), and not the eigenvalues of H: on x >= 0, y >= 0 nothing is less than
x y + x^2 + y^2 - 3 x y / 2 at 0.
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.linear import decompositions, rank
from lagcli.statics import flat_directions, precise_zeros, refine, shared_multipliers
from lagcli.statics.flat_directions import FlatVerdict
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import RestEquations, Scales
from lagcli.statics.shared_multipliers import SharedMultipliers
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]
Kind = Literal["minimum", "maximum", "saddle", "isolated", "degenerate"]


class PointTypeParameters:
    """Limits of what is zero where the kind of a point is told; parts are of no unit.

    The tests are of `tests/unit/test_numbers_of_rest_searches.py` and
    `tests/unit/test_numbers_of_statics.py`.
    """

    __slots__ = ()

    flat: float = 1e-7
    """Curvatures of this part of the largest are zero. `test_a_curvature_of_seven_digits_less_is_flat` fails
    at 1e-8 and 1e-6."""
    asymmetric: float = 1e-8
    """Forces have no potential where the Hessian is asymmetric by this part.
    `test_forces_have_no_potential_where_their_gradient_is_asymmetric` fails at 1e-9 and 1e-7."""
    most_weak: int = 8
    """All sets of so many contacts that carry nothing are gone through.
    `test_all_sets_of_eight_contacts_that_carry_nothing_are_gone_through` fails at 0 and 80."""
    doubtful: float = 1e-5
    """Curvatures of this part of their terms may be none: higher derivatives are looked at.
    `test_a_curvature_below_five_digits_of_its_terms_is_looked_at_again` fails at 1e-6 and 1e-4."""
    soft: float = 1e-3
    """And so may those of this part of force over length.
    `test_a_curvature_is_looked_at_again_below_a_part_of_force_over_length` fails at 1e-4 and 1e-2."""


PARAMETERS = PointTypeParameters()


@dataclasses.dataclass(frozen=True, slots=True)
class PointType:
    """kind and index (negative directions) are None where the forces have no potential, or the rank of the equality
    rows is undecided; unique: whether lambda is, None where the rank of the rows does not say;
    rank: of the equality rows; freedom: what these leave; is_regular: whether all curvatures are known and none
    vanishes, so that no other point is near."""

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

    along (n, d): the directions of a continuum, whose type is that of the directions across; is_exact: the point is
    known to rounding, so that curvatures do not vanish which would do so elsewhere. Contacts that carry a
    force count as rows; one that pushes is a wall of a minimum, one that pulls of a maximum. Those that touch and
    carry nothing leave a cone of directions.
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
    shared = shared_multipliers.of_one_sign(problem, point, scales)
    held, walls = shared.point, (shared.pushes, shared.pulls)
    values, carry = problem.at(problem.t, held.q, held.lam), carrying(problem, held, scales)
    Z = rank.null_basis(np.vstack([B, decompositions.unit(values.G[list(carry)]), along.T]))
    if (decided := _of_many_multipliers(problem, shared, scales, Z)) is not None:
        is_alone = decided[0] == "isolated" and not along.size
        return dataclasses.replace(plain, kind=decided[0], index=decided[1], is_regular=is_alone), point
    H, units = _scaled(-Z.T @ values.K @ Z)
    largest = float(np.abs(H).max(initial=0.0))
    if np.abs(H - H.T).max(initial=0.0) > PARAMETERS.asymmetric * largest:
        return plain, point
    curvatures, axes = np.linalg.eigh((H + H.T) / 2)
    idle = [k for k in refine.touching(problem, point, scales) if k not in carry]
    if shared.are_many:
        idle = shared_multipliers.in_the_way(values.G, idle, Z)
    ways = Z @ (axes / units[:, None])
    ways /= np.linalg.norm(ways, axis=0)
    slopes = np.abs(np.einsum("ij,ik,kj->j", ways, values.K, ways))
    floor = scales.force / scales.length
    is_doubtful = np.abs(curvatures) <= PARAMETERS.doubtful * largest
    is_doubtful |= slopes <= max(PARAMETERS.doubtful * float(np.abs(values.K).max()), PARAMETERS.soft * floor)
    bare = dataclasses.replace(held, closed=carry)
    is_known = np.abs(curvatures) > PARAMETERS.flat * largest
    signs = np.sign(curvatures) * is_known * (slopes.max(initial=0.0) > doubles.ZERO * floor)
    doubtful, sure = (ways[:, is_doubtful], along), curvatures[~is_doubtful]
    exact = _of_digits(problem, bare, scales, along) if is_doubtful.any() else None
    verdict = exact or _of_doubtful(problem, bare, scales, doubtful, signs[is_doubtful], is_exact)
    if is_exact and flat_directions.is_elsewhere(verdict.point, point, scales):
        verdict = _of_signs(bare, signs[is_doubtful])
    if idle and verdict.is_odd:  # along one of two opposite directions a contact is in the way
        verdict = dataclasses.replace(verdict, rises=False, falls=False)
    up, down = verdict.up, verdict.down
    if exact is None:
        up, down = int((sure > 0).sum()) + up, int((sure < 0).sum()) + down
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


def _of_many_multipliers(
    problem: StaticProblem, shared: SharedMultipliers, scales: Scales, Z: Floats
) -> tuple[Kind, int] | None:
    """The kind and the index along directions Z (n, d) where one choice of multipliers does not give them."""
    if not shared.are_told:
        return "degenerate", 0
    if not Z.shape[1] and not (shared.pushes or shared.pulls):
        return "isolated", 0
    signs = shared_multipliers.curvature_signs(problem, shared, scales, Z, PARAMETERS.most_weak)
    if signs is None:
        return None
    rises, falls, is_strict, index = signs
    return _kind(rises, falls, is_strict, shared.pushes, shared.pulls), index


def _of_digits(
    problem: StaticProblem, point: EquilibriumPoint, scales: Scales, along: Floats
) -> FlatVerdict | None:
    """The verdict on all directions beside those of a continuum (n, d) by many digits, where these decide."""
    equations = RestEquations(problem, point.closed, scales)
    found = precise_zeros.signs(
        equations,
        np.concatenate([point.q, point.lam[[*range(problem.C), *(problem.C + k for k in point.closed)]]]),
    )
    return None if found is None or found[2] != along.shape[1] else FlatVerdict(point, *found[:2])


def _of_doubtful(
    problem: StaticProblem,
    point: EquilibriumPoint,
    scales: Scales,
    directions: tuple[Floats, Floats],
    signs: Floats,
    is_exact: bool,
) -> FlatVerdict:
    """The verdict on directions (n, k) whose curvatures may vanish, beside those of a continuum (n, d): by higher
    derivatives, where rows are of positions alone, nothing depends on t, and the model is not large; else by the signs
    (k,) of the curvatures."""
    doubtful, along = directions
    is_small = problem.n + problem.C <= refine.PARAMETERS.large and len(problem.times) == 1
    if doubtful.shape[1] and is_small and is_holonomic(problem, point):
        basis = decompositions.orthonormal(doubtful)[0]
        return flat_directions.judged(problem, point, scales, (basis, along), is_exact)
    return _of_signs(point, signs)


def _of_signs(point: EquilibriumPoint, signs: Floats) -> FlatVerdict:
    """The verdict that the signs (k,) of curvatures give."""
    up, down = int((signs > 0).sum()), int((signs < 0).sum())
    return FlatVerdict(point, up, down, len(signs) - up - down)


def is_holonomic(problem: StaticProblem, point: EquilibriumPoint) -> bool:
    """True if what the rows leave is what the conditions leave."""
    values = problem.at(problem.t, point.q, point.lam)
    return unit_rank(np.vstack([values.B, values.dc])) == unit_rank(values.dc)


def _kind_on_cone(
    H: Floats, weak: Floats, counts: tuple[int, int], walls: tuple[bool, bool]
) -> tuple[Kind, int]:
    """The kind and the index where only directions u with weak u >= 0 are allowed; counts: the positive and negative
    curvatures of H, which decide where contacts are too many to be gone through."""
    (up, down), flat = counts, PARAMETERS.flat * float(np.abs(H).max(initial=0.0))
    if len(weak) > PARAMETERS.most_weak:
        is_definite = len(H) in counts
        return _kind(up > 0, down > 0, True, *walls) if is_definite else "degenerate", down
    found = extremes(H, weak)
    if found is None:
        return _kind(False, False, True, *walls) if any(walls) else "isolated", 0
    least, greatest = found
    rises, falls = greatest > flat, least < -flat
    return _kind(rises, falls, least > flat or greatest < -flat, *walls), down if falls else 0


def carrying(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> tuple[int, ...]:
    """The closed contacts that carry a force, by their numbers."""
    signs = shared_multipliers.signs(problem, point, scales)
    return tuple(k for k, sign in zip(point.closed, signs.tolist(), strict=True) if sign)


def _kind(rises: bool, falls: bool, is_strict: bool, pushes: bool, pulls: bool) -> Kind:
    rises, falls = rises or pushes, falls or pulls
    if rises and falls:
        return "saddle"
    if not is_strict or not (rises or falls):
        return "degenerate"
    return "minimum" if rises else "maximum"


def unit_rank(rows: Floats) -> int:
    """The rank of rows, each measured by its length."""
    return rank.space(decompositions.unit(rows), is_whole=False).low


def _scaled(H: Floats) -> tuple[Floats, Floats]:
    """H with its rows and columns measured by what they hold, and these units: signs stay, units go."""
    widest = float(np.abs(H).max(initial=0.0))
    if not widest > 0:
        return H, np.ones(len(H))
    by = np.sqrt(np.maximum(np.abs(H).max(axis=1), 1e-6 * widest))
    return np.asarray(H / by[:, None] / by[None, :]), by


def extremes(H: Floats, G: Floats) -> tuple[float, float] | None:
    """The least and the greatest u^T H u of all u of length one with G u >= 0, None where only u = 0 is left.

    H (d, d) symmetric, G (k, d) with few rows. Both are reached at an eigenvector of H restricted to a face
    of the cone, on which some rows are zero, and of several the smaller faces have their own.
    """
    lengths = np.linalg.norm(G, axis=1)
    rows = G[lengths > rank.PARAMETERS.small] / lengths[lengths > rank.PARAMETERS.small, None]
    found: list[float] = []
    for size in range(len(rows) + 1):
        for on in itertools.combinations(range(len(rows)), size):
            face = rank.null_basis(rows[list(on)])
            if not face.shape[1]:
                continue
            values, vectors = np.linalg.eigh(face.T @ H @ face)
            above = rows @ (face @ vectors)
            inside = (above >= -rank.PARAMETERS.small).all(axis=0) | (above <= rank.PARAMETERS.small).all(
                axis=0
            )
            found += values[inside].tolist()
    return (min(found), max(found)) if found else None
