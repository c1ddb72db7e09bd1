"""Rows for a figure: all of them while they are few, every second, fourth, ... where they are more than it can show."""

import numpy as np
from numpy.typing import NDArray

from lagcli.simulation.run_state.incident import KINDS

# A figure is some 1 500 pixels wide; this many points on one curve show more than that.
FEWEST_ROWS = 4096
NUMBERS = 1 << 22


class Thinned:
    """Rows in arrival order, thinned evenly so that their number stays bounded; the last row is always there.

    marks: times and kinds of incidents among them.
    """

    def __init__(self) -> None:
        self.marks: list[tuple[float, str]] = []
        self._stride = 1
        self._arrived = 0
        self._blocks: list[NDArray[np.float64]] = []
        self._count = 0
        self._last: NDArray[np.float64] | None = None

    def add(self, rows: NDArray[np.float64]) -> None:
        """Take in ``rows``, shape (k, columns)."""
        if not len(rows):
            return
        most = max(FEWEST_ROWS, NUMBERS // rows.shape[1])
        self._keep(rows[-self._arrived % self._stride :: self._stride])
        self._arrived += len(rows)
        self._last = rows[-1].copy()
        while self._count > most:
            kept = np.concatenate(self._blocks)[::2]
            self._stride *= 2
            self._blocks, self._count = [], 0
            self._keep(kept)

    def mark(self, incidents: NDArray[np.float64]) -> None:
        """Take in incidents (k, columns): their times, and their kinds by their places in `KINDS`, come first."""
        self.marks.extend((float(t), KINDS[int(kind)]) for t, kind in incidents[:, :2])

    def rows(self) -> NDArray[np.float64]:
        """The rows that are left, shape (k, columns)."""
        if self._last is None:
            return np.zeros((0, 0))
        ended = (self._arrived - 1) % self._stride == 0
        return np.concatenate([*self._blocks, *([] if ended else [self._last[None]])])

    def _keep(self, rows: NDArray[np.float64]) -> None:
        self._blocks.append(rows.copy())
        self._count += len(rows)
