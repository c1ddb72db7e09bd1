"""A page of blocks for figures that are printed: texts, legends, axes, in inches from the upper left corner. Texts are
measured, broken into lines, and never read as markup: names and titles are the user's."""

import bisect
import contextlib
import dataclasses
import io
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypedDict, Unpack

import matplotlib
import numpy as np
from matplotlib import axes, colors, figure, font_manager, layout_engine, lines, textpath, ticker
from matplotlib.backends import backend_agg

from lagcli.arrays import Floats
from lagcli.output.figures import chart, labels
from lagcli.output.figures.chart import IncidentMarks
from lagcli.output.files import atomic_file, formats

Dash = Literal["-"] | tuple[float, tuple[float, ...]]

# A figure in the hands of those who do not load matplotlib.
PlainFigure: TypeAlias = figure.Figure


class TextStyle(TypedDict, total=False):
    """The style of a text, by matplotlib's names."""

    ha: str
    weight: str
    color: str


class LineStyle(TypedDict, total=False):
    """The style of a line, by matplotlib's names."""

    color: str
    linestyle: Dash
    linewidth: float


WIDTH = 7.2  # inches, of a page of text
MARGIN = 0.12  # inches
DPI = 200  # of pictures that are printed
SCREEN_DPI = 100  # in a notebook
INK = "#222222"
GREY = "#888888"
# Okabe and Ito's colours, which the colour-blind can tell apart; dashes tell apart curves that coincide.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
BLUE, RED, GREEN, *_ = COLOURS
DASHES: tuple[Dash, ...] = (
    "-",
    (0, (5, 2)),
    (0, (1.5, 1.5)),
    (0, (6, 1.5, 1.5, 1.5)),
    (0, (3, 3)),
    (0, (8, 3)),
)
# Of marks of incidents, lighter, in the order of their kinds.
MARK_COLOURS = ("#E3A587", "#C39BD3", "#B7A27A", "#93C9A8", "#9DB9D9", "#AAAAAA")
MARK_DASHES: tuple[Dash, ...] = ("-", (0, (6, 1.5)), (0, (2, 1)), (0, (4, 2)), (0, (1, 1)), DASHES[3])
# Asked only for characters that DejaVu Sans, which comes with matplotlib, does not have.
FALLBACK_FONTS = (
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
TICKS: dict[str, str | float] = {
    "color": GREY,
    "labelcolor": INK,
    "major.width": 0.6,
    "major.size": 2.5,
    "major.pad": 2,
}
STYLE: dict[Any, str | float] = {  # matplotlib's keys are literals
    "text.parse_math": False,
    "text.usetex": False,
    "text.color": INK,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    **{f"{axis}tick.{name}": value for axis in "xy" for name, value in TICKS.items()},
    "svg.hashsalt": "lagcli",
    "pdf.fonttype": 42,  # journals refuse Type 3 fonts
    "agg.path.chunksize": 10_000,
}
METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Creator": "lagcli", "Date": None},
    "pdf": {"Creator": "lagcli", "Producer": None, "CreationDate": None},
}


def write(path: str | os.PathLike[str], drawn: figure.Figure) -> None:
    """Write a figure to ``path``: png, svg or pdf. Raises ``formats.UnknownFormat``, OSError."""
    target = Path(path)
    atomic_file.write(target, content(formats.of(target, formats.FIGURES), drawn))


def content(fmt: str, drawn: figure.Figure, dpi: float | Literal["figure"] = "figure") -> bytes:
    """A figure in a format of ``formats.FIGURES``, as the bytes of a file."""
    made = io.BytesIO()
    with style(), any_sign():
        drawn.savefig(made, format=fmt, metadata=METADATA[fmt], dpi=dpi)
    return made.getvalue()


@contextlib.contextmanager
def any_sign() -> Iterator[None]:
    """No warnings of signs that no font here has: a title may hold any, and they are drawn as boxes."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .*missing from", UserWarning)
        yield


@contextlib.contextmanager
def style() -> Iterator[None]:
    """The project's look whatever the user's matplotlibrc says, which is left as it is."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


class NotebookFigure(figure.Figure):
    """A figure that a notebook shows, though no window and no state of pyplot belongs to it."""

    def _repr_png_(self) -> bytes:
        return content("png", self, SCREEN_DPI)


