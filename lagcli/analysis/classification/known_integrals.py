"""The first integrals of the differential rows, with what else a search for them has found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lagcli.frozen import frozen_value
from lagcli.model.invariant import FirstIntegral

if TYPE_CHECKING:
    # Most models have no differential rows: they load no more than this.
    from lagcli.analysis.classification.verdict import Condition
    from lagcli.start.initial import State

Integrals = tuple[FirstIntegral, ...]


@frozen_value
class Orbit:
    """Rows by their numbers, and states to which motions from the start come, as far as these rows see them."""

    rows: tuple[int, ...]
    states: tuple[State, ...]


@frozen_value
class KnownIntegrals:
    """First integrals of the differential rows, notes on those that are not known, the hidden conditions, and where
    motions from the start were followed."""

    integrals: Integrals = ()
    notes: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    orbits: tuple[Orbit, ...] = ()
