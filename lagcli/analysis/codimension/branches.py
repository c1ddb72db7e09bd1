"""Singular points: on the surface nearby the rank of B is higher, as off the position where a linkage lies flat."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.analysis.codimension import regular_point
from lagcli.analysis.codimension.scaled_equations import ScaledPart
from lagcli.linear import rank

Floats = npt.NDArray[np.float64]

# Points sought, and how many of them by walks of several steps.
POINTS, WALKS, STEPS = 16, 4, 3
# In units of the scaled coordinates, the step and how often it is halved to begin with: a branch that bends away
# is seen close by only. Closer to a singular point the rank cannot be seen.
STEP, CLOSER, HALVINGS = 0.2, 4, 7
NEWTON_STEPS, MORE_STEPS = 8, 40
# Newton's method squares a small residual where the rank is constant, and halves the distance where it is not.
SOLVED, SQUARED, CREEPING = 1e-13, 0.02, 1e-9
SEED = 20062


class _Creeping(Exception):
    """Newton's method comes to the surface, but slowly: what is there is not regular."""


def codimensions(part: ScaledPart, times: Sequence[float]) -> set[int | None]:
    """The codimensions at points of the surface that random steps reach from the begin; None where one is not
    proved, as where several branches meet of which one is not regular anywhere, or where most steps come nowhere.
    Where time enters they are at later times: the start may be special for its time too."""
    found: set[int | None] = set()
    failed = 0
    random = np.random.default_rng(SEED)
    for point in range(POINTS):
        z: Floats | None = part.begin
        t = times[point % len(times)] if times else part.state.t
        try:
            for _ in range(STEPS if point < WALKS else 1):
                z = _step(part, z, t, random, STEP / 2 ** (point % CLOSER)) if z is not None else None
        except _Creeping:
            return {None}
        if z is None:
            failed += 1
        else:
            found.add(_at(part.moved(z, t), [time for time in times if time > t]))
        if None in found or len(found) > 1 or failed > POINTS // 2:
            return {None}
    return found


def _at(part: ScaledPart, times: Sequence[float]) -> int | None:
    """The codimension at a point, or None."""
    _, J = part.at(part.begin, part.state.t)
    sigma = np.linalg.svd(_unit_rows(J), compute_uv=False)
    large = int((sigma > rank.LARGE).sum())
    if large != int((sigma > rank.SMALL).sum()):
        return None
    return large if large == len(part.rows) or regular_point.is_regular(part, large, times) else None


def _step(part: ScaledPart, z: Floats, t: float, random: np.random.Generator, size: float) -> Floats | None:
    """A random step along the kernel of B, back to the surface where Newton's method squares the residual.

    Raises `_Creeping`.
    """
    _, J = part.at(z, t)
    _, sigma, right = np.linalg.svd(_unit_rows(J))
    tangent = right[int((sigma > rank.LARGE).sum()) :].T
    direction = tangent @ random.standard_normal(tangent.shape[1])
    largest = float(np.abs(direction).max(initial=0.0))
    step = size * direction / largest if largest > 0 else direction
    for halving in range(HALVINGS):
        there = _nearby(part, z + step / 2**halving, t)
        if there is not None:
            return there
    return None


def _nearby(part: ScaledPart, z: Floats, t: float) -> Floats | None:
    """The point that a few Newton steps reach, each squaring a small residual, or None. Raises `_Creeping`."""
    before = residual = np.inf
    limit = SOLVED + 4 * part.rounding
    for done in range(NEWTON_STEPS + MORE_STEPS):
        F, J = part.at(z, t)
        if not (np.isfinite(F).all() and np.isfinite(J).all()):
            return None
        lengths = np.linalg.norm(J, axis=1)
        lengths = np.where(lengths > 0, lengths, 1.0)
        residual = float(np.abs(F / lengths).max(initial=0.0))
        if residual <= limit:
            if residual <= SQUARED * before or before <= limit:
                return z if done < NEWTON_STEPS else None
            break
        z = z - np.linalg.lstsq(J / lengths[:, None], F / lengths, rcond=rank.SMALL)[0]
        before = residual
    if residual <= CREEPING + limit:
        raise _Creeping
    return None


def _unit_rows(J: Floats) -> Floats:
    lengths = np.linalg.norm(J, axis=1)
    return np.asarray(J / np.where(lengths > 0, lengths, 1.0)[:, None])
