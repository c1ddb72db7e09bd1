"""Rows that do not hold together: in velocities (a combination of them says dt = 0, D.6), in positions, and later.
Named is the smallest set that was found: none of them can be left out."""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import decompositions, metric_rows, rank
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows
from lagcli.start import initial, projection
from lagcli.start.configuration_search import ConfigurationResult, Search
from lagcli.start.initial import State
from lagcli.start.projection import PARAMETERS as PROJECTION


def least(rows: LocalRows, b: Floats) -> list[int]:
    """Rows of B v + b = 0 without a solution, of which none can be left out; empty where there is a solution. Where
    more rows take part than are looked at densely all of them are given."""
    lengths = rows.divisors
    scaled = rest = b / lengths
    scale = float(np.abs(scaled).max(initial=0.0)) or 1.0
    # The rows in which something is left after the best velocity
    if rows.count <= metric_rows.PARAMETERS.dense:
        rest, apart = (
            decompositions.residual(np.array(rows.B) / lengths[:, None], scaled),
            rank.PARAMETERS.small,
        )
    else:
        unit, apart = MetricRows(rows.B, Metric.unit(rows.B.shape[1])), doubles.ROOT
        # By sparse factors, damped: what a velocity takes away shrinks at every pass, the rest of it stays.
        for _ in range(4):
            rest = doubles.ZERO * unit.weights(rest * unit.lengths, doubles.ZERO)
    involved = np.flatnonzero(np.abs(rest) > apart * scale).tolist()
    if len(involved) > metric_rows.PARAMETERS.dense:
        return involved
    B, b = np.array(rows.B[involved, :]) / lengths[involved, None], scaled[involved]
    scale = float(np.abs(b).max(initial=0.0)) or 1.0
    among = list(range(len(involved)))
    for i in reversed(range(len(involved))):
        fewer = [k for k in among if k != i]
        # What no velocity takes away is a combination y of the rows with y B = 0.
        rest = np.abs(decompositions.residual(B[fewer], b[fewer]))
        if rest.max(initial=0.0) > rank.PARAMETERS.small * scale:
            among = fewer
    return [involved[i] for i in among]


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
    # The rows that are violated where the sum of squares is least, if they have no configuration either
    ended = search.surface(failed.rows).descend(failed.best.q, to_the_end=True)
    found = failed
    for part in (PROJECTION.offset, doubles.ROOT) if np.isfinite(ended.worst) else ():
        pairs = zip(failed.rows, ended.residuals, strict=True)
        rows = [i for i, residual in pairs if residual > part * ended.worst]
        if len(rows) == len(failed.rows):
            break
        among = search.reach(rows, (search.state.q, ended.q))
        if not among.is_on:
            found = among
            break
    begins = (search.state.q, found.best.q)
    # What is left to be tried: sets of rows, times their number of rows
    left = 1500
    length = max(1, len(found.rows) // 2)
    while True:
        all_rows = found.rows
        for end in range(len(all_rows), 0, -length):
            chunk = all_rows[max(0, end - length) : end]
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


def require_lasting(
    system: System, numeric: NumericSystem, state: State, proved: frozenset[int] = frozenset()
) -> None:
    """Raise `diagnostics.ModelError` where rows that depend on one another at a consistent state part later.

    proved: rows that part from no others. Soon after the state the nearest configuration is sought, and velocities for
    it; dependent rows that have none contradict each other (`a.x = t` and `a.x = sin(t)`).
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
