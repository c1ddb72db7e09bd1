"""Where numbers count as equal, zero or parts of pi at the start and at other points of a run."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest
import sympy

from lagcli.pfaffian import special_points
from lagcli.pfaffian.exact import real_bounds
from lagcli.pfaffian.forms.form import PfaffianBlock
from lagcli.pfaffian.special_points import SpecialPoint

x, y = sympy.symbols("x y", real=True)
BLOCK = PfaffianBlock(("row",), (x, y), ((y, x),))


def points(*places: dict[sympy.Symbol, float]) -> list[SpecialPoint]:
    return [SpecialPoint(place) for place in places]


@pytest.mark.parametrize(("difference", "stands"), [(3e-10, True), (3e-9, False)])
def test_a_coordinate_that_differs_in_the_ninth_place_stands_still(difference: float, stands: bool) -> None:
    found = special_points.still(BLOCK, points({x: 0.5, y: 0.0}, {x: 0.5 + difference, y: 1.0}), {})
    assert found == ([x - sympy.Rational(1, 2)] if stands else [])


@pytest.mark.parametrize(("off", "is_part"), [(3e-13, True), (3e-12, False)])
def test_values_near_parts_of_pi_are_spelled_so(off: float, is_part: bool) -> None:
    value = math.pi / 3 * (1 + off)
    (equation,) = special_points.still(BLOCK, points({x: value, y: 0.0}, {x: value, y: 1.0}), {})
    assert (equation == x - sympy.pi / 3) == is_part


def test_a_coordinate_stands_still_at_what_is_written() -> None:
    start = SpecialPoint({x: 1 / 3, y: 0.0}, {x: Fraction(1, 3), y: Fraction(0)})
    there = SpecialPoint({x: 1 / 3, y: 1.0})
    assert special_points.still(BLOCK, [start, there], {x: sympy.Rational(1, 3)}) == [
        x - sympy.Rational(1, 3)
    ]
    assert special_points.still(BLOCK, [start, there], {}) == []


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
    assert real_bounds.never_vanishes(sympy.cos(x) + 1 + sympy.Float(more)) == never