def sheet(title: str, height: float) -> NotebookFigure:
    """A figure of that height in inches under a title, whose axes matplotlib lays out. Call it within `style`."""
    pads = layout_engine.ConstrainedLayoutEngine(w_pad=MARGIN / 2, h_pad=MARGIN / 2, wspace=0.04, hspace=0.04)
    drawn = NotebookFigure(figsize=(WIDTH, height), dpi=DPI, layout=pads)
    backend_agg.FigureCanvasAgg(drawn)
    ruler = Ruler([title])
    matplotlib.rcParams["font.family"] = ruler.families
    drawn.suptitle(ruler.wrap(title, WIDTH - 2 * MARGIN, 10, "bold"), fontsize=10, fontweight="bold")
    return drawn


class FigurePage:
    """A figure on which things are placed in inches from its left and upper edge."""

    def __init__(self, height: float) -> None:
        self.figure = NotebookFigure(figsize=(WIDTH, height), dpi=DPI)
        self._height = height
        backend_agg.FigureCanvasAgg(self.figure)

    def axes(self, left: float, top: float, width: float, height: float) -> axes.Axes:
        bottom = self._height - top - height
        return self.figure.add_axes(
            (left / WIDTH, bottom / self._height, width / WIDTH, height / self._height)
        )

    def text(self, left: float, top: float, text: str, size: float, **style: Unpack[TextStyle]) -> None:
        # Line by line on its baseline: matplotlib aligns by the ink, which differs with the letters.
        for number, line in enumerate(text.split("\n") if text else []):
            below = top + (number + 0.75) * text_height("", size)
            self.figure.text(left / WIDTH, 1 - below / self._height, line, fontsize=size, **style)

    def upright(self, left: float, middle: float, text: str, size: float) -> None:
        """Text that reads upwards, for the axis of values."""
        x, y = left / WIDTH, 1 - middle / self._height
        self.figure.text(x, y, text, fontsize=size, rotation=90, va="center", multialignment="center")

    def line(self, left: float, right: float, top: float, **style: Unpack[LineStyle]) -> None:
        height = 1 - top / self._height
        self.figure.add_artist(lines.Line2D([left / WIDTH, right / WIDTH], [height, height], **style))


class Ruler:
    """Measures texts, in inches, and breaks them into lines; chooses the fonts that ``texts`` need."""

    def __init__(self, texts: Sequence[str]) -> None:
        self.families = ["DejaVu Sans"]
        lacking = set("".join(texts)) - _characters("DejaVu Sans")
        if lacking:
            installed = {entry.name for entry in font_manager.fontManager.ttflist}
            self.families += [name for name in FALLBACK_FONTS if name in installed]
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

        done: list[str] = []
        line = ""
        for word in labels.shortened(text, labels.TITLE).translate(self._codes).split():
            if line and self.width(f"{line} {word}", size, weight) > room:
                done.append(line)
                line = ""
            line = f"{line} {word}" if line else word
            while len(line) > 1 and self.width(line, size, weight) > room:
                # As many letters as fit, one at the least
                ends, known = range(2, len(line) + 1), line
                fits = 1 + bisect.bisect_right(
                    ends, room, key=lambda end: self.width(known[:end], size, weight)
                )
                done.append(line[:fits])
                line = line[fits:]
        return "\n".join([*done, line] if line or not done else done)


def _characters(family: str) -> set[str]:
    path = font_manager.findfont(family, fallback_to_default=False)
    return {chr(code) for code in font_manager.get_font(path).get_charmap()}


def text_height(text: str, size: float) -> float:
    """The height of a text of that many lines."""
    return (text.count("\n") + 1) * size * 1.4 / 72


@dataclasses.dataclass(frozen=True, slots=True)
class FigureBlock:
    """Something as wide as the page; ``draw`` gets the page and the block's distance from its upper edge."""

    height: float
    draw: Callable[[FigurePage, float], None]


def stacked(blocks: Sequence[FigureBlock]) -> NotebookFigure:
    """The page that holds the blocks from top to bottom."""
    page = FigurePage(sum(block.height for block in blocks) + 2 * MARGIN)
    top = MARGIN
    for block in blocks:
        block.draw(page, top)
        top += block.height
    return page.figure


def paragraph(
    ruler: Ruler, text: str, size: float, *, weight: str = "normal", gap: float = 0.0, colour: str = INK
) -> FigureBlock:
    """A paragraph with ``gap`` above it."""
    wrapped = ruler.wrap(text, WIDTH - 2 * MARGIN, size, weight)
    return FigureBlock(
        gap + text_height(wrapped, size),
        lambda page, top: page.text(MARGIN, top + gap, wrapped, size, weight=weight, color=colour),
    )


def note(ruler: Ruler, text: str) -> FigureBlock:
    """A remark below axes."""
    return paragraph(ruler, text, 7.5, gap=0.02, colour="#666666")


