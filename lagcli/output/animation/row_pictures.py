"""The rows of a model as what is drawn of them: rods, planes, round surfaces, curves, radii of hard spheres."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from lagcli.model import model as nouns
from lagcli.output.animation import links, quadratic_algebra, rounds, sheets, square_distance, wires
from lagcli.output.animation.links import PointTable
from lagcli.output.animation.quadratic_algebra import PicturedRow
from lagcli.output.animation.rounds import HeldPlane
from lagcli.output.animation.scene import DrawnSurface, Link, Viewpoint
from lagcli.output.animation.square_distance import SquareDistance

Floats = npt.NDArray[np.float64]
STILL = 1e-6  # a part of the size: what moves less along a line does not move there
# Rows of models of more particles are not tried one by one for curves.
MOST_TRIED = 60
# The directions of space, for shapes whose corners are places.
STANDING = np.concatenate([np.eye(3), np.zeros((1, 3))])[None]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class LoneRow:
    """A row that names one particle and does not move: its value at places (k, 3)."""

    name: str
    one_sided: bool
    simple: bool
    function: wires.Function


@dataclasses.dataclass(slots=True, eq=False)
class RowPictures:
    """links: rods and strings; planes and rounds of single particles, rounds with the particle; pairs, lines: of
    contacts between two particles; lone: the rows of each particle alone, but for rods; others: rows that are not of
    the second degree; curved: particles whose curve is drawn."""

    links: list[Link] = dataclasses.field(default_factory=list)
    planes: list[HeldPlane] = dataclasses.field(default_factory=list)
    rounds: list[tuple[int, DrawnSurface]] = dataclasses.field(default_factory=list)
    pairs: list[SquareDistance] = dataclasses.field(default_factory=list)
    lines: list[tuple[int, int, float]] = dataclasses.field(default_factory=list)
    lone: dict[int, list[LoneRow]] = dataclasses.field(default_factory=dict)
    others: list[PicturedRow] = dataclasses.field(default_factory=list)
    curved: set[int] = dataclasses.field(default_factory=set)


def pictures(
    model: nouns.Model, t: Floats, particles: Floats, points: PointTable, size: float
) -> RowPictures:
    """The pictures of the rows of a model whose particles are at (T, N, 3) at t (T,)."""
    found = RowPictures()
    for row in quadratic_algebra.rows(model, t):
        if not row.form.known:
            strings = links.of_sum(row.name, quadratic_algebra.summed(model, t, row), points)
            found.links += strings
            if not strings:
                found.others.append(row)
            continue
        distance = square_distance.found(row.form, row.kind == "inequality")
        link = links.of_row(row, distance, points) if distance is not None else None
        particle = rounds.alone(row.form)
        if link is not None:
            found.links.append(link)
        elif particle is not None:
            _lone(found, row, particle, particles[:, particle], size)
        elif distance is not None and distance.at_least and len(distance.weights) == 2:
            found.pairs.append(distance)
        elif (line := _line_contact(row, particles, size)) is not None:
            found.lines.append(line)
    found.links += links.of_bodies(model, particles)
    found.links += links.of_springs(quadratic_algebra.springs(model, t), points)
    return found


def _lone(found: RowPictures, row: PicturedRow, particle: int, track: Floats, size: float) -> None:
    """A row of one particle: a plane, something round, or anything else of the second degree."""
    one_sided = row.kind == "inequality"
    flat = rounds.plane(row, particle)
    ball = None if flat is not None else rounds.quadric(row, particle, track, size)
    if flat is not None:
        found.planes.append(flat)
    elif ball is not None:
        found.rounds.append((particle, ball))
    if row.form.is_at_rest:
        simple = flat is not None or ball is not None
        found.lone.setdefault(particle, []).append(LoneRow(row.name, one_sided, simple, row.form.values))


def _line_contact(row: PicturedRow, particles: Floats, size: float) -> tuple[int, int, float] | None:
    """Two particles on one line along an axis that keep a distance: a.x - b.x >= D."""
    form = row.form
    if row.kind != "inequality" or not form.is_polynomial or form.quadratic or len(form.linear) != 2:
        return None
    (i, a), (j, b) = form.linear.items()
    if not form.is_at_rest or i % 3 != j % 3:
        return None
    factor, other, constant = (float(np.ravel(value)[0]) for value in (a, b, form.constant))
    if factor != -other or constant >= 0:
        return None
    apart = np.delete(particles[:, i // 3] - particles[:, j // 3], i % 3, axis=1)
    if float(np.abs(apart).max()) > STILL * size:
        return None
    return i // 3, j // 3, -constant / abs(factor)


def surfaces(found: RowPictures, particles: Floats, radii: Floats, view: Viewpoint) -> list[DrawnSurface]:
    """The surfaces and curves that are drawn; particles (T, N, 3), radii (N,) of hard spheres."""
    size, drawn = 2 * view.size, list[DrawnSurface]()
    free = [one for one in found.planes if not (view.flat and _is_face(one, view))]
    equal = [k for one in free if not one.one_sided for k in one.particles]
    equal += [k for k, ball in found.rounds if not ball.one_sided]
    for particle, ball in found.rounds:
        cut = [one for one in found.planes if particle in one.particles and not one.one_sided]
        circle = _circle(ball, cut[0]) if ball.kind == "sphere" and cut and not ball.one_sided else None
        if circle is None and not ball.one_sided and equal.count(particle) > 1 and ball.kind != "sphere":
            continue  # its curve is drawn
        drawn.append(circle or (_flat_circle(ball, view) if view.flat else None) or ball)
    # Of a particle that two rows hold, the curve is drawn and not the planes.
    planes = [
        one
        for one in free
        if one.one_sided or all(equal.count(k) == 1 and k not in found.curved for k in one.particles)
    ]
    return drawn + rounds.polygons(rounds.merged(planes, size), particles, radii, size)


def _is_face(one: HeldPlane, view: Viewpoint) -> bool:
    """True for the plane in which the whole motion lies."""
    return not one.one_sided and bool(np.all(np.abs(np.abs(one.normal @ view.towards) - 1.0) <= STILL))


def _flat_circle(ball: DrawnSurface, view: Viewpoint) -> DrawnSurface | None:
    """The circle in which a sphere meets the plane of the motion."""
    if ball.kind != "sphere":
        return None
    normal = np.broadcast_to(view.towards, (len(ball.frames), 3))
    offset = np.full(len(ball.frames), float(view.centre @ view.towards))
    return _circle(ball, HeldPlane(ball.name, ball.one_sided, normal, offset, set()))


def _circle(ball: DrawnSurface, one: HeldPlane) -> DrawnSurface | None:
    """The circle in which a sphere and a plane meet."""
    lengths = np.linalg.norm(ball.frames[:, :3], axis=-1)
    if np.ptp(lengths, axis=1).max() > rounds.SAME * lengths.max():
        return None
    count = max(len(ball.frames), len(one.normal), len(one.offset))
    centre = np.broadcast_to(ball.frames[:, 3], (count, 3))
    normal = np.broadcast_to(one.normal, (count, 3))
    height = one.offset - (centre * normal).sum(axis=-1)
    square = lengths[:, 0] ** 2 - height**2
    if not np.all(square > 0):
        return None
    u, v = rounds.basis(normal)
    radius = np.sqrt(square)[:, None]
    frames = np.stack([radius * u, radius * v, normal * radius, centre + height[:, None] * normal], axis=1)
    return DrawnSurface("circle", ball.name, ball.one_sided, frames)


def curves(
    model: nouns.Model, found: RowPictures, particles: Floats, view: Viewpoint
) -> Iterator[DrawnSurface]:
    """The curves that two rows leave a particle, and the lines of walls in the plane of a motion, where they do not
    move and are nothing simpler."""
    if particles.shape[1] > MOST_TRIED:
        return
    size = 2 * view.size
    for number in range(particles.shape[1]):
        track = particles[:, number]
        own = found.lone.get(number, []) + list(_others(model, found, number, track[0]))
        own = [one for one in own if not (view.flat and _is_level(one, track, view))]
        equal = [one for one in own if not one.one_sided]
        if len(equal) == 2:
            if not _is_circle(found, number):
                found.curved.add(number)
                yield from _line([one.function for one in equal], equal[0], track[0], view)
        elif view.flat and len(equal) == 1 and not equal[0].simple:
            yield from _line([equal[0].function, _face(view)], equal[0], track[0], view)
        for one in own:
            if not view.flat and not one.simple and (one.one_sided or len(equal) == 1):
                yield from _sheet(one, track, size)
            elif one.one_sided and not one.simple:
                yield from _line([one.function, _face(view)], one, _touched(one.function, track), view)


def _is_circle(found: RowPictures, number: int) -> bool:
    """True for a particle whose curve is drawn as a circle: on a sphere and a plane."""
    return any(k == number and ball.kind == "sphere" for k, ball in found.rounds)


def _is_level(one: LoneRow, track: Floats, view: Viewpoint) -> bool:
    """True for an equation that only says in which plane the motion is."""
    if one.one_sided or not one.simple:
        return False
    slope = wires.gradient(one.function, track[0], 2 * view.size)
    return bool(np.linalg.norm(np.cross(slope, view.towards)) <= STILL * np.linalg.norm(slope))


def _others(model: nouns.Model, found: RowPictures, number: int, place: Floats) -> Iterator[LoneRow]:
    """The rows not of the second degree that name this particle alone and do not depend on t."""
    for row in found.others[:MOST_TRIED]:
        function = functools.partial(quadratic_algebra.value_at, model, row.law, row.row, number)
        values = function(place[None])
        if values is not None and np.isfinite(values).all():
            yield LoneRow(row.name, row.kind == "inequality", False, _numbers(function))


def _line(
    functions: list[wires.Function], row: LoneRow, start: Floats, view: Viewpoint
) -> Iterator[DrawnSurface]:
    with np.errstate(all="ignore"):
        points = wires.followed(functions, start, 2 * view.size, view.centre)
    if len(points) > 2:
        yield DrawnSurface("line", row.name, row.one_sided, STANDING, points)


def _sheet(row: LoneRow, track: Floats, size: float) -> Iterator[DrawnSurface]:
    with np.errstate(all="ignore"):
        corners = sheets.triangles(row.function, track, size)
    if len(corners):
        yield DrawnSurface("net", row.name, row.one_sided, STANDING, corners)


def _face(view: Viewpoint) -> wires.Function:
    return lambda places: (places - view.centre) @ view.towards


def _touched(function: wires.Function, track: Floats) -> Floats:
    """The place of a track (T, 3) that is nearest to a wall."""
    with np.errstate(all="ignore"):
        gap = np.abs(np.broadcast_to(function(track), len(track)))
    return np.asarray(track[int(np.argmin(np.where(np.isfinite(gap), gap, np.inf)))])


def _numbers(function: Callable[[Floats], Floats | None]) -> wires.Function:
    def values(places: Floats) -> Floats:
        found = function(places)
        return np.full(len(places), np.nan) if found is None else found

    return values
