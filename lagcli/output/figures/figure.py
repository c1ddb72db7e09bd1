"""Figures of a run, fit to be printed: lambda_i(t) and R_k(t). The only file that imports matplotlib.

The page is a column of blocks, each of which knows its height in inches before anything is drawn. Texts are
measured and broken into lines, cut only where they are very long, and never read as markup: the names and the title
are the user's.
"""

import bisect
import contextlib
import dataclasses
import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack

import matplotlib
import numpy as np
from matplotlib import axes, collections, colors, figure, font_manager, lines, textpath, ticker
from matplotlib.backends import backend_agg
from numpy.typing import NDArray

from lagcli.output import atomic_file, endings
from lagcli.output.figures import incident_marks, labels, panels

_Dash = Literal["-"] | tuple[float, tuple[float, ...]]


class _TextStyle(TypedDict, total=False):
    ha: str
    va: str
    rotation: float
    multialignment: str
    weight: str
    color: str


class _LineStyle(TypedDict, total=False):
    color: str
    linestyle: _Dash
    linewidth: float


_WIDTH = 7.2
_MARGIN = 0.12
_DPI = 200
_INK = "#222222"
_GREY = "#888888"
# Okabe and Ito's colours, which the colour-blind can tell apart; dashes tell apart curves that coincide.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_DASHES: tuple[_Dash, ...] = (
    "-",
    (0, (5, 2)),
    (0, (1.5, 1.5)),
    (0, (6, 1.5, 1.5, 1.5)),
    (0, (3, 3)),
    (0, (8, 3)),
)
# Of marks of incidents, lighter, in the order of their kinds.
_MARK_COLOURS = ("#E3A587", "#C39BD3", "#B7A27A", "#93C9A8", "#9DB9D9", "#AAAAAA")
_MARK_DASHES: tuple[_Dash, ...] = (
    "-",
    (0, (6, 1.5)),
    (0, (2, 1)),
    (0, (4, 2)),
    (0, (1, 1)),
    (0, (6, 1.5, 1.5, 1.5)),
)
# Asked only for characters that DejaVu Sans, which comes with matplotlib, does not have.
_FALLBACK_FONTS = (
    "Noto Sans CJK SC",
    "Noto Sans CJK JP",
    "Source Han Sans",
    "WenQuanYi Micro Hei",
    "Droid Sans Fallback",
    "Hiragino Sans",
    "PingFang SC",
    "Microsoft YaHei",
    "Yu Gothic",
    "Malgun Gothic",
    "Noto Sans Devanagari",
    "Noto Sans Thai",
    "Arial Unicode MS",
)
_STYLE: dict[Any, str | float] = {  # matplotlib's keys are literals
    "text.parse_math": False,
    "text.usetex": False,
    "text.color": _INK,
    "axes.edgecolor": _GREY,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": _GREY,
    "ytick.color": _GREY,
    "xtick.labelcolor": _INK,
    "ytick.labelcolor": _INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.pad": 2.0,
    "ytick.major.pad": 2.0,
    "svg.hashsalt": "lagcli",
    "pdf.fonttype": 42,  # journals refuse Type 3 fonts
    "agg.path.chunksize": 10_000,
}
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Creator": "lagcli", "Date": None},
    "pdf": {"Creator": "lagcli", "Producer": None, "CreationDate": None},
}


def draw(
    path: str | os.PathLike[str],
    columns: Sequence[str],
    rows: NDArray[np.float64],
    *,
    title: str,
    units: panels.PanelUnits,
    facts: panels.PanelFacts = panels.NOTHING,
) -> None:
    """Draw the multipliers and constraint forces of a run to ``path``: png, svg or pdf.

    ``rows`` has shape (T, len(columns)), with all the columns of a run; equal runs give equal bytes.
    ``facts``: multipliers that are not unique are marked, columns that are zero to rounding drawn as zero, incidents
    light upright lines.
    The file is written aside and moved into place.
    Raises ``endings.UnknownFormat``, OSError, and ValueError where the column ``t`` is missing.
    """
    target = Path(path)
    fmt = endings.of(target, endings.FIGURES)
    with style():
        drawn = compose(columns, rows, title=title, units=units, facts=facts)
        write(target, fmt, drawn)


