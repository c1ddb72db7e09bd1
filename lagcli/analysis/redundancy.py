"""The independent rows that a run is stepped with, and the multipliers that are unique.

Where the rank of the rows is the codimension of the constraint surface, motion and R are unique whichever independent
rows are taken; where it is below, no finite multipliers give the true motion. lambda_i is unique exactly where no null
vector of B^T has a weight on row i (D.13-D.22): asked at generic points, as a weight may vanish at the start.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lagcli import progress
from lagcli.analysis.classification.verdict import Orbit
from lagcli.compiled import NumericSystem
from lagcli.compiled.selection import Selection
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import decompositions, metric_rows, rank
from lagcli.linear.metric_rows import MetricRows
from lagcli.start import initial, projection
from lagcli.start.initial import State

if TYPE_CHECKING:
    from lagcli.analysis.codimension import Codimension

# Points ahead of the start, at these parts of the size of the configuration: rows that depend on one another at the
# start may do so there alone.
AHEAD = tuple(projection.PARAMETERS.step / part for part in (4, 10, 40))


@progress.phase("choosing independent rows")
def begin(
    system: System,
    numeric: NumericSystem,
    state: State,
    whole: tuple[System, NumericSystem] | None = None,
    orbits: Sequence[Orbit] = (),
) -> tuple[Selection, bool]:
    """The rows that a run begins with from a consistent state, and whether they are dependent at its very start alone,
    a singular configuration. Raises `diagnostics.ModelError`, by name, if none can.

    whole: the system with the hidden conditions of its rows, to whose surface the motion keeps; orbits: where motions
    from the start were followed, which may keep to a set where rows are dependent.
    """
    if not system.rows.rows:
        return numeric.selection, False
    rows = projection.rows(numeric, state)
    found = rank.estimate(rows)
    if found.value == rows.count:
        _require_far(system, rows, range(rows.count))
        return numeric.selection, False
    if found.value is None:
        undecided = [rank.participants(null_vector) for null_vector in found.dependences]
        raise diagnostics.ModelError(
            diagnostics.Diagnostic(
                "dependent-constraints",
                f"whether the rows {initial.names_of(system, among)} are independent at the start cannot be decided: no"
                " gap in their singular values decides",
                system.rows.rows[among[-1]].location,
                "move the start a little, or leave out a row that nearly follows from the others",
            )
            for among in undecided
        )
    # Loaded here and not above: independent rows need none of it.
    from lagcli.analysis import codimension
    from lagcli.analysis.codimension.examine import multiplier_rule, undecided_start
    from lagcli.linear import independent_rows
    from lagcli.start import conflict

    if rows.rank_in_digits is not None:
        _require_far(system, rows, independent_rows.dependence(rows, found.value).independent)
    elif projection.needs_digits(system, numeric, state):
        _require_far(system, rows, range(rows.count))
    whole = whole or (system, numeric)
    conflict.require_lasting(*whole, state)
    lower_rank = _states_of_lower_rank(numeric, found, orbits)
    # Rows that are dependent at the start alone are looked at where the motion leads, a little ahead on the surface.
    speed = 0.0 if lower_rank else float(np.abs(state.v).max(initial=0.0))
    ahead = []
    for part in AHEAD if speed else ():
        tau = part * initial.size(state.q) / speed
        after = dataclasses.replace(state, t=state.t + tau)
        q = projection.surface_at(whole[1], after).nearby(state.q + tau * state.v)
        if q is not None and projection.is_finite(whole[1], dataclasses.replace(after, q=q)):
            ahead.append(dataclasses.replace(after, q=q))
    along = {rank.estimate(projection.rows(numeric, point)).low: point for point in reversed(ahead)}
    count = max([found.value, *along])
    there = along[count] if count > found.value else state
    surface = codimension.examine(system, numeric, there)
    if surface.kind == "deficient":
        raise multiplier_rule(system, surface)
    if surface.kind == "undecided":
        raise undecided_start(system, numeric, there, surface)
    # Generic points of the surface around, later ones where time enters: at the start a weight may vanish.
    holonomic, later = list(range(whole[0].holonomic_count)), initial.later(whole[0])
    generic = lower_rank or projection.along(whole[1], there, holonomic, later)[1:]
    around = [projection.rows(numeric, point) for point in generic]
    if surface.kind == "singular" or max((rank.estimate(each).low for each in around), default=0) > count:
        # A singular configuration without a velocity that leads on
        dependent = sorted({i for vector in found.dependences for i in rank.participants(vector)})
        names = initial.names_of(system, dependent)
        what = f"{names} are dependent" if len(dependent) > 1 else f"the gradient of {names} vanishes"
        raise diagnostics.error(
            "singular-start",
            f"the start is a singular configuration: {what} there and not nearby, and the initial velocities lead along"
            " none of the branches that meet",
            system.rows.rows[dependent[-1]].location,
            "give velocities along one branch, or start a little aside",
        )
    chosen = independent_rows.dependence(projection.rows(numeric, there), count, system.holonomic_count)
    others = (
        independent_rows.over(each, chosen.independent).selection
        for each in around
        if rank.estimate(each).value == count
    )
    return independent_rows.joined(chosen.selection, others), count > found.value


def require_clear(system: System, numeric: NumericSystem, state: State) -> None:
    """Raise `diagnostics.ModelError` for rows that are independent, and that doubles cannot tell from dependent ones
    wherever they are looked at: no point that they lead to is known to any digit."""
    if not system.rows.rows:
        return
    rows = projection.rows(numeric, state)
    if rows.are_independent or rank.estimate(rows).value != rows.count:
        return
    direction = decompositions.generic_direction(state.q.size, projection.SEED)
    aside = state.q + projection.PARAMETERS.offset * initial.size(state.q) * direction
    beside = dataclasses.replace(state, q=aside)
    if projection.is_finite(numeric, beside) and not rank.is_near(projection.rows(numeric, beside)):
        return
    _require_far(system, rows, range(rows.count))


def _require_far(system: System, rows: MetricRows, among: Sequence[int]) -> None:
    """Raise `diagnostics.ModelError` for rows `among` others that are independent, if doubles cannot tell them from
    dependent ones."""
    part = rows.take(list(among))
    if not rank.is_near(part):
        return
    least, vector = rank.nearest_dependence(part)
    near = [among[k] for k in rank.participants(vector)]
    raise diagnostics.error(
        "dependent-constraints",
        f"the rows {initial.names_of(system, near)} are independent at the start, but within {least:.2g} of dependent"
        " ones: their multipliers would have no right digit",
        system.rows.rows[near[-1]].location,
        "move the start a little, or leave out a row that nearly follows from the others",
    )


def _states_of_lower_rank(numeric: NumericSystem, found: rank.Rank, orbits: Sequence[Orbit]) -> list[State]:
    """States on the motions from the start where the rank of the rows is that of the start, which is less than beside
    it; none where motions lead away from such a state, or where not all dependent rows were followed."""
    own = {i for vector in found.dependences for i in rank.participants(vector)}
    followed = [orbit for orbit in orbits if own & set(orbit.rows)]
    if not own <= {i for orbit in followed for i in orbit.rows}:
        return []
    states = [state for orbit in followed for state in orbit.states]
    ranks = (rank.estimate(projection.rows(numeric, each)).value for each in states)
    return states if all(one == found.value for one in ranks) else []


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
    from lagcli.linear import independent_rows

    count, holonomic = len(system.rows.rows), list(range(system.holonomic_count))
    found = _ranks(numeric, points)
    if max(one.low for one, _ in found) < count and len(points) == 1:
        # Of many rows a walk takes long.
        most = 1 if count > metric_rows.PARAMETERS.dense else projection.PARAMETERS.points
        later = initial.later(system)
        found = _ranks(numeric, projection.along(numeric, points[0], holonomic, later, most))
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
    there = (point for point in points if projection.is_finite(numeric, point))
    return [(rank.estimate(rows), rows) for rows in (projection.plain_rows(numeric, one) for one in there)]
