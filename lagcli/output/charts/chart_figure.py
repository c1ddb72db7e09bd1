"""A chart as a figure that is printed: png, svg, pdf; equal charts give equal bytes."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib import axes, collections, ticker

from lagcli.output.charts.chart import ChartData, ChartPanel, decades, squared
from lagcli.output.figures import axis_scale, figure_page, incident_marks, labels, panels
from lagcli.output.figures.incident_marks import IncidentMarks

GAP = 0.08  # inches above a panel
SMALL = 7.0  # points: ticks and names beside a bar of colours
BAR = 0.27  # inches that a bar of colours takes
TALLEST, LOWEST = 6.0, 1.4  # inches of axes with one scale
SMALLEST, LARGEST = -323, 308  # powers of ten that are doubles
MOST_TICKS = 7  # decades that are named


def draw(path: str | os.PathLike[str], chart: ChartData) -> None:
    """Draw a chart to ``path``: png, svg or pdf; written aside and moved into place.

    Raises ``formats.UnknownFormat``, OSError.
    """
    figure_page.draw(path, lambda: compose(chart))


def compose(chart: ChartData) -> figure_page.NotebookFigure:
    """The figure that ``draw`` writes."""
    title = labels.shortened(chart.title, labels.TITLE)
    timed = [panel for panel in chart.panels if panel.shape == "time" and panel.limits is not None]
    marks: Sequence[IncidentMarks] = ()
    if chart.incidents and (timed or any(panel.dots for panel in chart.panels)):
        times = [t for t, _ in chart.incidents]
        marks = incident_marks.of(
            chart.incidents, timed[0].limits or (0, 1) if timed else (min(times), max(times))
        )
    with figure_page.style():
        ruler = figure_page.Ruler([title, *_texts(chart.panels)])
        matplotlib.rcParams["font.family"] = ruler.families
        blocks = (
            [figure_page.paragraph(ruler, title, size=11, weight="bold", gap=0.04)] if title.strip() else []
        )
        if marks:
            named = [mark.label for mark in marks]
            blocks.append(figure_page.legend(ruler, named, [figure_page.mark_look(mark) for mark in marks]))
        frames = [_frame(ruler, panel, len(chart.panels)) for panel in chart.panels]
        # Axes above each other begin and end at one abscissa, so that an instant is below itself.
        left, beside = (max(getattr(frame, name) for frame in frames) for name in ("left", "beside"))
        for index, frame in enumerate(frames):
            panel = frame.panel
            after = chart.panels[index + 1] if index + 1 < len(frames) else None
            is_last = after is None or (after.x_label, after.limits) != (panel.x_label, panel.limits)
            is_named = is_last or panel.limits is None
            blocks += _panel(ruler, dataclasses.replace(frame, left=left, beside=beside), marks, is_named)
        return figure_page.stacked(blocks)


def _texts(found: Sequence[ChartPanel]) -> list[str]:
    return [
        text
        for panel in found
        for text in (
            panel.x_label,
            panel.y_label,
            *panel.notes,
            *(key.label for key in panel.keys),
            *(curve.label for curve in panel.curves),
        )
    ]


@dataclasses.dataclass(frozen=True, slots=True)
class _Frame:
    """The measures of the axes of a panel in inches, and what stands beside them.

    left, beside: room for the values on the left and for names on the right; named: indices of curves that are named at
    the bar of their colours.
    """

    panel: ChartPanel
    scale: axis_scale.Scale
    label: str
    names: Sequence[str]
    named: Sequence[int]
    height: float
    left: float
    beside: float


def _frame(ruler: figure_page.Ruler, panel: ChartPanel, count: int) -> _Frame:
    """The measures of a panel by itself, one of so many."""
    scale = _values(panel, 5 if count <= 2 else 4)
    names = [ruler.wrap(labels.shortened(curve.label, labels.NAME), 1.6, SMALL) for curve in panel.curves]
    high = 3.0 if panel.shape != "time" else 2.2 if count <= 2 else 1.5 if count <= 5 else 1.0
    if panel.is_family:
        high = max(high, 2.3, 2 * max(figure_page.text_height(name, SMALL) for name in names))
    label = ruler.wrap(panel.y_label, high, 8)
    texts = scale.texts if panel.shape != "equal" else ("−0.00000",)  # its limits depend on its width
    left = (
        figure_page.MARGIN
        + figure_page.text_height(label, 8)
        + max(0.36, 0.08 + max((ruler.width(text, SMALL) for text in texts), default=0.0))
    )
    named = figure_page.named_indices(names, high, SMALL) if panel.is_family else []
    widths = [ruler.width(line, SMALL) for index in named for line in names[index].split("\n")]
    beside = BAR + 0.1 + max(widths) if widths else 0.0
    return _Frame(panel, scale, label, names, named, high, left, beside)


def _panel(
    ruler: figure_page.Ruler, frame: _Frame, marks: Sequence[IncidentMarks], is_named: bool
) -> list[figure_page.FigureBlock]:
    panel, blocks = frame.panel, [figure_page.FigureBlock(GAP, lambda page, top: None)]
    if panel.keys:
        looks = [_key_look(key.colour, key.dash) for key in panel.keys]
        names = [labels.shortened(key.label, labels.NAME) for key in panel.keys]
        blocks.append(figure_page.legend(ruler, names, looks))
    blocks.append(_axes(frame, marks, is_named))
    if is_named:
        blocks.append(figure_page.axis_name(ruler, panel.x_label))
    blocks += [figure_page.paragraph(ruler, note, 7.5, gap=0.02, colour="#666666") for note in panel.notes]
    return blocks


def _key_look(colour: int | None, dash: int) -> figure_page.LineStyle:
    look = _look(colour or 0, dash)
    return look if colour is not None else {**look, "color": figure_page.GREY}


def _look(colour: int, dash: int) -> figure_page.LineStyle:
    """The line of a curve; the sequence of colours and dashes of other figures where both indices are one."""
    if colour == dash:
        return figure_page.look(colour)
    dashed = figure_page.DASHES[dash % len(figure_page.DASHES)]
    return {
        "color": figure_page.COLOURS[colour % len(figure_page.COLOURS)],
        "linestyle": dashed,
        "linewidth": 1.2,
    }


def _axes(frame: _Frame, marks: Sequence[IncidentMarks], is_named: bool) -> figure_page.FigureBlock:
    """The axes with their curves, the name of their values on the left, names of many curves on the right."""
    panel, scale, high = frame.panel, frame.scale, frame.height
    width = figure_page.WIDTH - frame.left - frame.beside - figure_page.MARGIN - 0.05
    limits = panel.limits or (0.0, 0.0)
    if panel.limits is None or limits[0] == limits[1]:
        limits = panels.widened(panel.extent()[0] if panel.limits is None else limits, 0.03)
    if panel.shape == "equal":
        x, y = panel.extent()
        ratio = (y[1] - y[0]) / (x[1] - x[0]) if x[1] > x[0] else TALLEST
        high = min(TALLEST, max(LOWEST, width * ratio, figure_page.text_height(frame.label, 8)))
        limits, values = squared(x, y, width, high)
        scale = axis_scale.scale_of(*values, most=max(3, int(2.2 * high)))
    times = axis_scale.scale_of(*limits, most=6)

    def draw(page: figure_page.FigurePage, top: float) -> None:
        page.upright(figure_page.MARGIN, top + 0.06 + high / 2, frame.label, 8)
        plot = page.axes(frame.left, top + 0.06, width, high)
        if panel.is_log:
            plot.set_yscale("log")
            plot.yaxis.set_minor_locator(ticker.NullLocator())
        axis_scale.ticks(plot, times, scale, SMALL, times_named=is_named)
        if panel.shape == "time":
            figure_page.put_marks(plot, marks)
        _put_curves(plot, panel)
        if panel.is_family:
            bar = page.axes(frame.left + width + 0.15, top + 0.06, 0.12, high)
            figure_page.colour_bar(bar, frame.names, frame.named, SMALL)

    return figure_page.FigureBlock(0.06 + high + (0.2 if is_named else 0.06), draw)


def _put_curves(plot: axes.Axes, panel: ChartPanel) -> None:
    if panel.is_family:
        shade = figure_page.shades()(np.linspace(0, 1, len(panel.curves)))
        paths = [np.column_stack([curve.x, curve.y]) for curve in panel.curves]
        plot.add_collection(collections.LineCollection(paths, colors=shade, linewidths=0.7), autolim=False)
        singles = [index for index, curve in enumerate(panel.curves) if len(curve.x) == 1]
        if singles:
            points = np.concatenate([paths[index] for index in singles])
            plot.scatter(points[:, 0], points[:, 1], s=9, c=shade[singles])
        return
    for curve in panel.curves:
        look = _look(curve.colour, curve.dash)
        plot.plot(curve.x, curve.y, marker="o" if len(curve.x) == 1 else None, markersize=3, **look)
        if panel.shape == "equal" and len(curve.x) > 1:
            plot.plot(curve.x[:1], curve.y[:1], "o", color=look["color"], markersize=3.5)
    for dot in panel.dots:
        colour = figure_page.MARK_COLOURS[dot.number]
        plot.plot(
            dot.x,
            dot.y,
            "D",
            color=colour,
            markersize=3.5,
            markeredgecolor=figure_page.GREY,
            markeredgewidth=0.4,
        )


def _values(panel: ChartPanel, most: int) -> axis_scale.Scale:
    """The scale of the values."""
    if not panel.is_log:
        return axis_scale.value_scale((curve.y for curve in panel.curves), 0.0, most)
    bottom, top = decades(*panel.extent()[1])
    every = max(1, -(-(top - bottom) // MOST_TICKS))
    powers = [p for p in range(-(-bottom // every) * every, top + 1, every) if SMALLEST <= p <= LARGEST]
    texts = tuple(axis_scale.number_text(f"{10.0**p:g}" if -3 <= p <= 4 else f"1e{p}") for p in powers)
    limits = 10.0**bottom or np.nextafter(0, 1), 10.0**top if top <= LARGEST else np.finfo(float).max
    return axis_scale.Scale(limits, tuple(10.0**p for p in powers), texts)
