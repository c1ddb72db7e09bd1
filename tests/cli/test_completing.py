"""Completion of shells, asked for as they ask: by variables of the environment."""

import os
import pathlib
import shutil
import subprocess
import sys
import types

import pytest

from lagcli.cli.commands import COMMANDS, completing
from lagcli.errors import catalogue
from lagcli.input.starting import first_models, model_outline
from tests.helpers import in_process

ROOT = pathlib.Path(__file__).parents[2]
MODEL = """\
lagcli: 1
parameters: {m: 2, L: 1, N: 3, down: [0, 0, -1]}
coordinates: {theta: {value: 0.5}}
particles:
  a: {mass: m, position: [L, 0, 0]}
  "p[i]": {for: i = 1..N, mass: m, position: [i, 0, 0]}
holonomic:
  rod: L = norm(a)
  pin: p[1] = [1, 0, 0]
  "link[i]": {for: "i = 2..N", equation: "distance(p[i-1], p[i]) = L"}
differential: {skate: d(a.y) = theta*d(a.x)}
inequality: {floor: a.z >= -2}
outputs: {height: a.z}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.yaml").write_text(MODEL, encoding="utf-8")
    return tmp_path


def asked(*words: str, shell: str = "zsh") -> tuple[str, int]:
    """What is printed for a command line whose last word is being typed, and the exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("_LAGCLI_COMPLETE", f"complete_{shell}")
        patch.setenv("COMP_WORDS", "\n".join(["lagcli", *words]))
        patch.setenv("COMP_CWORD", str(len(words)))
        patch.setenv("_TYPER_COMPLETE_ARGS", " ".join(["lagcli", *words]))
        patch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
        patch.setenv("_TYPER_COMPLETE_WORD_TO_COMPLETE", words[-1])
        out, err, code = in_process.run()
    assert err == ""
    return out, code


def completed(*words: str) -> list[str]:
    out, code = asked(*words, shell="bash")
    assert code == 0
    return [line.replace("\\", "") for line in out.splitlines() if line]


def test_commands() -> None:
    assert set(completed("")) >= set(COMMANDS)
    assert completed("s") == [name for name in COMMANDS if name.startswith("s")]
    assert "--version" in completed("--")


def test_options() -> None:
    assert set(completed("check", "--")) >= {"--json", "--strict", "--watch", "--witness"}
    assert completed("simulate", "m.yaml", "--dur") == ["--duration"]


def test_model_files(folder: pathlib.Path) -> None:
    (folder / "n.yml").touch()
    (folder / "other.txt").touch()
    (folder / ".hidden.yaml").touch()
    (folder / "sub" / "deep").mkdir(parents=True)
    (folder / "sub" / "deep" / "x.yaml").touch()
    assert completed("dof", "") == ["m.yaml", "n.yml", "sub/"]
    assert completed("check", "m.yaml", "n") == ["n.yml"]
    assert completed("dof", "su") == ["sub/deep/x.yaml"]
    assert completed("dof", "sub/") == ["sub/deep/x.yaml"]
    assert completed("dof", ".h") == [".hidden.yaml"]
    assert completed("dof", str(folder / "m")) == [str(folder / "m.yaml")]
    assert completed("dof", "nowhere/") == []


def test_empty_folders_and_links_in_a_circle_end(folder: pathlib.Path) -> None:
    (folder / "sub").mkdir()
    assert completed("dof", "s") == ["sub/"]
    if hasattr(os, "symlink"):
        (folder / "sub" / "again").symlink_to(folder / "sub", target_is_directory=True)
        (found,) = completed("dof", "s")
        assert found.startswith("sub/again/")


def test_columns() -> None:
    found = completed("simulate", "m.yaml", "--columns", "")
    assert set(found) >= {
        "t",
        "a.x",
        "a.vz",
        "theta",
        "rate(theta)",
        "p[*].x",
        "lambda.rod",
        "lambda.pin.x",
        "R.a.z",
    }
    assert set(found) >= {"lambda.link[*]", "lambda.skate", "lambda.floor", "height", "energy", "R.*"}
    assert "lambda.pin" not in found
    assert completed("simulate", "m.yaml", "--columns", "t,a.x,lambda.r") == ["t,a.x,lambda.rod"]
    assert completed("compare", "m.yaml", "--columns", "R.a.") == ["R.a.x", "R.a.y", "R.a.z"]


