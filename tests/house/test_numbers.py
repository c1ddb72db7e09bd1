"""The numbers of algorithms: each field of a parameter object names a test that fails when it moves.

`python -m tests.moved_numbers` moves them and says which no named test notices.
"""

from __future__ import annotations

import ast
import re

import pytest

from tests.helpers.parameter_objects import defined_in, fields, files_named, named_in, parameter_objects

OBJECTS = list(parameter_objects())


def test_there_are_parameter_objects() -> None:
    assert len(OBJECTS) > 50
    assert sum(len(list(fields(node))) for _, node in OBJECTS) > 400


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
