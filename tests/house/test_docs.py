"""The documentation is true: its links lead somewhere, its commands run, its examples are models."""

import importlib.util
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
from types import ModuleType

import pytest
import typer

import lagcli
from lagcli import yaml_tree
from lagcli.cli import app, commands
from tests.helpers import in_process

ROOT = pathlib.Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "models").glob("*.md")])
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
README = (ROOT / "README.md").read_text(encoding="utf-8")


def name_of(page: pathlib.Path) -> str:
    return page.relative_to(ROOT).as_posix()


def blocks(text: str, language: str) -> list[str]:
    return [body for kind, body in FENCE.findall(text) if kind == language]


def generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_reference", ROOT / "docs" / "make_reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_generated_reference_is_what_the_tables_give() -> None:
    make_reference = generator()
    pages = list(make_reference.pages())
    names = {"CONTRIBUTING.md", "equations.md", "errors.md", "model-file.md", "published-numbers.md"}
    assert {page.name for page in pages} == names
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert text == make_reference.made(text), f"run docs/make_reference.py: {page.name} is old"


def anchors(page: pathlib.Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_relative_links_resolve(page: pathlib.Path) -> None:
    prose = FENCE.sub("", page.read_text(encoding="utf-8"))
    for link in LINK.findall(prose):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.is_relative_to(ROOT), f"{link} leads out of the repository"
        assert target.exists(), f"{link} leads nowhere"
        assert not anchor or anchor in anchors(target), f"{link}: no such heading"


def test_every_page_of_docs_is_in_its_index() -> None:
    index = ROOT / "docs" / "README.md"
    linked = {(index.parent / link).resolve() for link in LINK.findall(index.read_text(encoding="utf-8"))}
    missing = [name_of(page) for page in (ROOT / "docs").rglob("*.md") if page not in {*linked, index}]
    assert not missing


def test_decisions_are_numbered_without_a_gap() -> None:
    pages = sorted((ROOT / "docs" / "explanation" / "decisions").glob("*.md"))
    assert [int(page.name[:4]) for page in pages] == list(range(1, len(pages) + 1))


EXAMPLES = [
    pytest.param(body, id=f"{name_of(page)}-{number}")
    for page in PAGES
    for number, body in enumerate(blocks(page.read_text(encoding="utf-8"), "yaml"))
]


@pytest.mark.parametrize("text", EXAMPLES)
def test_yaml_examples_are_models_that_run(text: str) -> None:
    assert yaml_tree.parse(text, "example").key("lagcli") is not None
    run = lagcli.simulate(lagcli.loads(text), duration=0.1, samples=3)
    assert run.t[-1] == 0.1


def command_lines() -> list[str]:
    shown = [line for body in blocks(README, "sh") for line in body.splitlines()]
    return [line for line in shown if line.startswith("lagcli ")]


@pytest.fixture
def clone(tmp_path: pathlib.Path) -> pathlib.Path:
    """A folder like a clone: the gallery, and the models the README shows under their names."""
    shutil.copytree(ROOT / "models", tmp_path / "models")
    for body in blocks(README, "yaml"):
        name = re.match(r"# (\S+\.yaml)\n", body)
        assert name is not None
        (tmp_path / name[1]).write_text(body, encoding="utf-8")
    return tmp_path


def run(line: str, folder: pathlib.Path) -> subprocess.CompletedProcess[str]:
    """A line of the shell, `lagcli` being the one under test: in this process where it is one command and no more."""
    if line.startswith("lagcli ") and not set(line) & set("|&;<$`\\"):
        words, _, target = line.partition(" > ")
        named = [
            sorted(path.relative_to(folder).as_posix() for path in folder.glob(word)) or [word]
            for word in shlex.split(words)[1:]
        ]
        done = in_process.completed(*(word for found in named for word in found), folder=folder)
        if target:
            (folder / target).write_text(done.stdout, encoding="utf-8")
        return done
    line = re.sub(r"\blagcli(?= [a-z])", f'"{sys.executable}" -m lagcli', line)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        line, shell=True, cwd=folder, env=environment, capture_output=True, text=True, timeout=60, check=False
    )


@pytest.mark.parametrize("line", command_lines())
def test_readme_commands_run(line: str, clone: pathlib.Path) -> None:
    done = run(line, clone)
    assert done.returncode == 0, done.stderr
    for file in re.findall(r"(?:-o|--plot|--stats|>) (\S+)", line):
        assert (clone / file).stat().st_size > 0


SESSIONS = [
    (command, "".join(f"{line}\n" for line in output.splitlines()))
    for body in blocks(README, "console")
    for command, _, output in (part.partition("\n") for part in body.split("$ ")[1:])
]


@pytest.mark.parametrize(("command", "output"), SESSIONS)
def test_readme_sessions_print_what_is_shown(command: str, output: str, clone: pathlib.Path) -> None:
    assert run(command, clone).stdout == output


def test_readme_error_is_what_the_reader_says(clone: pathlib.Path) -> None:
    first = clone / "first.yaml"
    first.write_text(first.read_text(encoding="utf-8").replace("norm(bob)", "norm(bop)"), encoding="utf-8")
    assert run("lagcli check first.yaml", clone).stderr in blocks(README, "text")


def test_first_model_pulls_with_three_weights_at_the_lowest_point(clone: pathlib.Path) -> None:
    run = lagcli.simulate(lagcli.load(clone / "first.yaml"), samples=2001)
    assert run["lambda.rod"].max() == pytest.approx(58.86, rel=1e-4)


def test_readme_python_runs(clone: pathlib.Path) -> None:
    (code,) = blocks(README, "python")
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=clone,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[:2] == ["1", "True"]


