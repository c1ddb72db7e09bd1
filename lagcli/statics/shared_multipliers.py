"""The forces of contacts at a point of rest where gradients depend on each other, so that many multipliers balance it.

Allowed are the directions d with B d = 0 and G d >= 0, G of all contacts that touch. To first order a function falls
along none of them where there are multipliers of contacts >= 0 (Farkas), and rises along none where there are some
<= 0. Of second order it falls along d where the curvature of the Lagrangian does for all such multipliers, if these are
bounded, and it is a minimum where it rises for one of them along all d (Ben-Tal, J. Optim. Theory Appl. 31 (1980) 143).
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.contact import least_distance
from lagcli.linear import decompositions, rank
from lagcli.statics import refine
from lagcli.statics.refine import EquilibriumPoint
from lagcli.statics.rest_equations import Scales
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SharedMultipliers:
    """The point with multipliers of which those of contacts have one sign, if there are such; pushes, pulls: whether
    the function rises, and falls, along an allowed direction to first order; are_many: other multipliers balance it
    too, and those of `point` are a choice; are_told: not where numbers leave it open whether there are some."""

    point: EquilibriumPoint
    pushes: bool
    pulls: bool
    are_many: bool = False
    are_told: bool = True


def signs(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> Floats:
    """The signs of the forces of the closed contacts, 0 of what is rounding."""
    push = point.lam[[problem.C + k for k in point.closed]] * scales.contacts[list(point.closed)]
    return np.asarray(np.sign(push) * (np.abs(push) > _no_force(problem, point, scales)))


def _no_force(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> float:
    F = problem.at(problem.t, point.q, point.lam).F
    return doubles.ZERO * max(scales.force, float(np.abs(F).max(initial=0.0)))


def of_one_sign(problem: StaticProblem, point: EquilibriumPoint, scales: Scales) -> SharedMultipliers:
    """The multipliers of one sign at a point."""
    own = signs(problem, point, scales)
    plain = SharedMultipliers(point, bool((own > 0).any()), bool((own < 0).any()))
    touching = refine.touching(problem, point, scales)
    values = problem.at(problem.t, point.q, point.lam)
    rows = np.vstack([values.B, values.G[list(touching)]])
    unit, lengths = decompositions.unit(rows), decompositions.lengths(rows)
    if not own.any() or rank.space(unit, is_whole=False).low == len(rows):
        return plain
    limit = _no_force(problem, point, scales)
    balanced: dict[int, Floats] = {}
    for sign in (1, -1):
        columns = np.vstack([unit[: problem.C], -unit[: problem.C], sign * unit[problem.C :]]).T
        weights = least_distance.weights(columns, -values.F)
        if weights is None:
            return dataclasses.replace(plain, are_told=False)
        if np.abs(values.F + columns @ weights).max() <= limit:
            of_rows = weights[: problem.C] - weights[problem.C : 2 * problem.C]
            balanced[sign] = np.concatenate([of_rows, sign * weights[2 * problem.C :]]) / lengths
    if not balanced:
        return SharedMultipliers(point, True, True)
    chosen = _at(problem, point, touching, balanced[1 if 1 in balanced else -1])
    return SharedMultipliers(chosen, -1 not in balanced, 1 not in balanced, are_many=True)


def in_the_way(G: Floats, contacts: list[int], Z: Floats) -> list[int]:
    """The contacts with gradients G (K, n) that may not be passed along directions Z (n, d): the others follow from
    those that carry."""
    parts = np.abs(decompositions.unit(G[contacts]) @ Z).max(axis=1, initial=0.0)
    return [k for k, part in zip(contacts, parts.tolist(), strict=True) if part > rank.PARAMETERS.small]


def _at(
    problem: StaticProblem, point: EquilibriumPoint, contacts: tuple[int, ...], lam: Floats
) -> EquilibriumPoint:
    """The point with multipliers lam of its rows and of these contacts."""
    whole = np.zeros_like(point.lam)
    whole[[*range(problem.C), *(problem.C + k for k in contacts)]] = lam
    return dataclasses.replace(point, lam=whole, closed=contacts)


def curvature_signs(
    problem: StaticProblem, shared: SharedMultipliers, scales: Scales, Z: Floats, most: int
) -> tuple[bool, bool, bool, int] | None:
    """What curvatures do along the directions Z (n, d) where they are not the same for all multipliers: whether the
    function rises, and falls, whether that is known of all directions, and its index; None where they are the same.

    most: contacts that touch, all sets of which are gone through."""
    if not shared.are_many or not Z.shape[1]:
        return None
    point, limit = shared.point, _no_force(problem, shared.point, scales)

    def curvature(lam: Floats) -> Floats:
        H = -Z.T @ problem.at(problem.t, point.q, lam).K @ Z
        return np.asarray((H + H.T) / 2)

    own = curvature(point.lam)
    values = problem.at(problem.t, point.q, point.lam)
    rows = np.vstack([values.B, values.G[list(point.closed)]])
    dependences = rank.space(decompositions.unit(rows)).dependences / decompositions.lengths(rows)
    size = max(float(np.abs(own).max()), scales.force / scales.length)
    added = (_at(problem, point, point.closed, lam).lam for lam in dependences)
    bent = [curvature(point.lam + lam * np.abs(values.F).max()) - own for lam in added]
    if all(np.abs(each).max() <= doubles.ZERO * size for each in bent):
        return None
    known: dict[int, list[Floats]] = {}
    for sign, is_met in ((1, not shared.pulls), (-1, not shared.pushes)):
        vertices = (
            _vertices(problem, point, sign, limit) if is_met and len(point.closed) <= most else iter(())
        )
        known[sign] = [sign * curvature(lam) for lam in vertices]
        if any(np.linalg.eigvalsh(H)[0] > doubles.ZERO * size for H in known[sign]):
            return sign > 0, sign < 0, True, 0 if sign > 0 else Z.shape[1]
    if _are_unbounded(rows, problem.C):
        return False, False, False, 0
    turns = {sign: _turns(known[sign], doubles.ZERO * size) for sign in known}
    rises, falls = shared.pushes or turns[-1] > 0, shared.pulls or turns[1] > 0
    return rises, falls, rises and falls, turns[1]


def _vertices(problem: StaticProblem, point: EquilibriumPoint, sign: int, limit: float) -> Iterator[Floats]:
    """The corners of the multipliers of which those of contacts have a sign: of independent gradients."""
    values, C = problem.at(problem.t, point.q, point.lam), problem.C
    for size in range(len(point.closed) + 1):
        for held in itertools.combinations(point.closed, size):
            rows = np.vstack([values.B, values.G[list(held)]])
            own = rank.space(decompositions.unit(rows), is_whole=False)
            if own.low < C + size:
                continue
            lam = own.weights(-values.F) / decompositions.lengths(rows)
            is_met = np.abs(values.F + rows.T @ lam).max() <= limit
            if is_met and (sign * lam[C:] * decompositions.lengths(rows)[C:] >= -limit).all():
                yield _at(problem, point, held, lam).lam


def _are_unbounded(rows: Floats, equalities: int) -> bool:
    """True if weights >= 0 of contacts, with any of the equality rows, sum to nothing."""
    unit = decompositions.unit(rows)
    columns = np.vstack([unit[:equalities], -unit[:equalities], unit[equalities:]]).T
    of_contacts = np.concatenate([np.zeros(2 * equalities), np.ones(len(rows) - equalities)])
    target = np.append(np.zeros(len(columns)), 1.0)
    left = least_distance.residual(np.vstack([columns, of_contacts]), target)
    return left is None or float(np.linalg.norm(left)) <= doubles.ZERO


def _turns(curvatures: list[Floats], limit: float) -> int:
    """The number of directions, among the axes of curvatures (d, d), along which all of these are negative."""
    if not curvatures:
        return 0
    axes = np.hstack([np.linalg.eigh(H)[1] for H in curvatures])
    most = np.max([np.einsum("ij,ik,kj->j", axes, H, axes) for H in curvatures], axis=0)
    return min(int((most < -limit).sum()), len(axes))
