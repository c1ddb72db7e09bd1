"""Curves and nets: what rows that are nothing simpler leave a particle, also where they move."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.model import model as nouns
from lagcli.output.animation import nets, quadratic_algebra
from lagcli.output.animation.row_pictures import RowPictures, SingleParticleRow
from lagcli.output.animation.scene import STANDING, DrawnSurface, Viewpoint

Floats = npt.NDArray[np.float64]
# Rows of models of more particles are not tried one by one for curves.
MOST_TRIED = 60
# Shapes that move take room in a page for each instant.
MOST_MOVING = 6


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
