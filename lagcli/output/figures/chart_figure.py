"""Charts, and the multipliers and forces of a run, as figures that are printed; equal ones give equal bytes."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib import axes, collections, ticker

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.model.model import Units
from lagcli.output.figures import chart, figure_page, labels, panels
from lagcli.output.figures.chart import ChartData, ChartPanel, IncidentMarks, incident_marks, squared, widened

GAP = 0.08  # inches above a panel
SMALL = 7.0  # points: ticks and names beside a bar of colours
BAR = 0.27  # inches that a bar of colours takes
TALLEST, LOWEST = 6.0, 1.4  # inches of axes with one scale
SMALLEST, LARGEST = -323, 308  # powers of ten that are doubles
MOST_TICKS = 7  # decades that are named


def compose(data: ChartData) -> figure_page.NotebookFigure:
    """The figure of a chart: its panels one below the other."""
    spans = [panel.limits for panel in data.panels if panel.shape == "time" and panel.limits is not None]
    marks: Sequence[IncidentMarks] = ()
    if data.incidents and (spans or any(panel.dots for panel in data.panels)):
        times = [t for t, _ in data.incidents]
        marks = incident_marks(data.incidents, spans[0] if spans else (min(times), max(times)))
    with figure_page.style():
        ruler, blocks = _begun(data.title, data.panels, marks)
        frames = [_frame(ruler, panel, len(data.panels)) for panel in data.panels]
        # Axes above each other begin and end at one abscissa, so that an instant is below itself.
        left, beside = (max(getattr(frame, name) for frame in frames) for name in ("left", "beside"))
        for frame, after in itertools.zip_longest(frames, data.panels[1:]):
            panel = frame.panel
            is_last = after is None or (after.x_label, after.limits) != (panel.x_label, panel.limits)
            is_named = is_last or panel.limits is None
            blocks.append(figure_page.FigureBlock(GAP, lambda page, top: None))
            blocks += _legend(ruler, panel)
            blocks.append(_axes(dataclasses.replace(frame, left=left, beside=beside), marks, is_named))
            if is_named:
                blocks.append(figure_page.axis_name(ruler, panel.x_label))
            blocks += [figure_page.note(ruler, text) for text in panel.notes]
        return figure_page.stacked(blocks)


def compose_run(
    columns: Sequence[str],
    rows: Floats,
    *,
    title: str,
    units: Units,
    facts: panels.PanelFacts = panels.NOTHING,
) -> figure_page.NotebookFigure:
    """The figure of the multipliers and constraint forces of a run, rows (T, len(columns)), lambda_i(t) and R_k(t).

    Multipliers that are not unique are marked, columns that are zero to rounding drawn as zero, incidents light upright
    lines. Raises ValueError where the column ``t`` is missing.
    """
    bands = panels.bands(columns, rows, labels.short_units(units), facts)
    drawn = [panel for band in bands for panel in band.panels]
    marks: Sequence[IncidentMarks] = ()
    if facts.incidents and drawn:
        marks = incident_marks(facts.incidents, widened(drawn[0].limits or (0.0, 1.0)))
    with figure_page.style():
        ruler, blocks = _begun(title, drawn, marks)
        for band in bands:
            blocks.append(figure_page.paragraph(ruler, band.heading, 9, weight="bold", gap=0.1))
            if band.panels:
                first = band.panels[0]
                blocks += _legend(ruler, first)
                if first.is_family:
                    blocks.append(_axes(_frame(ruler, first, 1), marks, True))
                else:
                    blocks.append(_grid(ruler, band.panels, marks))
                blocks.append(figure_page.axis_name(ruler, first.x_label))
            if band.note:
                blocks.append(figure_page.note(ruler, band.note))
        return figure_page.stacked(blocks)


def _begun(
    title: str, drawn: Sequence[ChartPanel], marks: Sequence[IncidentMarks]
) -> tuple[figure_page.Ruler, list[figure_page.FigureBlock]]:
    """The ruler for the texts of a page, whose fonts are taken from now on, its title, and the legend of incidents."""
    title = labels.shortened(title, labels.TITLE)
    texts = [title]
    for panel in drawn:
        texts += [panel.title, panel.x_label, panel.y_label, *panel.notes]
        texts += [*(key.label for key in panel.keys), *(curve.label for curve in panel.curves)]
    ruler = figure_page.Ruler(texts)
    matplotlib.rcParams["font.family"] = ruler.families
    blocks = []
    if title.strip():
        blocks.append(figure_page.paragraph(ruler, title, 11, weight="bold", gap=0.04))
    if marks:
        looks = [figure_page.mark_look(mark) for mark in marks]
        blocks.append(figure_page.legend(ruler, [mark.label for mark in marks], looks))
    return ruler, blocks


def _legend(ruler: figure_page.Ruler, panel: ChartPanel) -> list[figure_page.FigureBlock]:
    """The legend of a panel, where it has one; a key without a colour explains dashes, in grey."""
    if not panel.keys:
        return []
    looks = [figure_page.look(key.colour or 0, key.dash) for key in panel.keys]
    for look, key in zip(looks, panel.keys, strict=True):
        if key.colour is None:
            look["color"] = figure_page.GREY
    names = [labels.shortened(key.label, labels.NAME) for key in panel.keys]
    return [figure_page.legend(ruler, names, looks)]


@dataclasses.dataclass(frozen=True, slots=True)
class _Frame:
    """The measures of the axes of a panel in inches: room for the values on the left and for names beside them; named:
    indices of curves that are named at the bar of their colours."""

    panel: ChartPanel
    scale: figure_page.Scale
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
    named: list[int] = []
    if panel.is_family:  # the names that fit beside the bar, both ends among them
        tallest = max(figure_page.text_height(name, SMALL) for name in names)
        most = min(9, max(2, int(high / (1.6 * tallest))))
        named = [int(index) for index in np.unique(np.linspace(0, len(names) - 1, most).round())]
    widths = [ruler.width(line, SMALL) for index in named for line in names[index].split("\n")]
    beside = BAR + 0.1 + max(widths) if widths else 0.0
    return _Frame(panel, scale, label, names, named, high, left, beside)


def _grid(
    ruler: figure_page.Ruler, shown: Sequence[ChartPanel], marks: Sequence[IncidentMarks]
) -> figure_page.FigureBlock:
    """Small axes side by side, each under its title and with its own scale, all with the same times."""
    count = len(shown)
    usual = {1: 1, 2: 2, 3: 3, 4: 2, 5: 3, 6: 3}.get(count, 4 if count <= 12 else 5)
    high = {1: 2.0, 2: 1.4, 3: 1.2, 4: 0.9, 5: 0.56}[usual]
    size = 8.0 if usual <= 3 else 7.0
    floor = doubles.VALUE * max(panels.size(curve.y) for panel in shown for curve in panel.curves)
    scales = [_values(panel, 5 if usual <= 2 else 3, floor) for panel in shown]
    label = ruler.wrap(shown[0].y_label, -(-count // usual) * high, 8)
    strip = figure_page.MARGIN + figure_page.text_height(label, 8)
    room = max(0.36, 0.08 + max(ruler.width(text, size - 1) for scale in scales for text in scale.texts))
    # Long names get wider panels.
    for across in range(usual, 0, -1):
        cell = (figure_page.WIDTH - strip - figure_page.MARGIN) / across
        width = cell - room - 0.1
        titles = [ruler.wrap(panel.title, width, size) for panel in shown]
        if max(title.count("\n") for title in titles) <= 1:
            break
    heads = [
        max((figure_page.text_height(title, size) for title in row if title), default=0.06) + 0.02
        for row in (titles[k : k + across] for k in range(0, count, across))
    ]
    tops = list(itertools.accumulate((head + high + 0.08 for head in heads), initial=0.0))
    times = figure_page.scale_of(*widened(shown[0].limits or (0.0, 1.0)), most=6 if across <= 2 else 3)

    def draw(page: figure_page.FigurePage, start: float) -> None:
        middle = start + heads[0] + (tops[-1] - heads[0]) / 2
        page.upright(figure_page.MARGIN, middle, label, 8)
        for index, panel in enumerate(shown):
            row, column = divmod(index, across)
            left, top = strip + column * cell + room, start + tops[row]
            bottom = index + across >= count
            page.text(left, top, titles[index], size)
            plot = page.axes(left, top + heads[row], width, high)
            figure_page.ticks(plot, times, scales[index], size - 1, times_named=bottom)
            _put_curves(plot, panel, marks)

    return figure_page.FigureBlock(tops[-1] + 0.14, draw)


def _axes(frame: _Frame, marks: Sequence[IncidentMarks], is_named: bool) -> figure_page.FigureBlock:
    """The axes with their curves, the name of their values on the left, names of many curves on the right."""
    panel, scale, high = frame.panel, frame.scale, frame.height
    width = figure_page.WIDTH - frame.left - frame.beside - figure_page.MARGIN - 0.05
    limits = panel.limits or (0.0, 0.0)
    if panel.limits is None or limits[0] == limits[1]:
        limits = widened(panel.extent()[0] if panel.limits is None else limits, 0.03)
    if panel.shape == "equal":
        x, y = panel.extent()
        ratio = (y[1] - y[0]) / (x[1] - x[0]) if x[1] > x[0] else TALLEST
        high = min(TALLEST, max(LOWEST, width * ratio, figure_page.text_height(frame.label, 8)))
        limits, values = squared(x, y, width, high)
        scale = figure_page.scale_of(*values, most=max(3, int(2.2 * high)))
    times = figure_page.scale_of(*limits, most=6)

    def draw(page: figure_page.FigurePage, top: float) -> None:
        page.upright(figure_page.MARGIN, top + 0.06 + high / 2, frame.label, 8)
        plot = page.axes(frame.left, top + 0.06, width, high)
        if panel.is_log:
            plot.set_yscale("log")
            plot.yaxis.set_minor_locator(ticker.NullLocator())
        figure_page.ticks(plot, times, scale, SMALL, times_named=is_named)
        _put_curves(plot, panel, marks)
        if panel.is_family:
            bar = page.axes(frame.left + width + 0.15, top + 0.06, 0.12, high)
            extent, colours = (0.0, 1.0, len(frame.names) - 0.5, -0.5), np.linspace(0, 1, 256)[:, None]
            bar.imshow(colours, cmap=figure_page.shades(), aspect="auto", extent=extent)
            bar.set_xticks([])
            bar.yaxis.tick_right()
            bar.set_yticks(frame.named, [frame.names[index] for index in frame.named], fontsize=SMALL)
            # The outer names keep within the height of the bar, however many lines they have.
            bar.get_yticklabels()[0].set_verticalalignment("top")
            bar.get_yticklabels()[-1].set_verticalalignment("bottom")
            bar.spines[:].set_visible(False)

    return figure_page.FigureBlock(0.06 + high + (0.2 if is_named else 0.06), draw)


def _put_curves(plot: axes.Axes, panel: ChartPanel, marks: Sequence[IncidentMarks] = ()) -> None:
    """The curves of a panel on its axes, behind them the marks of incidents, before them their points in a plane."""
    if panel.shape == "time":
        for mark in marks:  # from the lower edge of the axes to the upper one
            look, width = figure_page.mark_look(mark), 0.3 if mark.is_dense else 0.7
            marked = plot.vlines(mark.times, 0.0, 1.0, look["color"], look["linestyle"], linewidths=width)
            marked.set(transform=plot.get_xaxis_transform(), zorder=0.5)
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
        look = figure_page.look(curve.colour, curve.dash)
        plot.plot(curve.x, curve.y, marker="o" if len(curve.x) == 1 else None, markersize=3, **look)
        if panel.shape == "equal" and len(curve.x) > 1:
            plot.plot(curve.x[:1], curve.y[:1], "o", color=look["color"], markersize=3.5)
    for dot in panel.dots:
        (drawn,) = plot.plot(dot.x, dot.y, "D", color=figure_page.MARK_COLOURS[dot.number], markersize=3.5)
        drawn.set(markeredgecolor=figure_page.GREY, markeredgewidth=0.4)


def _values(panel: ChartPanel, most: int, floor: float = 0.0) -> figure_page.Scale:
    """The scale of the values; what is not larger than the floor is drawn as zero."""
    if not panel.is_log:
        return figure_page.value_scale((curve.y for curve in panel.curves), floor, most)
    bottom, top = chart.decades(*panel.extent()[1])
    every = max(1, -(-(top - bottom) // MOST_TICKS))
    powers = [p for p in range(-(-bottom // every) * every, top + 1, every) if SMALLEST <= p <= LARGEST]
    texts = tuple(figure_page.number_text(f"{10.0**p:g}" if -3 <= p <= 4 else f"1e{p}") for p in powers)
    limits = 10.0**bottom or np.nextafter(0, 1), 10.0**top if top <= LARGEST else np.finfo(float).max
    return figure_page.Scale(limits, tuple(10.0**p for p in powers), texts)
