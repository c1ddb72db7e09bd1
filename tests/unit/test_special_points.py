"""Where numbers count as zero at the start and at other points of a run."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy

from lagcli.pfaffian import special_points
from lagcli.pfaffian.exact import enclosure
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.special_points import SpecialPoint

x, y = sympy.symbols("x y", real=True)
BLOCK = PfaffianBlock(("row",), (x, y), ((y, x),))


def points(*places: dict[sympy.Symbol, float]) -> list[SpecialPoint]:
    return [SpecialPoint(place) for place in places]


@pytest.mark.parametrize(("rest", "is_zero"), [(3e-10, True), (3e-9, False)])
def test_an_expression_vanishes_below_the_round_off_of_its_point(rest: float, is_zero: bool) -> None:
    there = points({x: 1.0, y: 1.0 - 2 * rest})
    assert special_points.vanishes(x - y, there) == is_zero
    assert special_points.is_nothing(x - y, there) == is_zero


@pytest.mark.parametrize(("rest", "is_zero"), [("3e-41", True), ("3e-40", False)])
def test_at_a_start_an_expression_vanishes_to_forty_digits(rest: str, is_zero: bool) -> None:
    start = SpecialPoint({x: 1.0, y: 1.0}, {x: Fraction(1), y: 1 - 2 * Fraction(rest)})
    assert special_points.vanishes(x - y, [start]) == is_zero
    assert special_points.beside(x - y, start) != is_zero


def test_a_coordinate_that_was_computed_is_zero_to_the_size_of_what_it_came_from() -> None:
    digits = {x: Fraction("1e-45"), y: Fraction(0)}
    assert not special_points.vanishes(x, [SpecialPoint({x: 1e-45, y: 0.0}, digits)])
    assert special_points.vanishes(x, [SpecialPoint({x: 1e-45, y: 0.0}, digits, {x: 1.0})])


def test_an_expression_without_a_value_vanishes_and_is_not_nothing() -> None:
    for expression in (sympy.log(x), 1 / y):
        assert special_points.vanishes(expression, points({x: -1.0, y: 0.0}))
        assert not special_points.is_nothing(expression, points({x: -1.0, y: 0.0}))


@pytest.mark.parametrize(("more", "never"), [(3e-9, True), (3e-10, False)])
def test_what_keeps_off_zero_by_more_than_round_off_never_vanishes(more: float, never: bool) -> None:
    assert enclosure.never_vanishes(sympy.cos(x) + 1 + sympy.Float(more)) == never
