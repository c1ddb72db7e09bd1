"""Paths that satisfy all rows, A dz = 0, integrated for many controls at once.

A path is a chain of segments, and each segment has a constant control u (m,) over s from 0 to 1:
dz/ds = X(z) u with the columns of X (k + 1, m) in the kernel of A. The scheme is the one of the integrator
(DOP853, order 8) at fixed steps; what a path ends at is known from two step lengths.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lagcli.analysis.holonomy.local_system import LocalPart
from lagcli.compiled import dop853_tableau, paths

Floats = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

SHARED = 50  # paths among which common beginnings are looked for
SCHEME = (dop853_tableau.A[: dop853_tableau.STAGES], dop853_tableau.B)


class ControlledFrame(Protocol):
    """Fields that span the kernel of A."""

    @property
    def part(self) -> LocalPart:
        """Whose rows are kept."""

    @property
    def steps(self) -> paths.PathSteps:
        """Steps along the fields of the part."""

    @property
    def controls(self) -> Floats:
        """The arguments of the steps for a control u (m,): columns (., m)."""


@dataclasses.dataclass(frozen=True)
class Axes:
    """Moves along single coordinates: the `free` ones (m,) take the controls, the `led` ones (r,) follow.

    X_f = e_f - A_led^-1 A_f for `chosen` independent rows (r,): the fields commute in the free coordinates, so that
    a loop is one that a person can draw.
    """

    part: LocalPart
    chosen: Numbers
    led: Numbers
    free: Numbers

    @cached_property
    def steps(self) -> paths.PathSteps:
        """Return the steps as `Frame` does."""
        part = self.part

        def build() -> paths.PathSteps:
            z, A = part.expressions
            return paths.PathSteps(paths.axes(z, A[self.chosen.tolist(), :], self.led, self.free), SCHEME)

        return part.once((*self.chosen, -1, *self.led, -1, *self.free), build)

    @cached_property
    def controls(self) -> Floats:
        """Return the controls as `Frame` does."""
        return np.eye(self.free.size)


@dataclasses.dataclass(frozen=True)
class Projected:
    """Fixed directions E (k, m) projected onto the kernel; the last control is dt. It has no pole.

    dq = E u - B^T (B B^T)^-1 (B E u + b dt).
    """

    part: LocalPart
    directions: Floats

    @cached_property
    def steps(self) -> paths.PathSteps:
        """Return the steps as `Frame` does; U (N, m + 1)."""
        return self.part.once((), lambda: paths.PathSteps(paths.projected(*self.part.expressions), SCHEME))

    @cached_property
    def controls(self) -> Floats:
        """Return the controls as `Frame` does."""
        k, m = self.directions.shape
        found = np.zeros((k + 1, m + 1))
        found[:k, :m], found[k, m] = self.directions, 1.0
        return found


def velocity(frame: ControlledFrame, Z: Floats, U: Floats) -> Floats:
    """X(z) u (N, k + 1) for points Z (N, k + 1) and controls U (N, m); not finite at a pole."""
    frame.part.wait()
    return frame.steps.rate(Z, U @ frame.controls.T)


def ends(frame: ControlledFrame, start: Floats, controls: Floats, steps: int) -> Floats:
    """The ends of paths, (N, k + 1): controls (N, S, m), `steps` in each segment, start (k + 1,) or (N, k + 1)."""
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
                frame.part.wait()
                there[moving] = frame.steps.ahead(there[moving], U[moving] @ frame.controls.T, 1 / steps)
            Z = there[which.ravel()]
    return Z


def turned(
    frame: ControlledFrame, start: Floats, controls: Floats, basis: Floats, steps: int
) -> tuple[Floats, Floats]:
    """The ends of paths from start (k + 1,), (N, k + 1), and their derivatives by lengths x, (N, k + 1, q).

    controls (N, S, m) change with x by basis (S, m, q).
    """
    Z = np.broadcast_to(start, (len(controls), start.size)).copy()
    D = np.zeros((len(controls), start.size, basis.shape[2]))
    with np.errstate(all="ignore"):
        for segment in range(controls.shape[1]):
            by_x = frame.controls @ basis[segment]
            for _ in range(steps):
                frame.part.wait()
                Z, J_z, J_u = frame.steps.turned(Z, controls[:, segment] @ frame.controls.T, 1 / steps)
                D = J_z @ D + J_u @ by_x
    return Z, D


def knots(frame: ControlledFrame, start: Floats, controls: Floats, steps: int) -> Floats:
    """The points of one path, (S steps + 1, k + 1): controls (S, m)."""
    points = [start]
    with np.errstate(all="ignore"):
        for U in controls @ frame.controls.T:
            frame.part.wait()
            for _ in range(steps):
                points.append(frame.steps.ahead(points[-1][None], U[None], 1 / steps)[0])
    return np.array(points)
