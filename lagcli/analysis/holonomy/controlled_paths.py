"""Paths that satisfy all rows, A dz = 0, integrated for many controls at once: chains of segments, each with a constant
control u (m,) over s from 0 to 1, dz/ds = X(z) u with the columns of X (k + 1, m) in the kernel of A, by the scheme of
the integrator (DOP853) at fixed steps.

The directions that paths through a point can reach are the tangent space of its orbit. Fields carried to the point by
flows span it (H. J. Sussmann, Trans. AMS 180 (1973) 171): for random paths w the vectors d/de w^-1(w(z) + e X). A row
that vanishes on it is kept by first integrals (D.3), and has no witness.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.linalg import LinAlgError

from lagcli import doubles
from lagcli.analysis.holonomy.local_system import LocalPart
from lagcli.arrays import Floats, Integers
from lagcli.compiled import dop853_tableau, paths
from lagcli.linear import decompositions, rank

SCHEME = (dop853_tableau.A[: dop853_tableau.STAGES], dop853_tableau.B)


@dataclasses.dataclass(frozen=True)
class ControlledFrame:
    """Fields that span the kernel of the rows A of a part.

    controls (., m): the arguments of the steps for a control u (m,); build: makes the steps, once for each `key`; free:
    the coordinates along which a control moves singly, if it does.
    """

    part: LocalPart
    controls: Floats
    key: tuple[int, ...]
    build: Callable[[], paths.PathSteps]
    free: tuple[int, ...] = ()

    @cached_property
    def steps(self) -> paths.PathSteps:
        """Steps along the fields."""
        if self.key not in self.part.built:
            self.part.built[self.key] = self.build()
        return self.part.built[self.key]


def along_axes(part: LocalPart, chosen: Integers, led: Integers, free: Integers) -> ControlledFrame:
    """Moves along single coordinates: the `free` ones (m,) take the controls, the `led` ones (r,) follow, by the fields
    X_f = e_f - A_led^-1 A_f for `chosen` independent rows (r,). These commute in the free coordinates: a loop is
    one that a person can draw."""

    def build() -> paths.PathSteps:
        z, A = part.expressions
        return paths.PathSteps(paths.axes(z, A[chosen.tolist(), :], led, free), SCHEME)

    return ControlledFrame(part, np.eye(free.size), (*chosen, -1, *led, -1, *free), build, tuple(free))


def projected(part: LocalPart, directions: Floats) -> ControlledFrame:
    """Fixed directions E (k, m) projected onto the kernel; the last control is dt. It has no pole.

    dq = E u - B^T (B B^T)^-1 (B E u + b dt).
    """
    k, m = directions.shape
    controls = np.zeros((k + 1, m + 1))
    controls[:k, :m], controls[k, m] = directions, 1.0
    return ControlledFrame(
        part, controls, (), lambda: paths.PathSteps(paths.projected(*part.expressions), SCHEME)
    )


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
            if is_shared and len(Z) > 50:
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


# How far points are from one that may be singular; an orbit is explored where this part of the paths comes back.
BESIDE, MOST = 0.1, 0.8
# Directions of this part are none: far above the error of a difference quotient. Rough paths that miss by it are near.
SEEN = doubles.STEP
# Of random paths: the same in every run.
SEED = 1973


@dataclasses.dataclass(frozen=True)
class PathOrbit:
    """`tangent` (k + 1, a): an orthonormal basis; `kernel` (k, m): directions of the rows with t fixed.

    `is_explored`: most random paths came back, so that a smaller distance shows no more.
    """

    tangent: Floats
    kernel: Floats
    is_explored: bool

    def lift(self, closed: Integers) -> Floats | None:
        """The tangent vectors (k + 1, a) with unit components along coordinates `closed` (a,), if they have one."""
        picked = self.tangent[closed]
        sigma = decompositions.singular_values(picked)
        if sigma.size == 0 or sigma[-1] < SEEN:
            return None
        found = self.tangent @ np.linalg.inv(picked)
        return np.asarray(np.where(np.abs(found) < SEEN, 0.0, found))


def through(part: LocalPart, point: Floats, size: float, timed: bool) -> PathOrbit | None:
    """The orbit of a point (k + 1,), explored over the distance `size`; None where the rows are not finite."""
    kernel = _kernel(part, point)
    m = 0 if kernel is None else kernel.shape[1] + timed
    if kernel is None or m == 0:
        return None
    frame = projected(part, kernel)
    control = np.eye(kernel.shape[1] + 1)[:m]  # of each field, the last in time
    # The fields at the ends of random paths, carried back to the point.
    random = np.random.default_rng(SEED)
    count = min(40, 2 * point.size + 4)
    out = size * random.uniform(-1, 1, (count, 3, m)) @ control
    out[0] = 0.0
    rough, fine = (_returned(frame, point, out, control, size, steps) for steps in (2, 4))
    with np.errstate(invalid="ignore"):
        # Beside a pole the difference of paths is that of their errors.
        sure = np.abs(fine - rough).max(axis=1) <= doubles.ROOT * np.abs(fine).max(axis=1)
    vectors = fine[sure].T
    lengths = np.linalg.norm(vectors, axis=0)
    vectors = vectors[:, (lengths > 1e-9) & (lengths < 1e6)]
    sigma, left = decompositions.column_axes(vectors / np.linalg.norm(vectors, axis=0))
    many = int((sigma > SEEN * sigma.max(initial=0.0)).sum())
    return PathOrbit(left[:, :many], kernel, bool(sure.mean() > MOST))


def is_singular(part: LocalPart, point: Floats) -> bool:
    """True if the rows are dependent at a point (k + 1,) and not beside it on their surface, or not finite. Such a
    point, a chain drawn straight between two ends, has directions of the rows that no path takes."""
    kernel = _kernel(part, point)
    if kernel is None:
        return True
    random = np.random.default_rng(SEED)
    out = np.zeros((3, 1, kernel.shape[1] + 1))
    out[:, 0, :-1] = BESIDE * random.standard_normal((3, kernel.shape[1]))
    points = ends(projected(part, kernel), point, out, 2)
    kernels = (_kernel(part, end) for end in points if np.isfinite(end).all())
    return any(other is not None and other.shape[1] < kernel.shape[1] for other in kernels)


def _kernel(part: LocalPart, point: Floats) -> Floats | None:
    """An orthonormal basis (k, m) of the displacements with t fixed; None where the rows are not finite."""
    B = part.forms(point[None])[0][:, :-1]
    if not np.isfinite(B).all():
        return None
    try:
        return rank.null_basis(decompositions.unit(B))
    except LinAlgError:
        return None


def _returned(
    frame: ControlledFrame, point: Floats, out: Floats, control: Floats, size: float, steps: int
) -> Floats:
    """The fields of `control` (m, .) carried back along each path `out` (N, S, .), (N m, k + 1), some not finite."""
    far = ends(frame, point, out, steps)
    back, offset = -out[:, ::-1], doubles.STEP * size
    shifted_ends = []
    for sign in (1.0, -1.0):
        with np.errstate(all="ignore"):
            shifted = [far + sign * offset * velocity(frame, far, np.tile(u, (len(far), 1))) for u in control]
        shifted_ends.append(ends(frame, np.concatenate(shifted), np.tile(back, (len(control), 1, 1)), steps))
    return np.asarray((shifted_ends[0] - shifted_ends[1]) / (2 * offset))
