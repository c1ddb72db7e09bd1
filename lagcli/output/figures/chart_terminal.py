"""A chart as text for a terminal: curves of braille dots between axes of plain characters."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.output.figures import chart
from lagcli.output.figures.chart import (
    ChartCurve,
    ChartData,
    ChartPanel,
    IncidentMarks,
    Span,
    squared,
    widened,
)

NARROWEST = 30  # columns: narrower terminals wrap the lines
ROWS = {1: 16, 2: 11}  # lines of axes, by the number of panels
FEWEST_ROWS = 7  # lines of axes of any panel: three ticks
MOST_LABEL = 30  # characters of a name in a legend
# Numbers of the colours of 256 that come next to those of figures, and of the sequence for many curves.
COLOURS = (25, 166, 36, 175, 178, 74)
SEQUENCE = (54, 60, 24, 30, 29, 35, 71, 77, 112, 148)
EMPTY = "\u2800"  # the character of no dots
MARK, MARK_COLOUR = "┆", 245
LETTERS = "abcdefghijkl"
SPOTS = 3  # letters on a curve where there are no colours


@dataclasses.dataclass(frozen=True, slots=True)
class TerminalLook:
    """The columns of a terminal, and whether it has colours."""

    columns: int = 80
    has_colours: bool = False


def lines(data: ChartData, look: TerminalLook) -> Iterator[str]:
    """The chart as lines of at most so many columns."""
    look = dataclasses.replace(look, columns=max(NARROWEST, look.columns))
    if data.title.strip():
        yield _cut(data.title, look.columns)
    for panel in data.panels:
        yield ""
        yield _cut(panel.y_label, look.columns)
        area = _Area(panel, look, ROWS.get(len(data.panels), FEWEST_ROWS))
        marks = (
            chart.incident_marks(data.incidents, area.x) if panel.shape == "time" and data.incidents else []
        )
        yield from area.drawn(marks)
        yield _cut(f"{' ' * (area.left + 1)}{panel.x_label.center(area.width)}".rstrip(), look.columns)
        for mark in marks:
            yield _cut(f"{MARK} {mark.label}", look.columns)
        yield from _legend(panel, look)
        for note in panel.notes:
            line = ""
            for word in diagnostics.printable(note).split():
                longer = f"{line} {word}" if line else _cut(word, look.columns)
                if line and diagnostics.columns(longer) > look.columns:
                    yield line
                    longer = _cut(word, look.columns)
                line = longer
            yield line


def _legend(panel: ChartPanel, look: TerminalLook) -> Iterator[str]:
    if panel.is_family:
        first, last = panel.curves[0].label, panel.curves[-1].label
        yield _cut(
            f"{len(panel.curves)} curves, {_cut(first, MOST_LABEL)} to {_cut(last, MOST_LABEL)}", look.columns
        )
        return
    if len(panel.curves) < 2 and not panel.keys:
        return
    line, used = "", 0
    for index, curve in enumerate(panel.curves):
        # The name of a curve; of columns of several runs both of the legend's entries
        column = next((key.label for key in panel.keys if key.colour == curve.colour and key.dash == 0), "")
        is_both = any(key.colour is None for key in panel.keys)
        name = _cut(f"{column}, {curve.label}" if is_both else curve.label, MOST_LABEL)
        sample = "──" if look.has_colours else LETTERS[index % len(LETTERS)]
        width = diagnostics.columns(sample) + 1 + diagnostics.columns(name) + 3
        if line and used + width > look.columns:
            yield line.rstrip()
            line, used = "", 0
        if look.has_colours:
            sample = f"\x1b[38;5;{_colour(panel, index)}m{sample}\x1b[0m"
        line += f"{sample} {name}   "
        used += width
    yield line.rstrip()


def _colour(panel: ChartPanel, index: int) -> int:
    if panel.is_family:
        return SEQUENCE[index * len(SEQUENCE) // len(panel.curves)]
    return COLOURS[index % len(COLOURS)]


class _Area:
    """The axes of a panel: a canvas of dots, four high and two wide in a character, with ticks beside it."""

    def __init__(self, panel: ChartPanel, look: TerminalLook, rows: int) -> None:
        self._panel, self._look, self.rows = panel, look, rows
        x, y = panel.extent()
        x = panel.limits if panel.limits is not None else x
        if panel.is_log:  # of the powers of ten
            bottom, top = chart.decades(*y)
            self.x, self._y = widened(x, 0.0), (float(bottom), float(top))
        else:
            flat = max(1e-3 * max(abs(y[0]), abs(y[1])), 0.0) or 1.0
            if y[1] - y[0] < flat:  # round-off about a constant is no motion
                middle = y[0] / 2 + y[1] / 2
                y = middle - flat / 2, middle + flat / 2
            self.x, self._y = widened(x, 0.0 if panel.shape == "time" else 0.03), widened(y, 0.04)
        self._measure()
        if panel.shape == "equal":
            (left, right), (lowest, highest) = panel.extent()
            ratio = (highest - lowest) / (right - left) if right > left else 1.0
            self.rows = round(min(max(self.width * ratio / 2, FEWEST_ROWS), 2 * rows))
            self.x, self._y = squared(*panel.extent(), 2 * self.width, 4 * self.rows)
            self._measure()
            self.x, self._y = squared(*panel.extent(), 2 * self.width, 4 * self.rows)
        self._ticks = self._texts()

    def _measure(self) -> None:
        """The columns of the texts on the left, and those that they leave."""
        self.left = max(map(len, self._texts().values()), default=0)
        self.width = max(10, self._look.columns - self.left - 2)

    def _texts(self) -> dict[int, str]:
        """The texts of ticks on the left by the number of the line from above."""
        low, high = self._y
        found: dict[int, str] = {}
        pairs = ticks(low, high, max(3, self.rows // 3))
        if self._panel.is_log:
            every = max(1, -(-round(high - low) // max(1, self.rows // 2)))
            pairs = [(float(p), f"1e{p}") for p in range(round(low), round(high) + 1, every)]
        for value, text in pairs:
            line = self.rows - 1 - int((value - low) / (high - low) * self.rows - 1e-9)
            found[min(max(line, 0), self.rows - 1)] = text
        return found

    def _points(self, curve: ChartCurve) -> tuple[list[list[float]], list[int]]:
        """The points of a curve on the canvas, pairs, and the indices of those that are finite."""
        y = np.log10(curve.y) if self._panel.is_log else curve.y
        if self._panel.shape == "time":
            chosen = chart.extrema(y, 4 * self.width)
            x, y = curve.x[chosen], y[chosen]
        else:
            x, y = chart.path(curve.x, y, most=8 * self.width, cells=4 * self.width)
        pairs = np.column_stack([_part(x, self.x), _part(y, self._y)])
        return pairs.tolist(), np.flatnonzero(np.isfinite(pairs).all(axis=1)).tolist()

    def drawn(self, marks: Sequence[IncidentMarks]) -> Iterator[str]:
        """The lines of the axes with their ticks."""
        # Loaded by --show alone.
        import plotille

        panel, has_colours = self._panel, self._look.has_colours
        canvas = plotille.Canvas(self.width, self.rows, 0.0, 0.0, 1.0, 1.0, mode="byte")
        curves = [self._points(curve) for curve in panel.curves]
        for index, (points, known) in enumerate(curves):
            colour = _colour(panel, index) if has_colours else None
            for before, after in itertools.pairwise(known):
                if after == before + 1:
                    canvas.line(*points[before], *points[after], color=colour)
            if len(known) == 1:
                canvas.point(*points[known[0]], color=colour)
        if not has_colours and 1 < len(curves) <= len(LETTERS):
            for index, (points, known) in enumerate(curves):
                # A letter on a curve, at some of its points that no other curve has
                for spot in range(SPOTS if known else 0):
                    part = (spot + (index + 1) / (len(curves) + 1)) / SPOTS
                    point = points[known[min(int(part * len(known)), len(known) - 1)]]
                    canvas.point(*point, marker=LETTERS[index])
        for t in itertools.chain(*(mark.times for mark in marks)):
            (fraction,) = _part(np.array([t]), self.x)
            if np.isfinite(fraction):
                for row in (0, self.rows - 1):  # at the edges: it would hide the curve
                    colour = MARK_COLOUR if has_colours else None
                    canvas.point(float(fraction), (row + 0.5) / self.rows, color=colour, marker=MARK)
        for number, line in enumerate(canvas.plot().split("\n")):
            line = line.replace(EMPTY, " ")
            text = self._ticks.get(number, "")
            yield f"{text:>{self.left}}{'┤' if text else '│'}{line}".rstrip()
        # The axis below with its ticks, as many as have room
        axis, names = ["─"] * self.width, [" "] * (self.width + 1)
        free = 0
        for value, text in ticks(*self.x, max(2, self.width // 12)):
            at = min(int((value - self.x[0]) / (self.x[1] - self.x[0]) * self.width), self.width - 1)
            axis[at] = "┬"
            start = min(max(at - len(text) // 2, 0), self.width - len(text))
            if start >= free:
                names[start : start + len(text)] = text
                free = start + len(text) + 1
        yield f"{' ' * self.left}└{''.join(axis)}"
        yield f"{' ' * self.left} {''.join(names)}".rstrip()


def _part(values: Floats, limits: Span) -> Floats:
    """The positions of values on an axis, 0 at its beginning and just below 1 at its end; nan outside."""
    half = limits[1] / 2 - limits[0] / 2  # twice the largest double is none
    if not half:  # of the smallest numbers there are no halves
        return np.where(values == limits[0], 0.0, 1 - 1e-9)
    part = (values / 2 - limits[0] / 2) / half
    return np.where((part >= 0) & (part <= 1), np.minimum(part, 1 - 1e-9), np.nan)


def _cut(text: str, columns: int) -> str:
    """The text as far as it goes in so many columns, without what a terminal would act on."""
    plain = diagnostics.printable(text).replace("\n", " ").replace("  (", " (")
    if diagnostics.columns(plain) <= columns:
        return plain
    while diagnostics.columns(plain) > columns - 1:
        plain = plain[: min(len(plain) - 1, columns)]
    return plain + "…"


def ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """About `most` round values from low to high, each with a text that tells it from the next."""
    rough = (high / most) - (low / most)
    if not (rough > 0 and math.isfinite(rough)):
        return [(low, f"{low:.6g}")] if math.isfinite(low) else []
    power = 10.0 ** math.floor(math.log10(rough))
    step = next((part * power for part in chart.STEPS if part * power >= rough * (1 - 1e-9)), 10 * power)
    if step <= 0.0 or high / step - math.floor(low / step) > 100 * most:
        return [(low, f"{low:.6g}"), (high, f"{high:.6g}")]
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    values = [number * step for number in range(first, last + 1)]
    largest = max(map(abs, values), default=0.0)
    digits = max(1, math.ceil(math.log10(largest / step) + 1e-9) + 2) if largest else 1
    return [
        (value, text.replace("e-0", "e-").replace("e+0", "e"))
        for value, text in zip(values, chart.tick_texts(values, digits), strict=True)
    ]
