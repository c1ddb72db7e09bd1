"""`lagcli report` and `lagcli.report`: one page, whatever a model says of itself."""

import html.parser
import os
import pathlib
import re
import stat
from xml.etree import ElementTree

import pytest

import lagcli
from lagcli.api import simulate
from lagcli.output import latex_text
from lagcli.output.figures import labels
from lagcli.reporting import model_on_page, report_page
from lagcli.reporting.model_on_page import ReportContents
from tests.helpers import in_process

ROOT = pathlib.Path(__file__).parents[2]
MODELS = ROOT / "models"
VOID = {"meta", "img", "br", "mspace"}

PENDULUM = """lagcli: 1
title: {title}
description: {description}
units: {{length: {unit}, mass: kg, time: s}}
parameters: {{m: 2, L: 1}}
particles:
  a: {{mass: m, position: [0.6, 0, -0.8]}}
forces:
  weight: {{to: all, force: [0, 0, -m*9.81]}}  # {comment}
holonomic:
  rod: norm(a) = L
simulation: {{duration: 0.5, samples: 26}}
"""

SCRIPT = "<script>alert(1)</script>"
TITLES = {
    "markup": f'"{SCRIPT} </title> </h1> <b>x</b> {{{{ 7*7 }}}} {{% raw %}}"',
    "quotes": "'\"onload=\"alert(1)\" '' `code` $x$ | [l](javascript:alert(1))'",
    "escapes": r'"\e[31mred \a \0 \u202e \u2066 end"',
    "right to left": '"שלום עולם مرحبا"',
    "long": '"' + "long" * 500 + '"',
    "one word": '"' + "x" * 2000 + '"',
}


