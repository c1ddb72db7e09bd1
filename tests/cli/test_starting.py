"""The first minutes: the gallery, a new model, the schema, and what is said to who mistypes."""

import json
import os
import pathlib
import shutil
import subprocess
import sys

import jsonschema
import pytest

import lagcli
from lagcli import yaml_tree
from lagcli.input import format_schema
from lagcli.input.starting import first_models
from tests.helpers.in_process import Command, command

__all__ = ["command"]

ROOT = pathlib.Path(__file__).parents[2]
SCHEMA = "lagcli.schema.json"


@pytest.fixture(autouse=True)
def folder(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_gallery_is_listed_by_subject_with_a_line_each(command: Command) -> None:
    out, err, code = command("models")
    assert code == 0
    lines = out.splitlines()
    names = [line.split()[0] for line in lines if line.startswith("  ")]
    assert sorted(names) == sorted(path.stem for path in (ROOT / "models").glob("*.yaml"))
    assert all(len(line.split()) > 3 for line in lines if line.startswith("  "))
    subjects = [line for line in lines if line and not line.startswith(" ")]
    assert "Differential constraints" in subjects
    assert len(subjects) == len(set(subjects)) > 4
    assert "-o FILE" in err
    assert command("models", "-q")[1] == ""


def test_the_gallery_of_a_wheel_is_found_and_none_is_reported(
    command: Command, folder: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = folder / "place" / "lagcli"
    shutil.copytree(ROOT / "models", package / "gallery")
    monkeypatch.setattr(first_models, "_PACKAGE", package)
    first_models.models.cache_clear()
    try:
        assert first_models.find("pendulum").path == package / "gallery" / "pendulum.yaml"  # type: ignore[union-attr]
        # What another project has beside the package is no gallery.
        shutil.rmtree(package / "gallery")
        shutil.copytree(ROOT / "models", package.parent / "models")
        first_models.models.cache_clear()
        out, err, code = command("models")
        assert (out, code) == ("", 2)
        assert "no gallery" in err
    finally:
        first_models.models.cache_clear()


def test_the_gallery_as_json(command: Command) -> None:
    found = json.loads(command("models", "--json")[0])["models"]
    assert len(found) == len(list((ROOT / "models").glob("*.yaml")))
    pendulum = next(model for model in found if model["name"] == "pendulum")
    assert pendulum["title"] == "Pendulum"
    assert pendulum["subject"] == "Holonomic constraints"
    one = json.loads(command("models", "pendulum", "--json")[0])
    assert one["text"] == first_models.find("pendulum").text()  # type: ignore[union-attr]
    assert pathlib.Path(one["path"]).is_file()


@pytest.mark.parametrize("name", ["pendulum", "pendulum.yaml"])
def test_a_model_is_printed_as_a_model(command: Command, name: str) -> None:
    out, err, code = command("models", name)
    assert (err, code) == ("", 0)
    assert format_schema.MARK not in out
    assert lagcli.dof(lagcli.loads(out)).configuration_dof == 1


def test_a_model_is_copied_with_its_schema(command: Command, folder: pathlib.Path) -> None:
    assert command("models", "atwood", "-o", "w.yaml")[2] == 0
    text = (folder / "w.yaml").read_text(encoding="utf-8")
    assert text == (ROOT / "models" / "atwood.yaml").read_text(encoding="utf-8")
    assert text.startswith(f"{format_schema.EDITOR_LINE}\n")
    jsonschema.Draft7Validator(json.loads((folder / SCHEMA).read_text(encoding="utf-8"))).validate(
        format_schema.plain(yaml_tree.parse(text, ""))
    )
    (folder / "sub").mkdir()
    assert command("models", "atwood", "-o", "sub", "--no-schema")[2] == 0
    assert os.listdir("sub") == ["atwood.yaml"]
    assert (
        not (folder / "sub" / "atwood.yaml").read_text(encoding="utf-8").startswith("# yaml-language-server")
    )


def test_a_copy_never_replaces_another_file_unasked(command: Command, folder: pathlib.Path) -> None:
    mine = folder / "w.yaml"
    mine.write_text("mine", encoding="utf-8")
    out, err, code = command("models", "atwood", "-o", "w.yaml")
    assert (out, code) == ("", 2)
    assert "--force" in err
    assert mine.read_text(encoding="utf-8") == "mine"
    assert command("models", "atwood", "-o", "w.yaml", "--force")[2] == 0
    assert "already" in command("models", "atwood", "-o", "w.yaml")[1]
    assert command("models", "atwood", "-o", "missing/w.yaml")[2] == 74


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("models", "pendulm"), "did you mean `pendulum`?"),
        (("models", "-o", "x.yaml"), "give its NAME"),
        (("new",), "NAME is missing"),
        (("new", " "), "needs a name"),
        (("new", "x", "--template", "particle"), "did you mean `particles`?"),
        (("new", "x", "--template", "zzz"), "`mechanism`"),
        (("dof", "swing"), "did you mean swing.yaml?"),
        (("check", "swing"), "did you mean swing.yaml?"),
        (("simulate", "models/atwood.yaml"), "`lagcli models atwood -o atwood.yaml`"),
        (("dof", "nothing.yaml"), "there is no file nothing.yaml"),
        (("dof", "swing.yaml", "--jsn"), "did you mean `--json`?"),
        (("simulate", "swing.yaml", "--duraton=3"), "did you mean `--duration`?"),
        (("simulate", "swing.yaml", "--dt", "3"), "did you mean `--output-step`?"),
        (("simulate", "swing.yaml", "--out", "a.csv"), "did you mean `--output`?"),
        (("audit", "swing.yaml", "run.csv"), "did you mean `--run run.csv`?"),
        (("audit", "swing.yaml", "--table", "run.csv"), "did you mean `--run`?"),
        (("audit", "swing.yaml", "other.yaml"), "`other.yaml` is one argument too many\n"),
        (("dof", "swing.yaml", "run\x1b.csv"), "is one argument too many\n"),
        (("simulate", "swing.yaml", "--stats", "-o", "x.csv"), "`--stats` has no value: `-o` is an option"),
        (("dof", "swing.yaml", "--set", "--json"), "`--set` has no value: `--json` is an option"),
        (("sweep", "swing.yaml", "--vary", "m=1:2:3"), "did you mean `--over`?"),
        (("--verson",), "did you mean `--version`?"),
        (("dof", "swing.yaml", "--\x1b[31m"), "there is no option"),
        (("swing.yaml",), "did you mean `lagcli simulate swing.yaml`?"),
        (("chek", "swing.yaml"), "did you mean `check`?"),
        (("init", "swing"), "`lagcli new NAME`"),
        (("gallery",), "`lagcli models`"),
    ],
)
def test_what_is_mistyped_is_answered_by_what_was_meant(
    command: Command, folder: pathlib.Path, arguments: tuple[str, ...], told: str
) -> None:
    command("new", "swing", "-q", "--no-schema")
    out, err, code = command(*arguments)
    assert (out, code) == ("", 2)
    assert told in err
    assert "\x1b" not in err
    assert os.listdir() == ["swing.yaml"]


