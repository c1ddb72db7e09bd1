"""The page of a model in files: HTML, Markdown, and PDF, which a browser prints or LaTeX makes; the only module with
Jinja2. Every text is escaped by the writer and not by the template: HTML by autoescape, Markdown and LaTeX by
`finalize`. What is markup says so by its class."""

from __future__ import annotations

import base64
import contextlib
import dataclasses
import functools
import html
import os
import re
import shutil
import subprocess
import tempfile
import urllib.parse
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import jinja2
import markupsafe

from lagcli import memory
from lagcli.errors import diagnostics
from lagcli.output import latex_text
from lagcli.output.figures import labels
from lagcli.output.files import atomic_file, formats
from lagcli.reporting.model_on_page import PageFigure, PageListing, ReportContents

FORMATS = ("html", "md", "pdf")
MAKERS = ("browser", "latex")
_LACKING = {
    "browser": "Chromium, Google Chrome or Microsoft Edge prints it, and none is installed",
    "latex": "pdflatex makes it, which is not installed",
    None: (
        "a PDF is printed by Chromium, Google Chrome or Microsoft Edge, or made by pdflatex, and none is installed;"
        " install one, or write report.html and print it from any browser"
    ),
}
# Chromium and its relatives print without a window by the same options; Firefox and Safari have none for it.
BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge",
    "microsoft-edge", "microsoft-edge-stable", "brave-browser",
)  # fmt: skip
# Browsers that stand in no folder of the path.
LOCATIONS = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    "%ProgramFiles%\\Google\\Chrome\\Application\\chrome.exe",
    "%ProgramFiles(x86)%\\Google\\Chrome\\Application\\chrome.exe",
    "%ProgramFiles(x86)%\\Microsoft\\Edge\\Application\\msedge.exe",
)
LATEX = "pdflatex"
SECONDS = 120  # for one page: a browser that waits for a display or a question waits for ever
# No program is started by a document, and no file is read or written outside of its folder; the same document gives the
# same bytes at any time.
SAFE = {
    "openin_any": "p",
    "openout_any": "p",
    "shell_escape": "f",
    "SOURCE_DATE_EPOCH": "0",
    "FORCE_SOURCE_DATE": "1",
}
MEDIA = {"svg": "image/svg+xml", "png": "image/png"}
# What Markdown, tables of it, HTML in it and its mathematics act on.
_SPECIAL = re.compile(r"([\\`*_{}\[\]()<>#|~!$@:+.-])")


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
        return html_page(self.contents)

    def markdown(self, folder: str) -> str:
        """The page in Markdown, with its figures as files of this folder."""
        written = _template("report.md").render(page=self.contents, folder=folder)
        return re.sub(r"\n{3,}", "\n\n", written).strip() + "\n"

    def figures(self) -> dict[str, bytes]:
        """The files of the figures of `markdown`, by their names."""
        return {figure_file(figure): figure.content for figure in self.contents.figures}

    def save(self, path: str | os.PathLike[str], pdf: str | None = None) -> tuple[Path, ...]:
        """Write the page as .html, .md with its figures in a folder beside it, or .pdf; return the files. pdf:
        "browser" or "latex", which makes the PDF; by default the first there is. Raises `formats.UnknownFormat`,
        `NoPdf`, OSError."""
        target = Path(path)
        files: dict[Path, bytes] = {}
        match formats.of(target, FORMATS):
            case "html":
                files[target] = self.html().encode()
            case "pdf":
                files[target] = made(self.contents, pdf)
            case "md":
                folder = figure_folder(target)
                folder.mkdir(exist_ok=True)
                files = {folder / name: content for name, content in self.figures().items()}
                files[target] = self.markdown(folder.name).encode()
        for file, content in files.items():
            atomic_file.write(file, content)
        return (target, *(file for file in files if file != target))


def figure_folder(target: Path) -> Path:
    """The folder of the figures of a page in Markdown."""
    return target.with_name(f"{target.stem}-figures")


class NoPdf(Exception):
    """There is no program that makes a PDF, or it has made none."""


def require(maker: str | None = None) -> str:
    """The one of `MAKERS` that makes the PDF: the wanted one, or a browser, or else LaTeX. Raises `NoPdf` where it is
    not installed, and ValueError for another word."""
    if maker not in (*MAKERS, None):
        raise ValueError(f"a PDF is made by {' or '.join(MAKERS)}, and not by `{maker}`")
    for name in MAKERS if maker is None else (maker,):
        if (browser() if name == "browser" else latex()) is not None:
            return name
    raise NoPdf(_LACKING[maker])


