"""A chart as data: panels of curves with the words of their axes and legends, whatever they are drawn with.

All is decimated to what a figure can show: rows evenly, a curve over time keeps the extrema of its stretches, and a
path in a plane goes over the same points once.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lagcli import doubles
from lagcli.arrays import Floats, Integers
from lagcli.simulation.run_state.statistics import KINDS

Span = tuple[float, float]

# Curves of one panel that a legend can tell apart; more have the colours of a sequence.
MOST_KEYS = 12
# Of a logarithmic axis: from the largest forces to what is left of them after rounding, and then some.
MOST_DECADES = 40
# The largest size on an axis: ticks around it, and their differences, are doubles too.
LARGEST = 1e300
# Marks of incidents of one kind across a figure; closer ones cannot be told apart. From so many on lines are thinner.
MOST_MARKS, DENSE_MARKS = 300, 60
# A figure is some 1 500 pixels wide; this many points on one curve show more than that.
FEWEST_ROWS = 4096
NUMBERS = 1 << 22
# Of a path: points of an orbit that never closes, drawn with a pen of a thousandth of the page, and cells that a page
# tells apart in one direction; coarser than the fewest, it looks like steps.
PATH_POINTS, CELLS, FEWEST_CELLS = 20_000, 4000, 250
STEPS = (1, 2, 2.5, 5, 10)  # between ticks, times a power of ten


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ChartCurve:
    """A curve: x and y (k,), decimated, broken where one is nan; colour and dash by their indices in a sequence."""

    label: str
    x: Floats
    y: Floats
    colour: int
    dash: int


@dataclasses.dataclass(frozen=True, slots=True)
class LegendKey:
    """An entry of a legend; colour is None where it explains dashes alone."""

    label: str
    colour: int | None
    dash: int


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class IncidentDots:
    """The points of incidents of one kind, by its number, in a plane: x and y (k,)."""

    number: int
    x: Floats
    y: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class IncidentMarks:
    """The marks of one kind; count: incidents of it; number: of the kind in `KINDS`; times: (k,), decimated."""

    kind: str
    number: int
    count: int
    times: Floats

    @property
    def label(self) -> str:
        """The entry in the legend."""
        return self.kind if self.count == 1 else f"{self.count} × {self.kind}"

    @property
    def is_dense(self) -> bool:
        """True if there are so many that each must be thin."""
        return len(self.times) > DENSE_MARKS


def incident_marks(incidents: Iterable[tuple[float, str]], span: Span) -> Sequence[IncidentMarks]:
    """The marks of incidents, given by times and kinds, on an axis of time; kinds in their order."""
    known, (first, last) = list(incidents), span
    marks = []
    for number, kind in enumerate(KINDS):
        times = np.array([t for t, own in known if own == kind])
        if len(times):
            # The first time in each of `MOST_MARKS` parts of the axis
            parts = np.floor((times - first) / ((last - first) or 1.0) * MOST_MARKS)
            _, distinct = np.unique(parts, return_index=True)
            marks.append(IncidentMarks(kind, number, len(times), times[distinct]))
    return marks


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ChartPanel:
    """Curves on common axes.

    shape: `time` for values over a common axis that rises, `plane` for one column against another, `equal` for such
    with one scale; keys: of the legend; is_family: coloured by a sequence; is_log: sizes on a logarithmic scale;
    limits: of x where it is common to all panels; title: above one of several panels side by side.
    """

    shape: Literal["time", "plane", "equal"]
    x_label: str
    y_label: str
    curves: tuple[ChartCurve, ...]
    keys: tuple[LegendKey, ...] = ()
    is_family: bool = False
    is_log: bool = False
    limits: Span | None = None
    dots: tuple[IncidentDots, ...] = ()
    notes: tuple[str, ...] = ()
    title: str = ""

    def drawable(self) -> ChartPanel:
        """The panel; of values that are too large for an axis a part, which the name of the axis says."""
        (left, right), (bottom, top) = self.extent(np.inf)
        is_far, is_high = max(-left, right) > LARGEST, max(-bottom, top) > LARGEST
        if self.shape == "equal":
            is_far = is_high = is_far or is_high
        elif self.shape == "time":
            is_far = False
        if self.is_log or not (is_far or is_high):
            return self

        return dataclasses.replace(
            self,
            x_label=fitted(self.x_label) if is_far else self.x_label,
            y_label=fitted(self.y_label) if is_high else self.y_label,
            curves=tuple(
                dataclasses.replace(one, x=fit(one.x, is_far), y=fit(one.y, is_high)) for one in self.curves
            ),
            dots=tuple(
                dataclasses.replace(one, x=fit(one.x, is_far), y=fit(one.y, is_high)) for one in self.dots
            ),
        )

    def extent(self, most: float = LARGEST) -> tuple[Span, Span]:
        """The smallest and largest finite values of x and of y, up to the size `most`; (0, 0) where there are none."""
        return ends((c.x for c in self.curves), most), ends((c.y for c in self.curves), most)


def ends(values: Iterable[Floats], most: float = np.inf) -> Span:
    """The smallest and largest finite numbers of arrays, up to the size `most`; (0, 0) where there are none."""
    shown = np.concatenate([*values, np.zeros(0)])
    shown = np.clip(shown[np.isfinite(shown)], -most, most)
    return (float(shown.min()), float(shown.max())) if shown.size else (0.0, 0.0)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ChartData:
    """Panels from top to bottom under a title; incidents: times and kinds, marked on axes of time."""

    title: str
    panels: tuple[ChartPanel, ...]
    incidents: Sequence[tuple[float, str]] = ()


def squared(x: Span, y: Span, width: float, height: float) -> tuple[Span, Span]:
    """The limits of axes of that size on which both directions have one scale, with some room around x and y."""
    spans = max(x[1] - x[0], 0.0), max(y[1] - y[0], 0.0)
    scale = 1.08 * max(spans[0] / width, spans[1] / height)
    scale = scale or 1.08 * max(abs(x[0]), abs(y[0]), 1.0) / max(width, height)
    middles = x[0] / 2 + x[1] / 2, y[0] / 2 + y[1] / 2
    halves = (
        max(scale * size / 2, doubles.VALUE * abs(middle))
        for size, middle in zip((width, height), middles, strict=True)
    )
    (a, b), (c, d) = ((m - h, m + h) for m, h in zip(middles, halves, strict=True))
    return (a, b), (c, d)


def decades(low: float, high: float) -> tuple[int, int]:
    """The powers of ten from below the smallest to above the largest positive value; no more than MOST_DECADES."""
    top = int(np.ceil(np.log10(high))) if high > 0 else 0
    bottom = int(np.floor(np.log10(low))) if low > 0 else top - 1
    return max(min(bottom, top - 1), top - MOST_DECADES), top


def sizes(vectors: Floats) -> Floats:
    """The lengths of vectors (..., 3), whose squares may be beyond all doubles."""
    return np.asarray(np.hypot(np.hypot(vectors[..., 0], vectors[..., 1]), vectors[..., 2]))


def fit(values: Floats, is_large: bool = True) -> Floats:
    """Values that are too large for an axis, as they are drawn: none of them is larger than `LARGEST` then."""
    return np.asarray(values / 10**10) if is_large else values


def fitted(label: str) -> str:
    """The name of an axis of such values."""
    return f"{label} × 1e-10"


def widened(span: Span, part: float = 0.0) -> Span:
    """The limits of an axis that shows all of a span, and a part of it more at both ends; the span may be a point."""
    low, high = (min(max(end, -LARGEST), LARGEST) for end in span)
    if low == high:
        half = max(0.5, doubles.VALUE * abs(low))
        return low - half, high + half
    return low - part * (high - low), high + part * (high - low)


def tick_texts(values: Sequence[float], digits: int) -> list[str]:
    """Values as texts of so many digits, with as many decimals in each where none has an exponent."""
    texts = [f"{value:.{digits}g}" for value in values]
    if any("e" in text for text in texts):
        return texts
    decimals = max((len(text.partition(".")[2]) for text in texts), default=0)
    return [f"{value:.{decimals}f}" for value in values]


class DecimatedRows:
    """Rows in arrival order, decimated evenly to a bounded number, the last one among them; marks: of incidents."""

    def __init__(self) -> None:
        self.marks: list[tuple[float, str]] = []
        self._stride = 1
        self._arrived = 0
        self._blocks: list[Floats] = []
        self._count = 0
        self._last: Floats | None = None

    def add(self, rows: Floats) -> None:
        """Take in ``rows``, shape (k, columns)."""
        if not len(rows):
            return
        most = max(FEWEST_ROWS, NUMBERS // rows.shape[1])
        self._blocks.append(rows[-self._arrived % self._stride :: self._stride].copy())
        self._count += len(self._blocks[-1])
        self._arrived += len(rows)
        self._last = rows[-1].copy()
        while self._count > most:
            self._blocks = [np.concatenate(self._blocks)[::2].copy()]
            self._count = len(self._blocks[0])
            self._stride *= 2

    def mark(self, incidents: Floats) -> None:
        """Take in incidents (k, columns): their times, and their kinds by their indices in `KINDS`, come first."""
        self.marks.extend((float(t), KINDS[int(kind)]) for t, kind in incidents[:, :2])

    def rows(self) -> Floats:
        """The rows that are left, shape (k, columns)."""
        if self._last is None:
            return np.zeros((0, 0))
        ended = (self._arrived - 1) % self._stride == 0
        return np.concatenate([*self._blocks, *([] if ended else [self._last[None]])])


def extrema(values: Floats, most: int) -> NDArray[np.intp]:
    """Indices of about ``most`` of ``values``, shape (T,): the ends and the extrema of every stretch."""
    count = len(values)
    if count <= most:
        return np.arange(count)
    stretches = max(1, most // 2)
    width = -(-count // stretches)
    first = np.arange(stretches) * width
    padded = np.full((stretches, width), np.nan)
    padded.ravel()[:count] = values
    none = np.isnan(padded)
    lowest = (first + np.where(none, np.inf, padded).argmin(axis=1)).clip(max=count - 1)
    highest = (first + np.where(none, -np.inf, padded).argmax(axis=1)).clip(max=count - 1)
    # A curve is broken where it has no value; where that is so too often to be seen, it is by stretches of none.
    breaks = np.flatnonzero(np.isnan(values))
    breaks = breaks[: len(breaks) if len(breaks) <= most else 0]
    return np.unique(np.concatenate([lowest, highest, breaks, [0, count - 1]]))


def path(x: Floats, y: Floats, most: int = PATH_POINTS, cells: int = CELLS) -> tuple[Floats, Floats]:
    """About `most` points of the curve through x and y (T,), which looks the same to `cells` cells across; pieces that
    are left are parted by nan."""
    if len(x) <= most:
        return x, y
    while True:
        chosen, keys = _moved(x, y, cells)
        if len(chosen) <= most:
            return x[chosen], y[chosen]
        # The points from which a piece leads to the next that no piece before has led over, either way
        low, high = np.minimum(keys[:-1], keys[1:]), np.maximum(keys[:-1], keys[1:])
        pairs = low * (CELLS * CELLS) + high
        _, first = np.unique(pairs, return_index=True)
        pieces = np.sort(first[low[first] >= 0])
        if len(pieces) <= most or cells <= FEWEST_CELLS:
            break
        cells //= 2
    # Noise goes to new cells for ever: every so many pieces of it look like all of them.
    pieces = pieces[:: -(-len(pieces) // most)]
    # Pieces that follow each other are joined, others parted by nan.
    starts = np.flatnonzero(np.diff(pieces, prepend=-2) != 1)
    ends = np.append(starts[1:], len(pieces))
    index = np.concatenate(
        [part for s, e in zip(starts, ends, strict=True) for part in (pieces[s:e], [pieces[e - 1] + 1, -1])]
    ).astype(np.intp)
    x, y = (np.where(index < 0, np.nan, values[chosen][index]) for values in (x, y))
    return x, y


def _moved(x: Floats, y: Floats, cells: int) -> tuple[NDArray[np.intp], Integers]:
    """The points at which the curve comes to another cell, and the last one, with their cells; -1 for nan."""
    keys = np.zeros(len(x), dtype=np.int64)
    lost = np.zeros(len(x), dtype=bool)
    for values in (x, y):
        finite = np.isfinite(values)
        lost |= ~finite
        low, high = ends([values])
        span = high / 2 - low / 2 or 1.0  # halves: twice the largest double is none
        cell = np.where(finite, (values / 2 - low / 2) / span * (cells - 1), 0.0)
        keys = keys * cells + cell.astype(np.int64)
    keys[lost] = -1
    changes = np.flatnonzero(np.diff(keys, prepend=keys[0] - 1))
    chosen = np.union1d(changes, [len(x) - 1])
    return chosen, keys[chosen]