def test_command_line_page_names_every_command_and_option() -> None:
    page = (ROOT / "docs" / "reference" / "command-line.md").read_text(encoding="utf-8")
    sections = {part.partition("\n")[0]: part for part in page.split("\n## ")}
    common = sections["Options of the three commands"]
    group = typer.main.get_command(app.app)
    for name in commands.COMMANDS:
        command = group.get_command(None, name)
        documented = set(re.findall(r"`(--?\w[\w-]*)", common + sections[name]))
        options = {option for parameter in command.params for option in parameter.opts if option[0] == "-"}
        assert options <= documented


def test_the_two_commands_of_the_readme_stand_in_the_ci_script() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert "-m pytest -n 2" in README
    assert "-m pytest -n 2" in script


def words(text: str) -> list[str]:
    return re.split(r"[\s,]+", text.strip())


def are_alike(shown: str, printed: str) -> bool:
    """Word for word, numbers to nine digits and a residual to the size of rounding."""
    pairs = [(a.strip("()"), b.strip("()")) for a, b in zip(words(shown), words(printed), strict=False)]
    number = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")
    return len(words(shown)) == len(words(printed)) and all(
        float(a) == pytest.approx(float(b), rel=1e-8, abs=1e-9)
        if number.fullmatch(a) and number.fullmatch(b)
        else a == b
        for a, b in pairs
    )


TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
CHAPTERS = [part for part in TUTORIAL.split("\n## ") if "```console" in part]
# What these commands print beside words are times, steps, errors and how many digits agree: no machine has the same.
OWN_NUMBERS = ("compare", "limit", "audit")
NUMBER = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


def in_words(line: str) -> list[str]:
    """The words of a line, up to where a check of the audit was worst: rounding decides that."""
    return words(NUMBER.sub("N", line.partition(" pass ")[0]))


def require_shown(program: str, output: str, out: str, err: str) -> None:
    """Every line that is shown is printed, in this order; of commands with numbers of their own its words are."""
    printed = iter([*out.splitlines(), *err.splitlines()])
    for shown in filter(str.strip, output.splitlines()):
        costs = program in OWN_NUMBERS or shown.startswith("done:")
        assert shown.strip() == "..." or any(
            in_words(shown) == in_words(line) if costs else are_alike(shown, line) for line in printed
        ), (program, shown)


@pytest.mark.skipif(os.name != "posix", reason="its lines are for a shell")
@pytest.mark.parametrize("chapter", CHAPTERS, ids=lambda chapter: chapter.partition("\n")[0])
def test_the_tutorial_prints_what_is_shown(
    chapter: str, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The models of all chapters, the commands of one after the other; lines shown are printed, in this order."""
    for body in blocks(TUTORIAL, "yaml"):
        (tmp_path / body.split()[1]).write_text(body, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for session in (part for body in blocks(chapter, "console") for part in body.split("$ ")[1:]):
        command, _, output = session.partition("\n")
        program, name, *_ = typed = shlex.split(command)
        if program == "lagcli" and "|" not in typed:
            out, err, code = in_process.run(*typed[1:])
        else:
            done = run(command, tmp_path)
            out, err, code = done.stdout, done.stderr, done.returncode
        assert code == 0, (command, err)
        require_shown(name, output, out, err)


HOW_TO = [
    page
    for page in sorted((ROOT / "docs" / "how-to").glob("*.md"))
    if "```console" in page.read_text("utf-8")
]


@pytest.mark.parametrize("page", HOW_TO, ids=lambda page: page.stem)
def test_how_to_pages_print_what_is_shown(
    page: pathlib.Path, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The files a page shows under their names, then its commands one after the other in one folder."""
    text = page.read_text(encoding="utf-8")
    for body in blocks(text, "yaml"):
        (tmp_path / body.split()[1]).write_text(body, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    sessions = [part for body in blocks(text, "console") for part in body.removeprefix("$ ").split("\n$ ")]
    assert sessions
    for session in sessions:
        command, _, output = session.partition("\n")
        program, *arguments = shlex.split(command)
        assert program == "lagcli"
        out, err, code = in_process.run(*arguments)
        assert code == 0, (command, err)
        require_shown("", output, out, err)


# Sessions in pages of another kind stand indented.
SESSION = re.compile(r"^    \$ (lagcli .*)\n((?:(?:    .*)?\n)*)", re.MULTILINE)
EXPLAINED = [
    page
    for folder in ("explanation", "reference")
    for page in sorted((ROOT / "docs" / folder).glob("*.md"))
    if SESSION.search(page.read_text("utf-8"))
]


@pytest.mark.parametrize("page", EXPLAINED, ids=lambda page: page.stem)
def test_pages_that_explain_print_what_is_shown(
    page: pathlib.Path, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files that a page shows under their names, and those of the gallery; each session by itself."""
    text = page.read_text(encoding="utf-8")
    for body in blocks(text, "yaml"):
        if body.startswith("# "):
            (tmp_path / body.split()[1]).write_text(body, encoding="utf-8")
    shutil.copytree(ROOT / "models", tmp_path / "models")
    monkeypatch.chdir(tmp_path)
    for command, output in SESSION.findall(text):
        _, *arguments = shlex.split(command)
        out, err, code = in_process.run(*arguments)
        assert code == 0, (command, err)
        require_shown(arguments[0], textwrap.dedent(output), out, err)


def test_the_derivation_that_is_shown_is_printed() -> None:
    (shown,) = blocks((ROOT / "docs/explanation/derivation.md").read_text(encoding="utf-8"), "text")
    out, err, code = in_process.run("derive", str(ROOT / "models/rolling-disk.yaml"), "--solve")
    assert code == 0, err
    printed = iter(out.splitlines())
    for line in filter(str.strip, shown.splitlines()):
        assert any(words(line) == words(other) for other in printed), line
