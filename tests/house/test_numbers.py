"""The numbers of algorithms: each field of a parameter object names a test that fails when it moves."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "lagcli"


def parameter_objects() -> Iterator[tuple[str, ast.ClassDef]]:
    """Classes of numbers that are the same in every run, with the file that each stands in."""
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if "Parameters:" not in text:
            continue
        for node in ast.parse(text).body:
            is_named = isinstance(node, ast.ClassDef) and node.name.endswith("Parameters")
            if is_named and not node.decorator_list:  # those of one run are decorated dataclasses
                yield path.relative_to(PACKAGE).as_posix(), node


OBJECTS = list(parameter_objects())


def fields(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    """The fields of an object with their docstrings."""
    body = [*node.body, ast.Pass()]
    for field, after in itertools.pairwise(body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            yield field.target.id, str(after.value.value) if documented else ""


def functions(text: str) -> set[str]:
    """The tests of the files that a text names."""
    found: set[str] = set()
    for name in re.findall(r"tests/[\w/]+\.py", text):
        found |= set(
            re.findall(r"^ *def (test_\w+)", (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)
        )
    return found


def test_there_are_parameter_objects() -> None:
    assert len(OBJECTS) > 30
    assert sum(len(list(fields(node))) for _, node in OBJECTS) > 250


@pytest.mark.parametrize(("file", "node"), OBJECTS, ids=[f"{file}:{node.name}" for file, node in OBJECTS])
def test_a_number_names_its_unit_or_reason_and_the_test_that_fails_when_it_moves(
    file: str, node: ast.ClassDef
) -> None:
    there = functions(ast.get_docstring(node) or "")
    for name, docstring in fields(node):
        known = there | functions(docstring)
        named = set(re.findall(r"(test_\w+)`", docstring))
        assert named, f"{name} of {node.name} names no test that fails when it moves"
        assert named <= known, f"{sorted(named - known)} is in no file that {node.name} names"
        assert re.sub(r"`\w*test_\w+`", "", docstring).strip(), f"{name} has no reason"