def axis_name(ruler: Ruler, text: str) -> FigureBlock:
    """The name of the axis below the axes, in the middle of the page."""
    wrapped = ruler.wrap(text, WIDTH - 2 * MARGIN, 8)
    return FigureBlock(
        text_height(wrapped, 8), lambda page, top: page.text(WIDTH / 2, top, wrapped, 8, ha="center")
    )


def legend(ruler: Ruler, labels: Sequence[str], looks: Sequence[LineStyle]) -> FigureBlock:
    """Samples of the lines with their names, from left to right in as many lines as it takes."""
    size, sample, space = 8, 0.32, 0.2
    entries: list[tuple[float, float, str]] = []
    left, top, below = MARGIN, 0.04, 0.04
    for label in labels:
        wrapped = ruler.wrap(label, WIDTH - 2 * MARGIN - sample, size)
        width = sample + max(ruler.width(line, size) for line in wrapped.split("\n"))
        if left > MARGIN and left + width > WIDTH - MARGIN:
            left, top = MARGIN, below
        entries.append((left, top, wrapped))
        left += width + space
        below = max(below, top + text_height(wrapped, size))

    def draw(page: FigurePage, start: float) -> None:
        for index, (x, y, text) in enumerate(entries):
            middle = start + y + 0.55 * text_height("", size)
            page.line(x, x + sample - 0.07, middle, **looks[index])
            page.text(x + sample, start + y, text, size)

    return FigureBlock(below + 0.04, draw)


def look(colour: int, dash: int | None = None) -> LineStyle:
    """The line of a curve; where both indices are one, or there is one alone, 36 lines differ in colour or dashes."""
    if dash is None or dash == colour:
        dash = colour + colour // len(COLOURS)
    return {
        "color": COLOURS[colour % len(COLOURS)],
        "linestyle": DASHES[dash % len(DASHES)],
        "linewidth": 1.2,
    }


def mark_look(mark: IncidentMarks) -> LineStyle:
    """The line of the marks of a kind of incident."""
    return {
        "color": MARK_COLOURS[mark.number],
        "linestyle": "-" if mark.is_dense else MARK_DASHES[mark.number],
        "linewidth": 1.2,
    }


def shades() -> colors.ListedColormap:
    """The colours of many curves, by their order; the bright end of the map is hardly seen on white."""
    return colors.ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0, 0.93, 256)))


@dataclasses.dataclass(frozen=True, slots=True)
class Scale:
    """The range of an axis with its ticks and their texts."""

    limits: tuple[float, float]
    values: tuple[float, ...]
    texts: tuple[str, ...]


def value_scale(curves: Iterable[Floats], floor: float, most: int) -> Scale:
    """The scale of curves, not so fine that round-off looks like a motion; what is not larger than ``floor`` is
    zero."""
    low, high = chart.ends(curves)
    largest = max(abs(low), abs(high))
    if largest <= max(floor, 1e-280):
        return Scale((-1.0, 1.0), (0.0,), ("0",))
    half = 1.08 * max(high / 2 - low / 2, 5e-4 * largest)
    middle = high / 2 + low / 2
    return scale_of(middle - half, middle + half, most)


def scale_of(low: float, high: float, most: int) -> Scale:
    """A scale with about ``most`` ticks, each told apart from the next by its text."""
    low, high = max(low, -chart.LARGEST), min(high, chart.LARGEST)
    found = ticker.MaxNLocator(nbins=most, steps=chart.STEPS).tick_values(low, high)
    step = float(found[1] - found[0])
    values = [0.0 if abs(value) < 1e-9 * step else float(value) for value in found if low <= value <= high]
    values = values or [low, high]  # the ends of all doubles have no round numbers between
    digits = max(6, int(np.log10(max(abs(low), abs(high)) / step)) + 3)
    texts = [number_text(text) for text in chart.tick_texts(values, digits)]
    return Scale((low, high), tuple(values), tuple(texts))


def number_text(text: str) -> str:
    """A number as text with a minus sign and a short exponent."""
    mantissa, _, exponent = text.partition("e")
    power = f"e{int(exponent)}" if exponent else ""
    return (mantissa + power).replace("-", "−")


def ticks(plot: axes.Axes, times: Scale, scale: Scale, size: float, *, times_named: bool) -> None:
    """Put two scales on axes, and a line at zero."""
    plot.set_xlim(*times.limits)
    plot.set_ylim(*scale.limits)
    plot.set_xticks(times.values, times.texts if times_named else [""] * len(times.values), fontsize=size)
    plot.set_yticks(scale.values, scale.texts, fontsize=size)
    if scale.limits[0] < 0 < scale.limits[1]:
        plot.axhline(0, color="#cccccc", linewidth=0.6, zorder=0)
