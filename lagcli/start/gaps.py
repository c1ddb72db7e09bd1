"""The one-sided constraints at a start: open, closed, or violated, which is refused with the depth."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np
import numpy.typing as npt

from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.linear.metric_rows import LocalRows
from lagcli.start import initial
from lagcli.start.initial import State

Floats = npt.NDArray[np.float64]
Side = Literal["open", "closed", "violated"]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """g / |G| of the one-sided constraints (K,), which hold where it is not negative, and what counts as zero, `limit`.

    norms (K,): |G|, or 1 where the gradient vanishes or has no value, which is `flat` (K,).
    """

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
        return tuple("violated" if low else "open" if high else "closed" for low, high in self._told())

    def _told(self) -> list[tuple[bool, bool]]:
        return list(zip((self.g < -self.limit).tolist(), (self.g > self.limit).tolist(), strict=True))

    @property
    def depth(self) -> float:
        """The largest violation, as the condition is written; 0 where there is none."""
        broken = self.violated
        return float((-self.g * self.norms)[broken].max(initial=0.0))


def gaps(system: System, numeric: NumericSystem, state: State) -> Gaps:
    """The gaps at a state. Raises `diagnostics.ModelError` naming one that is not finite."""
    if not system.contacts.count:
        nothing = np.zeros(0)
        return Gaps(nothing, nothing, nothing.astype(bool), nothing)
    g = np.array(numeric.contacts(state.t, state.q, state.v, state.p)[0]).ravel()
    bad = np.flatnonzero(~np.isfinite(g))
    if bad.size:
        row = system.contacts.rows[int(bad[0])]
        message = f"the one-sided constraint `{row.name}` is not finite at the start"
        hint = "move the start off the pole, or write the condition without it (for example squared)"
        raise diagnostics.ModelError(
            [diagnostics.Diagnostic("not-finite-at-start", message, row.location, hint)]
        )

    def rows_at(q: Floats) -> LocalRows:
        return LocalRows(numeric.contacts(state.t, q, state.v, state.p)[1])

    rows = rows_at(state.q).finite()
    norms = rows.divisors
    return Gaps(g / norms, initial.limits(rows_at, state, rows, np.abs(g) / norms), rows.norms == 0, norms)


def penetrations(system: System, found: Gaps) -> list[diagnostics.Diagnostic]:
    """One diagnostic for each constraint that the start violates; of a family some, and one for the rest of it."""
    by_place: dict[diagnostics.Location, list[int]] = {}
    for j in found.violated:
        by_place.setdefault(system.contacts.rows[j].location, []).append(j)
    report = []
    for location, broken in by_place.items():
        report += [_penetration(system, found, j) for j in broken[: initial.MOST_TOLD]]
        rest = broken[initial.MOST_TOLD :]
        if rest:
            worst = _penetration(system, found, min(rest, key=lambda j: float(found.g[j])))
            message = f"so do {len(rest)} more rows of this family; of them the most: {worst.message}"
            report.append(diagnostics.Diagnostic("start-penetrates", message, location, worst.hint))
    return report


def _penetration(system: System, found: Gaps, j: int) -> diagnostics.Diagnostic:
    row, units = system.contacts.rows[j], system.model.units
    unit = f" {units.length}" if not system.model.coordinates else ""
    by = initial.violated(-float(found.g[j]), float(found.norms[j]), unit)
    if found.flat[j]:
        by = f"{-found.g[j]:.6g} of its own unit (its gradient vanishes or has no value there)"
    message = f"the initial positions violate `{row.name}` by {by}: the start is on its forbidden side"
    hint = "correct the initial positions, or use `--assemble` to move them to the nearest consistent state"
    return diagnostics.Diagnostic("start-penetrates", message, row.location, hint)


def require_outside(system: System, numeric: NumericSystem, state: State) -> None:
    """Raise `diagnostics.ModelError` naming every one-sided constraint on whose forbidden side the state is."""
    report = penetrations(system, gaps(system, numeric, state))
    if report:
        raise diagnostics.ModelError(report)
