"""The contents of a report, in blocks that every format of it can write.

All texts are plain: nothing in them is markup, and the writers escape every one. Only `PageEquations` holds markup,
which `derive` has made and escaped.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from lagcli.output.figures.figure_page import PlainFigure

# Bytes of a drawing in lines; one of more is painted in points, which are never so many.
MOST_DRAWN = 600_000


@dataclasses.dataclass(frozen=True, slots=True)
class PageTable:
    """A table; `code`: numbers of the columns that hold what was typed, `caption`: what it is a table of, `failures`:
    numbers of the rows that tell of a failure."""

    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    code: frozenset[int] = frozenset()
    caption: str = ""
    failures: frozenset[int] = frozenset()
    kind: Literal["table"] = "table"


@dataclasses.dataclass(frozen=True, slots=True)
class PageSentences:
    """Sentences, one below the other."""

    lines: tuple[str, ...]
    kind: Literal["sentences"] = "sentences"


@dataclasses.dataclass(frozen=True, slots=True)
class PageListing:
    """The text of a file in lines, each of which is a list of pieces: their look (``key``, ``comment`` or nothing) and
    their text. `caption` says what it is."""

    lines: tuple[tuple[tuple[str, str], ...], ...]
    caption: str
    kind: Literal["listing"] = "listing"

    @property
    def text(self) -> str:
        """The lines as they were written."""
        return "\n".join("".join(piece for _, piece in line) for line in self.lines)


@dataclasses.dataclass(frozen=True, slots=True)
class PageFigure:
    """A picture: its name as a part of a file name, its format (svg or png), its bytes; `words`: what it shows, for
    those who do not see it; pdf: makes it as PDF."""

    name: str
    ending: Literal["svg", "png"]
    content: bytes
    words: str
    pdf: Callable[[], bytes]
    kind: Literal["figure"] = "figure"


@dataclasses.dataclass(frozen=True, slots=True)
class PageEquations:
    """Equations as parts of a page in HTML, in Markdown and in LaTeX; markup that needs no escaping."""

    html: str
    markdown: str
    latex: str
    kind: Literal["equations"] = "equations"


Block = PageTable | PageSentences | PageListing | PageFigure | PageEquations


@dataclasses.dataclass(frozen=True, slots=True)
class PageSection:
    """Blocks under a title; `anchor` is its name in links."""

    title: str
    anchor: str
    blocks: tuple[Block, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class ReportContents:
    """The page: its title, sentences about it, what is wrong (`failures`), what is open (`open_questions`), the outcome
    in a few lines (`summary`: label and value), and the sections."""

    title: str
    about: tuple[str, ...]
    failures: tuple[str, ...]
    open_questions: tuple[str, ...]
    summary: tuple[tuple[str, str], ...]
    sections: tuple[PageSection, ...]

    @property
    def figures(self) -> tuple[PageFigure, ...]:
        """All pictures, in their order."""
        return tuple(b for section in self.sections for b in section.blocks if isinstance(b, PageFigure))


def drawing(name: str, svg: str, words: str, pdf: Callable[[], bytes]) -> PageFigure:
    """The picture of a drawing that is an element of SVG; pdf: makes it as PDF."""
    return PageFigure(name, "svg", svg.encode(), words, pdf)


def picture(name: str, drawn: PlainFigure, words: str) -> PageFigure:
    """The picture of a figure; `words`: what it shows."""
    # A page is written without matplotlib.
    from lagcli.output.figures import figure_page

    lines = figure_page.content("svg", drawn)
    pdf = functools.partial(figure_page.content, "pdf", drawn)
    if len(lines) <= MOST_DRAWN:
        return PageFigure(name, "svg", lines, words, pdf)
    return PageFigure(name, "png", figure_page.content("png", drawn), words, pdf)
