"""A report as PDF: printed by a browser, or else made by LaTeX, whichever is installed."""

from __future__ import annotations

from lagcli.output.report import browser_pdf, latex_pdf, report_writer
from lagcli.output.report.report_contents import ReportContents


class NoPdf(Exception):
    """There is no program that makes a PDF, or it has made none."""


def require() -> None:
    """Raise `NoPdf` where neither a browser nor LaTeX is installed."""
    if not browser_pdf.is_there() and latex_pdf.found() is None:
        raise NoPdf(
            "a PDF is printed by Chromium, Google Chrome or Microsoft Edge, or made by pdflatex, and none is installed;"
            " install one, or write report.html and print it from any browser"
        )


def made(contents: ReportContents) -> bytes:
    """The PDF. Raises `NoPdf`."""
    require()
    try:
        if browser_pdf.is_there():
            return browser_pdf.printed(report_writer.html_page(contents))
        program = latex_pdf.found()
        assert program is not None
        figures = {f"{figure.name}.pdf": figure.pdf() for figure in contents.figures}
        return latex_pdf.printed(program, report_writer.latex_page(contents), figures)
    except (browser_pdf.NoBrowser, latex_pdf.LatexFailed) as error:
        raise NoPdf(str(error)) from None
