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


# An arithmetic is a table of operations by their names in a `Program`, or by their codes.
ARITHMETICS = {
    "lagcli.expression.intervals": "ranges of floats, of arrays and, by `contact_values`, of expressions",
    "lagcli.expression.enclosures": "ranges in many digits, which mpmath rounds outwards",
    "lagcli.expression.term_sizes": "sizes of the terms of a value",
    "lagcli.equations.operation_rules": "roundings of a value as an expression, which a run evaluates",
    "lagcli.equations.power_series": "coefficients of power series",
    "lagcli.compiled.multiprecision": "many digits, with derivatives",
}


def operations_in(node: ast.Dict) -> set[str]:
    """The operations that are keys of a table."""
    names = {ast.unparse(key).strip("'\"") for key in node.keys if key is not None}
    return {name.removeprefix("ca.OP_").lower() for name in names}


def test_each_arithmetic_stands_in_one_file() -> None:
    found = {
        name
        for name in FILES
        for node in nodes(name)
        if isinstance(node, ast.Dict) and {"add", "mul"} <= operations_in(node)
    }
    assert (
        found - {"lagcli.smoothness.time_functions"} == ARITHMETICS.keys()
    )  # which folds plain numbers faster
