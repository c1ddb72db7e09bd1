"""The road onto a surface is `linear/surface.py`: no other file iterates Newton's steps, but for those that say why."""

import ast
from collections.abc import Iterator

import pytest

from tests.house.test_architecture import FILES, nodes

OWNER = "lagcli.linear.surface"
# What solves linear equations; a loop that moves a point by what one of these gives is an iteration of Newton.
SOLVERS = frozenset(
    "correction whole_correction damped least_squares lstsq solve solved lu_solve"
    " pseudo_inverse pinv inv _inverse _damped".split()
)
# Iterations onto something else, or with a control of their own: decision 0028 has the reasons.
OTHERS = {
    "lagcli.analysis.codimension.second_order": "the minimum of a barrier",
    "lagcli.analysis.holonomy.loop_words": "lengths of paths, whose ends an integration gives",
    "lagcli.formulations.maggi": "an implicit function at every step, by factors of an earlier one",
    "lagcli.statics.flat_directions": "coefficients of series in many digits",
    "lagcli.statics.refine": "a descent to points of rest, damped by its gains, and the corrector of a path",
}


def iterations(tree: Iterator[ast.AST] | list[ast.AST]) -> Iterator[int]:
    """The lines of loops that solve linear equations and move a variable by a sum or difference of itself. Two passes
    of a projection, of which the second removes the rounding of the first, are none."""
    for loop in tree:
        if isinstance(loop, ast.For | ast.While) and not _is_twice(loop):
            called = {_called(node) for node in ast.walk(loop) if isinstance(node, ast.Call)}
            if called & SOLVERS and any(map(_moves, ast.walk(loop))):
                yield loop.lineno


def _is_twice(loop: ast.For | ast.While) -> bool:
    return isinstance(loop, ast.For) and ast.unparse(loop.iter) == "range(2)"


def _called(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def _moves(node: ast.AST) -> bool:
    """True for `x = x + step`, alone or in a tuple, and `x += step`."""
    if isinstance(node, ast.AugAssign):
        return isinstance(node.op, ast.Add | ast.Sub) and isinstance(node.target, ast.Name)
    if not isinstance(node, ast.Assign):
        return False
    pairs = [(target, node.value) for target in node.targets]
    for target, value in list(pairs):
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs += zip(target.elts, value.elts, strict=True)
    return any(
        isinstance(part, ast.BinOp) and isinstance(part.op, ast.Add | ast.Sub) and target.id in _names(part)
        for target, value in pairs
        if isinstance(target, ast.Name)
        for part in ast.walk(value)
    )


def _names(node: ast.AST) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def test_one_file_iterates_newton_steps() -> None:
    found = {name for name in FILES for _ in iterations(nodes(name))}
    assert found == {OWNER, *OTHERS}


@pytest.mark.parametrize(
    "text",
    [
        "for _ in range(9):\n    x = x - rows.correction(f(x))",
        "while True:\n    step = np.linalg.solve(J, f)\n    x, f = x + 0.5 * step, g(x)",
        "for _ in range(n):\n    x -= decompositions.least_squares(J, f)",
        "for _ in range(n):\n    q = np.where(known, q - pseudo_inverse(B) @ f, nan)",
    ],
)
def test_an_iteration_is_seen_however_it_is_written(text: str) -> None:
    assert list(iterations(ast.walk(ast.parse(text)))) == [1]


@pytest.mark.parametrize(
    "text",
    [
        "for _ in range(2):\n    v = v + rows.correction(b)",
        "for t in times:\n    lam = least_squares(A, b)\n    left = b + A @ lam",
    ],
)
def test_what_is_solved_once_or_twice_is_no_iteration(text: str) -> None:
    assert not list(iterations(ast.walk(ast.parse(text))))
