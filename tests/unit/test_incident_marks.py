"""Incidents in figures: marks that stay legible however many there are."""

import numpy as np
from matplotlib import collections

from lagcli.output.figures import chart, chart_figure, figure_page, panels

SPAN = (0.0, 10.0)


class Units:
    """Labels of a model without units."""

    length = mass = time = ""


def composed(incidents: list[tuple[float, str]]) -> figure_page.PlainFigure:
    t = np.linspace(*SPAN, 11)
    rows = np.column_stack([t, np.sin(t)])
    facts = panels.PanelFacts(incidents=incidents)
    return chart_figure.compose_run(("t", "lambda.floor"), rows, title="", units=Units(), facts=facts)


def test_marks_are_told_by_kind_in_the_order_of_kinds() -> None:
    found = chart.incident_marks([(1.0, "release"), (2.0, "impact"), (3.0, "impact")], SPAN)
    assert [mark.label for mark in found] == ["2 × impact", "release"]
    assert found[0].times.tolist() == [2.0, 3.0]


def test_many_marks_are_thinned_and_counted_all() -> None:
    (mark,) = chart.incident_marks([(t, "impact") for t in np.linspace(0, 10, 5000)], SPAN)
    assert mark.count == 5000
    assert len(mark.times) <= chart.MOST_MARKS + 1
    assert mark.is_dense
    # They still reach over the whole axis, without a gap.
    assert np.diff(mark.times).max() < 2 * 10 / chart.MOST_MARKS


def test_marks_stand_in_every_panel_with_a_legend() -> None:
    drawn = composed([(2.0, "impact"), (2.0, "contact"), (5.0, "release")])
    (plot,) = drawn.axes
    marks = [c for c in plot.collections if isinstance(c, collections.LineCollection)]
    assert [[path[0, 0] for path in mark.get_segments()] for mark in marks] == [[2.0], [2.0], [5.0]]
    assert plot.get_ylim()[1] > 0.99
    texts = [text.get_text() for text in drawn.texts]
    assert {"impact", "contact", "release"} <= set(texts)


def test_a_run_without_incidents_has_no_marks() -> None:
    (plot,) = composed([]).axes
    assert not plot.collections