class StrictPage(html.parser.HTMLParser):
    """A page whose elements are closed in order; its texts and attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(page)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        assert len({name for name, _ in attrs}) == len(attrs)
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    def names(self) -> set[str]:
        return {tag for tag, _ in self.elements}


def written(**texts: str) -> str:
    return PENDULUM.format(**{"title": "x", "description": "x", "unit": "m", "comment": "x", **texts})


def page_of(model: str | lagcli.Model, **options: object) -> lagcli.ReportPage:
    return lagcli.report(lagcli.loads(model) if isinstance(model, str) else model, **options)


def require_harmless(page: StrictPage) -> None:
    assert not page.names() & {"script", "iframe", "object", "embed", "form", "link", "base", "b"}
    for tag, attributes in page.elements:
        assert not any(name.startswith("on") for name in attributes), tag
        if tag == "a":
            assert re.fullmatch(r"#[a-z]+", attributes["href"])
        if tag == "img":
            assert re.match(r"data:image/(svg\+xml|png);base64,[A-Za-z0-9+/=]+$", attributes["src"])
    # U+2061 stands between a function and its argument in MathML.
    assert all(c.isprintable() or c in "\n\u2061" for text in page.texts for c in text)


@pytest.mark.parametrize("title", TITLES.values(), ids=TITLES)
def test_no_text_of_a_model_is_markup(title):
    model = lagcli.loads(
        written(title=title, description=title, unit=title, comment=f"</code></pre>{SCRIPT}")
    )
    made = page_of(model)
    page = StrictPage(made.html())
    require_harmless(page)
    told = "".join(page.texts)
    shown = labels.shortened(model.title, labels.TITLE)
    assert shown in told
    assert len(made.contents.title) <= labels.TITLE
    assert not re.search(r"[\u202e\u2066\x00-\x1f]", told.replace("\n", ""))
    assert f"</code></pre>{SCRIPT}" in told
    assert "{{ 7*7 }}" in told or "7*7" not in title
    in_markdown = made.markdown("figures")
    listing = re.search(r"^(`{3,})yaml\n(.*?)^\1$", in_markdown, re.DOTALL | re.MULTILINE)
    outside = in_markdown.replace(listing[0], "")
    assert "<" not in outside.replace("<=", "")
    assert not re.search(r"(?<!\\)\]\((?!figures/)", outside)
    assert made.contents.title not in outside or title in (
        TITLES["right to left"],
        TITLES["long"],
        TITLES["one word"],
    )


def test_a_title_of_the_command_line_is_escaped_too(tmp_path):
    (tmp_path / "model.yaml").write_text(written(), encoding="utf-8")
    out, err, code = in_process.run("report", str(tmp_path / "model.yaml"), "--title", SCRIPT)
    assert (code, err) == (0, "")
    page = StrictPage(out)
    require_harmless(page)
    assert SCRIPT in page.texts


@pytest.mark.parametrize("name", ["rolling-disk", "twin-rod", "chain", "three-bar-truss", "martinet"])
def test_the_page_of_a_model_is_valid_and_holds_what_the_commands_say(name):
    model = lagcli.load(MODELS / f"{name}.yaml")
    made = page_of(model, duration=0.2, samples=21)
    page = StrictPage(made.html())
    require_harmless(page)
    anchors = {a["id"] for tag, a in page.elements if tag == "section"}
    assert anchors == {a["href"][1:] for tag, a in page.elements if tag == "a"}
    told = "".join(page.texts)
    for row in lagcli.check(model).constraints[:40]:
        assert row.name in told
        assert row.verdict.kind in told
    out, _, _ = in_process.run("dof", "--explain", str(MODELS / f"{name}.yaml"))
    for line in out.splitlines():
        assert line in told
    assert model.sha256 in told
    assert made.passed
    assert "All checks passed." in told or "Not judged" in told
    for math in re.findall(r"<math.*?</math>", made.html()):
        ElementTree.fromstring(math.replace("&nbsp;", " "))


def test_equal_runs_give_equal_pages():
    assert page_of(written()).html() == page_of(written()).html()


def test_a_stopped_run_is_written_and_reported(tmp_path):
    model = tmp_path / "pole.yaml"
    model.write_text(
        "lagcli: 1\nparticles:\n  a: {mass: 1, position: [0, 0, 0], velocity: [1, 0, 0]}\n"
        "forces:\n  pull: {to: all, force: [1/(1-t)**2, 0, 0]}\nsimulation: {duration: 2, samples: 21}\n",
        encoding="utf-8",
    )
    file = tmp_path / "report.html"
    out, err, code = in_process.run("report", str(model), "-o", str(file))
    assert (out, code) == ("", 3)
    page = StrictPage(file.read_text(encoding="utf-8"))
    alarms = [a for tag, a in page.elements if tag == "p" and a.get("class") == "alarm"]
    assert len(alarms) == 1
    assert any("The run stopped before its end" in text for text in page.texts)
    assert "lagcli: " in err


def test_a_report_whose_audit_fails_is_written_and_reported(tmp_path, monkeypatch):
    """A run whose multiplier is off by a hundredth is no motion of the model."""
    made = simulate.as_far

    def bent(model, **settings):
        run, reason = made(model, **settings)
        run.rows[:, run.columns.index("lambda.rod")] *= 1.01
        return run, reason

    monkeypatch.setattr(simulate, "as_far", bent)
    file = tmp_path / "report.html"
    _, err, code = in_process.run("report", str(MODELS / "pendulum.yaml"), "-o", str(file), "--duration", "1")
    assert code == 1
    assert "the audit fails; the page says which checks" in err
    page = StrictPage(file.read_text(encoding="utf-8"))
    alarms = [a for tag, a in page.elements if tag == "p" and a.get("class") == "alarm"]
    assert len(alarms) == 1
    told = "".join(page.texts)
    assert "The audit failed: 3 checks fail: the table is not a motion of this model." in told
    failing = re.findall(r'<tr class="fail"><td[^>]*>(\w+)</td>', file.read_text(encoding="utf-8"))
    assert failing == ["reactions", "multipliers", "columns"]
    again = lagcli.report(MODELS / "pendulum.yaml", duration=1)
    assert again.passed is False
    assert "audit failed" in repr(again)
    assert "The audit failed" in again.markdown("figures")


def test_an_inconsistent_start_is_the_error_of_simulate(tmp_path):
    model, file = tmp_path / "model.yaml", tmp_path / "report.html"
    model.write_text(written().replace("L: 1", "L: 2"), encoding="utf-8")
    _, err, code = in_process.run("report", str(model), "-o", str(file))
    assert code == 1
    assert "error[" in err
    assert not file.exists()
    assert in_process.run("report", str(model), "-o", str(file), "--assemble")[2] == 0


def test_an_undecided_count_is_reported_and_no_failure():
    made = page_of(lagcli.load(MODELS / "rolling-disk.yaml"), duration=0.1, samples=11, limit=0)
    assert made.passed
    assert any("undecided" in one.lower() for one in made.contents.open_questions)


def test_incidents_digits_and_changes_are_on_the_page():
    model = lagcli.load(MODELS / "zeno-ball.yaml", {"m": 0.7})
    told = "".join(StrictPage(page_of(model, digits=True, duration=1).html()).texts)
    assert "impact" in told
    assert "--set m" in told
    assert "right digits of r" in told


def test_markdown_has_its_figures_beside_it(tmp_path):
    file = tmp_path / "a b.md"
    out, _, code = in_process.run(
        "report", str(MODELS / "pendulum.yaml"), "-o", str(file), "--duration", "0.5"
    )
    assert (out, code) == ("", 0)
    text = file.read_text(encoding="utf-8")
    links = re.findall(r"^!\[.*\]\((.*)\)$", text, re.MULTILINE)
    assert len(links) >= 2
    for link in links:
        assert link.startswith("a%20b-figures/")
        ElementTree.parse(tmp_path / link.replace("%20", " "))
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert all(line.endswith("|") for line in rows)
    assert r"f_{\mathrm{rod}}" in text


def test_what_cannot_be_written_is_refused_before_any_work(tmp_path):
    model = str(MODELS / "pendulum.yaml")
    _, err, code = in_process.run("report", model, "-o", str(tmp_path / "report.doc"))
    assert code == 2
    assert ".html, .md, .pdf" in err
    copy = tmp_path / "model.md"
    copy.write_text(written(), encoding="utf-8")
    assert in_process.run("report", str(copy), "-o", str(copy))[2] == 2
    (tmp_path / "r-figures").write_text("mine", encoding="utf-8")
    _, err, code = in_process.run("report", model, "-o", str(tmp_path / "r.md"))
    assert code == 2
    assert "r-figures" in err


def test_without_a_browser_a_pdf_is_refused_with_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(report_page, "LOCATIONS", ())
    _, err, code = in_process.run("report", str(MODELS / "pendulum.yaml"), "-o", str(tmp_path / "report.pdf"))
    assert code == 2
    assert "install one" in err
    assert not (tmp_path / "report.pdf").exists()


@pytest.mark.skipif(os.name == "nt", reason="the stand-in is a shell script")
@pytest.mark.parametrize("works", [True, False])
def test_a_pdf_is_what_the_browser_prints(tmp_path, monkeypatch, works):
    browser, file = tmp_path / "chromium", tmp_path / "report.pdf"
    body = (
        'for a; do case "$a" in --print-to-pdf=*) printf "%%PDF-1.4" > "${a#*=}";; esac; done'
        if works
        else "exit 7"
    )
    browser.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    browser.chmod(browser.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", str(tmp_path))
    _, err, code = in_process.run(
        "report", str(MODELS / "pendulum.yaml"), "-o", str(file), "--duration", "0.1", "--samples", "5"
    )
    if works:
        assert (code, file.read_bytes()) == (0, b"%PDF-1.4")
    else:
        assert code == 74
        assert "exit code 7" in err
        assert not file.exists()


def stand_in(folder, body):
    """The program pdflatex of a folder, which is all that is there."""
    program = folder / "pdflatex"
    program.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)


@pytest.mark.skipif(os.name == "nt", reason="the stand-in is a shell script")
@pytest.mark.parametrize("works", [True, False])
def test_without_a_browser_latex_makes_the_pdf(tmp_path, monkeypatch, works):
    """It has the document and all its figures beside it, starts no program, and reads and writes nothing elsewhere."""
    bin_, file = tmp_path / "bin", tmp_path / "report.pdf"
    bin_.mkdir()
    made = (
        'test "$4" = report.tex && test -s start.pdf && test -s forces.pdf && test -s audit.pdf || exit 9\n'
        'test "$openin_any$openout_any$shell_escape" = ppf && test "$3" = -no-shell-escape || exit 8\n'
        'printf "%%PDF-1.5" > report.pdf'
    )
    stand_in(bin_, made if works else 'echo "! Undefined control sequence."; exit 1')
    monkeypatch.setenv("PATH", str(bin_))
    monkeypatch.setattr(report_page, "LOCATIONS", ())
    arguments = (
        "report",
        str(MODELS / "pendulum.yaml"),
        "-o",
        str(file),
        "--duration",
        "0.1",
        "--samples",
        "5",
    )
    _, err, code = in_process.run(*arguments)
    if works:
        assert (code, file.read_bytes()) == (0, b"%PDF-1.5"), err
    else:
        assert code == 74
        assert "pdflatex has made no PDF: Undefined control sequence." in err
        assert not file.exists()


@pytest.mark.parametrize(
    ("maker", "found", "expected"),
    [
        (None, "browser latex", "browser"),
        (None, "latex", "latex"),
        ("latex", "browser latex", "latex"),
        ("browser", "browser latex", "browser"),
        ("latex", "browser", "pdflatex makes it, which is not installed"),
        ("browser", "latex", "Chrome"),
    ],
)
def test_what_makes_a_pdf_is_chosen(monkeypatch, maker, found, expected):
    monkeypatch.setattr(report_page, "browser", lambda: "chromium" if "browser" in found else None)
    monkeypatch.setattr(report_page, "printed_by_browser", lambda _: b"browser")
    monkeypatch.setattr(report_page, "latex", lambda: "pdflatex" if "latex" in found else None)
    monkeypatch.setattr(report_page, "made_by_latex", lambda *_: b"latex")
    contents = ReportContents("title", (), (), (), (), ())
    if expected in report_page.MAKERS:
        assert report_page.made(contents, maker) == expected.encode()
    else:
        with pytest.raises(report_page.NoPdf, match=expected):
            report_page.made(contents, maker)


@pytest.mark.parametrize(
    ("name", "maker", "word"), [("r.html", "latex", "no PDF"), ("r.pdf", "word", "browser or latex")]
)
def test_a_maker_that_is_none_or_not_needed_is_refused(tmp_path, name, maker, word):
    file = tmp_path / name
    _, err, code = in_process.run("report", str(MODELS / "pendulum.yaml"), "-o", str(file), "--pdf", maker)
    assert code == 2
    assert word in err
    assert not file.exists()


@pytest.mark.skipif(report_page.latex() is None, reason="there is no LaTeX")
def test_latex_takes_every_text():
    model = lagcli.loads(
        written(
            title=TITLES["markup"],
            description=TITLES["right to left"],
            unit=TITLES["escapes"],
            comment="\\end{document} \\input{/etc/passwd} % λ̈ ₖ ⁻¹ ∑ 漢" + "x" * 2000,
        )
    )
    page = page_of(model)
    document = report_page.latex_page(page.contents)
    figures = {f"{figure.name}.pdf": figure.pdf() for figure in page.contents.figures}
    assert report_page.made_by_latex(document, figures).startswith(b"%PDF")


@pytest.mark.filterwarnings("error:Glyph .* missing")
def test_pictures_of_a_report_hold_no_text_that_acts():
    r"""Neither a formula of the title nor an escape sequence of a unit, in none of their formats."""
    page = page_of(written(title=r"'$x_{ \\'", unit='"m"').replace("time: s", r'time: "s\e[2J $y_{"'))
    for figure in page.contents.figures:
        assert figure.pdf().startswith(b"%PDF")
        assert b"\x1b" not in figure.content
    assert "\x1b" not in page.html()


def test_a_document_in_latex_holds_no_command_of_a_model():
    name = r"\input{x} $y$ #1 & % ~ ^ _ {{ <% raw %> << 7 >> \end{document}"
    document = report_page.latex_page(page_of(written(title=repr(name), comment=name)).contents)
    assert document.count(r"\end{document}") == 1
    assert r"\input" not in document.replace(r"\inputenc", "")
    assert latex_text.plain(name).startswith(r"\textbackslash{}input\{x\} \$y\$ \#1 \& \% \textasciitilde{}")
    body = document.partition(r"\begin{document}")[2]
    unknown = {letter for letter in body if letter > latex_text.LAST_LATIN}
    declared = set(re.findall(r"\\DeclareUnicodeCharacter\{([0-9A-F]+)\}", document))
    assert {f"{ord(letter):04X}" for letter in unknown} <= declared


@pytest.mark.parametrize(
    ("letter", "sign"),
    [
        ("λ", r"\ensuremath{\lambda}"),
        ("Λ", r"\ensuremath{\Lambda}"),
        ("ο", r"\ensuremath{o}"),
        ("Α", r"\ensuremath{\mathrm{A}}"),
        ("⁴", "\\ensuremath{^{4}}"),
        ("ₖ", "\\ensuremath{_{k}}"),
        ("⁻", "\\ensuremath{^{-}}"),
        ("≤", r"\ensuremath{\le}"),
        ("ש", r"\texttt{[U+05E9]}"),
        ("漢", r"\texttt{[U+6F22]}"),
    ],
)
def test_a_letter_without_a_sign_in_latex_is_printed_by_its_number(letter, sign):
    assert (
        latex_text.declarations(f"a{letter}é") == rf"\DeclareUnicodeCharacter{{{ord(letter):04X}}}{{{sign}}}"
    )


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda path: path.stem)
def test_a_listing_is_the_text_of_the_file(path):
    text = path.read_text(encoding="utf-8")
    listing = model_on_page.listing(text, path.name)
    assert listing.text == text.rstrip("\n")
    keys = {piece.strip() for line in listing.lines for look, piece in line if look == "key"}
    assert {"lagcli", "title"} <= keys
    comments = [piece for line in listing.lines for look, piece in line if look == "comment"]
    assert all(piece.startswith("#") for piece in comments)
    assert len(comments) == sum(" #" in line or line.startswith("#") for line in text.split("\n"))


def test_a_long_listing_is_cut_and_says_so():
    text = written() + "# more\n" * 1000
    listing = model_on_page.listing(text, "model.yaml")
    assert len(listing.lines) == model_on_page.MOST_LINES
    assert "of which the first" in listing.caption
    wide = model_on_page.listing(written(comment="x" * 5000), "model.yaml")
    assert all(len("".join(piece for _, piece in line)) < 2100 for line in wide.lines)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a|b", r"a\|b"),
        ("# head", r"\# head"),
        ("1. one", r"1\. one"),
        ("- one", r"\- one"),
        ("m*v_x", r"m\*v\_x"),
        ("<b>&amp;", "&lt;b&gt;&amp;amp;"),
        ("two\nlines", "two lines"),
        ("3.5 - 2", "3.5 - 2"),
    ],
)
def test_markdown_prints_texts_as_they_are(text, shown):
    assert report_page.escaped(text) == shown
