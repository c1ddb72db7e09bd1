"""Incidents of a run and of the same run repeated: rows that stand between them, the errors of the lines before and
after them, and the growth of errors by impacts.

Times of incidents are off by the errors of both runs. A row between them has the velocities before the impact in the
one and those after it in the other: that tells nothing about how well either is known. The lines on one side of an
incident belong together all the same.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.simulation.run_state.statistics import Incident

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

KINDS = ("impact", "contact", "release", "accumulation")
LATE = 1e-4  # of the time since the start: incidents that differ by more are no longer the same
# Errors that grow by powers of time come to less than GROWN times from half of the impacts on; FEWEST are needed.
GROWN, FEWEST = 30.0, 6


class IncidentSides:
    """The incidents of two runs, taken as they come, and the rows between those that belong together: how many `rows`
    there were, and the time of the `first`."""

    def __init__(self) -> None:
        self.rows = 0
        self.first: float | None = None
        self._start: float | None = None
        self._pending: dict[tuple[str, str], tuple[list[float], list[float]]] = {}

    def add(self, side: int, incidents: Sequence[Incident]) -> None:
        """Incidents of the run (0) or of the repeated one (1), in the order of time."""
        for one in incidents:
            if one.kind in KINDS:
                self._pending.setdefault((one.kind, one.name), ([], []))[side].append(one.t)

    def between(self, t: Floats) -> Flags:
        """True for rows at times t (k,) between the incidents of both runs, all of which are known up to the last
        row."""
        found = np.zeros(len(t), dtype=bool)
        if not len(t):
            return found
        start = self._start = float(t[0]) if self._start is None else self._start
        late = LATE * (t - start)
        for sides in self._pending.values():
            one, other = (np.searchsorted(side, t, "right") for side in sides)
            for k in np.flatnonzero(one != other).tolist():
                ahead = sides[0] if one[k] > other[k] else sides[1]
                found[k] |= t[k] - ahead[min(one[k], other[k])] <= late[k]
            # What belongs together is left out, and what has had no other for long.
            count = min(int(one[-1]), int(other[-1]))
            for side in sides:
                del side[:count]
                del side[: int(np.searchsorted(side, float(t[-1]) - float(late[-1]), "left"))]
        return self._counted(t, found)

    def beside(self, t: Floats) -> Flags:
        """As `between`, for a table whose own incidents are not known: rows next to one of the repeated run."""
        start = self._start = float(t[0]) if self._start is None and len(t) else self._start
        found = np.zeros(len(t), dtype=bool)
        for _, times in self._pending.values():
            for at in times:
                found |= np.abs(t - at) <= LATE * LATE * (t - (start or 0.0))
            times[:] = [at for at in times if len(t) and at > t[-1]]
        return self._counted(t, found)

    def _counted(self, t: Floats, found: Flags) -> Flags:
        if found.any() and self.first is None:
            self.first = float(t[int(np.argmax(found))])
        self.rows += int(found.sum())
        return found


class ImpactGrowth:
    """The distance of positions as the impacts go on."""

    def __init__(self) -> None:
        self._gaps: list[float] = []  # behind so many instants of impacts
        self._last: float | None = None
        self._count = 0

    def take(self, t: Floats, gaps: Floats, incidents: Sequence[Incident]) -> None:
        """Rows t (k,), the largest distance of positions up to each (k,), and the incidents that came with them."""
        times = []
        for one in incidents:
            if one.kind == "impact" and one.t != self._last:
                self._last = one.t
                times.append(one.t)
        if not times or not len(t):
            return
        rows = np.minimum(np.searchsorted(t, times, "left"), len(t) - 1)
        self._gaps += gaps[rows].tolist()
        self._count += len(times)

    def factor(self, floor: float) -> float | None:
        """By how much an impact makes errors grow, where they grow exponentially; floor: what is rounding alone."""
        gaps = np.array(self._gaps)
        if len(gaps) < FEWEST:
            return None
        half = len(gaps) // 2
        begin = max(float(gaps[half]), floor)
        if gaps[-1] < GROWN * begin:
            return None
        return float((gaps[-1] / begin) ** (1 / (len(gaps) - 1 - half)))


class IncidentErrors:
    """Incidents of the repeated run that wait for those of the run, in their order by kind and name.

    kinds: the columns of each kind in a row of the table; factor: on the distance of the two runs.
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

        start: the time of the first row; rows (k, 5): times with the errors up to each. An error is the larger of that
        at the row before and that at the incident, nan where the repeated run has no such incident by then.
        """
        found = []
        for t, group in itertools.groupby(incidents, key=lambda incident: incident.t):
            reported, partners, late = list(group), list[Incident](), LATE * (t - start)
            for one in reported:
                waiting = self._waiting.get((one.kind, one.name), collections.deque())
                while waiting and waiting[0].t < t - late:
                    waiting.popleft()
                if waiting and waiting[0].t <= t + late:
                    partners.append(waiting.popleft())
            row = int(np.searchsorted(rows[:, 0], t, "left")) - 1
            least = rows[row, 1:] if row >= 0 else np.zeros(len(self._kinds))
            before = after = np.full(len(self._kinds), np.nan)
            if len(partners) == len(reported):
                partners.sort(key=lambda incident: incident.t)
                before = np.maximum(least, self._errors(reported[0].before, partners[0].before))
                after = np.maximum(before, self._errors(reported[-1].after, partners[-1].after))
            for one in reported:
                lines = np.append(one.before, before), np.append(one.after, after)
                found.append(dataclasses.replace(one, before=lines[0], after=lines[1]))
        return found

    def _errors(self, line: Floats, other: Floats) -> Floats:
        """The largest distance of two lines for each kind; they have no t, and what has no value does not count."""
        with np.errstate(invalid="ignore"):
            gaps = np.abs(line - other)
        gaps[~np.isfinite(gaps)] = 0.0
        largest = [gaps[np.array(at, dtype=int) - 1].max(initial=0.0) for at in self._kinds]
        return np.asarray(self._factor * np.array(largest))
