"""Decimation: of rows, curves and paths as many points as a figure can show.

Rows are all there while they are few, and every second, fourth, ... of them where they are more; a curve over time
keeps the extrema of its stretches; of a path in a plane what goes over the same points again is drawn once.
"""

import numpy as np
from numpy.typing import NDArray

from lagcli.simulation.run_state.incident import KINDS

Floats = NDArray[np.float64]

# A figure is some 1 500 pixels wide; this many points on one curve show more than that.
FEWEST_ROWS = 4096
NUMBERS = 1 << 22
# Of a path: points of an orbit that never closes, drawn with a pen of a thousandth of the page, and cells that a page
# tells apart in one direction; coarser than the fewest, it looks like steps.
PATH_POINTS, CELLS, FEWEST_CELLS = 20_000, 4000, 250


class DecimatedRows:
    """Rows in arrival order, decimated evenly so that their number stays bounded; the last row is always there.

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
        self._store(rows[-self._arrived % self._stride :: self._stride])
        self._arrived += len(rows)
        self._last = rows[-1].copy()
        while self._count > most:
            chosen = np.concatenate(self._blocks)[::2]
            self._stride *= 2
            self._blocks, self._count = [], 0
            self._store(chosen)

    def mark(self, incidents: NDArray[np.float64]) -> None:
        """Take in incidents (k, columns): their times, and their kinds by their indices in `KINDS`, come first."""
        self.marks.extend((float(t), KINDS[int(kind)]) for t, kind in incidents[:, :2])

    def rows(self) -> NDArray[np.float64]:
        """The rows that are left, shape (k, columns)."""
        if self._last is None:
            return np.zeros((0, 0))
        ended = (self._arrived - 1) % self._stride == 0
        return np.concatenate([*self._blocks, *([] if ended else [self._last[None]])])

    def _store(self, rows: NDArray[np.float64]) -> None:
        self._blocks.append(rows.copy())
        self._count += len(rows)


def extrema(values: NDArray[np.float64], most: int) -> NDArray[np.intp]:
    """Indices of about ``most`` of ``values``, shape (T,): the ends and the extrema of every stretch."""
    count = len(values)
    if count <= most:
        return np.arange(count)
    stretches = max(1, most // 2)
    width = -(-count // stretches)
    first = np.arange(stretches) * width
    none = np.isnan(values)
    padded = np.empty((stretches, width))
    padded.ravel()[:count] = values
    padded.ravel()[count:] = np.nan
    has_gaps = count < padded.size or bool(none.any())
    lowest, highest = (
        (first + pick(np.where(np.isnan(padded), other, padded) if has_gaps else padded, axis=1)).clip(
            max=count - 1
        )
        for pick, other in ((np.argmin, np.inf), (np.argmax, -np.inf))
    )
    # A curve is broken where it has no value; where that is so too often to be seen, it is by stretches of none.
    breaks = np.flatnonzero(none)
    breaks = breaks[: len(breaks) if len(breaks) <= most else 0]
    return np.unique(np.concatenate([lowest, highest, breaks, [0, count - 1]]))


def path(x: Floats, y: Floats, most: int = PATH_POINTS, cells: int = CELLS) -> tuple[Floats, Floats]:
    """About `most` points of the curve through x and y (T,), which looks the same to `cells` cells across.

    Pieces that are left are parted by nan, where a curve is broken.
    """
    if len(x) <= most:
        return x, y
    while True:
        chosen, keys = _moved(x, y, cells)
        if len(chosen) <= most:
            return x[chosen], y[chosen]
        # The indices of points from which a piece leads to the next that no piece before has led over,
        # either way
        low, high = np.minimum(keys[:-1], keys[1:]), np.maximum(keys[:-1], keys[1:])
        pairs = low * (CELLS * CELLS) + high
        _, first = np.unique(pairs, return_index=True)
        pieces = np.sort(first[low[first] >= 0])
        if len(pieces) <= most or cells <= FEWEST_CELLS:
            break
        cells //= 2
    # Noise goes to new cells for ever: every so many pieces of it look like all of them.
    return _joined(x[chosen], y[chosen], pieces[:: -(-len(pieces) // most)])


def _moved(x: Floats, y: Floats, cells: int) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """The points at which the curve comes to another cell, and the last one, with their cells; -1 for nan."""
    keys = np.zeros(len(x), dtype=np.int64)
    lost = np.zeros(len(x), dtype=bool)
    for values in (x, y):
        finite = np.isfinite(values)
        lost |= ~finite
        low, high = (values[finite].min(), values[finite].max()) if finite.any() else (0.0, 0.0)
        span = high / 2 - low / 2 or 1.0  # halves: twice the largest double is none
        cell = np.where(finite, (values / 2 - low / 2) / span * (cells - 1), 0.0)
        keys = keys * cells + cell.astype(np.int64)
    keys[lost] = -1
    changes = np.flatnonzero(np.diff(keys, prepend=keys[0] - 1))
    chosen = np.union1d(changes, [len(x) - 1])
    return chosen, keys[chosen]


def _joined(x: Floats, y: Floats, pieces: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """The points of pieces, those that follow each other joined, others parted by nan."""
    starts = np.flatnonzero(np.diff(pieces, prepend=-2) != 1)
    ends = np.append(starts[1:], len(pieces))
    index = np.concatenate(
        [part for s, e in zip(starts, ends, strict=True) for part in (pieces[s:e], [pieces[e - 1] + 1, -1])]
    ).astype(np.intp)
    return tuple(np.where(index < 0, np.nan, values[index]) for values in (x, y))  # type: ignore[return-value]
