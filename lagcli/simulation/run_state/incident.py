"""Incidents of a run: impacts, contacts and releases, crossings of singular configurations, and declared events."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from lagcli.frozen import frozen, frozen_value

Floats = npt.NDArray[np.float64]

# In the order in which those of one instant are reported: what came before it, what it was, what holds after it.
Kind = Literal["impact", "accumulation", "contact", "release", "event", "crossing"]
KINDS: tuple[Kind, ...] = get_args(Kind)


@frozen
class Incident:
    """An impact, contact, release or event of one name at an instant t, not counted from the origin of the run.

    impulses: of all constraints at that instant, in the order of the columns `lambda.NAME` (C + K,), in units of
    lambda times time; before, after: lines of the table without t (columns of `System.columns`,), then errors where the
    table has them, the same for all incidents of one instant. The momenta jump by B^T Lambda + G^T Lambda_G (theory of
    impacts).
    """

    t: float
    kind: Kind
    name: str
    impulses: Floats
    before: Floats
    after: Floats


@frozen_value
class RankDrop:
    """At a time t the rank of the rows drops by `number`; participants: the rows that become dependent."""

    t: float
    number: int
    participants: tuple[int, ...]


@frozen_value
class Tally:
    """Numbers of incidents up to some state.

    incidents: all of them; instants: different times; impacts, releases, accumulations: of single contacts, several of
    which may share an instant; last: time of the last one, None before.
    """

    incidents: int = 0
    instants: int = 0
    impacts: int = 0
    releases: int = 0
    accumulations: int = 0
    last: float | None = None

    def plus(self, incident: Incident) -> Tally:
        """The numbers behind one more."""
        return Tally(
            self.incidents + 1,
            self.instants + (incident.t != self.last),
            self.impacts + (incident.kind == "impact"),
            self.releases + (incident.kind == "release"),
            self.accumulations + (incident.kind == "accumulation"),
            incident.t,
        )


NONE = Tally()
