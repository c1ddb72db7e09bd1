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
from lagcli.compiled.selection import Selection
from lagcli.equations.system import System
from lagcli.linear import independent_rows, metric_rows, rank
from lagcli.linear.metric_rows import MetricRows
from lagcli.start import initial, sample_points
from lagcli.start.initial import State
from lagcli.start.precise_rows import PreciseRows

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
    count = len(system.rows.rows)
    found = _ranks(numeric, points)
    if max(one.low for one, _ in found) < count and len(points) == 1:
        found = _ranks(numeric, _along(system, numeric, points[0]))
    best, rows = max(found, key=lambda one: one[0].low)
    unsure = _unsure(best, rows, surface, system.holonomic_count)
    if best.value is None or best.value == count:
        return Multipliers(tuple(None if i in unsure else True for i in range(count)), ())
    chosen = independent_rows.dependence(rows, best.value)
    selection = independent_rows.joined(chosen.selection, _elsewhere(found, chosen.independent))
    shared = {row for dependency in selection.dependencies for row in dependency}
    flags = tuple(False if i in shared else None if i in unsure else True for i in range(count))
    return Multipliers(flags, _null_vectors(system, rows, chosen, selection))


def _ranks(numeric: NumericSystem, points: Sequence[State]) -> list[tuple[rank.Rank, MetricRows]]:
    """Ranks of all rows at points, with the rows; the first point is known to be finite."""
    found = []
    for point in points:
        if sample_points.is_finite(numeric, point):
            B = numeric.rows(point.t, point.q, point.v, point.p)[0]
            rows = MetricRows(B, initial.metric_at(numeric, point), PreciseRows(numeric, point))
            found.append((rank.estimate(rows), rows))
    return found


def _along(system: System, numeric: NumericSystem, start: State) -> list[State]:
    later = initial.later(system)
    points = (
        1 if len(system.rows.rows) > metric_rows.PARAMETERS.dense else sample_points.PARAMETERS.points
    )  # of many rows a walk takes long
    return sample_points.along(numeric, start, list(range(system.holonomic_count)), later, points)


def _unsure(best: rank.Rank, rows: MetricRows, surface: Codimension, holonomic: int) -> set[int]:
    """Rows of which no null vector is known, and none excluded."""
    unsure: set[int] = set()
    if best.value is None:
        unsure.update(i for vector in best.dependences for i in rank.participants(vector))
    if surface.kind == "undecided":
        unsure.update(surface.rows)
    if surface.kind == "singular" and rank.estimate(rows.take(list(range(holonomic)))).low < (
        surface.codimension or 0
    ):
        unsure.update(surface.rows)  # no walk came to a generic point
    return unsure


def _elsewhere(
    found: Sequence[tuple[rank.Rank, MetricRows]], independent: tuple[int, ...]
) -> list[Selection]:
    """Dependencies over the same independent rows at other points, where these are independent too."""
    return [
        independent_rows.over(rows, independent).selection
        for one, rows in found
        if one.value == len(independent)
        and rank.estimate(rows.take(list(independent))).value == len(independent)
    ]


def _null_vectors(
    system: System, rows: MetricRows, chosen: independent_rows.Dependence, selection: Selection
) -> tuple[NullVector, ...]:
    names = [row.name for row in system.rows.rows]
    found = []
    for dependency, weights in zip(selection.dependencies, chosen.weights, strict=True):
        least = rows.lengths[list(dependency)].min()  # 1 / length may be beyond the range of numbers
        of = {dependency[0]: -least / rows.lengths[dependency[0]]}
        of |= {row: weights.get(row, 0.0) * (least / rows.lengths[row]) for row in dependency[1:]}
        vector = np.array([of[row] for row in sorted(dependency)])
        largest = np.abs(vector).max()
        lead = vector[np.abs(vector) > rank.PARAMETERS.small * largest][0]
        vector = vector / (largest * np.sign(lead))
        found.append(NullVector(tuple(names[row] for row in sorted(dependency)), tuple(vector.tolist())))
    return tuple(sorted(found, key=lambda one: [names.index(name) for name in one.rows]))
