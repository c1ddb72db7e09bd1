"""A report as PDF: printed by a browser, or made by LaTeX, whichever is wanted or else installed."""

from __future__ import annotations

from lagcli.output.report import browser_pdf, latex_pdf, report_writer
from lagcli.output.report.report_contents import ReportContents

MAKERS = ("browser", "latex")
_LACKING = {
    "browser": "Chromium, Google Chrome or Microsoft Edge prints it, and none is installed",
    "latex": "pdflatex makes it, which is not installed",
    None: (
        "a PDF is printed by Chromium, Google Chrome or Microsoft Edge, or made by pdflatex, and none is installed;"
        " install one, or write report.html and print it from any browser"
    ),
}


class NoPdf(Exception):
    """There is no program that makes a PDF, or it has made none."""


def require(maker: str | None = None) -> str:
    """The one of `MAKERS` that makes the PDF: the wanted one, or a browser, or else LaTeX. Raises `NoPdf` where it is
    not installed, and ValueError for another word."""
    if maker not in (*MAKERS, None):
        raise ValueError(f"a PDF is made by {' or '.join(MAKERS)}, and not by `{maker}`")
    for name in MAKERS if maker is None else (maker,):
        if browser_pdf.is_there() if name == "browser" else latex_pdf.found() is not None:
            return name
    raise NoPdf(_LACKING[maker])


def made(contents: ReportContents, maker: str | None = None) -> bytes:
    """The PDF. Raises as `require`, and `NoPdf` where the program fails."""
    chosen = require(maker)
    try:
        if chosen == "browser":
            return browser_pdf.printed(report_writer.html_page(contents))
        program = latex_pdf.found()
        assert program is not None
        figures = {f"{figure.name}.pdf": figure.pdf() for figure in contents.figures}
        return latex_pdf.printed(program, report_writer.latex_page(contents), figures)
    except (browser_pdf.NoBrowser, latex_pdf.LatexFailed) as error:
        raise NoPdf(str(error)) from None
