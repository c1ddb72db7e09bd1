"""The places where the motions of the two principles agree, and where they part."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lagcli.formulations.comparison import MOST_DIGITS, Agreement, Formulation
from lagcli.formulations.principles import PartingPoint

# Of the two principles the forces of constraint can be compared as a whole, and multipliers not: those of differential
# rows are not there, and those of holonomic ones share the force with them. Motions that agree are one motion.
COMPARED = ("r", "v", "R", "energy", "outputs")
MOTION = ("r", "v")


def digits(agreements: Mapping[str, Agreement]) -> float | None:
    """The fewest digits of positions and velocities."""
    found = [one.digits for kind, one in agreements.items() if kind in MOTION]
    return min(MOST_DIGITS, *found) if found else None


def parting(
    of: Mapping[str, str], first: Formulation, other: Formulation, tolerance: float
) -> PartingPoint | None:
    """The place where the positions of two tables over one grid part; `of`: columns with their kinds."""
    shared = [name for name, kind in of.items() if kind == "r" and name in other.columns]
    count = min(len(first.table), len(other.table))
    if not shared or not count:
        return None
    one, two = (run.table[:count, [run.columns.index(name) for name in shared]] for run in (first, other))
    gaps = np.abs(one - two)
    scale = float(np.abs(one).max(initial=0.0)) or 1.0
    apart = np.flatnonzero((gaps > tolerance * scale).any(axis=1))
    if not apart.size:
        return None
    row, place = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
    times = first.table[:count, 0]
    return PartingPoint(
        float(times[apart[0]]), float(gaps[row, place]), shared[int(place)], float(times[int(row)])
    )
