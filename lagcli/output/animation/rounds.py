"""Planes, spheres, cylinders and ellipsoids that rows of one particle keep it on, or on one side of."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.output.animation import quadratic_form
from lagcli.output.animation.quadratic_algebra import PicturedRow
from lagcli.output.animation.quadratic_form import Quadratic
from lagcli.output.animation.scene import DrawnSurface, steady

Floats = npt.NDArray[np.float64]
# A part of the size of the scene: a particle this far off a surface is not on it. FAR: sizes of the scene; a plane
# farther than this from all that moves on its side is not drawn.
# `tests/unit/test_drawing_thresholds.py::test_a_plane_far_from_its_particle_is_not_drawn`
# fails with either of them ten times larger or smaller.
OFF_SURFACE, FAR = 1e-5, 1.5
MARGIN = 0.12  # of the size of the scene, by which a surface reaches beyond what moves on it


@dataclasses.dataclass(slots=True, eq=False)
class RowPlane:
    """The plane normal . r = offset; of an inequality normal . r >= offset is allowed. normal (1 or T, 3) of length 1,
    offset (1 or T,). rows: the names of those that it is drawn for."""

    name: str
    one_sided: bool
    normal: Floats
    offset: Floats
    particles: set[int]
    rows: list[str] = dataclasses.field(default_factory=list)

    def is_the_same_as(self, other: RowPlane, size: float) -> bool:
        """True where both are one plane, with the same side allowed."""
        if self.one_sided != other.one_sided or self.normal.shape != other.normal.shape:
            return False
        if self.offset.shape != other.offset.shape:
            return False
        for sign in (1.0,) if self.one_sided else (1.0, -1.0):
            near = np.abs(self.normal - sign * other.normal).max() <= doubles.ZERO
            if near and np.abs(self.offset - sign * other.offset).max() <= doubles.ZERO * size:
                return True
        return False


def alone(form: Quadratic) -> int | None:
    """The only particle in a form, or None."""
    parts = [form, form.under] if form.under is not None else [form]
    found = {i // 3 for part in parts for i in (*part.linear, *itertools.chain(*part.quadratic))}
    return found.pop() if len(found) == 1 else None


def plane(row: PicturedRow, particle: int) -> RowPlane | None:
    """The plane of a row of the first degree."""
    form = row.form
    if not form.is_polynomial or form.quadratic:
        return None
    normal = np.atleast_2d(np.stack(np.broadcast_arrays(*form.slope(particle)), axis=-1))
    length = np.linalg.norm(normal, axis=-1)
    if not np.all(length > 0):
        return None
    offset = np.atleast_1d(-form.constant / length)
    return RowPlane(
        row.name,
        row.kind == "inequality",
        steady(normal / length[:, None]),
        steady(offset),
        {particle},
        [row.name],
    )


def quadric(row: PicturedRow, particle: int, track: Floats, size: float) -> DrawnSurface | None:
    """The sphere, ellipsoid or cylinder of a row of the second degree; track (k, 3) of the particle."""
    pair = quadratic_form.squared(row.form, row.kind == "inequality")
    if pair is None or not pair[0].quadratic:
        return None
    form = pair[0]
    if any(np.ptp(value) for value in form.quadratic.values()):
        return None
    A = np.zeros((3, 3))
    for (i, j), value in form.quadratic.items():
        A[i % 3, j % 3] += float(np.ravel(value)[0]) / 2
        A[j % 3, i % 3] += float(np.ravel(value)[0]) / 2
    *b, c = (np.atleast_1d(part) for part in np.broadcast_arrays(*form.slope(particle), form.constant))
    values, vectors = np.linalg.eigh(A)
    if values.sum() < 0:
        values, vectors, b, c = -values[::-1], vectors[:, ::-1], [-part for part in b], -c
    largest = values[2]
    if values[1] <= doubles.ZERO * largest or values[0] < -doubles.ZERO * largest:
        return None
    # In the principal directions: sum values_i (x_i + slope_i)^2 = square, and along a direction without a value x_i.
    along = np.stack(b, axis=-1) @ vectors
    bent = values > doubles.ZERO * largest
    if np.abs(along[:, ~bent]).max(initial=0.0) > doubles.ZERO * max(float(np.abs(along).max()), largest):
        return None
    slope = np.zeros_like(along)
    slope[:, bent] = along[:, bent] / (2 * values[bent])
    square = (slope**2 * values).sum(axis=-1) - c
    if not np.all(square > 0):
        return None
    half = np.sqrt(square[:, None] / np.where(bent, values, 1.0))
    middle = -slope
    if not bent.all():
        reach = track @ vectors[:, 0]
        middle[:, 0] = (reach.min() + reach.max()) / 2
        half[:, 0] = (reach.max() - reach.min()) / 2 + MARGIN * size
    order = [1, 2, 0]  # the axis of a cylinder comes last
    frames = [half[:, i, None] * vectors[:, i] for i in order]
    frame = np.stack([*frames, middle @ vectors.T], axis=1)
    kind: Literal["sphere", "cylinder"] = "sphere" if bent.all() else "cylinder"
    return DrawnSurface(kind, row.name, row.kind == "inequality", steady(frame))


def merged(planes: Sequence[RowPlane], size: float) -> list[RowPlane]:
    """Each plane once, with all its particles."""
    found: list[RowPlane] = []
    for one in planes:
        same = next((other for other in found if other.is_the_same_as(one, size)), None)
        if same is None:
            found.append(one)
        else:
            same.particles |= one.particles
            same.rows += one.rows
    return found


def polygons(
    planes: Sequence[RowPlane], particles: Floats, radii: Floats, size: float
) -> list[tuple[RowPlane, DrawnSurface]]:
    """The parts of planes that are drawn: around what moves on them, cut by walls that meet. particles (T, N, 3); radii
    (N,): of what touches them."""
    found = []
    for one in planes:
        tracks = particles[:, sorted(one.particles)]
        gap = (tracks * one.normal[:, None, :]).sum(axis=-1) - one.offset[:, None]
        near = float(np.abs(gap).min())
        if near > (FAR * size if one.one_sided else OFF_SURFACE * size):
            continue
        # The radius of the particles that touch a wall, where all have the same
        own = radii[sorted(one.particles)]
        known = one.one_sided and not np.isnan(own).any() and np.ptp(own) <= doubles.ZERO * own.max()
        shift = float(own[0]) if known else 0.0
        walls = [
            other
            for other in planes
            if other is not one and other.one_sided and other.particles & one.particles
            and len(other.normal) == len(other.offset) == 1
        ]  # fmt: skip
        found.append((one, _polygon(one, tracks.reshape(-1, 3), (walls, shift), size)))
    return found


def _polygon(one: RowPlane, tracks: Floats, cut: tuple[list[RowPlane], float], size: float) -> DrawnSurface:
    walls, shift = cut
    low, high = tracks.min(axis=0), tracks.max(axis=0)
    middle = (low + high) / 2
    u, v = basis(one.normal)
    off = (one.normal @ middle - one.offset)[:, None] * one.normal
    origin = middle - off - shift * one.normal
    # The reach along both directions, at the instant at which it is largest.
    across = max(float(np.abs((tracks - middle) @ part.T).max()) for part in (u, v))
    first = [float(np.abs((tracks - middle) @ part.T).max()) + MARGIN * size for part in (u, v)]
    first = [max(reach, 0.25 * across, MARGIN * size) for reach in first]
    rectangle = corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(first)
    if len(one.normal) == len(one.offset) == 1:
        for wall in walls:
            own = np.array([u[0] @ wall.normal[0], v[0] @ wall.normal[0]])
            level = float(wall.offset[0]) - float(origin[0] @ wall.normal[0]) - shift
            corners = _cut(corners, own, level)
    if len(corners) < 3:
        corners = rectangle
    shape = np.column_stack([corners, np.zeros(len(corners))])
    parts = np.broadcast_arrays(u, v, one.normal, origin)
    return DrawnSurface("plane", one.name, one.one_sided, steady(np.stack(parts, axis=1)), shape)


def basis(normal: Floats) -> tuple[Floats, Floats]:
    """Two directions in planes with normals (k, 3), the first of them level."""
    level = np.linalg.norm(normal[:, :2], axis=-1).min() > doubles.ZERO
    u = np.cross([0.0, 0.0, 1.0] if level else [0.0, 1.0, 0.0], normal)
    if np.linalg.norm(u, axis=-1).min() <= doubles.ZERO:
        u = np.cross([1.0, 0.0, 0.0], normal)
    lengths = np.linalg.norm(u, axis=-1)
    u = u / np.where(lengths > 0, lengths, 1.0)[:, None]
    return u, np.cross(normal, u)


def _cut(corners: Floats, normal: Floats, level: float) -> Floats:
    """The part of a convex polygon (k, 2) with normal . x >= level."""
    if np.linalg.norm(normal) <= doubles.ZERO or not len(corners):
        return corners
    gap = corners @ normal - level
    clipped = []
    for k in range(len(corners)):
        a, b, this, last = corners[k], corners[k - 1], gap[k], gap[k - 1]
        if (this >= 0) != (last >= 0):
            clipped.append(b + (a - b) * last / (last - this))
        if this >= 0:
            clipped.append(a)
    return np.array(clipped).reshape(-1, 2)
