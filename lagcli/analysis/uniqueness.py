"""The multipliers that are unique at generic points of the constraint surface, and the null vectors of B^T by name.

lambda_i is unique if and only if no null vector has a weight on row i (D.13-D.22: B^T lambda is given, and a null
vector makes no force). The start may be special: a weight may vanish there, and rows may be dependent there alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli import progress
from lagcli.analysis.codimension import Codimension
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear import independent_rows, metric_rows, rank
from lagcli.linear.metric_rows import MetricRows
from lagcli.start import initial, sample_points
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class NullVector:
    """Rows of which sum weights_i B_i = 0, as few as can be; weights of the rows as they are written, the largest 1
    in size, at the start, or where that is special at a generic point. One that vanishes there does not elsewhere."""

    rows: tuple[str, ...]
    weights: tuple[float, ...]

    def as_json(self) -> dict[str, Any]:
        """An entry of `dependences`."""
        return {"rows": list(self.rows), "weights": list(self.weights)}


@dataclasses.dataclass(frozen=True, slots=True)
class Multipliers:
    """For each row whether its multiplier is unique, None where that is undecided; a basis of null vectors."""

    unique: tuple[bool | None, ...]
    null_vectors: tuple[NullVector, ...]


@progress.phase("looking for multipliers that are not unique")
def multipliers(
    system: System, numeric: NumericSystem, points: Sequence[State], surface: Codimension
) -> Multipliers:
    """The multipliers of all rows; `points` of the surface, the start first, `surface` what is known of it there."""
    count, holonomic = len(system.rows.rows), list(range(system.holonomic_count))
    found = _ranks(numeric, points)
    if max(one.low for one, _ in found) < count and len(points) == 1:
        # Of many rows a walk takes long.
        most = 1 if count > metric_rows.PARAMETERS.dense else sample_points.PARAMETERS.points
        later = initial.later(system)
        found = _ranks(numeric, sample_points.along(numeric, points[0], holonomic, later, most))
    best, rows = max(found, key=lambda one: one[0].low)
    # Rows of which no null vector is known, and none excluded.
    unsure: set[int] = set()
    if best.value is None:
        unsure.update(i for vector in best.dependences for i in rank.participants(vector))
    is_special = surface.kind == "singular" and rank.estimate(rows.take(holonomic)).low < (
        surface.codimension or 0
    )
    if surface.kind == "undecided" or is_special:  # no walk came to a generic point
        unsure.update(surface.rows)
    if best.value is None or best.value == count:
        return Multipliers(tuple(None if i in unsure else True for i in range(count)), ())
    chosen = independent_rows.dependence(rows, best.value)
    independent = chosen.independent
    # Dependencies over the same rows at other points too, where these are independent.
    others = (
        independent_rows.over(there, independent).selection
        for one, there in found
        if one.value == len(independent)
        and rank.estimate(there.take(list(independent))).value == len(independent)
    )
    dependencies = independent_rows.joined(chosen.selection, others).dependencies
    shared = {row for dependency in dependencies for row in dependency}
    flags = tuple(False if i in shared else None if i in unsure else True for i in range(count))
    vectors = {}
    for dependency, weights in zip(dependencies, chosen.weights, strict=True):
        least = rows.lengths[list(dependency)].min()  # 1 / length may be beyond the range of numbers
        of = {dependency[0]: -least / rows.lengths[dependency[0]]}
        of |= {row: weights.get(row, 0.0) * (least / rows.lengths[row]) for row in dependency[1:]}
        members = tuple(sorted(dependency))
        vector = np.array([of[row] for row in members])
        largest = np.abs(vector).max()
        lead = vector[np.abs(vector) > rank.PARAMETERS.small * largest][0]
        names = tuple(system.rows.rows[row].name for row in members)
        vectors[members] = NullVector(names, tuple((vector / (largest * np.sign(lead))).tolist()))
    return Multipliers(flags, tuple(vectors[members] for members in sorted(vectors)))


def _ranks(numeric: NumericSystem, points: Sequence[State]) -> list[tuple[rank.Rank, MetricRows]]:
    """Ranks of all rows at points, with the rows; the first point is known to be finite."""
    there = (point for point in points if sample_points.is_finite(numeric, point))
    return [(rank.estimate(rows), rows) for rows in (sample_points.plain_rows(numeric, one) for one in there)]
