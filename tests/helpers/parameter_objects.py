"""The numbers of the algorithms: classes of fields whose docstrings name the tests that fail when they move."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "lagcli"

# Of numbers: longer ones are tableaux.
LONGEST_ROW = 6


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


def is_number(node: ast.expr) -> bool:
    """True of a formula in which only numbers stand, as 0.1, -4, 2**14 or 64 * float(np.finfo(float).eps)."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return is_number(node.operand)
    if isinstance(node, ast.BinOp):
        return is_number(node.left) and is_number(node.right)
    return ast.unparse(node) in ("float(np.finfo(float).eps)", "np.finfo(float).eps", "np.pi", "math.pi")


def loose_numbers(tree: ast.Module) -> Iterator[str]:
    """The names that a module gives to numbers outside of objects, and to short rows of numbers.

    An index is none of them: a name that is only read in the brackets of something, where nothing is compared. Nor is a
    tableau: a row in rows, or one of more than `LONGEST_ROW` numbers. Nor is the seed of random numbers.
    """
    subscripts = [each.slice for each in ast.walk(tree) if isinstance(each, ast.Subscript)]
    brackets = [part for part in subscripts if not any(isinstance(x, ast.Compare) for x in ast.walk(part))]
    indices = {id(name) for part in brackets for name in ast.walk(part) if isinstance(name, ast.Name)}
    read = [each for each in ast.walk(tree) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load)]
    used = {each.id for each in read}
    elsewhere = {each.id for each in read if id(each) not in indices}
    for statement in tree.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is not None:
            target = statement.target if isinstance(statement, ast.AnnAssign) else statement.targets[0]
            yield from (
                name
                for name, value in _pairs(target, statement.value)
                if (is_number(value) or _is_row(value))
                and (name in elsewhere or name not in used)
                and "SEED" not in name
            )


def _pairs(target: ast.expr, value: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    """Each name of an assignment with what it is given."""
    if isinstance(target, ast.Name):
        yield target.id, value
    elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        for part, its in zip(target.elts, value.elts, strict=True):
            yield from _pairs(part, its)


def _is_row(value: ast.expr) -> bool:
    return (
        isinstance(value, ast.Tuple)
        and 0 < len(value.elts) <= LONGEST_ROW
        and all(map(is_number, value.elts))
    )
