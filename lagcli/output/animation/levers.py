"""Bars that linear rows are: levers with a pivot, particles that stay beside another one or halfway between two."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from lagcli.output.animation import square_distance
from lagcli.output.animation.links import PointTable
from lagcli.output.animation.quadratic_algebra import PicturedRow
from lagcli.output.animation.scene import Link

Floats = npt.NDArray[np.float64]
Weights = dict[int, float]


def bars(rows: Iterable[PicturedRow], points: PointTable) -> Iterator[tuple[Link, set[str]]]:
    """The bars of rows sum_k weight_k r_k + shift = 0 of two or three particles in all components, with the names of
    these rows."""
    for weights, shift, names in _vectors(rows):
        for ends in _ends(weights, shift, points):
            yield Link("rod", min(names), ends), names


def _ends(weights: Weights, shift: Floats, points: PointTable) -> list[tuple[int, int]]:
    """The pairs of points that a bar joins; none where the rows are no bar."""
    total, heavy = sum(weights.values()), max(map(abs, weights.values()))
    balanced = abs(total) <= square_distance.SAME * heavy
    particles = list(weights)
    if len(particles) == 2:
        if balanced:
            return [(particles[0], particles[1])]
        pivot = points.place(-shift / total)
        return [(k, pivot) for k in particles]
    if not balanced or np.any(shift):
        return []
    positive = [k for k in particles if weights[k] > 0]
    (middle,) = positive if len(positive) == 1 else [k for k in particles if weights[k] < 0]
    return [(middle, k) for k in particles if k != middle]


def _vectors(rows: Iterable[PicturedRow]) -> Iterator[tuple[Weights, Floats, set[str]]]:
    """Rows of the first degree that together hold for all three components with the same weights of two or three
    particles: the weights, the shift (3,) or (T, 3), and their names."""
    found: dict[tuple[tuple[int, float], ...], dict[int, tuple[Floats, str]]] = {}
    for row in rows:
        form = row.form
        if row.kind != "holonomic" or not form.is_polynomial or form.quadratic:
            continue
        axes = {i % 3 for i in form.linear}
        if len(axes) != 1 or len(form.linear) not in (2, 3) or any(map(np.ptp, form.linear.values())):
            continue
        weights = {i // 3: float(np.ravel(value)[0]) for i, value in sorted(form.linear.items())}
        first = next(iter(weights.values()))
        key = tuple((k, round(weight / first, 12)) for k, weight in weights.items())
        found.setdefault(key, {})[axes.pop()] = np.asarray(form.constant / first), row.name
    for key, parts in found.items():
        if len(parts) == 3:
            shift = np.stack(np.broadcast_arrays(*(parts[axis][0] for axis in range(3))), axis=-1)
            yield dict(key), shift, {name for _, name in parts.values()}
