"""The page of `lagcli.report`, and its files."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

from lagcli.output.files import atomic_file, formats
from lagcli.reporting import pdf_programs, report_writer
from lagcli.reporting.report_contents import ReportContents

FORMATS = ("html", "md", "pdf")


@dataclasses.dataclass(frozen=True, slots=True)
class ReportPage:
    """The page; `passed`: no check of the audit fails; `stopped`: why the run ended before its end, or None."""

    contents: ReportContents
    passed: bool
    stopped: str | None

    def __repr__(self) -> str:
        audit = "audit passed" if self.passed else "audit failed"
        return f"<ReportPage {self.contents.title[:60]!r}: {audit}{', run stopped' if self.stopped else ''}>"

    def html(self) -> str:
        """One HTML page that needs nothing beside it."""
        return report_writer.html_page(self.contents)

    def markdown(self, folder: str) -> str:
        """The page in Markdown, with its figures as files of this folder."""
        return report_writer.markdown_page(self.contents, folder)

    def figures(self) -> dict[str, bytes]:
        """The files of the figures of `markdown`, by their names."""
        return {report_writer.figure_file(figure): figure.content for figure in self.contents.figures}

    def save(self, path: str | os.PathLike[str], pdf: str | None = None) -> tuple[Path, ...]:
        """Write the page as .html, .md with its figures in a folder beside it, or .pdf; return the files.

        pdf: "browser" or "latex", which makes the PDF; by default a browser, or else LaTeX. Each is written aside and
        moved into place. Raises `formats.UnknownFormat`, `pdf_programs.NoPdf`, OSError.
        """
        target = Path(path)
        match formats.of(target, FORMATS):
            case "html":
                return (_written(target, self.html().encode()),)
            case "pdf":
                return (_written(target, pdf_programs.made(self.contents, pdf)),)
        folder = figure_folder(target)
        folder.mkdir(exist_ok=True)
        files = [_written(folder / name, content) for name, content in self.figures().items()]
        return (_written(target, self.markdown(folder.name).encode()), *files)


def figure_folder(target: Path) -> Path:
    """The folder of the figures of a page in Markdown."""
    return target.with_name(f"{target.stem}-figures")


def _written(target: Path, content: bytes) -> Path:
    atomic_file.write(target, content)
    return target