def write(target: Path, fmt: str, drawn: figure.Figure) -> None:
    """A figure in a format of ``endings.FIGURES``, written aside and moved into place. Raises OSError."""
    place = atomic_file.Aside(target)
    with atomic_file.undone_by(place.discard):
        drawn.savefig(place.path, format=fmt, metadata=_METADATA[fmt])
        place.commit()


def compose(
    columns: Sequence[str],
    rows: NDArray[np.float64],
    *,
    title: str,
    units: panels.PanelUnits,
    facts: panels.PanelFacts = panels.NOTHING,
) -> figure.Figure:
    """The figure that ``draw`` writes; arguments and errors are those of ``draw``."""
    title = labels.shortened(title, labels.TITLE)
    units = labels.ShortUnits(
        *(labels.shortened(u, labels.UNIT) for u in (units.length, units.mass, units.time))
    )
    found = panels.bands(columns, rows, units, facts)
    time = panels.with_unit("t", units.time.strip())
    with style():
        ruler = _Ruler([title, *columns, units.length, units.mass, units.time])
        matplotlib.rcParams["font.family"] = ruler.families
        blocks = [_text(ruler, title, size=11, weight="bold", gap=0.04)] if title.strip() else []
        marks: Sequence[incident_marks.IncidentMarks] = ()
        if facts.incidents and any(band.panels for band in found):
            span = _time_limits(next(band for band in found if band.panels))
            marks = incident_marks.of(facts.incidents, span)
            names = [mark.label for mark in marks]
            blocks.append(_legend(ruler, names, [_mark_look(mark) for mark in marks]))
        for band in found:
            blocks += _band(ruler, band, time, marks)
        page = _Page(sum(block.height for block in blocks) + 2 * _MARGIN)
        top = _MARGIN
        for block in blocks:
            block.draw(page, top)
            top += block.height
        return page.figure


@contextlib.contextmanager
def style() -> Iterator[None]:
    """The project's look whatever the user's matplotlibrc says, which is left as it is."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield


class _Page:
    """A figure on which things are placed in inches from its left and upper edge."""

    def __init__(self, height: float) -> None:
        self.figure = figure.Figure(figsize=(_WIDTH, height), dpi=_DPI)
        self._height = height
        backend_agg.FigureCanvasAgg(self.figure)

    def axes(self, left: float, top: float, width: float, height: float) -> axes.Axes:
        bottom = self._height - top - height
        return self.figure.add_axes(
            (left / _WIDTH, bottom / self._height, width / _WIDTH, height / self._height)
        )

    def text(self, left: float, top: float, text: str, size: float, **style: Unpack[_TextStyle]) -> None:
        # Line by line on its baseline: matplotlib aligns by the ink, which differs with the letters.
        for number, line in enumerate(text.split("\n") if text else []):
            below = top + (number + 0.75) * _high("", size)
            self.figure.text(left / _WIDTH, 1 - below / self._height, line, fontsize=size, **style)

    def upright(self, left: float, middle: float, text: str, size: float) -> None:
        """Text that reads upwards, for the axis of values."""
        style: _TextStyle = {"rotation": 90, "va": "center", "multialignment": "center"}
        self.figure.text(left / _WIDTH, 1 - middle / self._height, text, fontsize=size, **style)

    def line(self, left: float, right: float, top: float, **style: Unpack[_LineStyle]) -> None:
        height = 1 - top / self._height
        self.figure.add_artist(lines.Line2D([left / _WIDTH, right / _WIDTH], [height, height], **style))


class _Ruler:
    """Measures texts, in inches, and breaks them into lines; chooses the fonts that ``texts`` need."""

    def __init__(self, texts: Sequence[str]) -> None:
        self.families = ["DejaVu Sans"]
        lacking = set("".join(texts)) - _characters("DejaVu Sans")
        if lacking:
            installed = {entry.name for entry in font_manager.fontManager.ttflist}
            self.families += [name for name in _FALLBACK_FONTS if name in installed]
            for name in self.families[1:]:
                lacking -= _characters(name)
        # What no font has is written as its code: a row of empty boxes would say nothing.
        self._codes = {ord(letter): f"\\u{ord(letter):04x}" for letter in lacking if not letter.isspace()}

    def width(self, text: str, size: float, weight: str = "normal") -> float:
        """The width of one line of text."""
        font = font_manager.FontProperties(family=self.families, size=size, weight=weight)
        width, _, _ = textpath.text_to_path.get_text_width_height_descent(text, font, False)
        return float(width) / 72

    def wrap(self, text: str, width: float, size: float, weight: str = "normal") -> str:
        """``text`` in lines of at most ``width``, broken between words where possible; cut if very long."""
        room = 0.97 * width  # pixels round letters to a little more than measured

        def too_wide(line: str) -> bool:
            return self.width(line, size, weight) > room

        done: list[str] = []
        line = ""
        for word in labels.shortened(text, labels.TITLE).translate(self._codes).split():
            if line and too_wide(f"{line} {word}"):
                done.append(line)
                line = ""
            line = f"{line} {word}" if line else word
            while len(line) > 1 and too_wide(line):
                fits = (
                    bisect.bisect_left(range(2, len(line) + 1), True, key=lambda end: too_wide(line[:end]))
                    + 1
                )
                done.append(line[:fits])
                line = line[fits:]
        return "\n".join([*done, line] if line or not done else done)


def _characters(family: str) -> set[str]:
    path = font_manager.findfont(family, fallback_to_default=False)
    return {chr(code) for code in font_manager.get_font(path).get_charmap()}


def _high(text: str, size: float) -> float:
    """The height of a text of that many lines."""
    return (text.count("\n") + 1) * size * 1.4 / 72


@dataclasses.dataclass(frozen=True, slots=True)
class _FigureBlock:
    """Something as wide as the page; ``draw`` gets the page and the block's distance from its upper edge."""

    height: float
    draw: Callable[[_Page, float], None]