@pytest.mark.parametrize("template", first_models.TEMPLATES)
def test_every_template_is_a_model_that_runs_as_it_is(
    command: Command, folder: pathlib.Path, template: str
) -> None:
    assert command("new", "mine", "--template", template)[2] == 0
    text = (folder / "mine.yaml").read_text(encoding="utf-8")
    assert text.startswith(f"{format_schema.EDITOR_LINE}\nlagcli: 1\ntitle: mine\n")
    assert text.count("\n# ") + text.count("\n  # ") >= 3, "it is commented"
    schema = json.loads((folder / SCHEMA).read_text(encoding="utf-8"))
    jsonschema.Draft7Validator(schema).validate(format_schema.plain(yaml_tree.parse(text, "")))
    out, err, code = command("check", "--strict", "mine.yaml")
    assert (err, code) == ("", 0), out
    assert command("simulate", "mine.yaml", "-o", "mine.csv", "-q")[2] == 0
    assert command("dof", "mine.yaml")[2] == 0


def test_what_is_commented_out_in_a_template_can_be_taken_in(command: Command, folder: pathlib.Path) -> None:
    """Lines of the form `# key: value`, each by itself."""
    count = 0
    for template in first_models.TEMPLATES:
        text = first_models.text(template, "x")
        for line in text.splitlines():
            head, sign, rest = line.partition("# ")
            key = rest.partition(":")[0].strip('"')
            if (
                not sign
                or head.strip()
                or ": " not in rest
                or not all(c.isalnum() or c in "[]_" for c in key)
            ):
                continue
            lagcli.loads(text.replace(line, head + rest, 1))
            count += 1
    assert count == 7


@pytest.mark.parametrize(
    "name",
    [
        "plain",
        "with space",
        "no",
        "3bodies",
        "a: b",
        "# x",
        "'",
        '"',
        "<script>",
        "ö",
        "😀",
        "tab\tx",
        "\x1b[31m",
        "{x}",
        "-x",
    ],
)
def test_any_name_becomes_a_title(command: Command, folder: pathlib.Path, name: str) -> None:
    end = command("new", "--template", "box", "--", name)
    assert end[2] == 0
    assert "\x1b" not in end[1]
    assert lagcli.load(f"{name}.yaml").title == name


