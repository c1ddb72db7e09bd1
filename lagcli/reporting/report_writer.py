"""A report in HTML, in Markdown and in LaTeX: the only module that uses Jinja2.

Every text is escaped by the writer and not by the template: HTML by Jinja2's autoescape, Markdown and LaTeX by
`finalize`. What is markup says so by its class.
"""

from __future__ import annotations

import base64
import functools
import html
import re
import urllib.parse
from collections.abc import Callable

import jinja2
import markupsafe

from lagcli.errors import diagnostics
from lagcli.output import latex_text
from lagcli.output.figures import labels
from lagcli.reporting.model_on_page import PageFigure, PageListing, ReportContents

MEDIA = {"svg": "image/svg+xml", "png": "image/png"}


class Written(str):
    """A text that is Markdown or LaTeX, whichever is written, and needs no escaping."""

    __slots__ = ()


def html_page(contents: ReportContents) -> str:
    """One HTML page that needs nothing beside it."""
    head = labels.shortened(" ".join(contents.title.split()), labels.NAME)  # the title of the window
    return _template("report.html").render(page=contents, head=head)


def markdown_page(contents: ReportContents, folder: str) -> str:
    """The page in Markdown; its figures are files of this folder beside it."""
    written = _template("report.md").render(page=contents, folder=folder)
    return re.sub(r"\n{3,}", "\n\n", written).strip() + "\n"


def latex_page(contents: ReportContents) -> str:
    """The page as a document in LaTeX; its figures are PDF files beside it, by their names."""
    written = functools.partial(_template("report.tex").render, page=contents)
    return written(declarations=latex_text.declarations(written(declarations="")))


def figure_file(figure: PageFigure) -> str:
    """The name of the file of a figure."""
    return f"{figure.name}.{figure.ending}"


@functools.cache
def _template(name: str) -> jinja2.Template:
    """A template of reports, each of whose values is written by the function `finalize` of its format."""
    finalize: dict[str, Callable[[object], object]] = {"report.html": _printable, "report.md": escaped}
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("lagcli.reporting"),
        autoescape=name == "report.html",
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=finalize.get(name, _in_latex),
    )
    if name == "report.tex":
        # Braces are LaTeX's own.
        made = made.overlay(
            block_start_string="<%",
            block_end_string="%>",
            variable_start_string="<<",
            variable_end_string=">>",
            comment_start_string="<#",
            comment_end_string="#>",
        )
    made.filters |= {
        "written": markupsafe.Markup if name == "report.html" else Written,
        "data": _data,
        "fenced": _fenced,
        "file": lambda figure: Written(figure_file(figure)),
        "place": lambda folder: Written(urllib.parse.quote(folder)),
        "listed": lambda line: Written(latex_text.listed(diagnostics.printable(line))),
        "width": lambda table: Written(f"{0.99 / len(table.headers):.3f}"),
    }
    return made.get_template(name)


def _in_latex(value: object) -> str:
    """A text as LaTeX prints it; what is LaTeX as it is."""
    if isinstance(value, Written):
        return value
    return latex_text.plain(diagnostics.printable(str(value)))


def _printable(value: object) -> object:
    """Texts without what a terminal or a browser acts on; markup as it is."""
    return diagnostics.printable(value) if type(value) is str else value


def _data(figure: PageFigure) -> markupsafe.Markup:
    """The picture as an address that holds it."""
    coded = base64.b64encode(figure.content).decode("ascii")
    return markupsafe.Markup(f"data:{MEDIA[figure.ending]};base64,{coded}")


# What Markdown, tables of it, HTML in it and its mathematics act on.
_SPECIAL = re.compile(r"([\\`*_{}\[\]()<>#|~!$@:+.-])")


def escaped(value: object) -> str:
    """A text that Markdown prints as it is, in one line."""
    if isinstance(value, Written):
        return value
    plain = " ".join(diagnostics.printable(str(value)).split())
    return _SPECIAL.sub(_letter, plain.replace("&", "&amp;"))


def _letter(found: re.Match[str]) -> str:
    """An escaped letter; one that is nothing within a word or a number stays as it is, for those who read the file."""
    letter, text, at = found[0], found.string, found.start()
    if letter in "<>":
        return html.escape(letter)
    if letter in ".:-+@!()":
        is_first = at == 0 or (letter in ".)" and text[:at].isdigit() and text[at + 1 : at + 2] in ("", " "))
        is_link = letter in ":@." and text[max(0, at - 5) : at].lower().endswith(
            ("http", "https", "www", "ftp")
        )
        return f"\\{letter}" if is_first or is_link or letter == "@" else letter
    return f"\\{letter}"


def _fenced(listing: PageListing) -> Written:
    """A block of code whose fence is longer than any in it."""
    longest = max((len(run) for run in re.findall(r"`+", listing.text)), default=0)
    fence = "`" * max(3, longest + 1)
    return Written(f"{fence}yaml\n{listing.text}\n{fence}")
