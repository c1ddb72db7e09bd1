"""Where doubles count as equal, zero or parts of pi at the places of a run."""

from __future__ import annotations

import math

import pytest
import sympy

from lagcli.pfaffian import special_points
from lagcli.pfaffian.exact import real_bounds
from lagcli.pfaffian.forms.form import PfaffianBlock

x, y = sympy.symbols("x y", real=True)
BLOCK = PfaffianBlock(("row",), (x, y), ((y, x),))


@pytest.mark.parametrize(("difference", "stands"), [(3e-10, True), (3e-9, False)])
def test_a_coordinate_that_differs_in_the_ninth_place_stands_still(difference: float, stands: bool) -> None:
    points = [{x: 0.5, y: 0.0}, {x: 0.5 + difference, y: 1.0}]
    assert special_points.still(BLOCK, points) == ([x - sympy.Rational(1, 2)] if stands else [])


@pytest.mark.parametrize(("off", "is_part"), [(3e-13, True), (3e-12, False)])
def test_values_near_parts_of_pi_are_spelled_so(off: float, is_part: bool) -> None:
    value = math.pi / 3 * (1 + off)
    (equation,) = special_points.still(BLOCK, [{x: value, y: 0.0}, {x: value, y: 1.0}])
    assert (equation == x - sympy.pi / 3) == is_part


@pytest.mark.parametrize(("rest", "is_zero"), [(3e-10, True), (3e-9, False)])
def test_an_expression_vanishes_below_the_round_off_of_its_point(rest: float, is_zero: bool) -> None:
    points = [{x: 1.0, y: 1.0 - 2 * rest}]
    assert special_points.vanishes(x - y, points) == is_zero
    assert special_points.is_nothing(x - y, points) == is_zero


def test_an_expression_without_a_value_vanishes_and_is_not_nothing() -> None:
    for expression in (sympy.log(x), 1 / y):
        assert special_points.vanishes(expression, [{x: -1.0, y: 0.0}])
        assert not special_points.is_nothing(expression, [{x: -1.0, y: 0.0}])


@pytest.mark.parametrize(("more", "never"), [(3e-9, True), (3e-10, False)])
def test_what_keeps_off_zero_by_more_than_round_off_never_vanishes(more: float, never: bool) -> None:
    assert real_bounds.never_vanishes(sympy.cos(x) + 1 + sympy.Float(more)) == never
