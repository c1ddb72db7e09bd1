"""The rows of a model as what is drawn of them: rods, planes, round surfaces, radii of hard spheres; else curves and
nets."""

from __future__ import annotations

import collections
import dataclasses
import functools
import itertools
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.model import model as nouns
from lagcli.output.animation import links, nets, quadratic
from lagcli.output.animation.links import PointTable
from lagcli.output.animation.nets import Function
from lagcli.output.animation.quadratic import Coefficient, PicturedRow, Quadratic
from lagcli.output.animation.scene import OFF, STANDING, DrawnSurface, Link, Viewpoint, steady

MOST_TRIED = 60  # rows of models of more particles are not tried one by one for curves
MOST_MOVING = 6  # shapes that move take room in a page for each instant
FAR = 1.5  # sizes of the scene: a plane farther than this from all that moves on its side is not drawn
MARGIN = 0.12  # of the size of the scene, by which a surface reaches beyond what moves on it


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SingleParticleRow:
    """A row that names one particle: its values (T, k) at points (T, k, 3). simple: a plane or something round."""

    name: str
    one_sided: bool
    simple: bool
    moves: bool
    function: Function


@dataclasses.dataclass(slots=True, eq=False)
class RowPictures:
    """links: rods and strings; planes and rounds of single particles, rounds with the particle; contacts: two particles
    and their distance; single: the rows of each particle alone, but for rods; others: rows that are not of the second
    degree; curved: particles whose curve is drawn; shown: the names of rows that are seen in the picture."""

    links: list[Link] = dataclasses.field(default_factory=list)
    planes: list[RowPlane] = dataclasses.field(default_factory=list)
    rounds: list[tuple[int, DrawnSurface]] = dataclasses.field(default_factory=list)
    contacts: list[tuple[int, int, float]] = dataclasses.field(default_factory=list)
    single: dict[int, list[SingleParticleRow]] = dataclasses.field(default_factory=dict)
    others: list[PicturedRow] = dataclasses.field(default_factory=list)
    curved: set[int] = dataclasses.field(default_factory=set)
    shown: set[str] = dataclasses.field(default_factory=set)


def pictures(
    model: nouns.Model, t: Floats, particles: Floats, points: PointTable, size: float
) -> RowPictures:
    """The pictures of the rows of a model whose particles are at (T, N, 3) at t (T,)."""
    found, linear = RowPictures(), list[PicturedRow]()
    rows = list(quadratic.rows(model, t))
    equations = [alone(row.form) for row in rows if not row.one_sided]
    counts = collections.Counter(k for k in equations if k is not None)
    for row in rows:
        if not row.form.known:
            strings = links.of_sum(row.name, quadratic.summed(model, t, row), points)
            found.links += strings
            if strings:
                found.shown.add(row.name)
            else:
                found.others.append(row)
            continue
        distance = quadratic.distance(row.form, row.one_sided)
        particle = alone(row.form)
        is_led = particle is not None and counts[particle] > 1
        link = links.of_row(row, distance, points, is_led) if distance is not None else None
        if link is not None:
            found.links.append(link)
            found.shown.add(row.name)
        elif particle is not None:
            # A plane, something round, or anything else of the second degree
            flat = plane(row, particle)
            ball = None if flat is not None else quadric(row, particle, particles[:, particle], size)
            if flat is not None:
                found.planes.append(flat)
            elif ball is not None:
                found.rounds.append((particle, ball))
            simple, moves = flat is not None or ball is not None, not row.form.is_at_rest
            single = SingleParticleRow(row.name, row.one_sided, simple, moves, row.form.values)
            found.single.setdefault(particle, []).append(single)
        elif distance is not None and distance.at_least and len(distance.weights) == 2:
            a, b = distance.weights
            found.contacts.append((a, b, float(np.ravel(distance.length)[0])))
            found.shown.add(row.name)
        elif (line := _line_contact(row, particles, size)) is not None:
            found.contacts.append(line)
            found.shown.add(row.name)
        else:
            linear.append(row)
    for bar, names in links.bars(linear, points):
        found.links.append(bar)
        found.shown |= names
    found.links += links.of_bodies(model, particles)
    for name, spring in quadratic.springs(model, t):
        ends = points.ends(spring)
        if ends is not None and ends[0] != ends[1]:
            found.links.append(Link("spring", name, ends))
    return found


