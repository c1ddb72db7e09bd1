"""Rows that do not hold together: in velocities (a combination of them says dt = 0, D.6), in positions, and later.

The rows that are named are the smallest set that was found: none of them can be left out.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import decompositions, metric_rows, rank
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows
from lagcli.start import initial, projection
from lagcli.start.configuration_search import ConfigurationResult, Search
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]


class ConflictParameters:
    """The smallest set of rows that contradict each other; parts are of rows of length one.

    The tests are of `tests/unit/test_numbers_of_starts.py` and `tests/unit/test_start_thresholds.py`.
    """

    __slots__ = ()

    shift: float = 1e-8
    """Of many rows what is left is found by sparse factors, with this part of the identity added.
    `test_what_is_left_of_many_rows_is_found_in_four_passes` fails at 1e-9 and 1e-7."""
    passes: int = 4
    """In so many passes. `test_what_is_left_of_many_rows_is_found_in_four_passes` fails at 0 and 40."""
    apart_of_many: float = 1e-5
    """The part of b that is left of many rows, above rounding. `test_many_rows_are_apart_by_five_digits`
    fails at 1e-6 and 0.0001."""
    taking_part: tuple[float, ...] = (1e-2, 1e-4, 1e-6)
    """Rows that have this part of the least residual, or that, take part in the conflict at that configuration.
    `test_rows_take_part_in_a_conflict_with_a_hundredth_of_what_remains` fails at a tenth and at ten times of it."""
    budget: int = 1500
    """Sets of rows that are tried, times their number of rows; the set that is left then is named.
    `test_sets_of_rows_are_tried_until_the_budget_is_spent` fails at 150 and 15000."""


PARAMETERS = ConflictParameters()


def least(rows: LocalRows, b: Floats) -> list[int]:
    """Rows of B v + b = 0 without a solution, of which none can be left out; empty where there is a solution.

    Where more rows take part than are looked at densely all of them are given.
    """
    lengths = rows.divisors
    involved = _taking_part(rows, b, lengths)
    if len(involved) > metric_rows.PARAMETERS.dense:
        return involved
    B, b = np.array(rows.B[involved, :]) / lengths[involved, None], b[involved] / lengths[involved]
    scale = float(np.abs(b).max(initial=0.0)) or 1.0
    among = list(range(len(involved)))
    for i in reversed(range(len(involved))):
        fewer = [k for k in among if k != i]
        # What no velocity takes away is a combination y of the rows with y B = 0.
        rest = np.abs(decompositions.residual(B[fewer], b[fewer]))
        if rest.max(initial=0.0) > rank.PARAMETERS.small * scale:
            among = fewer
    return [involved[i] for i in among]


def _taking_part(rows: LocalRows, b: Floats, lengths: Floats) -> list[int]:
    """The rows in which something is left after the best velocity."""
    scaled = b / lengths
    scale = float(np.abs(scaled).max(initial=0.0)) or 1.0
    if rows.count <= metric_rows.PARAMETERS.dense:
        rest = decompositions.residual(np.array(rows.B) / lengths[:, None], scaled)
        return [int(i) for i in np.flatnonzero(np.abs(rest) > rank.PARAMETERS.small * scale)]
    unit = MetricRows(rows.B, Metric.unit(rows.B.shape[1]))
    rest = scaled
    for _ in range(PARAMETERS.passes):
        # What a velocity takes away shrinks at every pass, the rest of it stays.
        rest = PARAMETERS.shift * unit.weights(rest * unit.lengths, PARAMETERS.shift)
    return [int(i) for i in np.flatnonzero(np.abs(rest) > PARAMETERS.apart_of_many * scale)]


def position(search: Search, failed: ConfigurationResult) -> diagnostics.Diagnostic:
    """The message where no configuration was found for some rows: the smallest set found that has none."""
    found = smallest(search, failed)
    system, rows = search.system, list(found.rows)
    names, location = initial.names_of(system, rows), system.rows.rows[rows[-1]].location
    worst = rows[int(np.argmax(found.best.residuals))]
    unit = f" {system.model.units.length}" if not system.model.coordinates else ""
    f = abs(
        float(np.array(search.numeric.holonomic(search.state.t, found.best.q, search.state.p)[0])[worst, 0])
    )
    shown, row = f"{found.best.worst:.6g}", system.rows.rows[worst].name
    remains = f"the least that remains is {shown}{unit}, in `{row}`"
    if f"{f:.6g}" != shown:
        remains = f"the least that remains is {shown}{unit} per unit of the gradient, in `{row}`, off by {f:.6g} there"
    if found.best.recedes:
        remains = "they come near one another only further and further off"
        if len(rows) == 1:
            remains = "it comes near to holding only further and further off"
    if not np.isfinite(found.best.worst):
        remains = "they have no finite value where it was looked for"
    free = Search(system, search.numeric, search.state, np.zeros_like(search.fixed))
    if search.fixed.any() and free.reach(rows, (search.state.q,)).is_on:
        message = (
            f"with the coordinates that `keep` holds, no configuration satisfies {names}: by {found.attempts_text}"
            f" {remains}"
        )
        hint = "let `keep` hold fewer coordinates, or give them other values"
        return diagnostics.Diagnostic("no-consistent-start", message, location, hint)

    def are_dependent(q: Floats) -> bool:
        B = search.numeric.holonomic(search.state.t, q, search.state.p)[1][rows, :]
        if not LocalRows(B).are_finite().all():
            return True
        return rank.estimate(MetricRows(B, search.full_metric)).high < len(rows)

    # Where rows are dependent wherever one looks a combination of them says 0 = 1.
    is_looked_at = 1 < len(rows) <= metric_rows.PARAMETERS.dense
    if is_looked_at and all(map(are_dependent, free.neighbours(search.state.q, rows))):
        message = f"{names} contradict each other: no configuration satisfies them together; {remains}"
        return diagnostics.Diagnostic("contradictory-constraints", message, location)
    message = f"no configuration near the start was found in which {names} "
    message += "holds" if len(rows) == 1 else "hold together"
    message += f": by {found.attempts_text} {remains}"
    hint = "the constraints may contradict each other, or the start may be too far away"
    return diagnostics.Diagnostic("no-consistent-start", message, location, hint)


def smallest(search: Search, failed: ConfigurationResult) -> ConfigurationResult:
    """A set of rows without a configuration, as far as searches tell, of which none can be left out."""
    found, left = _violated(search, failed), PARAMETERS.budget
    begins = (search.state.q, found.best.q)
    length = max(1, len(found.rows) // 2)
    while True:
        rows = found.rows
        for end in range(len(rows), 0, -length):
            chunk = rows[max(0, end - length) : end]
            fewer_rows = [i for i in found.rows if i not in chunk]
            left -= len(found.rows)
            if not fewer_rows or left < 0 or not set(chunk) <= set(found.rows):
                continue
            tried = search.reach(fewer_rows, begins)
            if not tried.is_on:
                found = tried
        if length == 1 or left < 0:
            return found
        length = max(1, min(length // 2, len(found.rows) // 2))


def _violated(search: Search, failed: ConfigurationResult) -> ConfigurationResult:
    """The rows that are violated where the sum of squares is least, if they have no configuration either."""
    ended = search.surface(failed.rows).descend(failed.best.q, to_the_end=True)
    begins = (search.state.q, ended.q)
    for part in PARAMETERS.taking_part if np.isfinite(ended.worst) else ():
        pairs = zip(failed.rows, ended.residuals, strict=True)
        rows = [i for i, residual in pairs if residual > part * ended.worst]
        if len(rows) == len(failed.rows):
            break
        found = search.reach(rows, begins)
        if not found.is_on:
            return found
    return failed


def require_lasting(
    system: System, numeric: NumericSystem, state: State, proved: frozenset[int] = frozenset()
) -> None:
    """Rows that depend on one another must move alike: raise `diagnostics.ModelError` where some part later.

    state: a consistent one, at which the rows are dependent; proved: rows that are known to part from no others. At a
    few times soon after it the nearest configuration is sought, and velocities for it; rows that are dependent at the
    state and have none there contradict each other (`a.x = t` and `a.x = sin(t)`, one rod with two lengths of which one
    grows).
    """
    soon = initial.later(system)
    if not soon:
        return  # what holds now holds for ever
    for after in (soon / 10, soon, 10 * soon):
        later = dataclasses.replace(state, t=state.t + after)
        parting = _parting(system, numeric, state, later)
        if parting and proved.isdisjoint(parting):
            names = initial.names_of(system, parting)
            message = (
                f"{names} contradict each other: they agree at the start and part later; at t = {later.t:.6g} no motion"
                " satisfies them together"
            )
            location = system.rows.rows[parting[-1]].location
            raise diagnostics.error("contradictory-constraints", message, location)


def _parting(system: System, numeric: NumericSystem, state: State, later: State) -> list[int]:
    """Rows dependent at a state that cannot hold together later."""
    free = np.zeros(state.q.size, dtype=bool)
    q = state.q + (later.t - state.t) * state.v
    f, B = numeric.holonomic(later.t, q, state.p)
    if not (np.isfinite(np.array(f)).all() and np.isfinite(np.array(B.nonzeros(), dtype=float)).all()):
        return []  # another law may have come to its end
    search = Search(system, numeric, dataclasses.replace(later, q=q), free)
    reached = search.surface().descend(q)
    if not reached.is_on:
        labels, _ = search.components()
        size = initial.size(reached.q)
        for number in np.unique(labels[~(reached.residuals <= doubles.ZERO * size)]):
            rows = np.flatnonzero(labels == number).tolist()
            found = search.reach(rows, (q, state.q))
            parting = [] if found.is_on else list(smallest(search, found).rows)
            if parting and _are_dependent(numeric, state, parting):
                return parting
        return []
    # What rows demand of velocities may grow with the distance from the surface, as that of 1e6*(x - y)*dt does.
    here = search.surface().at(reached.q)
    q = reached.q if here is None else reached.q + here.step()
    B, bias = numeric.rows(later.t, q, state.v, state.p)
    b = np.array(bias).ravel()
    if not (np.isfinite(np.array(B.nonzeros(), dtype=float)).all() and np.isfinite(b).all()):
        return []
    there = dataclasses.replace(later, q=q, v=state.v)
    if projection.consistent(system, numeric, there, search.full_metric)[1]:
        return []  # what is left is rounding
    parting = least(LocalRows(B), b)
    return parting if parting and _are_dependent(numeric, state, parting) else []


def _are_dependent(numeric: NumericSystem, state: State, rows: list[int]) -> bool:
    """True if some rows, few enough to be looked at, depend on one another at a state, or one of them vanishes."""
    if len(rows) > metric_rows.PARAMETERS.dense:
        return False
    B = numeric.rows(state.t, state.q, state.v, state.p)[0][rows, :]
    return rank.estimate(MetricRows(B, initial.metric_at(numeric, state))).low < len(rows)
