"""Figures of a run, fit to be printed: lambda_i(t) and R_k(t)."""

import itertools
import os
from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib import collections, figure
from numpy.typing import NDArray

from lagcli.output.figures import axis_scale, figure_page, incident_marks, labels, panels


def draw(
    path: str | os.PathLike[str],
    columns: Sequence[str],
    rows: NDArray[np.float64],
    *,
    title: str,
    units: labels.UnitLabels,
    facts: panels.PanelFacts = panels.NOTHING,
) -> None:
    """Draw the multipliers and constraint forces of a run to ``path``: png, svg or pdf.

    ``rows`` has shape (T, len(columns)), with all the columns of a run; equal runs give equal bytes.
    ``facts``: multipliers that are not unique are marked, columns that are zero to rounding drawn as zero, incidents
    light upright lines.
    The file is written aside and moved into place.
    Raises ``formats.UnknownFormat``, OSError, and ValueError where the column ``t`` is missing.
    """
    figure_page.draw(path, lambda: compose(columns, rows, title=title, units=units, facts=facts))


def compose(
    columns: Sequence[str],
    rows: NDArray[np.float64],
    *,
    title: str,
    units: labels.UnitLabels,
    facts: panels.PanelFacts = panels.NOTHING,
) -> figure.Figure:
    """The figure that ``draw`` writes; arguments and errors are those of ``draw``."""
    title = labels.shortened(title, labels.TITLE)
    units = labels.ShortUnits(
        *(labels.shortened(u, labels.UNIT) for u in (units.length, units.mass, units.time))
    )
    found = panels.bands(columns, rows, units, facts)
    time = labels.with_unit("t", units.time.strip())
    with figure_page.style():
        ruler = figure_page.Ruler([title, *columns, units.length, units.mass, units.time])
        matplotlib.rcParams["font.family"] = ruler.families
        blocks = (
            [figure_page.paragraph(ruler, title, size=11, weight="bold", gap=0.04)] if title.strip() else []
        )
        marks: Sequence[incident_marks.IncidentMarks] = ()
        if facts.incidents and any(band.panels for band in found):
            span = _time_limits(next(band for band in found if band.panels))
            marks = incident_marks.of(facts.incidents, span)
            names = [mark.label for mark in marks]
            blocks.append(figure_page.legend(ruler, names, [figure_page.mark_look(mark) for mark in marks]))
        for band in found:
            blocks += _band(ruler, band, time, marks)
        return figure_page.stacked(blocks)


def _band(
    ruler: figure_page.Ruler, band: panels.Band, time: str, marks: Sequence[incident_marks.IncidentMarks]
) -> list[figure_page.FigureBlock]:
    blocks = [figure_page.paragraph(ruler, band.heading, 9, weight="bold", gap=0.1)]
    if band.panels:
        labels = [curve.label for curve in band.panels[0].curves]
        if band.family:
            blocks.append(_family(ruler, band, marks))
        else:
            if len(labels) > 1:
                blocks.append(
                    figure_page.legend(
                        ruler, labels, [figure_page.look(index) for index in range(len(labels))]
                    )
                )
            blocks.append(_grid(ruler, band, marks))
        blocks.append(figure_page.axis_name(ruler, time))
    if band.note:
        blocks.append(figure_page.paragraph(ruler, band.note, 7.5, gap=0.02, colour="#666666"))
    return blocks