def test_columns_of_a_model_that_stands_after_the_cursor() -> None:
    """bash hands over the whole line."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("_LAGCLI_COMPLETE", "complete_bash")
        patch.setenv("COMP_WORDS", "lagcli\nsimulate\n--columns\nlambda.r\nm.yaml")
        patch.setenv("COMP_CWORD", "3")
        out, _, code = in_process.run()
    assert (out, code) == ("lambda.rod\n", 0)


def test_tables_and_their_columns(folder: pathlib.Path) -> None:
    (folder / "run.csv").write_text('t,ball.x,"lambda.floor",energy\n0,1,2,3\n', encoding="utf-8")
    (folder / "run.npz").touch()
    assert completed("animate", "") == ["m.yaml", "run.csv", "run.npz"]
    assert completed("dof", "") == ["m.yaml"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("_TYPER_COMPLETE_ARGS", "lagcli plot run.csv")
        context = types.SimpleNamespace(params={"files": ["run.csv"]})
        assert completing.columns(context, "t,l") == ["t,lambda.floor"]  # type: ignore[arg-type]
        context = types.SimpleNamespace(params={"files": ["run.npz"]})
        (folder / "run.csv").unlink()
        assert completing.columns(context, "ener") == ["energy"]  # type: ignore[arg-type]


def test_names_of_constraints_and_what_can_be_set() -> None:
    assert completed("limit", "m.yaml", "--constraint", "") == ["rod", "pin"]
    assert completed("check", "m.yaml", "--witness", "s") == ["skate"]
    assert completed("compare", "m.yaml", "--vakonomic", "--mu", "") == ["skate="]
    found = completed("dof", "m.yaml", "--set", "")
    assert set(found) >= {"m=", "L=", "theta.value=", "theta.rate=", "a.x=", "a.vz="}
    assert not [name for name in found if "[" in name]
    assert completed("derive", "m.yaml", "--values", "m,") == ["m,m", "m,L", "m,N", "m,down"]


def test_names_of_the_program() -> None:
    assert completed("models", "wat") == ["water-slide", "water-molecule", "water-vibrations"]
    assert len(completed("models", "")) == len(first_models.models())
    assert completed("new", "x", "--template", "") == list(first_models.TEMPLATES)
    assert completed("report", "x.yaml", "--pdf", "") == ["browser", "latex"]
    assert completed("explain", "") == list(catalogue.codes())
    assert completed("simulate", "m.yaml", "--method", "d") == ["dop853"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell", "pwsh"])
def test_all_shells_are_answered(shell: str) -> None:
    out, code = asked("models", "wat", shell=shell)
    assert code == 0
    assert "water-slide" in out
    out, code = asked("simulate", "m.yaml", "--columns", "lambda.", shell=shell)
    assert code == 0
    assert "lambda.rod" in out


BROKEN = {
    "nothing": "",
    "no YAML": "{{{",
    "binary": "\x00\x01",
    "a list": "- 1",
    "sections of other shapes": "particles: [a]\nholonomic: x\nparameters:\noutputs: {y: 1}\n",
    "names that are none": "particles: {1: {}, 'a b': {}, '$(touch x)': {}, '[': {}, ']': {}, c: {}}\n",
    "equations that are none": "holonomic: {a: '((', b: {x: 1}, c: [1], d: , e: 'a = b = c'}\n",
    "deep": "particles: " + "[" * 100,
    "duplicate": "particles: {a: {}, a: {}}\n",
    "unfinished": "lagcli: 1\nparticles:\n  a: {mass: 1, position: [0, 0\n",
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN)
@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_a_broken_model_gives_fewer_names_and_no_error(folder: pathlib.Path, shell: str, text: str) -> None:
    (folder / "m.yaml").write_text(text, encoding="utf-8")
    out, code = asked("simulate", "m.yaml", "--columns", "", shell=shell)
    assert code == 0
    assert "energy" in out
    for option in ("--set", "--events"):
        assert asked("simulate", "m.yaml", option, "", shell=shell)[1] == 0
    assert "touch" not in out
    assert "Traceback" not in out


def test_no_candidate_means_anything_to_a_shell(folder: pathlib.Path) -> None:
    for name in (
        "$(touch x).yaml",
        "`x`.yaml",
        "a;b.yaml",
        "a'b.yaml",
        'a"b.yaml',
        "a\nb.yaml",
        "a|b.yaml",
        "good.yaml",
    ):
        (folder / name).touch()
    out, code = asked("dof", "", shell="zsh")
    assert code == 0
    assert "good.yaml" in out
    assert "touch" not in out
    assert completed("dof", "") == ["good.yaml", "m.yaml"]


def test_bash_gets_what_it_may_insert(folder: pathlib.Path) -> None:
    (folder / "a b.yaml").touch()
    assert asked("dof", "a", shell="bash")[0] == "a\\ b.yaml\n"
    assert asked("simulate", "m.yaml", "--columns", "rate", shell="bash")[0] == "rate\\(theta\\)\n"
    assert asked("simulate", "m.yaml", "--columns", "'rate", shell="bash")[0] == "rate(theta)\n"


def test_a_very_long_model_is_not_read(folder: pathlib.Path) -> None:
    long = MODEL + "#" * model_outline.MAX_BYTES
    (folder / "m.yaml").write_text(long, encoding="utf-8")
    assert completed("simulate", "m.yaml", "--columns", "lam") == ["lambda.*"]


def test_completion_loads_no_numbers(folder: pathlib.Path) -> None:
    """It answers while somebody types."""
    program = (
        "import sys\nfrom lagcli.__main__ import main\n"
        "try:\n    main()\nfinally:\n"
        "    slow = {'numpy', 'casadi', 'scipy', 'sympy', 'matplotlib', 'rich.console'} & set(sys.modules)\n"
        "    print(sorted(slow), file=sys.stderr)\n"
    )
    environment = {
        **os.environ, "PYTHONPATH": str(ROOT), "_LAGCLI_COMPLETE": "complete_bash",
        "COMP_WORDS": "lagcli\nsimulate\nm.yaml\n--columns\nlambda.r", "COMP_CWORD": "4",
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("lambda.rod\n", "[]\n")


@pytest.mark.skipif(shutil.which("bash") is None or os.name == "nt", reason="no bash")
def test_bash_itself(folder: pathlib.Path) -> None:
    """The script that is installed, in a shell."""
    (folder / "bin").mkdir()
    program = folder / "bin" / "lagcli"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m lagcli "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    script = (
        'eval "$(_LAGCLI_COMPLETE=source_bash lagcli)"\n'
        "COMP_WORDS=(lagcli simulate m.yaml --columns t,lambda.s); COMP_CWORD=4\n"
        '_lagcli_completion lagcli\nprintf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PATH": f"{program.parent}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "--norc", "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("t,lambda.skate\n", "")


def test_the_script_is_shown() -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("_LAGCLI_COMPLETE", "source_fish")
        out, _, code = in_process.run()
    assert code == 0
    assert "complete --command lagcli" in out


def test_columns_are_those_of_the_tables_of_the_gallery() -> None:
    import re

    import lagcli

    for name in (
        "pendulum",
        "rolling-disk",
        "cloth",
        "double-four-bar",
        "co2",
        "zeno-ball",
        "ramp-stick-coordinates",
    ):
        path = ROOT / "models" / f"{name}.yaml"
        real = lagcli.simulate(lagcli.load(path), duration=1e-6, samples=2).columns
        told = model_outline.read(path.read_bytes()).columns()
        patterns = [re.compile(re.escape(column).replace(r"\*", ".*")) for column in told]
        assert all(any(pattern.fullmatch(column) for pattern in patterns) for column in real), name
        assert all(any(pattern.fullmatch(column) for column in real) for pattern in patterns), name
