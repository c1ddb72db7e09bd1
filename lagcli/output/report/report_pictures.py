"""Figures as pictures of a page."""

from __future__ import annotations

import functools
from collections.abc import Callable

from lagcli.output.figures import sheet
from lagcli.output.report.report_contents import PageFigure

# Bytes of a drawing in lines; one of more is painted in points, which are never so many.
MOST_DRAWN = 600_000


def drawing(name: str, svg: str, words: str, pdf: Callable[[], bytes]) -> PageFigure:
    """The picture of a drawing that is an element of SVG; pdf: makes it as PDF."""
    return PageFigure(name, "svg", svg.encode(), words, pdf)


def picture(name: str, drawn: sheet.SheetFigure, words: str) -> PageFigure:
    """The picture of a figure; `words`: what it shows."""
    lines = sheet.content("svg", drawn)
    pdf = functools.partial(sheet.content, "pdf", drawn)
    if len(lines) <= MOST_DRAWN:
        return PageFigure(name, "svg", lines, words, pdf)
    return PageFigure(name, "png", sheet.content("png", drawn), words, pdf)
