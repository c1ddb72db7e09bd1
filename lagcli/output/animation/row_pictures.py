"""The rows of a model as what is drawn of them: rods, planes, round surfaces, radii of hard spheres; else curves and
nets."""

from __future__ import annotations

import collections
import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.model import model as nouns
from lagcli.output.animation import links, nets, quadratic_algebra, quadratic_form, rounds
from lagcli.output.animation.links import PointTable
from lagcli.output.animation.nets import Function
from lagcli.output.animation.quadratic_algebra import PicturedRow
from lagcli.output.animation.quadratic_form import SquareDistance
from lagcli.output.animation.rounds import RowPlane
from lagcli.output.animation.scene import STANDING, DrawnSurface, Link, Viewpoint

Floats = npt.NDArray[np.float64]
# Rows of models of more particles are not tried one by one for curves.
MOST_TRIED = 60
# Shapes that move take room in a page for each instant.
MOST_MOVING = 6


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
    """links: rods and strings; planes and rounds of single particles, rounds with the particle; pairs, lines: of
    contacts between two particles; single: the rows of each particle alone, but for rods; others: rows that are not of
    the second degree; curved: particles whose curve is drawn; shown: the names of rows that are seen in the picture."""

    links: list[Link] = dataclasses.field(default_factory=list)
    planes: list[RowPlane] = dataclasses.field(default_factory=list)
    rounds: list[tuple[int, DrawnSurface]] = dataclasses.field(default_factory=list)
    pairs: list[SquareDistance] = dataclasses.field(default_factory=list)
    lines: list[tuple[int, int, float]] = dataclasses.field(default_factory=list)
    single: dict[int, list[SingleParticleRow]] = dataclasses.field(default_factory=dict)
    others: list[PicturedRow] = dataclasses.field(default_factory=list)
    curved: set[int] = dataclasses.field(default_factory=set)
    shown: set[str] = dataclasses.field(default_factory=set)


def pictures(
    model: nouns.Model, t: Floats, particles: Floats, points: PointTable, size: float
) -> RowPictures:
    """The pictures of the rows of a model whose particles are at (T, N, 3) at t (T,)."""
    found, linear = RowPictures(), list[PicturedRow]()
    rows = list(quadratic_algebra.rows(model, t))
    equations = [rounds.alone(row.form) for row in rows if row.kind == "holonomic"]
    counts = collections.Counter(k for k in equations if k is not None)
    for row in rows:
        if not row.form.known:
            strings = links.of_sum(row.name, quadratic_algebra.summed(model, t, row), points)
            found.links += strings
            if strings:
                found.shown.add(row.name)
            else:
                found.others.append(row)
            continue
        distance = quadratic_form.distance(row.form, row.kind == "inequality")
        particle = rounds.alone(row.form)
        is_led = particle is not None and counts[particle] > 1
        link = links.of_row(row, distance, points, is_led) if distance is not None else None
        if link is not None:
            found.links.append(link)
            found.shown.add(row.name)
        elif particle is not None:
            _of_one_particle(found, row, particle, particles[:, particle], size)
        elif distance is not None and distance.at_least and len(distance.weights) == 2:
            found.pairs.append(distance)
            found.shown.add(row.name)
        elif (line := _line_contact(row, particles, size)) is not None:
            found.lines.append(line)
            found.shown.add(row.name)
        else:
            linear.append(row)
    for bar, names in links.bars(linear, points):
        found.links.append(bar)
        found.shown |= names
    found.links += links.of_bodies(model, particles)
    found.links += links.of_springs(quadratic_algebra.springs(model, t), points)
    return found


def _of_one_particle(found: RowPictures, row: PicturedRow, particle: int, track: Floats, size: float) -> None:
    """A row of one particle: a plane, something round, or anything else of the second degree."""
    one_sided = row.kind == "inequality"
    flat = rounds.plane(row, particle)
    ball = None if flat is not None else rounds.quadric(row, particle, track, size)
    if flat is not None:
        found.planes.append(flat)
    elif ball is not None:
        found.rounds.append((particle, ball))
    simple = flat is not None or ball is not None
    single = SingleParticleRow(row.name, one_sided, simple, not row.form.is_at_rest, row.form.values)
    found.single.setdefault(particle, []).append(single)


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
    if float(np.abs(apart).max()) > doubles.ROOT * size:
        return None
    return i // 3, j // 3, -constant / abs(factor)


def surfaces(found: RowPictures, particles: Floats, radii: Floats, view: Viewpoint) -> list[DrawnSurface]:
    """The surfaces and curves that are drawn; particles (T, N, 3), radii (N,) of hard spheres."""
    size, drawn = 2 * view.size, list[DrawnSurface]()
    free = [one for one in found.planes if not (view.flat and _is_face(one, view))]
    # The plane of the picture is seen in it.
    found.shown |= {one.name for one in found.planes} - {one.name for one in free}
    equal = [k for one in free if not one.one_sided for k in one.particles]
    equal += [k for k, ball in found.rounds if not ball.one_sided]
    for particle, ball in found.rounds:
        cut = [one for one in found.planes if particle in one.particles and not one.one_sided]
        circle = _circle(ball, cut[0]) if ball.kind == "sphere" and cut and not ball.one_sided else None
        if circle is None and not ball.one_sided and equal.count(particle) > 1 and ball.kind != "sphere":
            continue  # its curve is drawn
        drawn.append(circle or (_flat_circle(ball, view) if view.flat else None) or ball)
        found.shown |= {ball.name, cut[0].name} if circle is not None else {ball.name}
    # Of a particle that two rows hold, the curve is drawn and not the planes.
    planes = [
        one
        for one in free
        if one.one_sided or all(equal.count(k) == 1 and k not in found.curved for k in one.particles)
    ]
    for plane, polygon in rounds.polygons(rounds.merged(planes, size), particles, radii, size):
        found.shown.update(plane.rows)
        drawn.append(polygon)
    return drawn