def made(contents: ReportContents, maker: str | None = None) -> bytes:
    """The PDF. Raises as `require`, and `NoPdf` where the program fails."""
    if require(maker) == "browser":
        return printed_by_browser(html_page(contents))
    figures = {f"{figure.name}.pdf": figure.pdf() for figure in contents.figures}
    return made_by_latex(latex_page(contents), figures)


def browser() -> str | None:
    """The browser that prints, if one is installed."""
    elsewhere = filter(os.path.isfile, map(os.path.expandvars, LOCATIONS))
    return next(filter(None, map(shutil.which, BROWSERS)), None) or next(elsewhere, None)


def latex() -> str | None:
    """The program of LaTeX, if it is installed."""
    return shutil.which(LATEX)


def printed_by_browser(page: str) -> bytes:
    """The PDF of an HTML page. Raises `NoPdf`."""
    program = browser()
    assert program is not None
    options = ["--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer"]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        # Chromium refuses to start its sandbox for root. The page holds no script, and its policy forbids any.
        options.insert(0, "--no-sandbox")
    with _folder({"report.html": page.encode()}) as folder:
        options += [f"--user-data-dir={folder / 'profile'}", f"--print-to-pdf={folder / 'report.pdf'}"]
        done, content = _run([program, *options, (folder / "report.html").as_uri()], folder, "printed")
    if not content.startswith(b"%PDF"):
        raise NoPdf(f"{program} has printed nothing (exit code {done.returncode})")
    return content


def made_by_latex(document: str, figures: Mapping[str, bytes]) -> bytes:
    """The PDF of a document with figures by the names of their files. Raises `NoPdf`."""
    program = latex()
    assert program is not None
    options = ["-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "report.tex"]
    with _folder({**figures, "report.tex": document.encode()}) as folder:
        done, content = _run([program, *options], folder, "made", SAFE)
    if done.returncode or not content.startswith(b"%PDF"):
        lines = done.stdout.decode(errors="replace").splitlines()
        first = next((line for line in lines if line.startswith("!")), f"exit code {done.returncode}")
        raise NoPdf(f"{program} has made no PDF: {first.lstrip('! ')}")
    return content


@contextlib.contextmanager
def _folder(files: Mapping[str, bytes]) -> Iterator[Path]:
    """A folder with these files, for as long as it is needed."""
    with tempfile.TemporaryDirectory(prefix="lagcli-", ignore_cleanup_errors=True) as name:
        for file, content in files.items():
            Path(name, file).write_bytes(content)
        yield Path(name)


def _run(
    command: Sequence[str], folder: Path, verb: str, environment: Mapping[str, str] | None = None
) -> tuple[subprocess.CompletedProcess[bytes], bytes]:
    """The end of a program that works in a folder, and the PDF there. Raises `NoPdf` where it does not start or end."""
    program = command[0]
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=SECONDS, check=False, stdin=subprocess.DEVNULL, cwd=folder,
            env={**os.environ, **(environment or {})},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise NoPdf(f"{program} has not {verb} the page within {SECONDS} s") from None
    except OSError as error:
        raise NoPdf(f"{program} cannot be started: {error.strerror}") from None
    target = folder / "report.pdf"
    return done, target.read_bytes() if target.is_file() else b""


class Written(str):
    """A text that is Markdown or LaTeX, whichever is written, and needs no escaping."""

    __slots__ = ()


def html_page(contents: ReportContents) -> str:
    """One HTML page that needs nothing beside it."""
    head = labels.shortened(" ".join(contents.title.split()), labels.NAME)  # the title of the window
    return _template("report.html").render(page=contents, head=head)


def latex_page(contents: ReportContents) -> str:
    """The page as a document in LaTeX; its figures are PDF files beside it, by their names."""
    written = functools.partial(_template("report.tex").render, page=contents)
    return written(declarations=latex_text.declarations(written(declarations="")))


def figure_file(figure: PageFigure) -> str:
    """The name of the file of a figure."""
    return f"{figure.name}.{figure.ending}"


@memory.remembered()
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
        before = text[max(0, at - 5) : at].lower()
        is_link = letter in ":." and before.endswith(("http", "https", "www", "ftp"))
        return f"\\{letter}" if is_first or is_link or letter == "@" else letter
    return f"\\{letter}"


def _fenced(listing: PageListing) -> Written:
    """A block of code whose fence is longer than any in it."""
    longest = max((len(run) for run in re.findall(r"`+", listing.text)), default=0)
    fence = "`" * max(3, longest + 1)
    return Written(f"{fence}yaml\n{listing.text}\n{fence}")
