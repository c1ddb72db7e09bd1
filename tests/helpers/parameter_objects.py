"""The numbers of the algorithms: classes of fields whose docstrings name the tests that fail when they move."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

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


def fields(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    """The fields of an object with their docstrings."""
    body = [*node.body, ast.Pass()]
    for field, after in itertools.pairwise(body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            yield field.target.id, str(after.value.value) if documented else ""


def files_named(text: str) -> list[str]:
    """The files of tests that a text names."""
    return re.findall(r"tests/[\w/]+\.py", text)


def named_in(text: str) -> list[str]:
    """The tests that a text names."""
    return re.findall(r"(test_\w+)`", text)


def defined_in(file: str) -> set[str]:
    """The tests of a file."""
    return set(re.findall(r"^ *def (test_\w+)", (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE))