def _is_face(one: RowPlane, view: Viewpoint) -> bool:
    """True for the plane in which the whole motion lies."""
    return not one.one_sided and bool(np.all(np.abs(np.abs(one.normal @ view.towards) - 1.0) <= doubles.ROOT))


def _flat_circle(ball: DrawnSurface, view: Viewpoint) -> DrawnSurface | None:
    """The circle in which a sphere meets the plane of the motion."""
    if ball.kind != "sphere":
        return None
    normal = np.broadcast_to(view.towards, (len(ball.frames), 3))
    offset = np.full(len(ball.frames), float(view.centre @ view.towards))
    return _circle(ball, RowPlane(ball.name, ball.one_sided, normal, offset, set()))


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
    u, v = rounds.basis(normal)
    radius = np.sqrt(square)[:, None]
    frames = np.stack([radius * u, radius * v, normal * radius, centre + height[:, None] * normal], axis=1)
    return DrawnSurface("circle", ball.name, ball.one_sided, frames)


@dataclasses.dataclass(slots=True, eq=False)
class CurvePictures:
    """The drawings of rows that are not simple. t (T,), particles (T, N, 3)."""

    model: nouns.Model
    t: Floats
    particles: Floats
    view: Viewpoint
    found: RowPictures
    drawn: list[DrawnSurface] = dataclasses.field(default_factory=list)

    def all(self) -> list[DrawnSurface]:
        """The curves that two rows leave a particle, nets, and the lines of walls in the plane of a motion."""
        if self.particles.shape[1] <= MOST_TRIED:
            for number in range(self.particles.shape[1]):
                self._of_particle(number, self.particles[:, number])
        return self.drawn

    def _of_particle(self, number: int, track: Floats) -> None:
        flat = self.view.flat
        own = [*self.found.single.get(number, []), *self._others(number, track)]
        level = [one for one in own if flat and self._is_level(one, track)]
        own = [one for one in own if one not in level]
        equal = [one for one in own if not one.one_sided]
        led = equal
        if (
            len(equal) + len(level) > 2
        ):  # its position is given at every instant: it is led along what does not move
            led = [one for one in equal if not one.moves]
            if all(one.simple for one in equal):  # and the position is all that there is to be seen of them
                self.found.shown |= {one.name for one in equal}
        if len(led) == 2 and not level:
            # A particle whose curve is drawn as a circle: on a sphere and a plane
            if not any(k == number and ball.kind == "sphere" for k, ball in self.found.rounds) and self._line(
                led, track, []
            ):
                self.found.curved.add(number)
        elif flat and len(led) == 1 and not led[0].simple:
            self._line(led, track, [self._face()])
        for one in own:
            if not flat and not one.simple and (one.one_sided or len(equal) == 1):
                self._figure_page(one, track)
            elif one.one_sided and not one.simple:
                self._line([one], track if one.moves else nets.touched(one.function, track), [self._face()])

    def _is_level(self, one: SingleParticleRow, track: Floats) -> bool:
        """True for an equation that only says in which plane the motion is."""
        if one.one_sided or not one.simple:
            return False
        points = track[:, None] if one.moves else track[:1, None]
        slope = nets.gradient(one.function, points, 2 * self.view.size)
        across = np.linalg.norm(np.cross(slope, self.view.towards), axis=-1)
        return bool(np.all(across <= doubles.ROOT * np.linalg.norm(slope, axis=-1)))

    def _others(self, number: int, track: Floats) -> Iterator[SingleParticleRow]:
        """The rows not of the second degree that name this particle alone."""
        for row in self.found.others[:MOST_TRIED]:
            for t, points in ((None, track[:1, None]), (self.t, track[:, None])):
                function = functools.partial(quadratic_algebra.value_at, self.model, row, t, number)
                values = function(points)
                if values is not None:
                    if np.isfinite(values).all():
                        one_sided = row.kind == "inequality"
                        yield SingleParticleRow(row.name, one_sided, False, t is not None, _numbers(function))
                    break

    def _line(self, rows: Sequence[SingleParticleRow], track: Floats, more: list[nets.Function]) -> bool:
        """Draw the curve of rows, with which others cut it out; False where there is none."""
        functions = [*(one.function for one in rows), *more]
        moves = any(one.moves for one in rows)
        if moves and self._moving() >= MOST_MOVING:
            return False
        view = self.view
        with np.errstate(all="ignore"):
            points = nets.followed(functions, track if moves else track[:1], 2 * view.size, view.centre)
        if points.shape[1]:
            self.drawn.append(DrawnSurface("line", rows[0].name, rows[0].one_sided, STANDING, points))
            self.found.shown |= {one.name for one in rows}
        return bool(points.shape[1])

    def _figure_page(self, row: SingleParticleRow, track: Floats) -> None:
        if row.moves and self._moving() >= MOST_MOVING:
            return
        with np.errstate(all="ignore"):
            found = nets.over_track(row.function, track, 2 * self.view.size, row.moves)
        for nodes in found:
            self.drawn.append(DrawnSurface("net", row.name, row.one_sided, STANDING, nodes))
            self.found.shown.add(row.name)

    def _moving(self) -> int:
        return sum(len(one.corners) > 1 for one in self.drawn)

    def _face(self) -> nets.Function:
        return lambda points: np.asarray((points - self.view.centre) @ self.view.towards)


def _numbers(function: Callable[[Floats], Floats | None]) -> nets.Function:
    def values(points: Floats) -> Floats:
        found = function(points)
        return np.full(points.shape[:-1], np.nan) if found is None else found

    return values