def _grid(
    ruler: figure_page.Ruler, band: panels.Band, marks: Sequence[incident_marks.IncidentMarks]
) -> figure_page.FigureBlock:
    """Small axes side by side, each under its title and with its own scale, all with the same times."""
    count = len(band.panels)
    usual = {1: 1, 2: 2, 3: 3, 4: 2, 5: 3, 6: 3}.get(count, 4 if count <= 12 else 5)
    high = {1: 2.0, 2: 1.4, 3: 1.2, 4: 0.9, 5: 0.56}[usual]
    size = 8.0 if usual <= 3 else 7.0
    floor = panels.ROUND_OFF * max(
        max(float(np.nanmax(np.abs(curve.values), initial=0.0)) for curve in panel.curves)
        for panel in band.panels
    )
    scales = [_value_scale(panel, floor, most=5 if usual <= 2 else 3) for panel in band.panels]
    label = ruler.wrap(band.label, -(-count // usual) * high, 8)
    strip = figure_page.MARGIN + figure_page.text_height(label, 8)
    room = max(0.36, 0.08 + max(ruler.width(text, size - 1) for scale in scales for text in scale.texts))
    # Long names get wider panels.
    for across in range(usual, 0, -1):
        cell = (figure_page.WIDTH - strip - figure_page.MARGIN) / across
        width = cell - room - 0.1
        titles = [ruler.wrap(panel.title, width, size) for panel in band.panels]
        if max(title.count("\n") for title in titles) <= 1:
            break
    heads = [
        max((figure_page.text_height(title, size) for title in row if title), default=0.06) + 0.02
        for row in (titles[k : k + across] for k in range(0, count, across))
    ]
    tops = list(itertools.accumulate((head + high + 0.08 for head in heads), initial=0.0))
    times = axis_scale.scale_of(*_time_limits(band), most=6 if across <= 2 else 3)

    def draw(page: figure_page.FigurePage, start: float) -> None:
        middle = start + heads[0] + (tops[-1] - heads[0]) / 2
        page.upright(figure_page.MARGIN, middle, label, 8)
        for index, panel in enumerate(band.panels):
            row, column = divmod(index, across)
            left, top = strip + column * cell + room, start + tops[row]
            bottom = index + across >= count
            page.text(left, top, titles[index], size)
            plot = page.axes(left, top + heads[row], width, high)
            axis_scale.ticks(plot, times, scales[index], size - 1, times_named=bottom)
            figure_page.put_marks(plot, marks)
            for number, curve in enumerate(panel.curves):
                marker = "o" if len(curve.t) == 1 else None
                plot.plot(curve.t, curve.values, marker=marker, markersize=3, **figure_page.look(number))

    return figure_page.FigureBlock(tops[-1] + 0.14, draw)


def _family(
    ruler: figure_page.Ruler, band: panels.Band, marks: Sequence[incident_marks.IncidentMarks]
) -> figure_page.FigureBlock:
    """Many curves on common axes, coloured by their order, with names along the bar of colours."""
    (panel,) = band.panels
    count, size = len(panel.curves), 7.0
    names = [ruler.wrap(curve.label, 1.6, size) for curve in panel.curves]
    high = max(2.3, 2 * max(figure_page.text_height(name, size) for name in names))
    named = figure_page.named_indices(names, high, size)
    beside = 0.1 + max(ruler.width(line, size) for index in named for line in names[index].split("\n"))
    scale = _value_scale(panel, 0.0, most=5)
    times = axis_scale.scale_of(*_time_limits(band), most=6)
    label = ruler.wrap(band.label, high, 8)
    left = (
        figure_page.MARGIN
        + figure_page.text_height(label, 8)
        + max(0.36, 0.08 + max(ruler.width(text, size) for text in scale.texts))
    )
    width = figure_page.WIDTH - left - 0.27 - beside - figure_page.MARGIN

    def draw(page: figure_page.FigurePage, top: float) -> None:
        top += 0.06
        page.text(
            figure_page.MARGIN,
            top + high / 2,
            label,
            8,
            rotation=90,
            va="center",
            ha="left",
            multialignment="center",
        )
        plot = page.axes(left, top, width, high)
        axis_scale.ticks(plot, times, scale, size, times_named=True)
        figure_page.put_marks(plot, marks)
        shade = figure_page.shades()(np.linspace(0, 1, count))
        paths = [np.column_stack([curve.t, curve.values]) for curve in panel.curves]
        plot.add_collection(collections.LineCollection(paths, colors=shade, linewidths=0.7), autolim=False)
        if len(panel.curves[0].t) == 1:
            moments, values = np.concatenate(paths).T
            plot.scatter(moments, values, s=9, c=shade)
        bar = page.axes(left + width + 0.15, top, 0.12, high)
        figure_page.colour_bar(bar, names, named, size)

    return figure_page.FigureBlock(0.06 + high + 0.22, draw)


def _value_scale(panel: panels.Panel, floor: float, most: int) -> axis_scale.Scale:
    """The scale of the values of a panel."""
    return axis_scale.value_scale((curve.values for curve in panel.curves), floor, most)


def _time_limits(band: panels.Band) -> tuple[float, float]:
    times = band.panels[0].curves[0].t
    if len(times) == 0:
        return 0.0, 1.0
    return panels.widened((float(times[0]), float(times[-1])))
