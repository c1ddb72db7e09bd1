"""Distances that a choice of coordinates keeps: found by places at coordinates drawn at random."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
KEPT = 1e-9  # a part of the distance: what varies less at all samples does not vary
MOST = 40  # particles whose pairs are looked at
NEAREST = 3  # of the particles at a kept distance, so many are joined to each
SAMPLES = 12  # instants at which a distance is compared


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Tie:
    """A particle at a kept distance from another one, or from a fixed place (3,)."""

    particle: int
    other: int | Floats
    length: float


def ties(samples: Floats, numbers: npt.NDArray[np.int64]) -> list[Tie]:
    """The kept distances of particles with these numbers, at samples (S, K, 3)."""
    if not 0 < len(numbers) <= MOST:
        return []
    found: list[Tie] = []
    size = float(np.abs(samples - samples.mean(axis=(0, 1))).max()) or 1.0
    pairs: dict[int, list[tuple[float, int]]] = {}
    for i in range(len(numbers)):
        apart = np.linalg.norm(samples - samples[:, i : i + 1], axis=-1)
        kept = np.flatnonzero((np.ptp(apart, axis=0) <= KEPT * size) & (apart[0] > KEPT * size))
        pairs[i] = sorted((float(apart[0, j]), int(j)) for j in kept)[:NEAREST]
    joined = {(min(i, j), max(i, j)): length for i, near in pairs.items() for length, j in near}
    found += [Tie(int(numbers[i]), int(numbers[j]), length) for (i, j), length in sorted(joined.items())]
    for i in range(len(numbers)):
        pivot = _pivot(samples[:, i], size)
        if pivot is not None:
            found.append(Tie(int(numbers[i]), *pivot))
    return found


def _pivot(places: Floats, size: float) -> tuple[Floats, float] | None:
    """The fixed place nearest to these from which they all have one distance, and the distance."""
    middle = places.mean(axis=0)
    offsets = places - middle
    if np.abs(offsets).max() <= KEPT * size:
        return None
    square = (offsets**2).sum(axis=1)
    # |p|^2 = 2 c . p + d; the mean is taken off, so that the solution of least norm lies in the plane of the places.
    matrix, right = offsets, (square - square.mean()) / 2
    centre, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=1e-9)
    distances = np.linalg.norm(offsets - centre, axis=1)
    if rank < 2 or np.ptp(distances) > KEPT * size:
        return None
    return middle + centre, float(distances.mean())
