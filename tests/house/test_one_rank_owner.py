"""Ranks, kernels and least squares are decided in `linear`: no other package decomposes a matrix for them."""

import ast

from tests.house.test_architecture import FILES, nodes, room

DECOMPOSING = {"svd", "svdvals", "lstsq", "qr", "matrix_rank", "pinv", "pinvh", "null_space", "orth"}
# Decision 0027: the audit shares no rank with the program that it judges.
ELSEWHERE = {"lagcli.auditing.evidence.virtual_space"}


def decomposes(name: str) -> bool:
    """True if a file calls such a function of NumPy or SciPy, or imports it by its name."""
    for node in nodes(name):
        if isinstance(node, ast.Attribute) and node.attr in DECOMPOSING and "linalg" in ast.unparse(node):
            return True
        named = {alias.name for alias in node.names} if isinstance(node, ast.ImportFrom) else set()
        if isinstance(node, ast.ImportFrom) and "linalg" in (node.module or "") and named & DECOMPOSING:
            return True
    return False


def test_matrices_are_decomposed_in_linear_alone() -> None:
    assert {name for name in FILES if decomposes(name) and room(name) != "linear"} == ELSEWHERE


def test_nobody_else_compares_singular_values_with_a_limit_of_a_call() -> None:
    """`rcond` and `tol` of a call are limits of its caller."""
    limits = {
        name
        for name in FILES
        for node in nodes(name)
        if isinstance(node, ast.Call) and any(each.arg == "rcond" for each in node.keywords)
    }
    assert {name for name in limits if room(name) != "linear"} == set()
