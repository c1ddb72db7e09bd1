"""Rows at which one run is before an incident and the run repeated behind it, and the growth of errors by impacts.

Times of incidents are off by the errors of both runs. A row between them has the velocities before the impact in the
one and those after it in the other: that tells nothing about how well either is known.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.simulation.run_state.incident import Incident

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

KINDS = ("impact", "contact", "release", "accumulation")
LATE = 1e-4  # of the time since the start: incidents that differ by more are no longer the same
# Errors that grow by powers of time come to less than GROWN times from half of the impacts on; FEWEST are needed.
GROWN, FEWEST = 30.0, 6


class IncidentSides:
    """The incidents of two runs, taken as they come, and the rows between those that belong together.

    rows: how many there were; first: the time of the first, None where there was none.
    """

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
        """True for rows at times t (k,), of which all incidents up to the last are known, and none later is asked for
        again."""
        found = np.zeros(len(t), dtype=bool)
        if not len(t):
            return found
        start = self._start = float(t[0]) if self._start is None else self._start
        late = LATE * (t - start)
        for sides in self._pending.values():
            one, other = (np.searchsorted(side, t, "right") for side in sides)
            differ = np.flatnonzero(one != other)
            for k in differ.tolist():
                ahead = sides[0] if one[k] > other[k] else sides[1]
                found[k] |= t[k] - ahead[min(one[k], other[k])] <= late[k]
            self._forget(sides, float(t[-1]), float(late[-1]))
        self._count(t, found)
        return found

    def beside(self, t: Floats) -> Flags:
        """As `between`, of a table whose own incidents are not known: rows next to one of the repeated run."""
        start = self._start = float(t[0]) if self._start is None and len(t) else self._start
        found = np.zeros(len(t), dtype=bool)
        for _, times in self._pending.values():
            for at in times:
                found |= np.abs(t - at) <= LATE * LATE * (t - (start or 0.0))
            times[:] = [at for at in times if len(t) and at > t[-1]]
        self._count(t, found)
        return found

    def _count(self, t: Floats, found: Flags) -> None:
        if found.any() and self.first is None:
            self.first = float(t[int(np.argmax(found))])
        self.rows += int(found.sum())

    @staticmethod
    def _forget(sides: tuple[list[float], list[float]], t: float, late: float) -> None:
        """Leave out what belongs together, and what has had no other for long."""
        one, other = sides
        count = min(int(np.searchsorted(one, t, "right")), int(np.searchsorted(other, t, "right")))
        del one[:count], other[:count]
        for side in sides:
            del side[: int(np.searchsorted(side, t - late, "left"))]


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
        places = np.minimum(np.searchsorted(t, times, "left"), len(t) - 1)
        self._gaps += gaps[places].tolist()
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
