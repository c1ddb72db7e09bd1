"""The oldest versions of libraries: declared once, and refused below."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import lagcli
from lagcli.errors import requirements
from lagcli.output.tables import table_format

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_versions_are_those_of_the_project_file():
    extras = PROJECT["optional-dependencies"]
    lines = [*PROJECT["dependencies"], *extras["parquet"], *extras["fast"]]
    found = dict(re.match(r"([a-z0-9]+)>=([0-9.]+)", line).groups() for line in lines)
    assert found == requirements.OLDEST


@pytest.mark.parametrize(
    ("version", "oldest", "older"),
    [
        ("3.6.6", "3.6.7", True),
        ("3.6.7", "3.6.7", False),
        ("3.6.10", "3.6.7", False),
        ("3.10", "3.9", False),
        ("3.9", "3.10", True),
        ("15", "15.0.0", False),
        ("15.0.0", "15", False),
        ("6.0rc1", "6.0.1", True),
        ("unknown", "1", False),
        ("", "1", False),
    ],
)
def test_versions_are_compared_by_their_numbers(version, oldest, older):
    assert requirements._is_older(version, oldest) is older


@pytest.fixture
def old_casadi(tmp_path):
    """A place on the path where an older casadi says that it is installed."""
    info = tmp_path / "casadi-3.5.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: casadi\nVersion: 3.5.5\n", encoding="utf-8")
    return tmp_path


def test_a_command_refuses_a_library_that_is_too_old(old_casadi):
    program = f"import sys; sys.path.insert(0, {str(old_casadi)!r}); from lagcli.__main__ import main; main()"
    ended = subprocess.run(
        [sys.executable, "-c", program, "dof", "models/pendulum.yaml"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert (ended.returncode, ended.stdout) == (2, "")
    oldest = requirements.OLDEST["casadi"]
    assert f"lagcli needs casadi {oldest} or newer, and 3.5.5 is installed" in ended.stderr
    assert f'-m pip install --upgrade "casadi>={oldest}"' in ended.stderr


def test_python_refuses_it_too(old_casadi, monkeypatch):
    monkeypatch.syspath_prepend(old_casadi)
    requirements._listed.cache_clear()
    lagcli._require_libraries.cache_clear()
    try:
        with pytest.raises(ImportError, match=r"lagcli needs casadi .* and 3\.5\.5 is installed"):
            lagcli.load("models/pendulum.yaml")
    finally:
        requirements._listed.cache_clear()
        lagcli._require_libraries.cache_clear()


def test_an_optional_library_counts_only_where_it_is_used(tmp_path, monkeypatch):
    info = tmp_path / "pyarrow-9.0.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: pyarrow\nVersion: 9.0.0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    requirements._listed.cache_clear()
    try:
        assert requirements.too_old() == ""
        assert "pyarrow" in requirements.too_old(("pyarrow",))
        assert lagcli.dof(lagcli.load(ROOT / "models" / "pendulum.yaml")).configuration_dof == 1
        with pytest.raises(table_format.MissingExtra, match=r"lagcli needs pyarrow 15 or newer"):
            table_format.of(Path("run.parquet"))
    finally:
        requirements._listed.cache_clear()
