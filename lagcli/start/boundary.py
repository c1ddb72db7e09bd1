"""The nearest configuration on the allowed side of all one-sided constraints: f = 0 and g >= 0, by an active set.

Constraints on whose forbidden side a configuration is are held at g = 0 like equations, and let go again where they
would hold it back: at the nearest point M (q - q0) = B^T mu + G^T nu with nu >= 0.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lagcli.errors import diagnostics
from lagcli.linear import independent_rows, metric_rows, rank
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.start import gaps, projection
from lagcli.start.configuration_search import SEED, Search
from lagcli.start.gaps import Gaps
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]

ROUNDS = 30  # changes of the active set
# Starts aside of a configuration where a gradient has no value, as parts of its size.
ASIDE = (0.01, 0.1, 0.3, 1.0)
# Pulls smaller than this part of the largest push are rounding.
PULLING = 1e-9
# Gaps that are this small a part of the size of a configuration are none.
ROUNDING = 1e-14


class BoundarySurface(projection.Surface):
    """f = 0 and g = 0 of some one-sided constraints."""

    def __init__(self, search: Search, active: list[int]) -> None:
        state = search.state
        super().__init__(search.numeric, state.t, state.p, search.metric)
        self._search, self._active = search, active

    def rows(self, q: Floats) -> tuple[Floats, Sparse]:
        """f (s,) and g of the constraints, and their gradients, sparse."""
        f, B = super().rows(q)
        state = self._search.state
        g, G = self._search.numeric.contacts(state.t, q, state.v, state.p)[:2]
        return np.concatenate([f, np.array(g).ravel()[self._active]]), metric_rows.stacked(
            B, G[self._active, :]
        )


def nearest(search: Search, q: Floats) -> Floats:
    """The allowed configuration (n,) nearest to that of the search, from q, the nearest on f = 0.

    Raises `diagnostics.ModelError` where none is found.
    """
    active: list[int] = []
    for _ in range(ROUNDS):
        found = gaps.gaps(search.system, search.numeric, _at(search, q))
        new = [j for j in found.violated if j not in active]
        worst = [min(new, key=lambda j: float(found.g[j]))] if new else []
        pulling = None if new else _most_pulling(search, active, q)
        if not new and pulling is None:
            return q
        # Where not all that are violated can be held together, one after another.
        for more in (new, worst) if len(new) > 1 else (new,):
            chosen = sorted(j for j in (*active, *more) if j != pulling)
            reached = _reached(search, chosen, q)
            if reached is not None:
                break
        if reached is None:
            break
        active, q = chosen, reached
    raise _none_found(search, gaps.gaps(search.system, search.numeric, _at(search, q)), active)


def settled(search: Search) -> Floats:
    """The configuration of the search, with gaps below zero by no more than decimals explain brought to zero."""
    q = search.state.q
    found = gaps.gaps(search.system, search.numeric, search.state)
    size = float(np.abs(q).max(initial=0.0))
    if found.violated or not (found.g < -ROUNDING * size).any():
        return q
    reached = BoundarySurface(search, np.flatnonzero(found.g <= 0.0).tolist()).descend(q)
    return reached.q if reached.is_on else q


def _at(search: Search, q: Floats) -> State:
    state = search.state
    return State(state.t, q, state.v, state.p)


def _reached(search: Search, active: list[int], q: Floats) -> Floats | None:
    """The nearest point of the boundary that is found, or None."""
    surface, best = BoundarySurface(search, active), None
    for begin in _begins(search, active, q):
        reached = surface.descend(begin)
        if reached.is_on:
            best = surface.refined(reached.q, search.state.q)
            break
    return best


def _begins(search: Search, active: list[int], q: Floats) -> Iterator[Floats]:
    """Starts for a search: the declared configuration, another, and some beside it; the same for the same question."""
    q0 = search.state.q
    yield q0
    yield q
    random = np.random.default_rng(SEED)
    touched = np.zeros(q.size, dtype=bool)
    touched[LocalRows(BoundarySurface(search, active).rows(q)[1]).column] = True
    touched &= ~search.fixed
    for part in ASIDE:
        yield q + np.where(touched, part * search.size(q0, touched), 0.0) * random.standard_normal(q.size)


def _most_pulling(search: Search, active: list[int], q: Floats) -> int | None:
    """The active constraint that holds a configuration back the most, or None where all push."""
    if not active:
        return None
    B = BoundarySurface(search, active).rows(q)[1]
    lines = MetricRows(B, search.metric)
    chosen = list(independent_rows.dependence(lines, rank.rank(lines).low).kept)
    kept = MetricRows(B[chosen, :], search.metric)
    pushes = np.zeros(B.shape[0])
    pushes[chosen] = kept.weights(LocalRows(B[chosen, :]).times(q - search.state.q))
    own = pushes[B.shape[0] - len(active) :]
    worst = int(np.argmin(own))
    return active[worst] if own[worst] < -PULLING * float(np.abs(pushes).max()) else None


def _none_found(search: Search, found: Gaps, active: list[int]) -> diagnostics.ModelError:
    """The error where no allowed configuration was found: a condition that is violated still, or one of those held."""
    rows = search.system.contacts.rows
    told = [rows[j] for j in (found.violated or active)][:3]
    names = ", ".join(f"`{row.name}`" for row in told)
    message = f"no configuration on the allowed side of {names} was found near the start"
    hint = "a conclusion of a search, not a proof: start nearer to where the conditions hold"
    return diagnostics.ModelError(
        [diagnostics.Diagnostic("no-consistent-start", message, told[0].location, hint)]
    )
