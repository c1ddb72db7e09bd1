"""Lines between points: rods, strings and springs that a model says, bars that linear rows are, and ties, the distances
that a choice of coordinates keeps."""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections.abc import Iterable, Iterator

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats, Integers
from lagcli.equations import rigid
from lagcli.linear import rank
from lagcli.model import model as nouns
from lagcli.output.animation import scene
from lagcli.output.animation.quadratic import PicturedRow, SquareDistance
from lagcli.output.animation.scene import Link

# A particle at a fixed distance from a point hangs on a rod or lies on a sphere: the name of the row says which. A
# second row makes a circle of the sphere; a wire by itself is what the particle hangs on.
ROUND = re.compile(r"(?i)(sphere|ball|bowl|dome|globe|shell|surface|cylinder|pipe|drum)")
CIRCULAR = re.compile(r"(?i)(hoop|ring|circle|wire|track)")
# All pairs of a rigid body of few particles are drawn, of more the nearest ones.
MOST_JOINED, NEAREST = 6, 3
MOST_TIED = 40  # particles whose pairs are looked at
NEAREST_TIED = 3  # of the particles at a constant distance, so many are joined to each
SAMPLES = 12  # instants at which a distance is compared


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Tie:
    """A particle at a constant distance from another one, or from a fixed position (3,)."""

    particle: int
    other: int | Floats
    length: float


class PointTable:
    """The points of a scene: the particles (T, N, 3), then those that rods and strings end at. is_run: rods keep their
    lengths; unenforced: the number of those that do not."""

    def __init__(self, particles: Floats, is_run: bool = True) -> None:
        self._positions, self.is_run, self.unenforced = particles, is_run, 0
        self.count = int(particles.shape[1])
        self.tracks: list[Floats] = [scene.steady(particles[:, k]) for k in range(self.count)]
        self._known: dict[tuple[tuple[tuple[int, float], ...], bytes], int] = {}

    def ends(self, found: SquareDistance) -> tuple[int, int] | None:
        """The points at both ends of u = sum weight_k r_k + shift, whose weights come to 0 or have one sign."""
        total = sum(found.weights.values())
        positive = {k: w for k, w in found.weights.items() if w > 0}
        negative = {k: -w for k, w in found.weights.items() if w < 0}
        heavy = sum(positive.values())
        nothing = np.zeros(3)
        if not negative or not positive:
            return self._mean(positive or negative, nothing), self.point_at(-found.shift / total)
        if abs(total) > doubles.ZERO * heavy:
            return None
        return self._mean(positive, nothing), self._mean(negative, -found.shift / heavy)

    def point_at(self, at: Floats) -> int:
        """The point at a position (3,) or (T, 3)."""
        return self._mean({}, at)

    def _mean(self, weights: dict[int, float], shift: Floats) -> int:
        """The point at the weighted mean of particles, moved by a shift; without weights the shift alone."""
        if len(weights) == 1 and not np.any(shift):
            return next(iter(weights))
        total = sum(weights.values())
        position = sum((w / total * self._positions[:, k] for k, w in weights.items()), np.zeros(3))
        # What is the same by its making is one point, whatever the motion is.
        key = tuple(sorted(weights.items())), (np.atleast_2d(shift) + 0.0).tobytes()
        if key not in self._known:
            self._known[key] = len(self.tracks)
            self.tracks.append(scene.steady(np.atleast_2d(position + shift)))
        return self._known[key]


def of_row(row: PicturedRow, found: SquareDistance, points: PointTable, is_led: bool) -> Link | None:
    """The rod or string that a row of a distance is, or None where it is a surface, or not satisfied in this run.
    is_led: there is another equation for its only particle."""
    if found.at_least:
        return None
    alone = len(found.weights) == 1
    is_round = ROUND.search(row.name) or (is_led and CIRCULAR.search(row.name))
    if alone and (is_round or len(found.axes) < 3):
        return None
    ends = points.ends(found)
    if ends is None:
        return None
    # By how much |u| is larger than the distance of the ends
    factor = sum(w for w in found.weights.values() if w > 0) or -sum(found.weights.values())
    length = found.length / factor
    one, two = (points.tracks[end] for end in ends)
    off = np.linalg.norm(one - two, axis=-1) - length
    size = float(np.abs(length).max())
    if size == 0.0:
        return None
    is_off = off.max() > scene.OFF * size or (not found.at_most and off.min() < -scene.OFF * size)
    if points.is_run and is_off:
        points.unenforced += 1
        return None
    first = float(np.ravel(length)[0])
    if not found.at_most:
        return Link("rod", row.name, ends, first)
    return Link("string", row.name, ends, first, np.ravel(length) if np.ptp(length) else None)


def of_sum(name: str, distances: Iterable[SquareDistance], points: PointTable) -> list[Link]:
    """The parts of a string whose lengths have one sum, taut; none where one of them has no ends."""
    found = [points.ends(one) for one in distances]
    known = [ends for ends in found if ends is not None]
    if len(known) < len(found):
        return []
    # From pulley to pulley, where these are no particles.
    pulleys = [end for ends in known for end in ends if end >= points.count]
    if len(pulleys) == len(known):
        known += [pair for pair in itertools.pairwise(pulleys) if pair[0] != pair[1]]
    return [Link("string", name, ends) for ends in known]


