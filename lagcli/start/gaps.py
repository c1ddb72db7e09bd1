"""The one-sided constraints at a start: open, closed, or violated, which is refused with the depth or corrected.

The nearest configuration with f = 0 and g >= 0 is found by an active set: violated constraints are enforced at g = 0,
and released where they would hold it back: at the nearest point M (q - q0) = B^T mu + G^T nu with nu >= 0.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem, bound_function
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear import independent_rows, metric_rows, rank
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse
from lagcli.start import configuration_search, initial, projection
from lagcli.start.configuration_search import SEED, Search
from lagcli.start.initial import State

Side = Literal["open", "closed", "violated"]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """g / |G| of the one-sided constraints (K,), which hold where it is not negative, and what counts as zero, `limit`;
    norms (K,): |G|, or 1 where the gradient vanishes or has no value, which is `flat` (K,)."""

    g: Floats
    limit: Floats
    flat: npt.NDArray[np.bool_]
    norms: Floats

    @property
    def violated(self) -> list[int]:
        """The constraints on whose forbidden side the state is."""
        return [int(j) for j in np.flatnonzero(self.g < -self.limit)]

    @property
    def sides(self) -> tuple[Side, ...]:
        """For each constraint on which side of it the state is."""
        return tuple(
            "violated" if low else "open" if high else "closed"
            for low, high in zip(self.g < -self.limit, self.g > self.limit, strict=True)
        )

    @property
    def depth(self) -> float:
        """The largest violation, as the condition is written; 0 where there is none."""
        broken = self.violated
        return float((-self.g * self.norms)[broken].max(initial=0.0))


def at_state(system: System, numeric: NumericSystem, state: State) -> Gaps:
    """The gaps at a state. Raises `diagnostics.ModelError` naming one that is not finite."""
    if not system.contacts.count:
        return Gaps(np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool), np.zeros(0))
    g = np.array(numeric.contacts(state.t, state.q, state.v, state.p)[0]).ravel()
    bad = np.flatnonzero(~np.isfinite(g))
    if bad.size:
        row = system.contacts.rows[int(bad[0])]
        message = f"the one-sided constraint `{row.name}` is not finite at the start"
        hint = "move the start off the pole, or write the condition without it (for example squared)"
        raise diagnostics.error("not-finite-at-start", message, row.location, hint)

    def rows_at(q: Floats) -> LocalRows:
        return LocalRows(numeric.contacts(state.t, q, state.v, state.p)[1])

    rows = rows_at(state.q).finite()
    norms = rows.divisors
    return Gaps(g / norms, initial.limits(rows_at, state, rows, np.abs(g) / norms), rows.norms == 0, norms)


def penetrations(system: System, found: Gaps) -> list[diagnostics.Diagnostic]:
    """One diagnostic for each constraint that the start violates; of a family some, and one for the rest of it."""
    unit = f" {system.model.units.length}" if not system.model.coordinates else ""

    def penetration(j: int) -> diagnostics.Diagnostic:
        row = system.contacts.rows[j]
        by = initial.violated(-float(found.g[j]), float(found.norms[j]), unit, bool(found.flat[j]))
        message = f"the initial positions violate `{row.name}` by {by}: the start is on its forbidden side"
        hint = (
            "correct the initial positions, or use `--assemble` to move them to the nearest consistent state"
        )
        return diagnostics.Diagnostic("start-penetrates", message, row.location, hint)

    return initial.by_family(found.violated, lambda j: -float(found.g[j]), penetration)


class BoundarySurface(projection.Surface):
    """f = 0 and g = 0 of some one-sided constraints."""

    def __init__(self, search: Search, active: list[int]) -> None:
        state = search.state
        super().__init__(search.numeric, state.t, state.p, search.metric)
        self._search, self._active = search, active
        pattern = search.numeric.contacts.sparsity_out(1)
        self._gradients = pattern.sub(active, list(range(pattern.size2())))[0]

    def values(self, q: Floats) -> tuple[Floats, Floats]:
        f, entries = super().values(q)
        state = self._search.state
        g, G = self._search.numeric.contacts(state.t, q, state.v, state.p)[:2]
        own = np.array(G[self._active, :].nonzeros(), dtype=float)
        return np.concatenate([f, np.array(g).ravel()[self._active]]), np.concatenate([entries, own])

    def matrix(self, entries: Floats) -> Sparse:
        equalities, own = np.split(entries, [entries.size - self._gradients.nnz()])
        return metric_rows.stacked(
            super().matrix(equalities), bound_function.sparse_matrix(self._gradients, own)
        )


def nearest(search: Search, q: Floats) -> Floats:
    """The allowed configuration (n,) nearest to that of the search, from q, the nearest on f = 0. Raises
    `diagnostics.ModelError` where none is found."""
    active: list[int] = []
    # An active set may return to one that it was: after thirty changes no nearest configuration is found.
    for _ in range(30):
        found = at_state(search.system, search.numeric, dataclasses.replace(search.state, q=q))
        new = [j for j in found.violated if j not in active]
        worst = [min(new, key=lambda j: float(found.g[j]))] if new else []
        # The active constraint that holds the configuration back the most, or None where all push
        pulling = None
        if active and not new:
            B = BoundarySurface(search, active).rows(q)[1]
            lines = MetricRows(B, search.metric)
            independent = list(independent_rows.dependence(lines, rank.estimate(lines).low).independent)
            enforced, pushes = MetricRows(B[independent, :], search.metric), np.zeros(B.shape[0])
            pushes[independent] = enforced.weights(LocalRows(B[independent, :]).times(q - search.state.q))
            own = pushes[B.shape[0] - len(active) :]
            if own.min() < -doubles.ZERO * float(np.abs(pushes).max()):
                pulling = active[int(np.argmin(own))]
        if not new and pulling is None:
            return q
        # Where not all that are violated can be enforced together, one after another.
        for more in (new, worst) if len(new) > 1 else (new,):
            chosen = sorted(j for j in (*active, *more) if j != pulling)
            surface = BoundarySurface(search, chosen)
            ends = (end for end in map(surface.descend, _begins(search, surface, q)) if end.is_on)
            reached = next(ends, None)
            if reached is not None:
                break
        if reached is None:
            break
        active, q = chosen, surface.nearest(reached.q, search.state.q)
    else:
        found = at_state(search.system, search.numeric, dataclasses.replace(search.state, q=q))
    # Conditions that are violated still, or else those that were enforced
    rows = search.system.contacts.rows
    named = [rows[j] for j in (found.violated or active)][:3]
    names = ", ".join(f"`{row.name}`" for row in named)
    message = f"no configuration on the allowed side of {names} was found near the start"
    hint = "a conclusion of a search, not a proof: start nearer to where the conditions hold"
    raise diagnostics.error("no-consistent-start", message, named[0].location, hint)


def settled(system: System, numeric: NumericSystem, state: State) -> State:
    """A consistent state with the gaps that decimals have put below zero at zero."""
    found = at_state(system, numeric, state)
    if found.violated or not (found.g < -doubles.SUM * float(np.abs(state.q).max(initial=0.0))).any():
        return state
    search = Search(system, numeric, state, np.zeros(state.q.size, dtype=bool))
    reached = BoundarySurface(search, np.flatnonzero(found.g <= 0.0).tolist()).descend(state.q)
    return dataclasses.replace(state, q=reached.q) if reached.is_on else state


def _begins(search: Search, surface: BoundarySurface, q: Floats) -> Iterator[Floats]:
    """Starts for a search: the declared configuration, another, and some beside it; the same for the same question."""
    q0 = search.state.q
    yield q0
    yield q
    random = np.random.default_rng(SEED)
    touched = np.zeros(q.size, dtype=bool)
    touched[LocalRows(surface.rows(q)[1]).column] = True
    touched &= ~search.fixed
    for part in configuration_search.PARAMETERS.offsets:
        yield q + np.where(touched, part * search.size(q0, touched), 0.0) * random.standard_normal(q.size)
