"""The first integrals of the differential rows, with what else a search for them has found."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from lagcli.model.invariant import FirstIntegral

if TYPE_CHECKING:
    # Most models have no differential rows: they load no more than this.
    from lagcli.analysis.classification.verdict import Condition
    from lagcli.analysis.codimension.redundancy import Orbit

Integrals = tuple[FirstIntegral, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class KnownIntegrals:
    """First integrals of the differential rows, notes on those that are not known, and the hidden conditions."""

    integrals: Integrals = ()
    notes: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    orbits: tuple[Orbit, ...] = ()
