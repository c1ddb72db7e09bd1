"""What surrounds the package says the same as the package: version, licence, libraries, files."""

import fnmatch
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tomllib

import pytest
import yaml

import lagcli
from tests.helpers import in_process

ROOT = pathlib.Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]
RECIPE = yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
# Names that conda-forge has otherwise.
CONDA = {"matplotlib": "matplotlib-base"}


def conda(requirement: str) -> str:
    match = re.fullmatch(r"([a-z][a-z0-9]*)(\S*)", requirement)
    assert match is not None
    return f"{CONDA.get(match[1], match[1])} {match[2]}"


def test_the_version_is_the_same_everywhere() -> None:
    assert PROJECT["dynamic"] == ["version"]
    assert PYPROJECT["tool"]["hatch"]["version"]["path"] == "lagcli/__init__.py"
    assert RECIPE["context"]["version"] == CITATION["version"] == lagcli.__version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    topmost = re.search(r"^## (\S+)", changes, re.MULTILINE)
    assert topmost is not None
    assert topmost[1] == lagcli.__version__


def test_the_recipe_has_the_libraries_of_the_project() -> None:
    run = RECIPE["requirements"]["run"]
    assert run == [f"python {PROJECT['requires-python']}", *map(conda, PROJECT["dependencies"])]
    host = RECIPE["requirements"]["host"]
    assert set(map(conda, PYPROJECT["build-system"]["requires"])) <= set(host)
    assert host[0] == run[0]
    assert RECIPE["package"]["name"] == PROJECT["name"]
    assert RECIPE["about"]["license"] == PROJECT["license"] == CITATION["license"] == "MIT"
    assert RECIPE["about"]["summary"] == PROJECT["description"]
    (script,) = RECIPE["build"]["python"]["entry_points"]
    assert script == f"lagcli = {PROJECT['scripts']['lagcli']}"
    assert (ROOT / "packaging" / "conda" / RECIPE["source"]["path"] / "pyproject.toml").is_file()


def test_the_commands_of_the_recipe_run(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for line in RECIPE["tests"][1]["script"]:
        program, *arguments = shlex.split(line)
        assert program == "lagcli"
        assert in_process.run(*arguments)[2] == 0, line


def test_the_citation_has_what_its_format_asks_for() -> None:
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION.keys() >= {"message", "title", "authors", "version"}
    assert all(author.keys() == {"name"} for author in CITATION["authors"])


def test_files_of_the_sdist_are_there() -> None:
    listed = PYPROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    assert [name for name in listed if not (ROOT / name.lstrip("/")).exists()] == []
    pages = {f"/{path.name}" for path in ROOT.glob("*.md")} | {"/CITATION.cff", "/packaging", "/LICENSE"}
    assert pages <= set(listed)


def stray(names: set[str]) -> set[str]:
    """Those names at the top of the repository that the sdist does not have and Git does not ignore."""
    listed = PYPROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    ignored = (ROOT / ".gitignore").read_text(encoding="utf-8").split()
    known = [*(name.strip("/") for name in (*listed, *ignored)), "pyproject.toml", ".git*", "PKG-INFO"]
    return {name for name in names if not any(fnmatch.fnmatch(name, pattern) for pattern in known)}


def test_nothing_lies_at_the_top_that_belongs_nowhere() -> None:
    assert stray({"t.csv", "t.svg", "README.md", ".venv", "lagcli"}) == {"t.csv", "t.svg"}
    assert stray({path.name for path in ROOT.iterdir()}) == set()


def test_the_hook_finds_models_and_refuses_bad_ones(tmp_path: pathlib.Path) -> None:
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    files = re.compile(hook["files"])
    assert files.search("models/a.yaml")
    assert files.search("sub/models/deep/a.yml")
    assert not files.search("notmodels/a.yaml")
    assert not files.search("models/a.md")
    program, *arguments = shlex.split(hook["entry"])
    assert program == "lagcli"
    good, bad = str(ROOT / "models" / "pendulum.yaml"), str(tmp_path / "bad.yaml")
    pathlib.Path(bad).write_text("lagcli: 1\nparticls: {}\n", encoding="utf-8")
    assert in_process.run(*arguments, good)[2] == 0
    assert in_process.run(*arguments, good, bad)[2] == 1


@pytest.mark.skipif(os.name == "nt", reason="scripts of a POSIX shell")
def test_scripts_are_programs_of_a_shell() -> None:
    for path in (ROOT / ".ci").iterdir():
        assert os.access(path, os.X_OK), path.name
        assert subprocess.run(["bash", "-n", str(path)], check=False).returncode == 0, path.name


def test_the_version_is_known_without_installation(tmp_path: pathlib.Path) -> None:
    """In a folder with the package alone: no metadata, no history."""
    (tmp_path / "lagcli").symlink_to(ROOT / "lagcli", target_is_directory=True)
    done = subprocess.run(
        [sys.executable, "-m", "lagcli", "--version"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == f"lagcli {lagcli.__version__}\n"


def test_the_first_session_runs_every_command_that_makes_pictures_or_pages() -> None:
    script = (ROOT / ".ci" / "first-session").read_text(encoding="utf-8")
    for command in ("plot", "animate", "report"):
        assert f"lagcli {command} " in script
