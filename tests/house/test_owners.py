"""One owner for each question: what only the owner needs stands in no other file."""

from __future__ import annotations

from tests.helpers.parameter_objects import fields, parameter_objects


def test_two_sides_are_told_apart_in_one_file() -> None:
    """By one set of limits, with the part of a jump that stays as the distance shrinks."""
    limits = {"stays", "abrupt"}
    owners = [file for file, node in parameter_objects() if limits & {name for name, _ in fields(node)}]
    assert owners == ["smoothness/sides.py"]