def _text(
    ruler: _Ruler, text: str, size: float, *, weight: str = "normal", gap: float = 0.0, colour: str = _INK
) -> _FigureBlock:
    """A paragraph with ``gap`` above it."""
    wrapped = ruler.wrap(text, _WIDTH - 2 * _MARGIN, size, weight)

    def draw(page: _Page, top: float) -> None:
        page.text(_MARGIN, top + gap, wrapped, size, weight=weight, color=colour)

    return _FigureBlock(gap + _high(wrapped, size), draw)


def _band(
    ruler: _Ruler, band: panels.Band, time: str, marks: Sequence[incident_marks.IncidentMarks]
) -> list[_FigureBlock]:
    blocks = [_text(ruler, band.heading, 9, weight="bold", gap=0.1)]
    if band.panels:
        labels = [curve.label for curve in band.panels[0].curves]
        if band.family:
            blocks.append(_family(ruler, band, marks))
        else:
            if len(labels) > 1:
                blocks.append(_legend(ruler, labels, [_look(place) for place in range(len(labels))]))
            blocks.append(_grid(ruler, band, marks))
        blocks.append(_time_label(ruler, time))
    if band.note:
        blocks.append(_text(ruler, band.note, 7.5, gap=0.02, colour="#666666"))
    return blocks


def _time_label(ruler: _Ruler, time: str) -> _FigureBlock:
    wrapped = ruler.wrap(time, _WIDTH - 2 * _MARGIN, 8)

    def draw(page: _Page, top: float) -> None:
        page.text(_WIDTH / 2, top, wrapped, 8, ha="center")

    return _FigureBlock(_high(wrapped, 8), draw)


def _legend(ruler: _Ruler, labels: Sequence[str], looks: Sequence[_LineStyle]) -> _FigureBlock:
    """Samples of the lines with their names, from left to right in as many lines as it takes."""
    size, sample, space = 8, 0.32, 0.2
    places: list[tuple[float, float, str]] = []
    left, top, below = _MARGIN, 0.04, 0.04
    for label in labels:
        wrapped = ruler.wrap(label, _WIDTH - 2 * _MARGIN - sample, size)
        width = sample + max(ruler.width(line, size) for line in wrapped.split("\n"))
        if left > _MARGIN and left + width > _WIDTH - _MARGIN:
            left, top = _MARGIN, below
        places.append((left, top, wrapped))
        left += width + space
        below = max(below, top + _high(wrapped, size))

    def draw(page: _Page, start: float) -> None:
        for place, (x, y, text) in enumerate(places):
            middle = start + y + 0.55 * _high("", size)
            page.line(x, x + sample - 0.07, middle, **looks[place])
            page.text(x + sample, start + y, text, size)

    return _FigureBlock(below + 0.04, draw)


def _look(place: int) -> _LineStyle:
    return {
        "color": _COLOURS[place % len(_COLOURS)],
        "linestyle": _DASHES[place % len(_DASHES)],
        "linewidth": 1.2,
    }


