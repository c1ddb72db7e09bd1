"""A function of the language is one row of `expression/functions.py`: no other file lists functions by name."""

import ast
import re
from collections.abc import Iterator

from lagcli.expression import functions
from tests.house.test_architecture import FILES, nodes

OWNER = "lagcli.expression.functions"
# So many names in one literal are a table: fewer belong to a rule that is about these alone.
LISTED = 3
# Rules of an arithmetic or an algebra, each of which has a method for these functions; what a table could hold is none.
METHODS = {
    "lagcli.compiled.multiprecision": "values in `Decimal`, and operations on two numbers",
    "lagcli.expression.term_sizes": "sizes of the terms of operations on two numbers",
    "lagcli.compiled.column_program": "operations of CasADi on many columns, whose bits are its own",
    "lagcli.equations.operation_rules": "sizes of terms in CasADi",
    "lagcli.equations.power_series": "recurrences of coefficients",
    "lagcli.expression.enclosures": "enclosures by mpmath",
    "lagcli.expression.integers": "whole numbers between bounds that are formulas",
    "lagcli.native.operations": "instructions for CasADi's operations",
    "lagcli.pfaffian.exact.normal_form": "the generators of an algebra",
    "lagcli.pfaffian.potential": "antiderivatives",
    "lagcli.pfaffian.tidy_integral": "exponentials written as hyperbolic functions",
    "lagcli.statics.polynomial_equations": "sine and cosine as two unknowns",
    "lagcli.statics.static_problem": "periodic operations",
}
SPELLINGS = {
    **{row.operation: row.name for row in functions.ROWS if row.operation},
    **{row.written: row.name for row in functions.ROWS if row.written},
    **{str(row.sympy).lower(): row.name for row in functions.ROWS if row.sympy},
    **{row.name: row.name for row in functions.ROWS},
}


def named(text: str) -> set[str]:
    """The functions that a text of names and signs alone lists; none where it is a sentence."""
    words = re.findall(r"[a-z]\w*", re.sub(r"\\[bsdwA-Z]", " ", text))
    known = {SPELLINGS[word] for word in words if word in SPELLINGS}
    return known if len(known) >= len(set(words)) - 1 else set()


def tables(name: str) -> Iterator[tuple[int, set[str]]]:
    """The literals of a file that list functions: by names, by codes of CasADi, or as those of a library."""
    for node in nodes(name):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, named(node.value)
        elif isinstance(node, ast.Dict | ast.Set | ast.Tuple | ast.List):
            parts = node.keys if isinstance(node, ast.Dict) else node.elts
            yield node.lineno, set().union(*map(_part, parts))
        elif isinstance(node, ast.MatchOr):
            yield node.lineno, set().union(*map(_part, node.patterns))


def _part(node: ast.AST | None) -> set[str]:
    if isinstance(node, ast.MatchValue):
        node = node.value
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return {SPELLINGS[node.value]} if node.value in SPELLINGS else set()
    if isinstance(node, ast.Attribute):
        word = node.attr.removeprefix("OP_").lower()
        return {SPELLINGS[word]} if word in SPELLINGS else set()
    return set()


def test_no_other_file_lists_functions() -> None:
    found = {
        name: line
        for name in FILES
        if name != OWNER and name not in METHODS
        for line, listed in tables(name)
        if len(listed) >= LISTED
    }
    assert found == {}


def test_files_with_methods_of_their_own_have_them() -> None:
    for name in METHODS:
        assert any(len(listed) >= LISTED for _, listed in tables(name)), name


def test_a_table_is_seen_however_it_is_written() -> None:
    assert named(r"\b(abs|sign|min)\s*\(") == {"abs", "sign", "min"}
    assert named("sin cos tan") == {"sin", "cos", "tan"}
    assert named("`sin`, `cos` and `tan` are taken of an angle here") == set()
    written = ast.parse("{ca.OP_FMIN: 1, sympy.Abs: 2, np.arcsin: 3}", mode="eval").body
    assert isinstance(written, ast.Dict)
    assert set().union(*map(_part, written.keys)) == {"min", "abs", "asin"}


def test_a_function_of_so_many_arguments_has_a_slope() -> None:
    """The audit differentiates by it; `min` and `max` choose one of theirs."""
    assert {row.name for row in functions.ROWS if row.slope is None} == {
        row.name for row in functions.ROWS if row.arguments == functions.MANY
    }
