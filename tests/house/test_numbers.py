"""The numbers of algorithms: each field of a parameter object names a test that fails when it moves.

`python -m tests.moved_numbers` moves them and says which no named test notices.
"""

from __future__ import annotations

import ast
import re

import pytest

from tests.helpers.parameter_objects import (
    PACKAGE,
    defined_in,
    fields,
    files_named,
    loose_numbers,
    named_in,
    parameter_objects,
)

OBJECTS = list(parameter_objects())

# Numbers of modules that stand in no object, by packages: they may only become fewer. Many are widths and lengths.
LOOSE = {
    "analysis": 30,
    "api": 38,
    "auditing": 45,
    "cli": 32,
    "compiled": 19,
    "contact": 3,
    "derivation": 30,
    "equations": 10,
    "errors": 7,
    "expression": 8,
    "formulations": 14,
    "input": 6,
    "linear": 1,
    "linearization": 17,
    "model": 4,
    "native": 5,
    "output": 124,
    "pfaffian": 49,
    "reporting": 9,
    "running": 7,
    "simulation": 72,
    "smoothness": 7,
    "start": 0,
    "statics": 3,
}


def test_there_are_parameter_objects() -> None:
    assert len(OBJECTS) > 20
    assert sum(len(list(fields(node))) for _, node in OBJECTS) > 100


@pytest.mark.parametrize(("file", "node"), OBJECTS, ids=[f"{file}:{node.name}" for file, node in OBJECTS])
def test_a_number_has_a_reason_and_names_the_test_that_fails_when_it_moves(
    file: str, node: ast.ClassDef
) -> None:
    own = files_named(ast.get_docstring(node) or "")
    for name, docstring in fields(node):
        known = set().union(*(defined_in(each) for each in (*own, *files_named(docstring))))
        named = set(named_in(docstring))
        assert named, f"{name} of {node.name} names no test that fails when it moves"
        assert named <= known, f"{sorted(named - known)} is in no file that {node.name} names"
        assert re.sub(r"`[\w/.:]*test_\w+`", "", docstring).strip(), f"{name} has no reason"


@pytest.mark.parametrize(("package", "most"), LOOSE.items())
def test_no_number_is_added_outside_of_an_object(package: str, most: int) -> None:
    names = {
        path.name: list(loose_numbers(ast.parse(path.read_text(encoding="utf-8"))))
        for path in (PACKAGE / package).rglob("*.py")
    }
    assert sum(map(len, names.values())) <= most, f"put the number into the `PARAMETERS` of its file: {names}"


def test_each_package_has_its_count_of_loose_numbers() -> None:
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} == set(LOOSE)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("LIMIT = 1e-3", ["LIMIT"]),
        ("NEAR, FAR = 0.1, 2**-4\nSTEPS: tuple[int, int] = (1, 2)", ["NEAR", "FAR", "STEPS"]),
        ("LAST = -1\nx = y[LAST]", []),
        ("LIMIT = 0.1\nx = y[y > LIMIT]", ["LIMIT"]),
        ("LAST = -1\nx = y[LAST] + LAST", ["LAST"]),
        ("A = ((1, 2), (3, 4))\nC = (1, 2, 3, 4, 5, 6, 7)\nSEED = 3\nNAMES = ('a', 'b')\nIS = True", []),
    ],
)
def test_indices_and_tableaux_are_no_loose_numbers(text: str, names: list[str]) -> None:
    assert list(loose_numbers(ast.parse(text))) == names