def _mark_look(mark: incident_marks.IncidentMarks) -> _LineStyle:
    return {
        "color": _MARK_COLOURS[mark.number],
        "linestyle": "-" if mark.is_dense else _MARK_DASHES[mark.number],
        "linewidth": 1.2,
    }


def _put_marks(plot: axes.Axes, marks: Sequence[incident_marks.IncidentMarks]) -> None:
    """The marks behind the curves, from the lower edge of the axes to the upper one."""
    for mark in marks:
        look = _mark_look(mark)
        plot.vlines(
            mark.times,
            0.0,
            1.0,
            transform=plot.get_xaxis_transform(),
            colors=look["color"],
            linestyles=look["linestyle"],
            linewidths=0.3 if mark.is_dense else 0.7,
            zorder=0.5,
        )


def _grid(ruler: _Ruler, band: panels.Band, marks: Sequence[incident_marks.IncidentMarks]) -> _FigureBlock:
    """Small axes side by side, each under its title and with its own scale, all with the same times."""
    count = len(band.panels)
    usual = {1: 1, 2: 2, 3: 3, 4: 2, 5: 3, 6: 3}.get(count, 4 if count <= 12 else 5)
    high = {1: 2.0, 2: 1.4, 3: 1.2, 4: 0.9, 5: 0.56}[usual]
    size = 8.0 if usual <= 3 else 7.0
    floor = panels.ROUND_OFF * max(_size(panel) for panel in band.panels)
    scales = [_value_scale(panel, floor, most=5 if usual <= 2 else 3) for panel in band.panels]
    label = ruler.wrap(band.label, -(-count // usual) * high, 8)
    strip = _MARGIN + _high(label, 8)
    room = max(0.36, 0.08 + max(ruler.width(text, size - 1) for scale in scales for text in scale.texts))
    # Long names get wider panels.
    for across in range(usual, 0, -1):
        cell = (_WIDTH - strip - _MARGIN) / across
        width = cell - room - 0.1
        titles = [ruler.wrap(panel.title, width, size) for panel in band.panels]
        if max(title.count("\n") for title in titles) <= 1:
            break
    heads = [
        max((_high(title, size) for title in row if title), default=0.06) + 0.02
        for row in _batched(titles, across)
    ]
    tops = list(itertools.accumulate((head + high + 0.08 for head in heads), initial=0.0))
    times = _scale(*_time_limits(band), most=6 if across <= 2 else 3)

    def draw(page: _Page, start: float) -> None:
        middle = start + heads[0] + (tops[-1] - heads[0]) / 2
        page.upright(_MARGIN, middle, label, 8)
        for place, panel in enumerate(band.panels):
            row, column = divmod(place, across)
            left, top = strip + column * cell + room, start + tops[row]
            bottom = place + across >= count
            page.text(left, top, titles[place], size)
            plot = page.axes(left, top + heads[row], width, high)
            _ticks(plot, times, scales[place], size - 1, times_named=bottom)
            _put_marks(plot, marks)
            for number, curve in enumerate(panel.curves):
                marker = "o" if len(curve.t) == 1 else None
                plot.plot(curve.t, curve.values, marker=marker, markersize=3, **_look(number))

    return _FigureBlock(tops[-1] + 0.14, draw)


def _family(ruler: _Ruler, band: panels.Band, marks: Sequence[incident_marks.IncidentMarks]) -> _FigureBlock:
    """Many curves on common axes, coloured by their order, with names along the bar of colours."""
    (panel,) = band.panels
    count, size = len(panel.curves), 7.0
    names = [ruler.wrap(curve.label, 1.6, size) for curve in panel.curves]
    tallest = max(_high(name, size) for name in names)
    high = max(2.3, 2 * tallest)
    named = np.unique(
        np.linspace(0, count - 1, min(9, max(2, int(high / (1.6 * tallest))))).round().astype(int)
    )
    beside = 0.1 + max(ruler.width(line, size) for place in named for line in names[place].split("\n"))
    scale = _value_scale(panel, 0.0, most=5)
    times = _scale(*_time_limits(band), most=6)
    label = ruler.wrap(band.label, high, 8)
    left = _MARGIN + _high(label, 8) + max(0.36, 0.08 + max(ruler.width(text, size) for text in scale.texts))
    width = _WIDTH - left - 0.27 - beside - _MARGIN
    # The bright end of the map is hardly seen on white.
    shades = colors.ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0, 0.93, 256)))

    def draw(page: _Page, top: float) -> None:
        top += 0.06
        page.text(
            _MARGIN, top + high / 2, label, 8, rotation=90, va="center", ha="left", multialignment="center"
        )
        plot = page.axes(left, top, width, high)
        _ticks(plot, times, scale, size, times_named=True)
        _put_marks(plot, marks)
        shade = shades(np.linspace(0, 1, count))
        paths = [np.column_stack([curve.t, curve.values]) for curve in panel.curves]
        plot.add_collection(collections.LineCollection(paths, colors=shade, linewidths=0.7), autolim=False)
        if len(panel.curves[0].t) == 1:
            moments, values = np.concatenate(paths).T
            plot.scatter(moments, values, s=9, c=shade)
        bar = page.axes(left + width + 0.15, top, 0.12, high)
        bar.imshow(
            np.linspace(0, 1, 256)[:, None], cmap=shades, aspect="auto", extent=(0, 1, count - 0.5, -0.5)
        )
        bar.set_xticks([])
        bar.yaxis.tick_right()
        bar.set_yticks(named, [names[place] for place in named], fontsize=size)
        # The outer names keep within the height of the bar, however many lines they have.
        bar.get_yticklabels()[0].set_verticalalignment("top")
        bar.get_yticklabels()[-1].set_verticalalignment("bottom")
        bar.spines[:].set_visible(False)

    return _FigureBlock(0.06 + high + 0.22, draw)


