"""Paths that satisfy all rows, A dz = 0, integrated for many controls at once.

A path is a chain of segments, and each segment has a constant control u (m,) over s from 0 to 1:
dz/ds = X(z) u with the columns of X (k + 1, m) in the kernel of A. The scheme is the one of the integrator
(DOP853, order 8) at fixed steps; what a path ends at is known from two step lengths.
"""

from __future__ import annotations

import dataclasses
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lagcli.holonomy.parts import Part
from lagcli.integrate import tableau

Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

SHARED = 50  # paths among which common beginnings are looked for
SHIFT = 1e-12  # of rows of length one


class Frame(Protocol):
    """Fields that span the kernel of A."""

    @property
    def part(self) -> Part:
        """Whose rows are kept."""

    def velocity(self, Z: Floats, U: Floats) -> Floats:
        """X(z) u (N, k + 1) for points Z (N, k + 1) and controls U (N, m); not finite at a pole."""


@dataclasses.dataclass(frozen=True)
class Axes:
    """Moves along single coordinates: the `free` ones (m,) take the controls, the `led` ones (r,) follow.

    X_f = e_f - A_led^-1 A_f for `chosen` independent rows (r,): the fields commute in the free coordinates, so that
    a loop is one that a person can draw.
    """

    part: Part
    chosen: Numbers
    led: Numbers
    free: Numbers

    def velocity(self, Z: Floats, U: Floats) -> Floats:
        """As `Frame`."""
        result = np.zeros_like(Z)
        result[:, self.free] = U
        A = self.part.forms(Z)[:, self.chosen]
        moved: Floats = np.einsum("ncf,nf->nc", A[:, :, self.free], U)
        # Where the free coordinates that move do not enter the rows nothing follows, be it at a pole.
        asks = np.asarray(moved.any(axis=1))  # true of nan as well
        if asks.any():
            result[np.ix_(asks, self.led)] = -_solved(A[asks][:, :, self.led], moved[asks])
        return result


def _solved(pivots: Floats, moved: Floats) -> Floats:
    """pivots^-1 moved (N, r), nan where that does not exist."""
    try:
        return np.asarray(np.linalg.solve(pivots, moved[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        unit = np.eye(pivots.shape[1])
        regular: npt.NDArray[np.bool_] = np.all(np.isfinite(pivots), axis=(1, 2))
        pivots = np.where(regular[:, None, None], pivots, unit)
        regular &= np.linalg.det(pivots) != 0  # by the same factors as solve
        pivots = np.where(regular[:, None, None], pivots, unit)
        found = np.linalg.solve(pivots, moved[:, :, None])[:, :, 0]
        return np.asarray(np.where(regular[:, None], found, np.nan))


@dataclasses.dataclass(frozen=True)
class Projected:
    """Fixed directions E (k, m) projected onto the kernel; the last control is dt. It has no pole.

    dq = E u - B^T (B B^T)^-1 (B E u + b dt).
    """

    part: Part
    directions: Floats

    def velocity(self, Z: Floats, U: Floats) -> Floats:
        """As `Frame`; U (N, m + 1)."""
        A = self.part.forms(Z)
        bad = ~np.isfinite(A).all(axis=(1, 2))
        A[bad] = 0.0
        lengths = np.linalg.norm(A[:, :, :-1], axis=2, keepdims=True)
        A /= np.where(lengths > 0, lengths, 1.0)
        B, b = A[:, :, :-1], A[:, :, -1]
        # Rows may depend on others; what the shift spoils the second pass mends.
        gram = B @ B.transpose(0, 2, 1) + SHIFT * np.eye(B.shape[1])
        dq = U[:, :-1] @ self.directions.T
        for _ in range(2):
            excess = np.einsum("ncq,nq->nc", B, dq) + b * U[:, -1:]
            dq = dq - np.einsum("ncq,nc->nq", B, _solved(gram, excess))
        result = np.column_stack([dq, U[:, -1]])
        result[bad] = np.nan
        return result


def ends(frame: Frame, start: Floats, controls: Floats, steps: int) -> Floats:
    """Where paths end, (N, k + 1): controls (N, S, m), `steps` in each segment, start (k + 1,) or (N, k + 1)."""
    Z = np.broadcast_to(start, (len(controls), start.shape[-1])).copy()
    is_shared = start.ndim == 1
    with np.errstate(all="ignore"):
        for segment in range(controls.shape[1]):
            # Words that begin alike are integrated once.
            seen = controls[:, : segment + 1].reshape(len(Z), -1)
            first, which = np.arange(len(Z)), np.arange(len(Z))
            if is_shared and len(Z) > SHARED:
                _, first, which = np.unique(seen, axis=0, return_index=True, return_inverse=True)
            U = controls[first, segment]
            moving = U.any(axis=1)
            there = Z[first]
            for _ in range(steps if moving.any() else 0):
                there[moving] = _step(frame, there[moving], U[moving], 1 / steps)
            Z = there[which.ravel()]
    return Z


def knots(frame: Frame, start: Floats, controls: Floats, steps: int) -> Floats:
    """The points of one path, (S steps + 1, k + 1): controls (S, m)."""
    points = [start]
    with np.errstate(all="ignore"):
        for U in controls:
            for _ in range(steps):
                points.append(_step(frame, points[-1][None], U[None], 1 / steps)[0])
    return np.array(points)


def _step(frame: Frame, Z: Floats, U: Floats, h: float) -> Floats:
    stages: list[Floats] = []
    for row in tableau.A[: tableau.STAGES]:
        at = Z + h * sum(a * stage for a, stage in zip(row, stages, strict=True) if a)
        stages.append(frame.velocity(at, U))
    return np.asarray(Z + h * sum(w * stage for w, stage in zip(tableau.B, stages, strict=True) if w))
