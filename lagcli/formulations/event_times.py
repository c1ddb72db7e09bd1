"""Incidents of two runs side by side: which belong together, and by how much their times differ."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
LATE = 1e-6  # of the time both runs last: an incident so near its end may be in one of them alone


@dataclasses.dataclass(frozen=True, slots=True)
class RunEvent:
    """An incident of a run: its time, and its kind and name."""

    t: float
    kind: str
    name: str

    @property
    def label(self) -> str:
        """`impact of floor`."""
        return f"{self.kind} of {self.name}"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Times (m, 2) of incidents that belong together, with their labels; alone: the first that has no other."""

    t: Floats
    labels: tuple[str, ...]
    alone: RunEvent | None

    def parts(self, rows: Floats) -> npt.NDArray[np.bool_]:
        """True for the times (k,) at which one run is before an incident and the other behind it."""
        found = np.zeros(len(rows), dtype=bool)
        first, last = self.t.min(axis=1, initial=np.inf), self.t.max(axis=1, initial=-np.inf)
        places = np.searchsorted(rows, first, "left"), np.searchsorted(rows, last, "left")
        for begin, end in zip(*places, strict=True):
            found[begin:end] = True
        return found


def matched(one: Sequence[RunEvent], other: Sequence[RunEvent], end: float, span: float) -> Matched:
    """The incidents of two runs that both last to `end`, each kind and name in its order.

    Rebounds before an accumulation that both runs have may be told to different ends.
    """
    sides = [_by_label([event for event in side if event.t <= end]) for side in (one, other)]
    times, labels = [], []
    alone: list[RunEvent] = []
    for label in dict.fromkeys([*sides[0], *sides[1]]):
        first, second = (side.get(label, []) for side in sides)
        count = min(len(first), len(second))
        times += [(a.t, b.t) for a, b in zip(first, second, strict=False)]
        labels += [label] * count
        rest = [*first[count:], *second[count:]]
        if rest and not _is_settled(rest, sides):
            alone += [event for event in rest if event.t < end - LATE * span]
    t = np.array(times, dtype=float).reshape(-1, 2)
    return Matched(t, tuple(labels), min(alone, key=lambda event: event.t, default=None))


def _by_label(events: Sequence[RunEvent]) -> dict[str, list[RunEvent]]:
    found: dict[str, list[RunEvent]] = {}
    for event in events:
        found.setdefault(event.label, []).append(event)
    return found


def _is_settled(rest: Sequence[RunEvent], sides: Sequence[dict[str, list[RunEvent]]]) -> bool:
    """True for impacts of a contact whose rebounds end in both runs."""
    return rest[0].kind == "impact" and all(f"accumulation of {rest[0].name}" in side for side in sides)