@dataclasses.dataclass(frozen=True, slots=True)
class _Scale:
    """The range of an axis with its ticks and their texts."""

    limits: tuple[float, float]
    values: tuple[float, ...]
    texts: tuple[str, ...]


def _scale(low: float, high: float, most: int) -> _Scale:
    """A scale with about ``most`` ticks, each told apart from the next by its text."""
    found = ticker.MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    step = float(found[1] - found[0])
    values = [0.0 if abs(value) < 1e-9 * step else float(value) for value in found if low <= value <= high]
    digits = max(6, int(np.log10(max(abs(low), abs(high)) / step)) + 3)
    texts = [f"{value:.{digits}g}" for value in values]
    if not any("e" in text for text in texts):
        decimals = max(len(text.partition(".")[2]) for text in texts)
        texts = [f"{value:.{decimals}f}" for value in values]
    texts = [_number(text) for text in texts]
    return _Scale((low, high), tuple(values), tuple(texts))


def _number(text: str) -> str:
    mantissa, _, exponent = text.partition("e")
    power = f"e{int(exponent)}" if exponent else ""
    return (mantissa + power).replace("-", "−")


def _ticks(plot: axes.Axes, times: _Scale, scale: _Scale, size: float, *, times_named: bool) -> None:
    plot.set_xlim(*times.limits)
    plot.set_ylim(*scale.limits)
    plot.set_xticks(times.values, times.texts if times_named else [""] * len(times.values), fontsize=size)
    plot.set_yticks(scale.values, scale.texts, fontsize=size)
    if scale.limits[0] < 0 < scale.limits[1]:
        plot.axhline(0, color="#cccccc", linewidth=0.6, zorder=0)


def _value_scale(panel: panels.Panel, floor: float, most: int) -> _Scale:
    """The scale of the values, not so fine that round-off about a constant looks like a motion."""
    values = np.concatenate([curve.values[np.isfinite(curve.values)] for curve in panel.curves])
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    largest = max(abs(low), abs(high))
    if largest <= max(floor, 1e-280):
        return _Scale((-1.0, 1.0), (0.0,), ("0",))
    half = 1.08 * max(high / 2 - low / 2, 5e-4 * largest)
    middle = high / 2 + low / 2
    return _scale(middle - half, middle + half, most)


def _time_limits(band: panels.Band) -> tuple[float, float]:
    times = band.panels[0].curves[0].t
    if len(times) == 0:
        return 0.0, 1.0
    first, last = float(times[0]), float(times[-1])
    return (first, last) if first < last else (first - 0.5, first + 0.5)


def _size(panel: panels.Panel) -> float:
    return max(float(np.nanmax(np.abs(curve.values), initial=0.0)) for curve in panel.curves)


def _batched(items: Sequence[str], size: int) -> list[Sequence[str]]:
    return [items[start : start + size] for start in range(0, len(items), size)]
