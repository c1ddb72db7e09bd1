"""One owner for each question: what only the owner needs stands in no other file."""

from __future__ import annotations

import ast

from tests.helpers.parameter_objects import fields, parameter_objects
from tests.house.test_architecture import FILES, imported, nodes


def test_two_sides_are_told_apart_in_one_file() -> None:
    """By one set of limits, with the part of a jump that stays as the distance shrinks."""
    limits = {"stays", "abrupt"}
    owners = [file for file, node in parameter_objects() if limits & {name for name, _ in fields(node)}]
    assert owners == ["smoothness/sides.py"]


def test_what_was_computed_before_is_kept_by_one_memory() -> None:
    """`functools.cache` makes a constant when it is first asked for: its functions take nothing."""
    keepers = ("collections.OrderedDict", "weakref.WeakKeyDictionary", "weakref.WeakValueDictionary")
    for name in FILES.keys() - {"lagcli.memory"}:
        assert not imported(name) & {"weakref"}, name
        for node in nodes(name):
            if isinstance(node, ast.ImportFrom):
                assert not {f"{node.module}.{a.name}" for a in node.names} & {
                    *keepers,
                    "functools.lru_cache",
                }, name
            if isinstance(node, ast.Attribute):
                assert ast.unparse(node) not in (*keepers, "functools.lru_cache"), name
            if isinstance(node, ast.FunctionDef) and "functools.cache" in map(
                ast.unparse, node.decorator_list
            ):
                assert not ast.unparse(node.args), f"{name}.{node.name}"