def test_a_new_model_keeps_its_ending_and_its_folder(command: Command, folder: pathlib.Path) -> None:
    (folder / "sub").mkdir()
    out, _, code = command("new", "sub/a.yml", "--json")
    assert code == 0
    assert json.loads(out) == {"path": "sub/a.yml", "template": "particles", "written": True}
    assert sorted(os.listdir("sub")) == ["a.yml", SCHEMA]
    assert lagcli.load("sub/a.yml").title == "a"
    assert json.loads(command("new", "sub/a.yml", "--json")[0])["written"] is False
    assert command("new", "nowhere/a")[2] == 74


def test_a_new_model_never_replaces_another_file_unasked(command: Command, folder: pathlib.Path) -> None:
    (folder / "a.yaml").write_text("mine", encoding="utf-8")
    _, err, code = command("new", "a")
    assert code == 2
    assert "a.yaml is there already" in err
    assert (folder / "a.yaml").read_text(encoding="utf-8") == "mine"
    assert os.listdir() == ["a.yaml"]
    assert command("new", "a", "--force")[2] == 0
    assert lagcli.load("a.yaml").title == "a"


def test_a_new_model_on_standard_output(command: Command, folder: pathlib.Path) -> None:
    out, err, code = command("new", "-", "--template", "box")
    assert (err, code) == ("", 0)
    assert lagcli.loads(out).title == "A new model"
    assert os.listdir() == []


def test_an_older_schema_is_left_and_reported(command: Command, folder: pathlib.Path) -> None:
    (folder / SCHEMA).write_text('{"title": "lagcli model, format version 0"}', encoding="utf-8")
    assert "lagcli schema -o" in command("new", "a")[1]
    assert command("schema", "-o", SCHEMA)[2] == 0
    assert (folder / SCHEMA).read_text(encoding="utf-8") == format_schema.text()
    (folder / "a.yaml").write_text("mine", encoding="utf-8")
    assert command("schema", "-o", "a.yaml")[2] == 2
    assert (folder / "a.yaml").read_text(encoding="utf-8") == "mine"


def test_the_schema_is_printed(command: Command) -> None:
    out, err, code = command("schema")
    assert (err, code) == ("", 0)
    assert out == format_schema.text() == command("schema", "-o", "-")[0]
    assert json.loads(out) == format_schema.schema()


def test_the_schema_beside_the_gallery_is_the_schema() -> None:
    assert (ROOT / "models" / SCHEMA).read_text(encoding="utf-8") == format_schema.text(), (
        "run docs/make_reference.py"
    )
    for path in (ROOT / "models").glob("*.yaml"):
        assert path.read_text(encoding="utf-8").startswith(f"{format_schema.EDITOR_LINE}\n"), path.name


def terminal(answers: str, *arguments: str) -> tuple[str, int]:
    """What a command says on a terminal where these lines are typed, and its exit code."""
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-m", "lagcli", *arguments],
        stdin=theirs,
        stdout=subprocess.PIPE,
        stderr=theirs,
        env={**os.environ, "PYTHONPATH": str(ROOT), "TERM": "dumb"},
    ) as process:
        os.close(theirs)
        os.write(ours, answers.encode())
        told = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # the other end was closed
                break
            if not part:
                break
            told += part
    os.close(ours)
    return told.decode(), process.returncode


def test_what_is_missing_is_asked_for_on_a_terminal(folder: pathlib.Path) -> None:
    told, code = terminal("\nmine\n9\nbox\n", "new")
    assert code == 0, told
    assert "name of the model" in told
    assert "walls, impacts and events" in told
    assert "there is no template `9`" in told
    assert lagcli.load("mine.yaml").inequality


def test_an_answer_may_be_a_number_or_nothing(folder: pathlib.Path) -> None:
    assert terminal("3\n", "new", "third")[1] == 0
    assert lagcli.load("third.yaml").differential
    assert terminal("\n", "new", "first")[1] == 0
    assert lagcli.load("first.yaml").holonomic


def test_no_answer_writes_nothing(folder: pathlib.Path) -> None:
    told, code = terminal("\x04", "new", "mine")
    assert code == 2
    assert "nothing was written" in told
    assert os.listdir() == []


def test_nothing_is_asked_where_all_is_given(folder: pathlib.Path) -> None:
    told, code = terminal("", "new", "mine", "--template", "box")
    assert code == 0
    assert "template (" not in told
