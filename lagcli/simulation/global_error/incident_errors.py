"""The errors of the lines before and after incidents, from the same incidents of the run repeated.

Each run has its own time of an incident. The lines on one side of it belong together all the same: between the two
times one run is before the incident and the other behind it, and a row of both at one time tells nothing.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.simulation.global_error.incident_sides import LATE
from lagcli.simulation.run_state.incident import Incident

Floats = npt.NDArray[np.float64]


class IncidentErrors:
    """Incidents of the repeated run that wait for those of the run, in their order by kind and name.

    kinds: the places of the columns of each kind in a row of the table; factor: on the distance of the two runs.
    """

    def __init__(self, kinds: tuple[list[int], ...], factor: float) -> None:
        self._kinds, self._factor = kinds, factor
        self._waiting: dict[tuple[str, str], collections.deque[Incident]] = {}

    def add(self, incidents: Sequence[Incident]) -> None:
        """Incidents of the repeated run, in the order of time."""
        for one in incidents:
            self._waiting.setdefault((one.kind, one.name), collections.deque()).append(one)

    def extended(self, incidents: Sequence[Incident], start: float, rows: Floats) -> list[Incident]:
        """Incidents of the run in the order of time, their lines with errors (4,) at the end.

        start: the time of the first row; rows (k, 5): times in their order, with the errors up to each. An error is
        the larger of that at the row before and of that at the incident itself, and nan where the repeated run has no
        such incident by then.
        """
        found = []
        for t, group in itertools.groupby(incidents, key=lambda incident: incident.t):
            told = list(group)
            others = [self._other(one, LATE * (t - start)) for one in told]
            place = int(np.searchsorted(rows[:, 0], t, "left")) - 1
            least = rows[place, 1:] if place >= 0 else np.zeros(len(self._kinds))
            partners = sorted((one for one in others if one is not None), key=lambda incident: incident.t)
            before = after = np.full(len(self._kinds), np.nan)
            if len(partners) == len(told):
                before = np.maximum(least, self._errors(told[0].before, partners[0].before))
                after = np.maximum(before, self._errors(told[-1].after, partners[-1].after))
            for one in told:
                lines = np.append(one.before, before), np.append(one.after, after)
                found.append(dataclasses.replace(one, before=lines[0], after=lines[1]))
        return found

    def _other(self, one: Incident, late: float) -> Incident | None:
        """The incident of the repeated run that belongs to one of the run."""
        waiting = self._waiting.get((one.kind, one.name))
        while waiting and waiting[0].t < one.t - late:
            waiting.popleft()
        return waiting.popleft() if waiting and waiting[0].t <= one.t + late else None

    def _errors(self, line: Floats, other: Floats) -> Floats:
        """Of each kind the largest distance of two lines, which have no t; what has no value does not count."""
        with np.errstate(invalid="ignore"):
            gaps = np.abs(line - other)
        gaps[~np.isfinite(gaps)] = 0.0
        largest = [gaps[np.array(at, dtype=int) - 1].max(initial=0.0) for at in self._kinds]
        return np.asarray(self._factor * np.array(largest))
