"""Curves in a plane thinned for a figure: what goes over the same places again is drawn once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MOST = 20_000  # points of one curve: an orbit that never closes, drawn with a pen of a thousandth of the page
CELLS = 4000  # places that a page tells apart in one direction
FEWEST_CELLS = 250  # coarser, and it looks like steps


def traced(x: Floats, y: Floats, most: int = MOST, cells: int = CELLS) -> tuple[Floats, Floats]:
    """About `most` points of the curve through x and y (T,), which looks the same to `cells` places across.

    Pieces that are left are parted by nan, where a curve is broken.
    """
    if len(x) <= most:
        return x, y
    while True:
        kept, keys = _moved(x, y, cells)
        if len(kept) <= most:
            return x[kept], y[kept]
        pieces = _new_pieces(keys)
        if len(pieces) <= most or cells <= FEWEST_CELLS:
            break
        cells //= 2
    # Noise goes to new places for ever: every so many pieces of it look like all of them.
    return _joined(x[kept], y[kept], pieces[:: -(-len(pieces) // most)])


def _moved(x: Floats, y: Floats, cells: int) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """The points at which the curve comes to another cell, and the last one, with their cells; -1 for nan."""
    keys = np.zeros(len(x), dtype=np.int64)
    lost = np.zeros(len(x), dtype=bool)
    for values in (x, y):
        finite = np.isfinite(values)
        lost |= ~finite
        low, high = (values[finite].min(), values[finite].max()) if finite.any() else (0.0, 0.0)
        span = high / 2 - low / 2 or 1.0  # halves: twice the largest double is none
        place = np.where(finite, (values / 2 - low / 2) / span * (cells - 1), 0.0)
        keys = keys * cells + place.astype(np.int64)
    keys[lost] = -1
    changes = np.flatnonzero(np.diff(keys, prepend=keys[0] - 1))
    kept = np.union1d(changes, [len(x) - 1])
    return kept, keys[kept]


def _new_pieces(keys: NDArray[np.int64]) -> NDArray[np.intp]:
    """The places of points from which a piece leads to the next that no piece before has led over, either way."""
    low, high = np.minimum(keys[:-1], keys[1:]), np.maximum(keys[:-1], keys[1:])
    pairs = low * (CELLS * CELLS) + high
    _, first = np.unique(pairs, return_index=True)
    return np.sort(first[low[first] >= 0])


def _joined(x: Floats, y: Floats, pieces: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """The points of pieces, those that follow each other joined, others parted by nan."""
    starts = np.flatnonzero(np.diff(pieces, prepend=-2) != 1)
    ends = np.append(starts[1:], len(pieces))
    index = np.concatenate(
        [part for s, e in zip(starts, ends, strict=True) for part in (pieces[s:e], [pieces[e - 1] + 1, -1])]
    ).astype(np.intp)
    return tuple(np.where(index < 0, np.nan, values[index]) for values in (x, y))  # type: ignore[return-value]
