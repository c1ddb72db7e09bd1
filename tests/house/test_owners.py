"""One owner for each question: what only the owner needs stands in no other file."""

from __future__ import annotations

import ast

import pytest

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
    "lagcli.expression.functions": "all that has Python's operators",
    "lagcli.expression.integers": "whole numbers and fractions, exactly",
    "lagcli.expression.intervals": "ranges of floats, of arrays and, by `contact_values`, of expressions",
    "lagcli.expression.enclosures": "ranges in many digits, which mpmath rounds outwards",
    "lagcli.expression.term_sizes": "sizes of the terms of a value",
    "lagcli.equations.operation_rules": "roundings of a value as an expression, which a run evaluates",
    "lagcli.equations.power_series": "coefficients of power series",
    "lagcli.compiled.multiprecision": "many digits, with derivatives",
    "lagcli.compiled.column_program": "doubles of many columns at once, by numpy",
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
    assert found == ARITHMETICS.keys()


# A change is bracketed by `smoothness/sides.bracket`; decision 0029 has the reasons of the others.
HALVING = {
    "lagcli.smoothness.sides": "the owner",
    "lagcli.contact.zero_search": "Newton's steps within a bracket, whose slopes are at hand",
    "lagcli.contact.zero_bounds": "the same on a cubic",
    "lagcli.statics.all_zeros": "all pieces that bounds leave open, not one change",
    "lagcli.statics.univariate": "the same as the owner in whole fractions, for which no double is near enough",
    "lagcli.linearization.floquet": "SciPy's root of a value that costs a matrix each time",
}
ROOTS = frozenset("brentq brenth bisect ridder toms748 root_scalar".split())


def halves(node: ast.AST) -> bool:
    """True for a loop that moves an end of an interval and takes its middle, and for a root of SciPy's."""
    if isinstance(node, ast.Attribute):
        return node.attr in ROOTS and ast.unparse(node.value).endswith("optimize")
    if not isinstance(node, ast.For | ast.While):
        return False
    moved: set[str] = set()
    for part in ast.walk(node):
        if isinstance(part, ast.Assign):
            for target in part.targets:
                moved |= {ast.unparse(end) for end in getattr(target, "elts", [target])}
    return any(len(moved & ends_of_middle(part)) == 2 for part in ast.walk(node))


def ends_of_middle(node: ast.AST) -> set[str]:
    """The ends of `(low + high) / 2`, `0.5 * (low + high)`, `low + (high - low) / 2` and the like."""
    match node:
        case ast.BinOp(ast.BinOp(low, ast.Add(), high), ast.Div(), ast.Constant()):
            return {ast.unparse(low), ast.unparse(high)}
        case ast.BinOp(ast.Constant(), ast.Mult(), ast.BinOp(low, ast.Add(), high)):
            return {ast.unparse(low), ast.unparse(high)}
        case ast.BinOp(
            low,
            ast.Add(),
            ast.BinOp(ast.BinOp(high, ast.Sub(), begin), ast.Div() | ast.Mult(), ast.Constant()),
        ) if ast.unparse(begin) == ast.unparse(low):
            return {ast.unparse(low), ast.unparse(high)}
    return set()


def test_a_change_is_bracketed_in_one_place() -> None:
    assert {name for name in FILES for node in nodes(name) if halves(node)} == HALVING.keys()


@pytest.mark.parametrize(
    "middle", ["(a + b) / 2", "0.5 * (a + b)", "a + (b - a) / 2", "a + (b - a) * 0.4871"]
)
def test_a_bisection_is_seen_however_it_is_written(middle: str) -> None:
    loop = f"while b - a > 1e-9:\n    c = {middle}\n    if f(c):\n        a = c\n    else:\n        b = c"
    assert halves(ast.parse(loop).body[0])
    assert not halves(ast.parse(f"for a, b in pairs:\n    c = {middle}").body[0])


def test_which_functions_occur_is_read_from_trees() -> None:
    """A pattern of a text is blind to where a name ends, to columns of this name, and to what a call stands in."""
    readers = {"compile", "match", "search", "findall", "finditer", "fullmatch"}
    found = {
        name
        for name in FILES
        for node in nodes(name)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in readers
        for part in node.args[:1]
        if ast.unparse(node.func.value) == "re" and {r"\(", "functions"} & pieces_of(part)
    }
    assert not found


def pieces_of(pattern: ast.expr) -> set[str]:
    """What a pattern ends with, two letters of it, and the names that it is made of."""
    made = {part.id for part in ast.walk(pattern) if isinstance(part, ast.Name)}
    texts = [part.value for part in ast.walk(pattern) if isinstance(part, ast.Constant)]
    return made | {text[-2:] for text in texts if isinstance(text, str)}


# Decision 0030 says what they look for besides switches.
PASSES = {
    *("lagcli.smoothness.operation_graph", "lagcli.smoothness.switches", "lagcli.smoothness.jump_search"),
    *("lagcli.equations.branch_cuts", "lagcli.equations.operation_rules"),
    *("lagcli.equations.power_series", "lagcli.compiled.contact_values", "lagcli.compiled.program"),
    *("lagcli.compiled.contact_kinds", "lagcli.compiled.column_program"),
    *("lagcli.compiled.narrow_arguments", "lagcli.compiled.row_block", "lagcli.statics.kink_points"),
    "lagcli.native.lowering",  # it writes each as an instruction, and asks nothing of it
}


def test_no_further_file_walks_the_operations_of_expressions() -> None:
    walking = {"replayed", "folded", "instructions", "instruction_id", "instructions_sx"}
    found = {
        name
        for name in FILES
        for node in nodes(name)
        if isinstance(node, ast.Call)
        and (
            getattr(node.func, "attr", "") in walking or getattr(node.func, "id", "") in walking - {"folded"}
        )
    }
    assert {name for name in found if not name.startswith(("lagcli.derivation", "lagcli.pfaffian"))} == PASSES