def _line_contact(row: PicturedRow, particles: Floats, size: float) -> tuple[int, int, float] | None:
    """Two particles on one line along an axis that keep a distance: a.x - b.x >= D."""
    form = row.form
    if not row.one_sided or not form.is_polynomial or form.quadratic or len(form.linear) != 2:
        return None
    (i, a), (j, b) = form.linear.items()
    if not form.is_at_rest or i % 3 != j % 3:
        return None
    factor, other, constant = (float(np.ravel(value)[0]) for value in (a, b, form.constant))
    if factor != -other or constant >= 0:
        return None
    apart = np.delete(particles[:, i // 3] - particles[:, j // 3], i % 3, axis=1)
    if float(np.abs(apart).max()) > doubles.ROOT * size:
        return None
    return i // 3, j // 3, -constant / abs(factor)


def surfaces(found: RowPictures, particles: Floats, radii: Floats, view: Viewpoint) -> list[DrawnSurface]:
    """The surfaces and curves that are drawn; particles (T, N, 3), radii (N,) of hard spheres."""
    size, drawn = 2 * view.size, list[DrawnSurface]()
    # The plane in which the whole motion lies is that of the picture, and seen in it.
    free = [
        one
        for one in found.planes
        if not view.flat
        or one.one_sided
        or (np.abs(np.abs(one.normal @ view.towards) - 1.0) > doubles.ROOT).any()
    ]
    found.shown |= {one.name for one in found.planes} - {one.name for one in free}
    equal = [k for one in free if not one.one_sided for k in one.particles]
    equal += [k for k, ball in found.rounds if not ball.one_sided]
    for particle, ball in found.rounds:
        cut = [one for one in found.planes if particle in one.particles and not one.one_sided]
        circle = _circle(ball, cut[0]) if ball.kind == "sphere" and cut and not ball.one_sided else None
        if circle is None and not ball.one_sided and equal.count(particle) > 1 and ball.kind != "sphere":
            continue  # its curve is drawn
        if circle is None and view.flat and ball.kind == "sphere":  # in the plane of the motion
            normal = np.broadcast_to(view.towards, (len(ball.frames), 3))
            offset = np.full(len(ball.frames), float(view.centre @ view.towards))
            face = RowPlane(ball.name, ball.one_sided, normal, offset, set())
            drawn.append(_circle(ball, face) or ball)
        else:
            drawn.append(circle or ball)
        found.shown |= {ball.name, cut[0].name} if circle is not None else {ball.name}
    # Of a particle that two rows hold, the curve is drawn and not the planes.
    planes = [
        one
        for one in free
        if one.one_sided or all(equal.count(k) == 1 and k not in found.curved for k in one.particles)
    ]
    for plane, polygon in polygons(merged(planes, size), particles, radii, size):
        found.shown.update(plane.rows)
        drawn.append(polygon)
    return drawn


def _circle(ball: DrawnSurface, one: RowPlane) -> DrawnSurface | None:
    """The circle in which a sphere and a plane meet."""
    lengths = np.linalg.norm(ball.frames[:, :3], axis=-1)
    if np.ptp(lengths, axis=1).max() > doubles.ZERO * lengths.max():
        return None
    count = max(len(ball.frames), len(one.normal), len(one.offset))
    centre = np.broadcast_to(ball.frames[:, 3], (count, 3))
    normal = np.broadcast_to(one.normal, (count, 3))
    height = one.offset - (centre * normal).sum(axis=-1)
    square = lengths[:, 0] ** 2 - height**2
    if not np.all(square > 0):
        return None
    u, v = basis(normal)
    radius = np.sqrt(square)[:, None]
    frames = np.stack([radius * u, radius * v, normal * radius, centre + height[:, None] * normal], axis=1)
    return DrawnSurface("circle", ball.name, ball.one_sided, frames)


def curves(
    model: nouns.Model, t: Floats, particles: Floats, view: Viewpoint, found: RowPictures
) -> list[DrawnSurface]:
    """The curves that two rows leave a particle, nets, and lines of walls, of rows that are not simple; particles (T,
    N, 3)."""
    drawn: list[DrawnSurface] = []
    size = 2 * view.size

    def face(points: Floats) -> Floats:
        """The height over the plane of the picture."""
        return np.asarray((points - view.centre) @ view.towards)

    for number in range(particles.shape[1] if particles.shape[1] <= MOST_TRIED else 0):
        track = particles[:, number]
        own = [*found.single.get(number, []), *_others(model, t, number, track, found)]
        for kind, rows in _cut_out(own, number, track, view, found):
            first, moves = rows[0], any(one.moves for one in rows)
            if moves and sum(len(one.corners) > 1 for one in drawn) >= MOST_MOVING:
                continue
            with np.errstate(all="ignore"):
                if kind == "net":
                    shapes = nets.over_track(first.function, track, size, moves)
                else:
                    functions = [one.function for one in rows]
                    if len(rows) == 1:
                        functions.append(face)
                    starts = track if moves else track[:1]
                    if first.one_sided and not moves:
                        starts = nets.touched(first.function, track)
                    points = nets.followed(functions, starts, size, view.centre)
                    shapes = [points] if points.shape[1] else []
            drawn += [DrawnSurface(kind, first.name, first.one_sided, STANDING, shape) for shape in shapes]
            if shapes:
                found.shown |= {one.name for one in rows}
            if shapes and len(rows) == 2:
                found.curved.add(number)
    return drawn


def _cut_out(
    own: list[SingleParticleRow], number: int, track: Floats, view: Viewpoint, found: RowPictures
) -> Iterator[tuple[Literal["line", "net"], list[SingleParticleRow]]]:
    """The rows of a particle that are drawn together: a curve on two of them, or on one in the plane of the picture, or
    a net."""

    def is_level(one: SingleParticleRow) -> bool:
        """True for an equation that only says in which plane the motion is."""
        if not view.flat or one.one_sided or not one.simple:
            return False
        slope = nets.gradient(one.function, track[:, None] if one.moves else track[:1, None], 2 * view.size)
        across = np.linalg.norm(np.cross(slope, view.towards), axis=-1)
        return bool(np.all(across <= doubles.ROOT * np.linalg.norm(slope, axis=-1)))

    level = [one for one in own if is_level(one)]
    own = [one for one in own if one not in level]
    led = equal = [one for one in own if not one.one_sided]
    if len(equal) + len(level) > 2:
        # Its position is given at every instant: it is led along what does not move, and where all rows are simple
        # the position is all that there is to be seen of them.
        led = [one for one in equal if not one.moves]
        if all(one.simple for one in equal):
            found.shown |= {one.name for one in equal}
    if len(led) == 2 and not level:
        # Not a curve that is drawn as a circle: on a sphere and a plane
        if not any(k == number and ball.kind == "sphere" for k, ball in found.rounds):
            yield "line", led
    elif view.flat and len(led) == 1 and not led[0].simple:
        yield "line", led
    for one in own:
        if not one.simple and not view.flat and (one.one_sided or len(equal) == 1):
            yield "net", [one]
        elif not one.simple and one.one_sided:
            yield "line", [one]


def _others(
    model: nouns.Model, t: Floats, number: int, track: Floats, found: RowPictures
) -> Iterator[SingleParticleRow]:
    """The rows not of the second degree that name this particle alone."""
    for row in found.others[:MOST_TRIED]:
        for instants, points in ((None, track[:1, None]), (t, track[:, None])):
            function = functools.partial(quadratic.value_at, model, row, instants, number)
            if np.isfinite(function(points)).all():
                yield SingleParticleRow(row.name, row.one_sided, False, instants is not None, function)
                break


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
        if self.one_sided != other.one_sided:
            return False
        if (self.normal.shape, self.offset.shape) != (other.normal.shape, other.offset.shape):
            return False
        return any(
            np.abs(self.normal - sign * other.normal).max() <= doubles.ZERO
            and np.abs(self.offset - sign * other.offset).max() <= doubles.ZERO * size
            for sign in ((1.0,) if self.one_sided else (1.0, -1.0))
        )


def alone(form: Quadratic) -> int | None:
    """The only particle in a form, or None."""
    parts = [form, form.under] if form.under is not None else [form]
    found = {i // 3 for part in parts for i in (*part.linear, *itertools.chain(*part.quadratic))}
    return found.pop() if len(found) == 1 else None


def _slope(form: Quadratic, particle: int) -> list[Coefficient]:
    """The linear coefficients of the three components of a particle."""
    return [form.linear.get(3 * particle + axis, quadratic.ZERO) for axis in range(3)]


def plane(row: PicturedRow, particle: int) -> RowPlane | None:
    """The plane of a row of the first degree."""
    form = row.form
    if not form.is_polynomial or form.quadratic:
        return None
    normal = np.atleast_2d(np.stack(np.broadcast_arrays(*_slope(form, particle)), axis=-1))
    length = np.linalg.norm(normal, axis=-1)
    if not np.all(length > 0):
        return None
    offset = np.atleast_1d(-form.constant / length)
    return RowPlane(
        row.name,
        row.one_sided,
        steady(normal / length[:, None]),
        steady(offset),
        {particle},
        [row.name],
    )


def quadric(row: PicturedRow, particle: int, track: Floats, size: float) -> DrawnSurface | None:
    """The sphere, ellipsoid or cylinder of a row of the second degree; track (k, 3) of the particle."""
    pair = quadratic.squared(row.form, row.one_sided)
    if pair is None:
        return None
    form = pair[0]
    A = np.zeros((3, 3))
    for (i, j), value in form.quadratic.items():
        A[i % 3, j % 3] += float(np.ravel(value)[0]) / 2
        A[j % 3, i % 3] += float(np.ravel(value)[0]) / 2
    *b, c = (np.atleast_1d(part) for part in np.broadcast_arrays(*_slope(form, particle), form.constant))
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
    return DrawnSurface(kind, row.name, row.one_sided, steady(frame))


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
    """The parts of planes that are drawn: around what moves on them, cut by walls that meet; radii (N,): of what
    touches them."""
    found = []
    for one in planes:
        tracks = particles[:, sorted(one.particles)]
        gap = (tracks * one.normal[:, None, :]).sum(axis=-1) - one.offset[:, None]
        near = float(np.abs(gap).min())
        if near > (FAR * size if one.one_sided else OFF * size):
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
        tracks = tracks.reshape(-1, 3)
        middle = (tracks.min(axis=0) + tracks.max(axis=0)) / 2
        u, v = basis(one.normal)
        off = (one.normal @ middle - one.offset)[:, None] * one.normal
        origin = middle - off - shift * one.normal
        # The reach along both directions, at the instant at which it is largest
        reach = np.array([float(np.abs((tracks - middle) @ part.T).max()) for part in (u, v)])
        half = np.maximum(reach + MARGIN * size, max(0.25 * reach.max(), MARGIN * size))
        rectangle = corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        if len(one.normal) == len(one.offset) == 1:
            for wall in walls:
                own = np.array([u[0] @ wall.normal[0], v[0] @ wall.normal[0]])
                level = float(wall.offset[0]) - float(origin[0] @ wall.normal[0]) - shift
                corners = _cut(corners, own, level)
        if len(corners) < 3:
            corners = rectangle
        shape = np.column_stack([corners, np.zeros(len(corners))])
        frames = steady(np.stack(np.broadcast_arrays(u, v, one.normal, origin), axis=1))
        found.append((one, DrawnSurface("plane", one.name, one.one_sided, frames, shape)))
    return found


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
