"""The incidents of a run as marks on the axis of time: a light line at each instant, decimated where they are many."""

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from lagcli.simulation.run_state.incident import KINDS

MOST = 300  # lines of one kind across a figure; closer ones cannot be told apart
DENSE = 60  # from so many on lines are thinner


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class IncidentMarks:
    """The marks of one kind; count: incidents of it; number: of the kind in `KINDS`; times: (k,), decimated."""

    kind: str
    number: int
    count: int
    times: NDArray[np.float64]

    @property
    def label(self) -> str:
        """The entry in the legend."""
        return self.kind if self.count == 1 else f"{self.count} × {self.kind}"

    @property
    def is_dense(self) -> bool:
        """True if there are so many that each must be thin."""
        return len(self.times) > DENSE


def of(incidents: Iterable[tuple[float, str]], span: tuple[float, float]) -> Sequence[IncidentMarks]:
    """The marks of incidents, given by times and kinds, on an axis of time; kinds in their order."""
    times: dict[str, list[float]] = {}
    for t, kind in incidents:
        times.setdefault(kind, []).append(t)
    return [
        IncidentMarks(kind, number, len(times[kind]), _decimated(np.array(times[kind]), span))
        for number, kind in enumerate(KINDS)
        if kind in times
    ]


def _decimated(times: NDArray[np.float64], span: tuple[float, float]) -> NDArray[np.float64]:
    """The first time in each of `MOST` parts of the axis."""
    first, last = span
    _, distinct = np.unique(np.floor((times - first) / ((last - first) or 1.0) * MOST), return_index=True)
    return times[distinct]