def of_bodies(model: nouns.Model, particles: Floats) -> Iterable[Link]:
    """The rods of rigid bodies; particles (T, N, 3)."""
    for body in model.rigid:
        positions = particles[0, list(body.particles)]
        count = len(body.particles)
        if count <= MOST_JOINED:
            pairs = set(itertools.combinations(range(count), 2))
        else:
            base = rigid.geometry(positions)
            pairs = {(min(a, b), max(a, b)) for a, b in ((base.base[i], base.base[j]) for i, j in base.pairs)}
            for k in range(count):
                near = np.argsort(np.linalg.norm(positions - positions[k], axis=1), kind="stable")
                pairs |= {(min(k, int(i)), max(k, int(i))) for i in near[1 : NEAREST + 1]}
        for i, j in sorted(pairs):
            length = float(np.linalg.norm(positions[i] - positions[j]))
            yield Link("rod", body.name, (body.particles[i], body.particles[j]), length)


def contact_radii(contacts: Iterable[tuple[int, int, float]], count: int) -> Floats:
    """The radius of each particle (count,) that keeps its distance from others like a hard sphere, nan for others.

    contacts: two particles and their distance, in space or along one line.
    """
    radii = np.full(count, np.nan)
    for a, b, distance in contacts:
        radii[[a, b]] = np.fmin(radii[[a, b]], distance / 2)
    return radii


def bars(rows: Iterable[PicturedRow], points: PointTable) -> Iterator[tuple[Link, set[str]]]:
    """The bars of rows sum_k weight_k r_k + shift = 0 of two or three particles, which together hold for all three
    components with the same weights, with the names of these rows."""
    found: dict[tuple[tuple[int, float], ...], dict[int, tuple[Floats, str]]] = {}
    for row in rows:
        form = row.form
        if row.one_sided or not form.is_polynomial or form.quadratic:
            continue
        axes = {i % 3 for i in form.linear}
        if len(axes) != 1 or len(form.linear) not in (2, 3) or any(map(np.ptp, form.linear.values())):
            continue
        terms = {i // 3: float(np.ravel(value)[0]) for i, value in sorted(form.linear.items())}
        first = next(iter(terms.values()))
        key = tuple((k, round(weight / first, 12)) for k, weight in terms.items())
        found.setdefault(key, {})[axes.pop()] = np.asarray(form.constant / first), row.name
    for key, parts in found.items():
        if len(parts) < 3:
            continue
        weights, particles = dict(key), [k for k, _ in key]
        shift = np.stack(np.broadcast_arrays(*(parts[axis][0] for axis in range(3))), axis=-1)
        total = sum(weights.values())
        balanced = abs(total) <= doubles.ZERO * max(map(abs, weights.values()))
        joined: list[tuple[int, int]] = []
        if len(particles) == 2 and balanced:
            joined = [(particles[0], particles[1])]
        elif len(particles) == 2:
            pivot = points.point_at(-shift / total)
            joined = [(k, pivot) for k in particles]
        elif balanced and not np.any(shift):
            positive = [k for k in particles if weights[k] > 0]
            (middle,) = positive if len(positive) == 1 else [k for k in particles if weights[k] < 0]
            joined = [(middle, k) for k in particles if k != middle]
        names = {name for _, name in parts.values()}
        for ends in joined:
            yield Link("rod", min(names), ends), names


def ties(samples: Floats, numbers: Integers) -> list[Tie]:
    """The constant distances of particles with these numbers, at samples (S, K, 3)."""
    if not 0 < len(numbers) <= MOST_TIED:
        return []
    size = float(np.abs(samples - samples.mean(axis=(0, 1))).max()) or 1.0
    pairs: dict[int, list[tuple[float, int]]] = {}
    for i in range(len(numbers)):
        apart = np.linalg.norm(samples - samples[:, i : i + 1], axis=-1)
        rounding = doubles.ZERO * size
        constant = np.flatnonzero((np.ptp(apart, axis=0) <= rounding) & (apart[0] > rounding))
        pairs[i] = sorted((float(apart[0, j]), int(j)) for j in constant)[:NEAREST_TIED]
    joined = {(min(i, j), max(i, j)): length for i, near in pairs.items() for length, j in near}
    found = [Tie(int(numbers[i]), int(numbers[j]), length) for (i, j), length in sorted(joined.items())]
    pivots = [(number, _pivot(samples[:, i], size)) for i, number in enumerate(numbers.tolist())]
    return found + [Tie(number, *pivot) for number, pivot in pivots if pivot is not None]


def _pivot(positions: Floats, size: float) -> tuple[Floats, float] | None:
    """The fixed position nearest to these from which they all have one distance, and the distance."""
    middle = positions.mean(axis=0)
    offsets = positions - middle
    if np.abs(offsets).max() <= doubles.ZERO * size:
        return None
    square = (offsets**2).sum(axis=1)
    # |p|^2 = 2 c . p + d; the mean is taken off, so that the solution of least norm lies in the plane of the positions.
    right, scale = (square - square.mean()) / 2, float(np.linalg.norm(offsets))
    found = rank.space(offsets / scale, is_whole=False)
    centre = found.step(right / scale)
    distances = np.linalg.norm(offsets - centre, axis=1)
    if found.low < 2 or np.ptp(distances) > doubles.ZERO * size:
        return None
    return middle + centre, float(distances.mean())
